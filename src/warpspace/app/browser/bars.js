// Scale bars of a drawing: a length of the geometry and one of the errors, at its middle.
(() => {
  const BAR_PX = 130, BAR_PART = 0.22;
  const roundDown = value => {
    const decade = 10 ** Math.floor(Math.log10(value));
    return Math.max(...[1, 2, 5].map(s => s * decade).filter(v => v <= value * (1 + 1e-9)), decade);
  };
  const spell = value => String(Number(value.toPrecision(6)));

  // column-major 4 × 4 times a point
  const through = (m, [x, y, z]) => [0, 1, 2, 3].map(
    i => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);

  // position of a point on the screen: pixels from the top left of the drawing, and depth
  const project = (camera, world, rect, point) => {
    const eye = through(camera.matrixWorldInverse.elements, through(world, point));
    const clip = through(camera.projectionMatrix.elements, eye);
    return { x: (clip[0] / clip[3] + 1) / 2 * rect.width,
      y: (1 - clip[1] / clip[3]) / 2 * rect.height, depth: -eye[2] };
  };

  window.warpspaceBars = {
    through, project,
    // centre in units of the drawing, of which a millimetre has `perMm`; displayed factor of the errors
    html(camera, world, rect, { centre, perMm: unit, factor, spelt }) {
      const { depth } = project(camera, world, rect, centre);
      const perMm = camera.projectionMatrix.elements[5] * rect.height / 2 / depth * unit;
      const free = Math.min(Math.max(BAR_PX, 0.09 * rect.width), BAR_PART * rect.width);
      if (!(depth > 0) || !(perMm > 0)) return "";
      const mm = roundDown(free / perMm), perUm = perMm * 1e-3 * factor, um = roundDown(free / perUm);
      const rows = [["mm", mm, mm * perMm, `${spell(mm)} mm geometry`], ["um", um, um * perUm,
        `${um < 1e4 ? `${spell(um)} µm` : `${spell(um * 1e-3)} mm`} error, drawn ${spelt}`]];
      return rows.map(([name, length, width, text]) => `<div data-bar-scale="${name}"
        data-length="${length}"><i style="width:${width.toFixed(2)}px"></i>${text}</div>`).join("");
    },
  };
})();
