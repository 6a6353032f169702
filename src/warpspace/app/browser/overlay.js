// The overlay of the drawing: scale bars, values of isolines, labels of points with their leaders,
// numbers and names of the axes, the triad. They follow the camera, which is never moved here.
(() => {
  if (window.warpspaceOverlay) return;
  const MOST_LABELS = 12, LABEL_APART = 52;
  const SETTLED_MS = 160, LEAST_FACING = 0.12, PLATE_MS = 250;
  const state = { labels: [], slices: [], axes: [], marks: [], corners: [], triad: [], stale: [],
    centre: [0, 0, 0], factor: 1, perMm: 0.01 };
  let sentSize = "", drawnLayout = "", plates = 0, timer = 0;

  const root = warpspacePage.over;
  const part = name => root.querySelector(`.ws-${name}`);
  const zoom = () => root.currentCSSZoom ?? 1;

  const { through, project } = warpspaceBars;

  const drawBars = (camera, world, rect) => {
    const html = state.bars ? warpspaceBars.html(camera, world, rect, state) : "";
    if (part("bars").innerHTML !== html) part("bars").innerHTML = html;
  };

  // true if a slice hides the point
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
    // the eye in the axes of the drawing, which the world rotates
    const c = camera.matrixWorld.elements;
    const eye = [0, 1, 2].map(i => world[4 * i] * c[12] + world[4 * i + 1] * c[13]
      + world[4 * i + 2] * c[14]);
    const placed = [];
    for (const { at, out, text } of state.labels) {
      if (placed.length === MOST_LABELS) break;
      const to = eye.map((e, k) => e - at[k]), long = Math.hypot(...to);
      const facing = (out[0] * to[0] + out[1] * to[1] + out[2] * to[2]) / long;
      // a face that looks away hides its lines; a slice is visible from both sides
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

  // --- labels of points: outside the volume, with a leader, without overlaps -----------------------
  const canvasContext = document.createElement("canvas").getContext("2d");
  const widths = new Map();
  const widthOf = (text, bold) => {
    const font = `${bold ? "600 " : ""}12px system-ui, "DejaVu Sans", sans-serif`, key = font + text;
    if (!widths.has(key)) {
      if (widths.size > 500) widths.clear();
      canvasContext.font = font;
      widths.set(key, canvasContext.measureText(text).width + 8);
    }
    return widths.get(key);
  };
  const overlaps = (a, b) => a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
  // the outline of points on the screen, counter-clockwise
  const outline = points => {
    const sorted = [...points].sort((a, b) => a.x - b.x || a.y - b.y);
    const half = list => {
      const hull = [];
      for (const p of list) {
        while (hull.length > 1) {
          const [a, b] = hull.slice(-2);
          if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > 0) break;
          hull.pop();
        }
        hull.push(p);
      }
      return hull.slice(0, -1);
    };
    return [...half(sorted), ...half(sorted.reverse())];
  };
  const within = (shape, x, y) => shape.length > 2 && shape.every((a, i) => {
    const b = shape[(i + 1) % shape.length];
    return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x) >= 0;
  });
  const touches = (shape, { x, y, w, h }) => [[0, 0], [1, 0], [0, 1], [1, 1], [.5, .5], [.5, 0], [.5, 1]]
    .some(([u, v]) => within(shape, x + u * w, y + v * h));
  const occupied = () => ["head", "legend", "controls", "bars", "hint", "triad", "compared"].map(part)
    .filter(node => node?.offsetWidth)
    .map(node => {
      let x = 0, y = 0;
      for (let up = node; up && up !== root; up = up.offsetParent) { x += up.offsetLeft; y += up.offsetTop; }
      return { x, y, w: node.offsetWidth, h: node.offsetHeight };
    });
  const ANGLES = [0, 25, -25, 50, -50, 80, -80, 120, -120, 160, -160].map(degrees => degrees * Math.PI / 180);
  // a name of an axis that would overlap is moved along it, outwards, or between its numbers
  const MOVES = [...Array(13)].flatMap((_, k) => [...Array(33)].map((_, n) => [5 * n - 80, 16 - 4 * k]))
    .sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
  const FAR = [20, 34, 52, 76], BESIDE = [...FAR, 110, 150, 200, 260];

  const drawPointLabels = (camera, world, rect) => {
    const home = part("words"), lines = part("leaders");
    const at = point => project(camera, world, rect, point);
    const shape = state.corners.length ? outline(state.corners.map(at)) : [];
    const middle = { x: shape.reduce((sum, p) => sum + p.x, 0) / (shape.length || 1),
      y: shape.reduce((sum, p) => sum + p.y, 0) / (shape.length || 1) };
    const used = occupied(), placed = [], leaders = [];
    const room = { x: 2, y: 2, w: rect.width - 4, h: rect.height - 4 };
    const fits = box => box.x >= room.x && box.y >= room.y && box.x + box.w <= room.x + room.w
      && box.y + box.h <= room.y + room.h;
    const put = (label, box) => { used.push(box); placed.push({ ...label, ...box }); };
    const beyond = new Map();
    // along an axis: numbers outside the ends of their ticks, the name outside the numbers
    for (const { text, at: end, from, kind, axis } of state.axes) {
      const p = at(end), foot = at(from);
      if (p.depth <= 0) continue;
      const long = Math.hypot(p.x - foot.x, p.y - foot.y);
      const [u, v] = long > 1 ? [(p.x - foot.x) / long, (p.y - foot.y) / long] : [0, 1];
      const w = widthOf(text, kind === "axis") - 6, h = 15.6;
      const reach = Math.abs(u) * w / 2 + Math.abs(v) * h / 2;
      const away = 3 + reach + (kind === "axis" ? beyond.get(axis) ?? 0 : 0);
      if (kind === "tick") beyond.set(axis, Math.max(beyond.get(axis) ?? 0, 2 * reach + 2));
      for (const [along, outwards] of kind === "axis" ? MOVES : [[0, 0]]) {
        const box = { x: p.x + u * (away + outwards) - v * along - w / 2,
          y: p.y + v * (away + outwards) + u * along - h / 2, w, h };
        if (!fits(box) || used.some(other => overlaps(box, other)) || touches(shape, box)) continue;
        put({ text, kind }, box);
        break;
      }
    }
    const depth = state.corners.reduce((sum, corner) => sum + at(corner).depth, 0) / (state.corners.length || 1);
    for (const { text: label, at: point, kind } of state.marks) {
      const p = at(point);
      if (p.depth <= 0 || p.x < 0 || p.y < 0 || p.x > rect.width || p.y > rect.height) continue;
      // hidden by the box itself
      const behind = state.solid && p.depth > depth && within(shape, p.x, p.y);
      if (behind && kind === "corner") continue;
      const text = behind && kind === "worst" ? `${label} (behind)` : label;
      const w = widthOf(text, kind === "worst"), h = 17;
      const outwards = Math.atan2(p.y - middle.y, p.x - middle.x);
      let best = null;
      // the name of a path or a measured length inside the box would hide the map
      for (const far of ["name", "measured"].includes(kind) ? BESIDE : FAR) for (const turn of ANGLES) {
        const u = Math.cos(outwards + turn), v = Math.sin(outwards + turn);
        const box = { x: p.x + u * (far + w / 2) - w / 2, y: p.y + v * (far + h / 2) - h / 2, w, h };
        let cost = far + 12 * Math.abs(turn);
        if (!fits(box)) cost += 2000;
        cost += 1000 * used.filter(other => overlaps(box, other)).length;
        if (touches(shape, box)) cost += 300;
        if (!best || cost < best.cost) best = { cost, box };
      }
      if (best.cost >= 1000 && !["worst", "asked", "measured", "note"].includes(kind)) continue;
      put({ text, kind }, best.box);
      const { box } = best;
      const x = Math.min(Math.max(p.x, box.x), box.x + w), y = Math.min(Math.max(p.y, box.y), box.y + h);
      const long = Math.hypot(x - p.x, y - p.y);
      if (long > 8) leaders.push([p.x + 5 * (x - p.x) / long, p.y + 5 * (y - p.y) / long, x, y, kind]);
    }
    while (home.children.length > placed.length) home.lastChild.remove();
    placed.forEach(({ x, y, text, kind }, number) => {
      const label = home.children[number] ?? home.appendChild(document.createElement("span"));
      if (label.textContent !== text) label.textContent = text;
      if (label.dataset.kind !== kind) label.dataset.kind = kind;
      if (kind === "note") {  // a click on a flag opens the list there
        const number = text.replace(/\D/g, "");
        label.dataset.do = JSON.stringify({ do: "RevealNote", number: Number(number) });
        label.classList.toggle("ws-changed", state.stale.includes(number));
      } else if (label.dataset.do) { delete label.dataset.do; label.classList.remove("ws-changed"); }
      label.style.transform = `translate(${x.toFixed(1)}px,${y.toFixed(1)}px)`;
    });
    lines.innerHTML = leaders.map(([a, b, c, d, kind]) =>
      `<path data-kind="${kind}" d="M${a.toFixed(1)} ${b.toFixed(1)}L${c.toFixed(1)} ${d.toFixed(1)}"/>`).join("");
  };

  // the triad: directions of the three axes, in the orientation of the camera
  const drawTriad = (camera, world) => {
    const place = document.querySelector(".ws-triad svg");
    if (!place) return;
    const origin = through(world, [0, 0, 0]);
    const turned = state.triad.map(({ name, way }) => {
      const end = through(world, way), to = end.map((value, k) => k < 3 ? value - origin[k] : 0);
      const m = camera.matrixWorldInverse.elements;
      const [x, y, z] = [0, 1, 2].map(i => m[i] * to[0] + m[4 + i] * to[1] + m[8 + i] * to[2]);
      return { name, x, y: -y, z };
    }).sort((a, b) => a.z - b.z);
    place.innerHTML = turned.map(({ name, x, y }) => `<g class="ws-axis-${name.toLowerCase()}">
      <path d="M0 0L${(27 * x).toFixed(1)} ${(27 * y).toFixed(1)}"/>
      <text x="${(36 * x).toFixed(1)}" y="${(36 * y).toFixed(1)}">${name}</text></g>`).join("");
  };

  // the selected trace, measured distances and a diagnosed element are never hidden by the box
  const FORWARD = ["/traces/actual", "/traces/nominal", "/measured/nominal", "/measured/actual", "/measured/points",
    "/diagnosis/guides"];
  const bringForward = () => {
    for (const name of FORWARD)
      warpspaceViser.node(name)?.traverse(piece => {
        if (!piece.material?.depthTest) return;
        piece.material.depthTest = false;
        piece.renderOrder = 100;
        warpspaceViser.requestRender();
      });
  };

  // size of the drawing, and of the text at its edges
  const sendSize = rect => {
    const size = [rect.width, rect.height].map(Math.round).join();
    clearTimeout(timer);
    if (size === sentSize || !part("head").firstChild) return;
    timer = setTimeout(() => {
      sentSize = size;
      const z = zoom(), head = part("head"), foot = part("foot"), legend = part("legend");
      const top = z * (head.offsetTop + head.offsetHeight), bottom = rect.height - z * foot.offsetTop;
      const right = rect.width - z * legend.offsetLeft;
      const sizes = Object.entries({ width: rect.width, height: rect.height, top, bottom, right });
      const rounded = sizes.map(([name, size]) => [name, Math.max(0, Math.round(size))]);
      warpspacePage.send({ do: "Resize", ...Object.fromEntries(rounded) });
    }, SETTLED_MS);
  };

  let pending = "";
  const frame = () => {
    requestAnimationFrame(frame);
    const canvas = warpspaceViser.canvas(), camera = warpspaceViser.camera(), world = warpspaceViser.world();
    if (!canvas?.isConnected || !camera || !world) return;
    const rect = canvas.getBoundingClientRect();
    const now = performance.now();
    if (now > plates) { plates = now + PLATE_MS; warpspaceMesh.holdBack(); bringForward(); }
    const layout = `${rect.x},${rect.y},${rect.width},${rect.height}`;
    const looks = camera.matrixWorld.elements.join() + camera.projectionMatrix.elements.join();
    if (layout + looks === drawnLayout) return;
    drawnLayout = layout + looks;
    if (pending !== layout) {
      pending = layout;
      sendSize(rect);
    }
    camera.updateMatrixWorld();
    // in pixels of the overlay, which a very large page magnifies
    const size = { width: rect.width / zoom(), height: rect.height / zoom() };
    drawBars(camera, world, size);
    drawLabels(camera, world, size);
    drawPointLabels(camera, world, size);
    drawTriad(camera, world);
  };

  window.warpspaceOverlay = {
    // changed inputs of bars and labels
    show(changes) {
      Object.assign(state, changes);
      drawnLayout = pending = "";
      plates = 0;
    },
  };
  requestAnimationFrame(frame);
})();
