// The camera of a story: it flies around what it looks at.
(() => {
  if (window.warpspaceFly) return;
  let turn = 0;
  const length = v => Math.hypot(...v);
  const mix = (a, b, share) => a.map((x, i) => x + share * (b[i] - x));
  const less = (a, b) => a.map((x, i) => x - b[i]);
  // the drawing is turned in viser's world; its rows turn back
  const world = () => window.__viserMutable?.nodeRefFromName?.[""]?.matrixWorld.elements;
  const out = ([x, y, z]) => [0, 1, 2].map(i => world()[i] * x + world()[4 + i] * y + world()[8 + i] * z);
  const back = v => [0, 1, 2].map(i => [0, 1, 2].reduce((sum, k) => sum + world()[4 * i + k] * v[k], 0));

  const now = ({ camera, cameraControl }) => {
    const place = camera.position.clone(), target = camera.position.clone();
    cameraControl.getPosition(place, false);
    cameraControl.getTarget(target, false);
    return { at: back(place.toArray()), to: back(target.toArray()), up: back(camera.up.toArray()),
      fov: camera.fov * Math.PI / 180 };
  };
  const stand = ({ camera, cameraControl, sendCamera, requestRender }, { at, to, up, fov }) => {
    camera.up.set(...out(up));
    cameraControl.updateCameraUp();
    camera.setFocalLength(0.5 * camera.getFilmHeight() / Math.tan(fov / 2));
    cameraControl.setLookAt(...out(at), ...out(to), false);
    sendCamera?.();
    requestRender?.();
  };

  window.warpspaceFly = ({ position, look_at, up, fov_rad }, long) => {
    const view = window.__viserMutable;
    if (!view?.cameraControl || !world()) return false;
    const end = { at: position, to: look_at, up, fov: fov_rad };
    const start = now(view), own = ++turn;
    const from = less(start.at, start.to), way = less(end.at, end.to);
    const one = from.map(x => x / length(from)), other = way.map(x => x / length(way));
    warpspaceMesh.eased(long, share => {
      if (own !== turn) return;
      if (share === 1) { stand(view, end); return; }
      // around the point that is looked at, not through it
      const seen = mix(one, other, share), far = length(from) ** (1 - share) * length(way) ** share;
      const to = mix(start.to, end.to, share), long = length(seen) || 1;
      stand(view, { at: to.map((x, i) => x + far * seen[i] / long), to,
        up: mix(start.up, end.up, share), fov: start.fov ** (1 - share) * end.fov ** share });
    });
    return true;
  };
  Object.assign(window.warpspaceFly, { out, back });
})();
