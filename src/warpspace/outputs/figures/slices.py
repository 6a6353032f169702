"""Three slices through the middle of the working volume, laid out like an engineering drawing."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.field.grid import PLANES, build_slice, slice_ranges
from warpspace.geometry.surfaces import box_edges, crease_lines, outer_faces, triangulate
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.map3d import GHOST_DASHES, draw_map, fit_map
from warpspace.outputs.drawing.render import (
    Body,
    Rect,
    fit_projection,
    render_bodies,
    split_visible,
)
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import isoline_words, say_statistics
from warpspace.picture.model import ScenePicture, Slice
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_short

VIEW_OF = {"Z": "top", "Y": "front", "X": "right"}


def draw_slices(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw three slices through the middle of a scene's working volume."""
    picture = evaluate_for(settings, scenes[0])
    exaggeration, scale = picture.exaggeration, picture.scale
    slices = _evaluate_slices(picture, settings.grid)
    title = f"Slices through the working volume: {picture.scene.title}"
    legend = map_legend(
        isoline_words(scale, picture.values), surface="deformed slice", diverging=scale.diverging
    )
    sheet = start_sheet(
        "slices", settings, title, scene_facts(picture, exaggeration), scenes, legend, exact=exact
    )
    canvas = sheet.canvas
    cells = _cells(canvas, sheet.content, slices)
    px_per_mm = min(
        fit_map(canvas, [part], cells[part.axis], VIEW_OF[part.axis]).px_per_mm for part in slices
    )
    maps: list[DrawnMap] = []
    for part in slices:
        cell, view = cells[part.axis], VIEW_OF[part.axis]
        fitted = fit_map(canvas, [part], cell, view)
        middle = np.array([cell[0] + cell[2], cell[1] + cell[3]]) / 2.0
        nominal = part.grid.nominal_mm.reshape(-1, 3)
        centre = (nominal.min(axis=0) + nominal.max(axis=0)) / 2.0
        projection = replace(fitted, px_per_mm=px_per_mm, centre_mm=centre, centre_px=middle)
        maps.append(draw_map(canvas, part, cell, view, projection=projection))
        name = f"{PLANES[part.axis]} plane at axis {part.axis} = {spell_short(part.position_mm)} mm"
        high = cell[3] - canvas.px(12.0)
        canvas.text(middle[0], high, name, weight="bold", ha="center", va="top")
    _draw_key(canvas, picture, slices, cells["key"])
    say_statistics(sheet, picture, px_per_mm, above=[("whole volume", "")])
    return sheet.finish(exaggeration, maps)


def _evaluate_slices(picture: ScenePicture, nodes: int) -> list[Slice]:
    scene = picture.scene
    ranges = slice_ranges(scene.model, scene.workspace)
    if not ranges:
        raise OptionError(
            f"figure 'slices': the working volume of {scene.name} does not extend along X, Y and Z;"
            " draw the error-map"
        )
    found: list[Slice] = []
    for axis in ("Z", "Y", "X"):
        low, high = ranges[axis]
        at = (low + high) / 2.0
        grid = build_slice(scene.model, scene.workspace, axis, at, nodes)
        found.append(
            Slice(
                view=picture.view,
                grid=grid,
                field=evaluate_first_order(
                    scene.model, scene.errors, grid.coordinates, picture.view, grid.point_mm
                ),
                exaggeration=picture.exaggeration,
                component=picture.component,
                colours=picture.scale,
                axis=axis,
                position_mm=at,
            )
        )
    return found


def _cells(canvas: Canvas, rect: Rect, slices: Sequence[Slice]) -> dict[str, Rect]:
    spans = {part.axis: np.ptp(part.grid.nominal_mm.reshape(-1, 3), axis=0) for part in slices}
    x, y, z = float(spans["Z"][0]), float(spans["Z"][1]), float(spans["Y"][2])
    left, bottom, right, top = rect
    # axes and labels take the same room in every cell, the rest follows the lengths
    fixed = min(canvas.px(230.0), 0.3 * (right - left), 0.3 * (top - bottom))
    column = left + fixed + (right - left - 2.0 * fixed) * x / (x + y)
    row = bottom + fixed + (top - bottom - 2.0 * fixed) * z / (z + y)
    return {
        "Z": (left, row, column, top),
        "Y": (left, bottom, column, row),
        "X": (column, bottom, right, row),
        "key": (column, row, right, top),
    }


def _draw_key(canvas: Canvas, picture: ScenePicture, slices: Sequence[Slice], rect: Rect) -> None:
    inset = canvas.px(46.0)
    room = (rect[0] + inset, rect[1] + inset, rect[2] - inset, rect[3] - inset)
    nodes = picture.grid.nominal_mm.reshape(-1, 3)
    projection = fit_projection("iso", nodes, room)
    bodies: list[Body] = []
    creases: list[Array] = []
    for part in slices:
        faces = outer_faces(part.shape)
        surface = triangulate(faces)
        points = part.grid.nominal_mm.reshape(-1, 3)
        values = part.values.reshape(-1)
        bodies.append(
            Body(points[surface.nodes], surface.triangles, values[surface.nodes], part.scale)
        )
        creases += [points[line] for line in crease_lines(faces, part.shape)]
    raster = render_bodies(bodies, projection)
    canvas.image(raster.reduced() if canvas.exact else raster.rgba, raster.rect)
    theme = canvas.theme
    seen = [line for crease in creases for line in split_visible(crease, projection, raster)[0]]
    canvas.lines(seen, width=SIZES.thin, colour=theme.grid, zorder=2.0)
    for edge in box_edges(picture.grid.shape):
        visible, hidden = split_visible(nodes[edge], projection, raster)
        canvas.lines(visible, width=SIZES.thin, colour=theme.ghost, dashes=GHOST_DASHES)
        canvas.lines(hidden, width=SIZES.hair, colour=theme.ghost, alpha=0.5, dashes=GHOST_DASHES)
    canvas.text(
        (rect[0] + rect[2]) / 2.0, rect[3] - canvas.px(12.0), "where they lie (not exaggerated)",
        weight="bold", ha="center", va="top",
    )  # fmt: skip
