// The room between the panels: heading, scale bars, values on isolines, one switch, drawn over the
// 3-D view. Nothing here takes a click but the buttons; the camera is read, never moved.
(() => {
  if (window.warpspaceRoom) return;
  const MOST_LABELS = 12, LABEL_APART = 52, BAR_PX = 150, BAR_PART = 0.32, PHONE_PX = 576;
  const SETTLED_MS = 160, LEAST_FACING = 0.12, LARGE_PX = 1600, PLATE_MS = 250, KEY = "warpspace-machine";
  const state = { html: {}, labels: [], slices: [], centre: [0, 0, 0], factor: 1, perMm: 0.01 };
  let widget = "", told = "", seen = "", plates = 0, timer = 0, remembered = false;

  const root = document.createElement("div");
  root.id = "warpspace-room";
  root.innerHTML = `<section class="ws-room-head" data-room="head" aria-label="What is shown"></section>
    <div class="ws-room-labels" aria-hidden="true"></div>
    <div class="ws-room-foot"><div class="ws-room-bars"></div>
    <div class="ws-room-buttons" data-room="buttons"></div>
    <section class="ws-room-strip" data-room="strip" aria-label="Colours and numbers"></section></div>`;
  const part = name => root.querySelector(`.ws-room-${name}`);
  const view = () => window.__viserMutable;
  const sheet = () => innerWidth > PHONE_PX ? null : document.querySelector(
    'div[style*="position: fixed"][style*="bottom: 0px"][style*="min-height: 3.5em"]');

  const roundDown = value => {
    const decade = 10 ** Math.floor(Math.log10(value));
    return Math.max(...[1, 2, 5].map(s => s * decade).filter(v => v <= value * (1 + 1e-9)), decade);
  };
  const spell = value => String(Number(value.toPrecision(6)));

  // column-major 4 × 4 times a point
  const through = (m, [x, y, z]) => [0, 1, 2, 3].map(
    i => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);

  // where a point of the drawing is on the screen: pixels from the left top of the room, and depth
  const project = (camera, world, rect, point) => {
    const eye = through(camera.matrixWorldInverse.elements, through(world, point));
    const clip = through(camera.projectionMatrix.elements, eye);
    return { x: (clip[0] / clip[3] + 1) / 2 * rect.width,
      y: (1 - clip[1] / clip[3]) / 2 * rect.height, depth: -eye[2] };
  };

  const drawBars = (camera, world, rect) => {
    const bars = part("bars");
    const depth = project(camera, world, rect, state.centre).depth;
    const perMm = camera.projectionMatrix.elements[5] * rect.height / 2 / depth * state.perMm;
    const free = Math.min(Math.max(BAR_PX, 0.09 * rect.width), BAR_PART * rect.width);
    if (!state.bars || !(depth > 0) || !(perMm > 0)) { bars.replaceChildren(); return; }
    const mm = roundDown(free / perMm), perUm = perMm * 1e-3 * state.factor;
    const um = roundDown(free / perUm);
    const rows = [["mm", mm, mm * perMm, `${spell(mm)} mm geometry`], ["um", um, um * perUm,
      `${um < 1e4 ? `${spell(um)} µm` : `${spell(um * 1e-3)} mm`} error, drawn ${state.spelt}`]];
    bars.innerHTML = rows.map(([name, length, width, text]) => `<div data-bar-scale="${name}"
      data-length="${length}"><i style="width:${width.toFixed(2)}px"></i>${text}</div>`).join("");
  };

  // what the eye meets first, of slices: does one of them lie before the point
  const behindSlice = (eye, point) => state.slices.some(({ axis, at, low, high }) => {
    const t = (at - eye[axis]) / (point[axis] - eye[axis]);
    if (!(t > 0 && t < 0.99)) return false;
    return [0, 1, 2].every(k => {
      const value = eye[k] + t * (point[k] - eye[k]);
      return k === axis || (value > low[k] && value < high[k]);
    });
  });

  const drawLabels = (camera, world, rect) => {
    const labels = part("labels");
    if (!state.labels.length) { if (labels.firstChild) labels.replaceChildren(); return; }
    // the eye in the drawing's own axes; the world only turns them
    const c = camera.matrixWorld.elements;
    const eye = [0, 1, 2].map(i => world[4 * i] * c[12] + world[4 * i + 1] * c[13]
      + world[4 * i + 2] * c[14]);
    const placed = [];
    for (const { at, out, text } of state.labels) {
      if (placed.length === MOST_LABELS) break;
      const to = eye.map((e, k) => e - at[k]), long = Math.hypot(...to);
      const facing = (out[0] * to[0] + out[1] * to[1] + out[2] * to[2]) / long;
      // a face that looks away hides its lines; a slice is seen from both sides
      if ((state.slices.length ? Math.abs(facing) : facing) < LEAST_FACING) continue;
      if (behindSlice(eye, at)) continue;
      const { x, y, depth } = project(camera, world, rect, at);
      if (depth <= 0 || x < 20 || y < 20 || x > rect.width - 20 || y > rect.height - 20) continue;
      if (placed.some(p => Math.hypot(p.x - x, 1.6 * (p.y - y)) < LABEL_APART)) continue;
      placed.push({ x, y, text });
    }
    while (labels.children.length > placed.length) labels.lastChild.remove();
    placed.forEach(({ x, y, text }, number) => {
      const label = labels.children[number] ?? labels.appendChild(document.createElement("span"));
      if (label.textContent !== text) label.textContent = text;
      label.style.transform = `translate(${x.toFixed(1)}px,${y.toFixed(1)}px) translate(-50%,-50%)`;
    });
  };

  // viser writes black on white, as large on every screen; on a dark page its labels are to be
  // light on dark, in a very large room larger
  const DARK = [/vec4\(0\.0, 0\.0, 0\.0, a\)/, "vec4(0.86, 0.89, 0.93, a)"];
  const PLATE = [/vec4\(1\.0, 1\.0, 1\.0, 0\.85 \* vAlpha\)/, "vec4(0.10, 0.11, 0.13, 0.80 * vAlpha)"];
  const LARGE = [/float refScale = 800\.0/, "float refScale = 1200.0"];
  const colourLabels = () => {
    let changed = false;
    view().scene?.traverse(({ material }) => {
      if (!material?.uniforms?.uLabelData) return;
      const made = material.userData.asMade ??= [material.fragmentShader, material.vertexShader];
      const fragment = state.dark ? made[0].replace(...DARK).replace(...PLATE) : made[0];
      const vertex = root.clientWidth > LARGE_PX ? made[1].replace(...LARGE) : made[1];
      if (material.fragmentShader === fragment && material.vertexShader === vertex) return;
      material.fragmentShader = fragment;
      material.vertexShader = vertex;
      material.needsUpdate = changed = true;
    });
    if (changed) view().requestRender?.();
  };

  // the ghost of the machine is drawn before all else and hides nothing: the map keeps its colours
  const GHOST = { transparent: false, depthWrite: false, blending: 5, blendSrc: 204, blendDst: 205,
    blendSrcAlpha: 201, blendDstAlpha: 205 };
  const holdBackGhost = () => {
    let changed = false;
    view().nodeRefFromName["/ghost_machine"]?.traverse(part => {
      if (!part.material) return;
      part.renderOrder = -1000;
      if (part.material.blending === GHOST.blending && !part.material.transparent) return;
      Object.assign(part.material, GHOST);
      part.material.needsUpdate = changed = true;
    });
    if (changed) view().requestRender?.();
  };

  const tell = rect => {
    const below = sheet()?.getBoundingClientRect();
    const foot = part("foot").getBoundingClientRect(), head = part("head").getBoundingClientRect();
    const covered = below && below.height ? rect.bottom - below.top : 0;
    const size = [rect.width, rect.height, covered].map(Math.round).join();
    clearTimeout(timer);
    if (size === told || !state.html.head) return;
    timer = setTimeout(() => {
      told = size;
      const top = Math.max(0, head.bottom - rect.top);
      const bottom = Math.max(covered, rect.bottom - foot.top, 0);
      view().sendMessage({ type: "GuiUpdateMessage", uuid: widget, updates: {
        value: [performance.now(), rect.width, rect.height, top, bottom].map(Math.round).join() } });
    }, SETTLED_MS);
  };

  let pending = "";
  const frame = () => {
    requestAnimationFrame(frame);
    const mutable = view(), canvas = mutable?.canvas, camera = mutable?.camera;
    const world = mutable?.nodeRefFromName?.[""]?.matrixWorld?.elements;
    if (!canvas?.isConnected || !camera || !world || !widget) return;
    const rect = canvas.getBoundingClientRect(), covered = sheet()?.offsetHeight ?? 0;
    const now = performance.now();
    if (now > plates) { plates = now + PLATE_MS; colourLabels(); holdBackGhost(); }
    const layout = `${rect.x},${rect.y},${rect.width},${rect.height},${covered}`;
    const looks = camera.matrixWorld.elements.join() + camera.projectionMatrix.elements.join();
    if (layout + looks === seen) return;
    seen = layout + looks;
    if (pending !== layout) {
      pending = layout;
      Object.assign(root.style, { left: `${rect.x}px`, top: `${rect.y}px`,
        width: `${rect.width}px`, height: `${rect.height}px` });
      root.classList.toggle("ws-room-narrow", rect.width < 480);
      tell(rect);
    }
    camera.updateMatrixWorld();
    drawBars(camera, world, rect);
    drawLabels(camera, world, rect);
  };

  // on a phone the sheet of panels starts folded, once a page, so that the drawing is seen
  const foldSheet = tries => {
    if (innerWidth > PHONE_PX || sessionStorage.getItem("warpspace-folded")) return;
    const paper = sheet();
    const handle = paper?.querySelector('[style*="height: 3.5em"][style*="cursor: pointer"]');
    if (!handle) { if (tries) setTimeout(foldSheet, 50, tries - 1); return; }
    sessionStorage.setItem("warpspace-folded", "1");
    handle.click();
  };

  window.warpspaceRoom = {
    // the widget that is told how large the room is
    open(name) {
      widget = name; told = seen = pending = "";
      if (!root.isConnected) { document.body.append(root); requestAnimationFrame(frame); }
      try { foldSheet(100); } catch { /* no storage: the sheet stays open */ }
    },
    // whatever has changed: pieces of HTML, and what bars and labels follow from
    show(changes) {
      Object.assign(state, changes, { html: { ...state.html, ...changes.html } });
      for (const [name, html] of Object.entries(changes.html ?? {}))
        root.querySelector(`[data-room="${name}"]`).innerHTML = html;
      const button = root.querySelector('[data-word="machine"]');
      if (button && !remembered) {
        remembered = true;
        let last = null;
        try { last = localStorage.getItem(KEY); } catch { /* no storage */ }
        if (last === "hidden" && button.getAttribute("aria-pressed") === "true") button.click();
      }
      seen = pending = "";
      if ("dark" in changes) plates = 0;
    },
  };
  root.addEventListener("click", ({ target, isTrusted }) => {
    const button = target.closest('[data-word="machine"]');
    if (!button || !isTrusted) return;
    const hidden = button.getAttribute("aria-pressed") === "true";
    try { localStorage.setItem(KEY, hidden ? "hidden" : "shown"); } catch { /* no storage */ }
  });
})();
