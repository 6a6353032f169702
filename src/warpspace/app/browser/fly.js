// The animated camera of a story: it moves around the point that it looks at.
(() => {
  if (window.warpspaceFly) return;
  let turn = 0;
  const length = v => Math.hypot(...v);
  const mix = (a, b, share) => a.map((x, i) => x + share * (b[i] - x));
  const less = (a, b) => a.map((x, i) => x - b[i]);
  // the drawing is rotated in viser's world; the rows of the matrix rotate back
  const { camera: cameraOf, cameraControl, requestRender, sendCamera, world } = warpspaceViser;
  const out = ([x, y, z]) => [0, 1, 2].map(i => world()[i] * x + world()[4 + i] * y + world()[8 + i] * z);
  const back = v => [0, 1, 2].map(i => [0, 1, 2].reduce((sum, k) => sum + world()[4 * i + k] * v[k], 0));

  const now = () => {
    const camera = cameraOf(), place = camera.position.clone(), target = camera.position.clone();
    cameraControl().getPosition(place, false);
    cameraControl().getTarget(target, false);
    return { at: back(place.toArray()), to: back(target.toArray()), up: back(camera.up.toArray()),
      fov: camera.fov * Math.PI / 180 };
  };
  const place = ({ at, to, up, fov }) => {
    const camera = cameraOf(), control = cameraControl();
    camera.up.set(...out(up));
    control.updateCameraUp();
    camera.setFocalLength(0.5 * camera.getFilmHeight() / Math.tan(fov / 2));
    control.setLookAt(...out(at), ...out(to), false);
    sendCamera();
    requestRender();
  };

  window.warpspaceFly = ({ position, look_at, up, fov_rad }, duration) => {
    if (!cameraControl() || !world()) return false;
    const end = { at: position, to: look_at, up, fov: fov_rad };
    const start = now(), current = ++turn;
    const from = less(start.at, start.to), target = less(end.at, end.to);
    const first = from.map(x => x / length(from)), last = target.map(x => x / length(target));
    warpspaceMesh.eased(duration, share => {
      if (current !== turn) return;
      if (share === 1) { place(end); return; }
      // around the point that it looks at, not through it
      const direction = mix(first, last, share), far = length(from) ** (1 - share) * length(target) ** share;
      const to = mix(start.to, end.to, share), norm = length(direction) || 1;
      place({ at: to.map((x, i) => x + far * direction[i] / norm), to,
        up: mix(start.up, end.up, share), fov: start.fov ** (1 - share) * end.fov ** share });
    });
    return true;
  };
  Object.assign(window.warpspaceFly, { out, back });
})();
