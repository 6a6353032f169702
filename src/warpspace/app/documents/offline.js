// Steps of a page that needs nothing but itself: words around the drawing, which follows.
(async () => {
  const WIDTH = 1.25;  // of a window, as a part of its height, that a camera is left where it was
  const NARROW = 500;  // px; where numbers along the axes would cover each other
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const packed = new Blob([bytes(document.getElementById("steps").textContent)]);
  const stream = packed.stream().pipeThrough(new DecompressionStream("deflate"));
  const { steps, start, unit, count, lines } = await new Response(stream).json();
  const frame = document.querySelector("iframe"), said = [...document.querySelectorAll("[data-step]")];
  const back = document.getElementById("back"), on = document.getElementById("on");
  const from = start && new Float32Array(bytes(start).buffer);  // one step alone is drawn already
  const bars = document.querySelector(".ws-bars");
  let at = 0, timer = 0, moves = Infinity, touched = false, looks = "";

  // what a camera sees from side to side is seen in a narrow window, too
  const fitted = ({ position, look_at, ...more }) => {
    const far = Math.max(1, WIDTH * frame.clientHeight / frame.clientWidth);
    return { ...more, look_at, position: position.map((x, i) => look_at[i] + far * (x - look_at[i])) };
  };
  const draw = long => {
    clearTimeout(timer);
    const { warpspaceMesh: mesh, warpspaceFly: fly, warpspaceViser: viser } = frame.contentWindow;
    const { camera, point, shifts, levels, palette } = steps[at];
    const wait = () => { timer = setTimeout(draw, 100, long); };  // the drawing is not there yet
    if (!viser?.node("/box/surface") || !fly(fitted(camera), long)) { wait(); return; }
    moves = performance.now() + long + 100;  // until then the camera is on its way
    touched = false;
    if (frame.clientWidth < NARROW)
      for (const name of viser.nodeNames()) if (name.startsWith("/words/tick")) mesh.move(name, [0, 0, 1e4]);
    if (!from) return;
    mesh.move("/story/point", point);
    mesh.open({ count, lines, palette });
    mesh.glide = long;
    if (!mesh.bend(from.map((x, i) => x + unit * shifts[i]), levels)) wait();
  };
  // viser sets its own camera and the direction upwards when they arrive, perhaps after ours: until
  // the reader moves the camera it is put where it belongs, also in a window of another size
  const isAway = (fly, viser) => {
    const { position, up } = fitted(steps[at].camera), camera = viser.camera();
    const far = Math.hypot(...position), off = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
    return off(fly.out(position), camera.position.toArray()) > 1e-3 * far
      || off(fly.out(up), camera.up.toArray()) > 1e-3;
  };
  const follow = () => {
    requestAnimationFrame(follow);
    const { warpspaceFly: fly, warpspaceBars, warpspaceViser: viser } = frame.contentWindow;
    const world = viser?.world(), camera = viser?.camera();
    if (!world || !camera || performance.now() < moves) return;
    if (!touched && isAway(fly, viser)) fly(fitted(steps[at].camera), 0);
    const facts = steps[at].bars, size = { width: frame.clientWidth, height: frame.clientHeight };
    const seen = [at, size.width, size.height, ...camera.matrixWorld.elements,
      ...camera.projectionMatrix.elements].join();
    if (seen === looks) return;
    looks = seen;
    bars.innerHTML = facts ? warpspaceBars.html(camera, world, size, facts) : "";
  };
  const go = to => {
    at = to;
    said.forEach(one => { one.hidden = Number(one.dataset.step) !== at; });
    document.querySelector("aside").scrollTop = 0;
    back.disabled = at === 0;
    on.disabled = at === steps.length - 1;
    draw(600);
  };
  const key = event => {
    const way = { ArrowRight: 1, " ": 1, ArrowLeft: -1 }[event.key];
    if (!(at + way in steps) || event.key === " " && event.target.closest?.("button, summary, a")) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    go(at + way);
  };
  const listen = () => {
    frame.contentWindow.addEventListener("keydown", key, true);
    for (const type of ["pointerdown", "wheel", "keydown"])
      frame.contentWindow.addEventListener(type, () => { touched = true; }, true);
  };
  addEventListener("keydown", key, true);
  frame.addEventListener("load", listen);
  listen();
  back.onclick = () => go(at - 1);
  on.onclick = () => go(at + 1);
  setInterval(() => frame.contentWindow.warpspaceMesh?.holdBack(document.documentElement.className), 250);
  draw(0);
  follow();
})();
