"""Maps of one scene: the bent working volume, slices of it, how far the tool axis leans."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from warpspace.analysis.statistics import Statistics, statistics
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.field.grid import PLANES, build_slice, slice_ranges
from warpspace.geometry import surfaces
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import TOOL_AXIS
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing import map3d, off_screen
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.settings import SIZES, FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    Row,
    Sheet,
    isoline_entries,
    line_entry,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.picture.formatting import IN_R, list_axes, quantity_words, spell_factor, spell_in_r
from warpspace.picture.model import ScenePicture, Slice, map_faces, view_words
from warpspace.scene.model import Scene
from warpspace.units import MICRORADIAN, RAD_PER_URAD, Array, spell, spell_fixed, spell_short

ISOLINE_STEP = "isolines every "


def draw_error_map(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    picture = evaluate_for(settings, scenes[0])
    component = settings.component
    subject = "Volumetric error map" if component == "norm" else f"Error map, {component} component"
    title = f"{subject}: {picture.scene.title}"
    facts = [*scene_facts(picture, picture.exaggeration), view_words(settings.view, picture.shape)]
    isolines = isoline_words(picture.scale, picture.values)
    legend = map_legend(isolines, picture.exceeded_um, diverging=picture.scale.diverging)
    sheet = start_sheet("error-map", settings, title, facts, scenes, legend, exact=exact)
    drawn = map3d.draw_map(sheet.canvas, picture, sheet.content, settings.view)
    draw_statistics(sheet, picture, drawn.projection.px_per_mm)
    return sheet.finish(picture.exaggeration, [drawn])


def draw_statistics(
    sheet: Sheet, picture: ScenePicture, px_per_mm: float, *, above: Sequence[Row] = ()
) -> None:
    summary, values = picture.statistics, picture.values
    rows: list[Row] = [
        *_summary_rows(summary, "|E|", "µm"),
        ("RMS", f"{spell_fixed(summary.rms_um)} µm"),
        *(_place_rows(summary) if summary.max_um > 0.0 else ()),
    ]
    marks = [("mean", summary.mean_um), ("P95", summary.p95_um), ("max", summary.max_um)]
    if picture.scene.limit_um is not None:
        marks.append(("limit", picture.scene.limit_um))
    if picture.component != "norm":
        low, high = float(values.min()), float(values.max())
        span = f"{spell_fixed(low)} … {spell_fixed(high)} µm"
        rows.insert(0, (f"{picture.component} component", span))
        marks = [("min", low), ("mean", float(values.mean())), ("max", high)]
    heading, bars = quantity_words(picture.component), (px_per_mm, picture.exaggeration)
    rows = [] if sheet.settings.printed else [*above, *rows]
    sheet.draw_panel(picture.scale, heading, marks, rows, bars)


def isoline_words(scale: ColourScale, values: Array | None = None) -> str:
    """Format the distance of isolines; empty if none lies within the values."""
    levels = surfaces.isoline_levels(scale)
    if values is not None:
        volume = sum(count > 1 for count in values.shape) > 1
        low, high = float(values.min()), float(values.max())
        levels = tuple(level for level in levels if volume and low < level < high)
    if not levels:
        return ""
    step = scale.ticks[1] - scale.ticks[0]
    return f"{ISOLINE_STEP}{spell_short(step)} {scale.unit}"


def _summary_rows(summary: Statistics, name: str, unit: str) -> list[Row]:
    values = {f"max {name}": summary.max_um, f"mean {name}": summary.mean_um, "P95": summary.p95_um}
    return [(label, f"{spell_fixed(value)} {unit}") for label, value in values.items()]


def _place_rows(summary: Statistics) -> list[Row]:
    linear = {name: value for name, value in summary.max_at_axes.items() if is_linear(name)}
    axes: list[Row] = [("max, axes", list_axes(linear))] if linear else []
    return [*axes, ("max, in R", spell_in_r(summary.max_at_mm).removeprefix(f"{IN_R} "))]


VIEW_OF = {"Z": "top", "Y": "front", "X": "right"}


def draw_slices(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    picture = evaluate_for(settings, scenes[0])
    exaggeration, scale = picture.exaggeration, picture.scale
    slices = _evaluate_slices(picture, settings.grid)
    title = f"Slices through the working volume: {picture.scene.title}"
    isolines = isoline_words(scale, picture.values)
    legend = map_legend(
        isolines, picture.exceeded_um, surface="deformed slice", diverging=scale.diverging
    )
    facts = scene_facts(picture, exaggeration)
    sheet = start_sheet("slices", settings, title, facts, scenes, legend, exact=exact)
    canvas = sheet.canvas
    cells = _cells(canvas, sheet.content, slices)
    px_per_mm = min(
        map3d.fit_map(canvas, [part], cells[part.axis], VIEW_OF[part.axis]).px_per_mm
        for part in slices
    )
    maps: list[DrawnMap] = []
    for part in slices:
        cell, view = cells[part.axis], VIEW_OF[part.axis]
        points = part.grid.nominal_mm
        projection = off_screen.fit_projection(view, points, cell, px_per_mm)
        maps.append(map3d.draw_map(canvas, part, cell, view, projection=projection))
        name = f"{PLANES[part.axis]} plane at axis {part.axis} = {spell_short(part.position_mm)} mm"
        middle, high = (cell[0] + cell[2]) / 2.0, cell[3] - canvas.px(12.0)
        canvas.text(middle, high, name, weight="bold", ha="center", va="top")
    _draw_key(canvas, picture, slices, cells["key"])
    draw_statistics(sheet, picture, px_per_mm, above=[("whole volume", "")])
    return sheet.finish(exaggeration, maps)


def _evaluate_slices(picture: ScenePicture, nodes: int) -> list[Slice]:
    scene = picture.scene
    ranges = slice_ranges(scene.model, scene.workspace)
    if not ranges:
        raise OptionError(
            f"figure 'slices': the working volume of {scene.name} does not extend along X, Y and Z;"
            " draw the error-map"
        )
    slices: list[Slice] = []
    for axis in ("Z", "Y", "X"):
        at, view = sum(ranges[axis]) / 2.0, picture.view
        grid = build_slice(scene.model, scene.workspace, axis, at, nodes)
        field = evaluate_first_order(
            scene.model, scene.errors, grid.coordinates, view, grid.point_mm
        )
        slices.append(
            Slice(
                view=view, grid=grid, field=field, exaggeration=picture.exaggeration,
                component=picture.component, colours=picture.scale, hatch_um=picture.hatch_um,
                axis=axis, position_mm=at,
            )
        )  # fmt: skip
    return slices


def _cells(
    canvas: Canvas, rect: off_screen.Rect, slices: Sequence[Slice]
) -> dict[str, off_screen.Rect]:
    spans = {part.axis: np.ptp(part.grid.nominal_mm.reshape(-1, 3), axis=0) for part in slices}
    x, y, z = float(spans["Z"][0]), float(spans["Z"][1]), float(spans["Y"][2])
    x_left, bottom, right, top = rect
    # axes and labels take the same space in every cell; the remainder follows the lengths
    fixed = min(canvas.px(230.0), 0.3 * (right - x_left), 0.3 * (top - bottom))
    column = x_left + fixed + (right - x_left - 2.0 * fixed) * x / (x + y)
    row = bottom + fixed + (top - bottom - 2.0 * fixed) * z / (z + y)
    return {
        "Z": (x_left, row, column, top),
        "Y": (x_left, bottom, column, row),
        "X": (column, bottom, right, row),
        "key": (column, row, right, top),
    }


def _draw_key(
    canvas: Canvas, picture: ScenePicture, slices: Sequence[Slice], rect: off_screen.Rect
) -> None:
    inset = canvas.px(46.0)
    area = (rect[0] + inset, rect[1] + inset, rect[2] - inset, rect[3] - inset)
    nodes = picture.grid.nominal_mm.reshape(-1, 3)
    projection = off_screen.fit_projection("iso", nodes, area)
    bodies: list[off_screen.RenderedBody] = []
    creases: list[Array] = []
    for part in slices:
        faces = surfaces.outer_faces(part.shape)
        bodies += map3d.surface_bodies(replace(part, exaggeration=0.0), faces)
        points = part.grid.nominal_mm.reshape(-1, 3)
        creases += [points[line] for line in surfaces.crease_lines(faces, part.shape)]
    raster = off_screen.render_bodies(bodies, projection)
    if raster is not None:
        map3d.draw_raster(canvas, raster)
    theme = canvas.theme
    visible, _ = off_screen.split_visible(creases, projection, raster)
    canvas.lines(visible, width=SIZES.thin, colour=theme.grid, zorder=2.0)
    edges = (nodes[edge] for edge in surfaces.box_edges(picture.grid.shape))
    style = {"colour": theme.ghost, "dashes": map3d.GHOST_DASHES}
    map3d.draw_split(canvas, edges, projection, raster, alpha=(1.0, 0.5), **style)
    x, y = (rect[0] + rect[2]) / 2.0, rect[3] - canvas.px(12.0)
    heading = "slices, not exaggerated"
    canvas.text(x, y, heading, weight="bold", ha="center", va="top")


LEAN_RAD = 0.45  # largest lean on screen that the factor aims at
NEEDLE_SHARE = 0.13  # length of a needle, as a share of the longest edge
NEEDLES = 5  # needles along each edge, about
NEEDLE_DASHES = (6.0, 4.0)


def draw_orientation(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    picture = evaluate_for(settings, scenes[0], quantity="orientation")
    values, scale, view = picture.values, picture.scale, settings.view
    drawn = replace(picture.field.tilts, nominal_mm=picture.grid.nominal_mm)
    summary = statistics(drawn, picture.grid.coordinates)
    requested = settings.exaggeration
    factor = _lean_factor(summary.max_um) if requested is None or requested == "auto" else requested
    title = f"Orientation error of the tool axis: {picture.scene.title}"
    facts = [
        *scene_facts(picture, None),
        f"lean of the tool axis drawn {spell_factor(factor)}",
        "volume undeformed",
        "orthographic",
        view_words(view, picture.grid.shape),
    ]
    legend = [
        line_entry("nominal tool axis", lambda theme: theme.ghost, SIZES.thin, NEEDLE_DASHES),
        line_entry("actual tool axis, lean exaggerated", lambda theme: theme.accent, SIZES.bold),
        *isoline_entries(isoline_words(scale, values)),
    ]
    sheet = start_sheet("orientation-map", settings, title, facts, scenes, legend, exact=exact)
    needles, feet = _needles(picture, factor), _feet(picture.shape, view)
    content = replace(picture, exaggeration=0.0)  # the volume itself is drawn undeformed
    ends = needles[:, feet].reshape(-1, 3)
    projection = map3d.fit_map(sheet.canvas, [content], sheet.content, view, beside_mm=ends)
    drawn = map3d.draw_map(
        sheet.canvas, content, sheet.content, view, projection=projection,
        annotate=partial(_draw_needles, needles, feet), ghost=False,
    )  # fmt: skip
    heading = "tilt" if settings.component == "norm" else f"rotation about {settings.component}"
    per_degree = math.radians(1.0) / RAD_PER_URAD / factor
    rows = [
        *_summary_rows(summary, "tilt", MICRORADIAN),
        *_place_rows(summary),
        ("1° of drawn lean", f"{spell(per_degree)} {MICRORADIAN}"),
    ]
    marks = [("mean", float(values.mean())), ("max", float(values.max()))]
    if settings.component != "norm":
        marks.insert(0, ("min", float(values.min())))
    heading = f"{heading}  [{MICRORADIAN}]"
    sheet.draw_panel(scale, heading, marks, rows, (projection.px_per_mm, None))
    return sheet.finish(factor, [drawn])


def _lean_factor(largest_urad: float) -> float:
    if not largest_urad > 0.0:
        return 1000.0
    return surfaces.round_down(max(LEAN_RAD / (largest_urad * RAD_PER_URAD), 1.0))


def _needles(picture: ScenePicture, factor: float) -> Array:
    """Compute the ends of the nominal and of the leaning tool axis at each node, [2, N, 2, 3]."""
    pose = branch_pose(picture.scene.model, "tool", picture.grid.coordinates)
    foot = picture.grid.nominal_mm.reshape(-1, 3)
    axis = pose[..., :3, :3] @ np.array(TOOL_AXIS)
    axis = np.broadcast_to(axis, picture.grid.nominal_mm.shape).reshape(-1, 3)
    turn = picture.field.orientation_urad.reshape(-1, 3)
    lean = factor * RAD_PER_URAD * np.cross(turn, axis)
    length = NEEDLE_SHARE * picture.size_mm
    tips = (foot + length * direction for direction in (axis, axis + lean))
    return np.stack([np.stack([foot, tip], 1) for tip in tips])


def _draw_needles(needles: Array, feet: surfaces.Index, stage: map3d.Stage) -> None:
    theme = stage.canvas.theme
    for ends, colour, width, dashes in (
        (needles[0], theme.ghost, SIZES.thin, NEEDLE_DASHES),
        (needles[1], theme.accent, SIZES.bold, None),
    ):
        lines, _ = stage.split(ends[feet])
        stage.canvas.lines(lines, width=width, colour=colour, dashes=dashes, zorder=4.0)
        stage.occupancy.add_lines(lines)
    tilt_urad = np.linalg.norm(stage.picture.field.orientation_urad.reshape(-1, 3), axis=-1)
    for corner in surfaces.corners(stage.picture.shape):
        ends = needles[1, corner]
        if stage.split([ends])[0]:
            text = f"{spell_fixed(float(tilt_urad[corner]))} {MICRORADIAN}"
            stage.label(text, [stage.projection.project(ends[1])])


def _feet(shape: surfaces.Shape, view: str) -> surfaces.Index:
    surface = surfaces.triangulate(map_faces(shape, cut=view == "iso")).nodes
    surface = surface if len(surface) else np.arange(np.prod(shape))
    at = np.stack(np.unravel_index(surface, shape), -1)
    step = [max(1, (count - 1) // (NEEDLES - 1)) for count in shape]
    selected = np.ones(len(surface), dtype=bool)
    for axis in range(3):
        selected &= (at[:, axis] % step[axis] == 0) | (at[:, axis] == shape[axis] - 1)
    return surface[selected]
