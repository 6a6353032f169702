// The deformed box during a change: only points and colours are sent. Triangles, ends of lines and the
// colour table are sent once; viser's copy is updated when the change is finished.
(() => {
  if (window.warpspaceMesh) return;
  const known = { lines: {}, palette: null, count: 0 };
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const floats = text => text.BYTES_PER_ELEMENT ? text : new Float32Array(bytes(text).buffer);
  const find = (name, matches) => {
    let match = null;
    warpspaceViser.node(name)?.traverse(part => {
      if (!match && matches(part)) match = part;
    });
    return match;
  };
  const follow = (attribute, values) => { attribute.array.set(values); attribute.needsUpdate = true; };

  const draw = (mesh, place, shade) => {
    const at = mesh.geometry.attributes;
    follow(at.position, place);
    follow(at.color, shade);
    mesh.geometry.computeBoundingSphere();
    for (const [name, { ends, lifts }] of Object.entries(known.lines)) {
      const line = find(name, part => part.geometry?.attributes.instanceStart);
      const data = line?.geometry.attributes.instanceStart.data;
      if (data?.array.length !== lifts.length) continue;
      for (let i = 0; i < ends.length; i++)
        for (let k = 0; k < 3; k++) data.array[3 * i + k] = place[3 * ends[i] + k] + lifts[3 * i + k];
      data.needsUpdate = true;
    }
    warpspaceViser.requestRender();
  };
  let turn = 0;

  window.warpspaceMesh = {
    glide: 0,  // duration of the next changes, ms; between steps of a story
    next: 0,  // duration of the next change only, ms
    moves: 0,  // number of changes, for benchmarks
    // number of points, colour table; of each set of lines the points of their ends, and their offsets
    open({ count, palette, lines }) {
      known.count = count;
      known.palette = floats(palette);
      known.lines = Object.fromEntries(Object.entries(lines).map(([name, [ends, lifts]]) =>
        [name, { ends: new Uint32Array(bytes(ends).buffer), lifts: floats(lifts) }]));
    },
    bend(points, colours) {
      const mesh = find("/box/surface", part => part.isMesh && part.geometry.attributes.color);
      const at = mesh?.geometry.attributes;
      if (!at || at.position.count !== known.count) return false;  // sent when the change is finished
      const place = floats(points), level = bytes(colours), { palette } = known;
      const size = at.color.itemSize, shade = at.color.array.slice();
      for (let i = 0; i < level.length; i++)
        for (let k = 0; k < 3; k++) shade[size * i + k] = palette[3 * level[i] + k];
      const duration = this.next || this.glide;
      this.next = 0;
      const current = ++turn, was = duration && [at.position.array.slice(), at.color.array.slice()];
      const mixed = (from, to, share) => share < 1 ? to.map((x, i) => from[i] + share * (x - from[i])) : to;
      this.eased(duration, share => {
        if (current === turn) draw(mesh, mixed(was[0], place, share), mixed(was[1], shade, share));
      });
      this.moves++;
      return true;
    },
    // call with a share that goes from 0 to 1 during a time, ms
    eased(duration, call) {
      if (!duration || matchMedia("(prefers-reduced-motion: reduce)").matches) { call(1); return; }
      const start = performance.now();
      const next = now => {
        const part = Math.min(1, Math.max(0, now - start) / duration);
        call(part * part * (3 - 2 * part));
        if (part < 1) requestAnimationFrame(next);
      };
      requestAnimationFrame(next);
    },
    // like viser's message for a pose
    move(name, at) {
      const pose = warpspaceViser.pose(name);
      if (!pose) return;
      pose.position = at;
      if (pose.poseUpdateState !== "waitForMakeObject") pose.poseUpdateState = "needsUpdate";
      warpspaceViser.requestRender();
    },
  };
})();
