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
  const hold = lines => {
    known.lines = Object.fromEntries(Object.entries(lines).map(([name, [ends, lifts]]) =>
      [name, { ends: new Uint32Array(bytes(ends).buffer), lifts: floats(lifts) }]));
  };
  const isReduced = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
  const RISEN = "warpspace-risen", RISE_MS = 1500, RISE_LATEST_MS = 4000;
  const SKIPS = ["keydown", "pointerdown", "wheel"];
  let turn = 0, rising = null;  // ends the first view

  // The ghost of the machine: drawn first, then hidden by everything, so that the colours of the
  // map are true. Its colours are those of the solid machine, faded into the background.
  const SHADOW = { transparent: false, depthWrite: false, blending: 5, blendSrc: 204, blendDst: 205,
    blendSrcAlpha: 201, blendDstAlpha: 205 };
  const BODY = { transparent: false, depthWrite: true, opacity: 1 };
  const PALE = { light: [0.9, 0.9], dark: [0.035, 0.012] };  // share of its colours, and light added

  window.warpspaceMesh = {
    solid: 0,  // share in which the ghost is solid
    holdBack(theme = document.documentElement.classList.contains("ws-dark") ? "dark" : "light") {
      const [share, light] = PALE[theme], { solid } = this, bodies = [];
      let changed = false;
      warpspaceViser.node("/ghost_machine")?.traverse(part => {
        const { material } = part;
        if (!material) return;
        const isShadow = material.name === "shadow", look = theme + solid;
        part.renderOrder = isShadow ? -1002 : -1001;
        if (!isShadow) bodies.push(part);
        if (material.userData.look === look) return;
        Object.assign(material, isShadow ? SHADOW : BODY);
        if (!isShadow) {
          material.color.setScalar(share + solid * (1 - share));
          material.emissive.setScalar(light * (1 - solid));
        }
        material.userData.look = look;
        material.needsUpdate = changed = true;
      });
      const last = bodies.at(-1);
      if (last) {
        last.renderOrder = -1000;
        last.frustumCulled = false;
        last.onAfterRender = renderer => renderer.clearDepth();
      }
      if (changed) warpspaceViser.requestRender();
    },
    glide: 0,  // duration of the next changes, ms; between steps of a story
    next: 0,  // duration of the next change only, ms
    moves: 0,  // number of changes, for benchmarks
    // number of points, colour table; of each set of lines the points of their ends, and their offsets
    open({ count, palette, lines }) {
      known.count = count;
      known.palette = floats(palette);
      hold(lines);
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
    // at the very first visit the machine is solid until the answer arrives; the address of a page
    // opened by a program contains fixedDpr
    greet() {
      const address = new URLSearchParams(location.search);
      try {
        const isKnown = localStorage.getItem(RISEN) || address.has("fixedDpr");
        if (isReduced() || isKnown && address.get("rise") !== "on") return;
        localStorage.setItem(RISEN, "1");
      } catch { return; }  // it would be repeated at each visit
      const end = () => {
        for (const name of SKIPS) removeEventListener(name, end, true);
        rising = null;
        this.show?.(1);
        this.home?.();
        this.solid = 0;
        this.holdBack();
      };
      rising = end;
      this.solid = 1;
      for (const name of SKIPS) addEventListener(name, end, true);
      setTimeout(() => rising?.(), RISE_LATEST_MS);
      warpspacePage.send("rise");
    },
    // from true scale to the errors drawn, while the solid machine becomes its ghost and the camera
    // comes from the whole machine to the box
    rise([whole, box], nominal, lines) {
      const mesh = find("/box/surface", part => part.isMesh && part.geometry.attributes.color);
      const at = mesh?.geometry.attributes, from = nominal && floats(nominal), current = ++turn;
      if (!rising) return;
      this.home = () => warpspaceFly(box, 0);
      warpspaceFly(whole, 0);
      warpspaceFly(box, RISE_MS);
      if (at && from?.length === at.position.array.length) {
        const place = at.position.array.slice(), shade = at.color.array.slice();
        hold(lines);
        this.show = share => {
          for (const name of ["/limit/line", "/limit/hatching"]) {
            const line = warpspaceViser.node(name);
            if (line) line.visible = share === 1;
          }
          if (current === turn) draw(mesh, place.map((x, i) => from[i] + share * (x - from[i])), shade);
        };
      }
      this.eased(RISE_MS, share => {
        if (!rising) return;
        if (share === 1) { rising(); return; }
        this.show?.(share);
        this.solid = 1 - share;
        this.holdBack();
      });
    },
    // call with a share that goes from 0 to 1 during a time, ms
    eased(duration, call) {
      if (!duration || isReduced()) { call(1); return; }
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
