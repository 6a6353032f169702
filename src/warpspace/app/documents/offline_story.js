// Steps of a story on a page that needs nothing but itself: words beside the drawing, which follows.
(() => {
  const { steps, palettes, count, lines } = JSON.parse(document.getElementById("story").textContent);
  const frame = document.querySelector("iframe"), texts = [...document.querySelectorAll("[data-step]")];
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  let at = 0, timer = 0;

  // points as they were packed: whole numbers, of each coordinate the changes from point to point
  const points = steps.map(async ({ points: packed, low, unit }) => {
    if (!packed) return null;
    const stream = new Blob([bytes(packed)]).stream().pipeThrough(new DecompressionStream("deflate"));
    const changes = new Uint16Array(await new Response(stream).arrayBuffer());
    const found = new Float32Array(3 * count);
    for (let k = 0; k < 3; k++)
      for (let i = 0, whole = 0; i < count; i++) {
        whole = (whole + changes[k * count + i]) & 0xffff;
        found[3 * i + k] = low[k] + unit * whole;
      }
    return found;
  });

  const draw = async long => {
    clearTimeout(timer);
    const own = at, place = await points[own];
    if (own !== at) return;
    const { warpspaceMesh: mesh, warpspaceFly: fly } = frame.contentWindow, step = steps[at];
    const wait = () => { timer = setTimeout(draw, 100, long); };  // the drawing is not there yet
    if (!mesh || !fly || !fly(step.camera, long)) { wait(); return; }
    mesh.move("/story/point", step.point);
    if (!place) return;
    mesh.open({ count, lines, palette: palettes[step.palette] });
    mesh.glide = long;
    if (!mesh.bend(place, step.levels)) wait();
  };
  const go = to => {
    if (to < 0 || to >= steps.length || to === at) return;
    at = to;
    texts.forEach((text, number) => { text.hidden = number !== at; });
    document.querySelector("aside").scrollTop = 0;
    document.getElementById("back").disabled = at === 0;
    document.getElementById("on").disabled = at === steps.length - 1;
    draw(600);
  };
  const key = event => {
    const way = { ArrowRight: 1, " ": 1, ArrowLeft: -1 }[event.key];
    if (!way || event.key === " " && event.target.closest?.("button, summary, a")) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    go(at + way);
  };
  const listen = () => frame.contentWindow.addEventListener("keydown", key, true);
  addEventListener("keydown", key, true);
  frame.addEventListener("load", listen);
  listen();
  document.getElementById("back").onclick = () => go(at - 1);
  document.getElementById("on").onclick = () => go(at + 1);
})();
