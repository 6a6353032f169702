// A shared review: pointers of the other participants on the map, as dots with their names.
(() => {
  const OFTEN_MS = 100, GONE_MS = 3000;
  const pointers = new Map();
  let installed = false, last = 0, over = false, drawing = false;
  const view = () => ({ canvas: warpspaceViser.canvas(), camera: warpspaceViser.camera() });
  const author = () => { try { return localStorage.getItem("warpspace-author") ?? ""; } catch { return ""; } };

  const gone = () => { if (over) { over = false; warpspacePage.send("pointer_gone"); } };
  const move = event => {
    const { canvas, camera } = view(), now = performance.now();
    if (!canvas || event.target !== canvas || event.buttons) { gone(); return; }
    if (now - last < OFTEN_MS) return;
    last = now;
    over = true;
    const rect = canvas.getBoundingClientRect();
    const at = camera.position.clone().set(2 * (event.clientX - rect.left) / rect.width - 1,
      1 - 2 * (event.clientY - rect.top) / rect.height, 0.5).unproject(camera).sub(camera.position);
    const ray = [...warpspaceFly.back(camera.position.toArray()), ...warpspaceFly.back(at.normalize().toArray())];
    warpspacePage.send({ do: "PointAt", ray: ray.map(x => Number(x.toFixed(5))), author: author() });
  };

  const draw = () => {
    const { canvas, camera } = view(), now = performance.now(), root = warpspacePage.over;
    for (const [key, { dot, at, until }] of pointers) {
      if (now > until || !canvas) { dot.remove(); pointers.delete(key); continue; }
      const projected = camera.position.clone().set(...warpspaceFly.out(at)).project(camera);
      dot.style.left = `${50 * (projected.x + 1)}%`;
      dot.style.top = `${50 * (1 - projected.y)}%`;
      if (dot.parentElement !== root) root.append(dot);
    }
    drawing = pointers.size > 0;
    if (drawing) requestAnimationFrame(draw);
  };

  warpspacePage.together = () => {
    if (installed) return;
    installed = true;
    addEventListener("pointermove", move, { passive: true });
    document.addEventListener("pointerleave", gone);
    addEventListener("blur", gone);
  };
  warpspacePage.pointer = (key, name, at) => {
    const known = pointers.get(key);
    if (!at) { if (known) known.until = 0; return; }
    const dot = known?.dot ?? Object.assign(document.createElement("span"), { className: "ws-pointer" });
    dot.textContent = name || "anonymous";
    pointers.set(key, { dot, at, until: performance.now() + GONE_MS });
    if (!drawing) { drawing = true; requestAnimationFrame(draw); }
  };
})();
