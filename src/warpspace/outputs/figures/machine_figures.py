"""Figures with the machine: displaced bodies around the deformed volume; traces of the table."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.bodies.placed import PlacedBody, place_bodies
from warpspace.exceptions import OptionError
from warpspace.geometry import surfaces
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.kinematics.chain import BASE
from warpspace.kinematics.transforms import apply, rotate
from warpspace.machine.definition import Vector
from warpspace.outputs.drawing import map3d, off_screen
from warpspace.outputs.drawing.canvas import Canvas, Occupancy, write_label
from warpspace.outputs.drawing.settings import LIGHT, SIZES, FigureSettings, Theme, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    LegendEntry,
    Row,
    line_entry,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.figures.maps import draw_statistics
from warpspace.picture.formatting import quantity_words, spell_vector
from warpspace.picture.model import (
    ScenePicture,
    choose_exaggeration,
    choose_scale,
    evaluate_picture,
)
from warpspace.picture.traces import TraceLine, evaluate_traces, trace_lines
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MINUS, Array, spell_fixed

VOLUME_ALPHA, BEHIND_ALPHA = 0.72, 0.22
"""Opacity of the coloured volume in front of bodies, and behind them."""
DARKER = 0.62


def _drawn_body(part: PlacedBody, theme: Theme) -> off_screen.RenderedBody:
    surface, shade = part.surface, 1.0 if theme is LIGHT else DARKER
    return off_screen.RenderedBody(
        apply(part.pose, surface.vertices_mm),
        surface.triangles.astype(np.intp),
        colours=shade * surface.colours,
        normals=None if surface.normals is None else rotate(part.pose[:3, :3], surface.normals),
    )


def draw_machine(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    picture = evaluate_for(settings, scenes[0])
    title = f"Machine and working volume: {picture.scene.title}"
    placed = settings.prepared
    placed = placed or place_bodies(picture.scene, picture.view, picture.exaggeration)
    facts = scene_facts(picture, picture.exaggeration)
    facts.append("bodies schematic, deformed and tilted like their frames")
    legend = [
        line_entry("nominal volume", lambda theme: theme.ink, SIZES.thin, map3d.GHOST_DASHES, 0.6),
        line_entry("deformed volume", lambda theme: theme.ink),
        line_entry("nominal bodies", lambda theme: theme.ghost, SIZES.thin, alpha=0.6),
    ]
    sheet = start_sheet("machine", settings, title, facts, scenes, legend, exact=exact)
    canvas, (x_left, bottom, right, top) = sheet.canvas, sheet.content
    points = [map3d.map_points_mm(picture), *(part.vertices_mm for part in placed)]
    side = canvas.px(20.0)
    area = (x_left + side, bottom + side, right - canvas.px(150.0), top - side)
    projection = off_screen.fit_projection(settings.view, np.concatenate(points), area)
    machine = draw_bodies(canvas, placed, projection)
    volume = off_screen.render_bodies(
        map3d.surface_bodies(picture, surfaces.outer_faces(picture.shape)), projection
    )
    if volume is not None:
        _overlay(canvas, volume, machine)
    _draw_volume_lines(canvas, picture, projection, volume, machine)
    map3d.draw_lone_line(canvas, picture, projection)
    if machine is not None:
        _label_bodies(canvas, placed, projection, machine, right)
    draw_statistics(sheet, picture, projection.px_per_mm)
    return sheet.finish(picture.exaggeration, [DrawnMap(projection, picture, volume)])


def draw_bodies(
    canvas: Canvas,
    placed: Sequence[PlacedBody],
    projection: off_screen.Projection,
    *,
    opacity: float = 1.0,
    nominal: bool = True,
    zorder: float = 1.0,
) -> off_screen.Raster | None:
    theme = canvas.theme
    raster = off_screen.render_bodies([_drawn_body(part, theme) for part in placed], projection)
    if raster is None:
        return None
    map3d.draw_raster(canvas, raster, opacity, zorder)
    undisplaced = [replace(part, exaggeration=0.0) for part in placed if part.body.frame != BASE]
    for bodies, colour, alpha, height in (
        (placed, theme.grid, 0.75, 0.1),
        (undisplaced if nominal else (), theme.ghost, 0.8, 0.05),
    ):
        edges = (edge for part in bodies for edge in part.edges_mm)
        visible, _ = off_screen.split_visible(edges, projection, raster)
        canvas.lines(visible, width=SIZES.hair, colour=colour, alpha=alpha, zorder=zorder + height)
    return raster


def _overlay(canvas: Canvas, volume: off_screen.Raster, machine: off_screen.Raster | None) -> None:
    rgba = volume.rgba.copy()
    before = np.ones(rgba.shape[:2], dtype=bool)
    if machine is not None:
        x_left, _, _, top = volume.rect
        step = volume.sampling
        rows, columns = np.indices(rgba.shape[:2])
        spots = np.stack([x_left + (columns + 0.5) / step, top - (rows + 0.5) / step], -1)
        before = volume.depth_mm <= machine.depth_at(spots)
    share = np.where(before, VOLUME_ALPHA, BEHIND_ALPHA)
    rgba[..., 3] = (rgba[..., 3] * share).astype(np.uint8)
    canvas.image(rgba, volume.rect, zorder=1.6)


def _draw_volume_lines(
    canvas: Canvas,
    picture: ScenePicture,
    projection: off_screen.Projection,
    volume: off_screen.Raster | None,
    machine: off_screen.Raster | None,
) -> None:
    theme, shape = canvas.theme, picture.shape
    nodes, nominal = picture.drawn_mm.reshape(-1, 3), picture.grid.nominal_mm.reshape(-1, 3)
    faces = surfaces.outer_faces(shape)
    x, y, z = surfaces.line_spacing(shape)
    for lines, width, alpha in (
        (surfaces.face_lines(faces, shape, (2 * x, 2 * y, 2 * z)), SIZES.hair, 0.35),
        (surfaces.crease_lines(faces, shape) or surfaces.box_edges(shape), SIZES.line, 0.95),
    ):
        visible, _ = off_screen.split_visible((nodes[line] for line in lines), projection, volume)
        canvas.lines(visible, width=width, colour=theme.grid, alpha=alpha, zorder=2.0)
    edges = (nominal[edge] for edge in surfaces.box_edges(shape))
    style = {"colour": theme.ink, "dashes": map3d.GHOST_DASHES, "zorder": 2.2}
    map3d.draw_split(canvas, edges, projection, machine, alpha=(0.6, 0.3), **style)


def _label_bodies(
    canvas: Canvas,
    placed: Sequence[PlacedBody],
    projection: off_screen.Projection,
    raster: off_screen.Raster,
    right: float,
) -> None:
    spots = [(_visible_spot(part, projection, raster), part.label) for part in placed]
    labels = sorted((spot[1], name, spot) for spot, name in spots if spot is not None)
    column = right - canvas.px(120.0)
    y = -np.inf
    for spot_y, name, spot in labels:
        y = max(spot_y, y + canvas.px(30.0))
        canvas.line(
            [spot, (column - canvas.px(26.0), y), (column - canvas.px(8.0), y)],
            width=SIZES.hair, colour=canvas.theme.muted, zorder=5.0,
        )  # fmt: skip
        canvas.disc(np.array(spot), 2.5, canvas.theme.muted)
        canvas.text(column, y, name, size=SIZES.small, va="center_baseline")


def _visible_spot(
    part: PlacedBody, projection: off_screen.Projection, raster: off_screen.Raster
) -> tuple[float, float] | None:
    corners = part.vertices_mm[part.body.triangles]
    rng = np.random.default_rng(0)
    weights = rng.dirichlet([1.0, 1.0, 1.0], size=(24, len(corners)))
    points = np.einsum("ktc,tcx->ktx", weights, corners).reshape(-1, 3)
    spots = projection.project(points)
    is_visible = projection.depth_mm(points) <= raster.depth_at(spots) + 1.5 / projection.px_per_mm
    if not is_visible.any():
        return None
    visible = spots[is_visible]
    middle = np.median(visible, axis=0)
    best = visible[np.argmin(np.hypot(*(visible - middle).T))]
    return float(best[0]), float(best[1])


PIECE = 2  # samples of a trace in one piece of one colour
TRACE_DASHES, FADED = (7.0, 5.0), 0.55


def draw_traces(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    scene = scenes[0]
    groups = evaluate_traces(scene, 1.0)
    lines = trace_lines(groups)
    if not lines:
        raise OptionError(
            f"figure 'traces': {scene.name} has no traces; expected a machine with a rotary axis"
            " and points in [points_mm] traces"
        )
    largest = max(line.largest_um for line in lines)
    nominal = np.concatenate([line.nominal_mm for line in lines])
    reach = float(np.ptp(nominal, axis=0).max())
    # twice: traces are often seen edge-on, where a tenth of their extent suffices
    factor = choose_exaggeration(settings.exaggeration, scene.exaggeration, 2.0 * largest, reach)
    traces = trace_lines([replace(group, exaggeration=factor) for group in groups])
    coloured = [component_values(line.error_um, settings.component) for line in traces]
    values = np.concatenate(coloured)
    scale = choose_scale([values], settings.component, end=settings.range_top)
    picture = evaluate_picture(scene, grid=2, loop="workpiece", exaggeration=factor)
    turning = [axis.name for axis in scene.machine.axes.values() if not axis.is_linear]
    # other bodies would hide the traces
    placed = place_bodies(scene, picture.view, factor, (*turning, "w"))
    title = f"Traces of the rotary axes: {scene.title}"
    facts = [
        fact for fact in scene_facts(picture, factor) if not fact.startswith(("working", "2 "))
    ]
    legend = [
        line_entry("nominal trace", lambda theme: theme.muted, SIZES.thin, TRACE_DASHES),
        trace_entry("actual trace, exaggerated, coloured by its error"),
    ]
    if largest == 0.0:
        facts.append("no error of a rotary axis displaces these points: nominal traces only")
        traces, coloured, legend = traces[:0], coloured[:0], legend[:1]
    sheet = start_sheet("traces", settings, title, facts, scenes, legend, exact=exact)
    canvas = sheet.canvas
    points = [nominal, *(line.actual_mm for line in traces)]
    points += [part.vertices_mm for part in placed]
    inset = canvas.px(70.0)
    x_left, bottom, right, top = sheet.content
    area = (x_left + inset, bottom + inset / 2, right - inset, top - inset / 2)
    projection = off_screen.fit_projection(settings.view, np.concatenate(points), area)
    raster = draw_bodies(canvas, placed, projection, opacity=FADED)
    style = {"colour": canvas.theme.muted, "dashes": TRACE_DASHES, "zorder": 3.0}
    paths = (line.nominal_mm for line in lines)
    map3d.draw_split(canvas, paths, projection, raster, alpha=(1.0, 0.5), **style)
    if not traces:
        return sheet.finish(factor)
    _draw_lines(canvas, traces, coloured, scale, projection, raster)
    _label_traces(canvas, traces, projection, sheet.content)
    norms = np.concatenate([np.linalg.norm(trace.error_um, axis=-1) for trace in traces])
    rows: list[Row] = [
        ("max |E|", f"{spell_fixed(largest)} {MICROMETRE}"),
        ("mean |E|", f"{spell_fixed(float(norms.mean()))} {MICROMETRE}"),
        ("max at", f"{spell_vector(nominal[int(np.argmax(norms))])} mm"),
        *((name, f"{spell_vector(point)} mm") for point, name in _points(traces).items()),
    ]
    marks = [("max", float(values.max())), ("mean", float(values.mean()))]
    heading, bars = quantity_words(settings.component), (projection.px_per_mm, factor)
    sheet.draw_panel(scale, heading, marks, rows, bars)
    return sheet.finish(factor)


def _draw_lines(
    canvas: Canvas,
    traces: Sequence[TraceLine],
    coloured: Sequence[Array],
    scale: ColourScale,
    projection: off_screen.Projection,
    raster: off_screen.Raster | None,
) -> None:
    lines: tuple[list[Array], list[Array]] = ([], [])  # visible and hidden ones
    colours: tuple[list[Array], list[Array]] = ([], [])
    for trace, values in zip(traces, coloured, strict=True):
        for start in range(0, len(values) - 1, PIECE):
            piece = slice(start, start + PIECE + 1)
            split = off_screen.split_visible([trace.actual_mm[piece]], projection, raster)
            for number, part in enumerate(split):
                lines[number].extend(part)
                colours[number].extend([scale.colours(values[piece].mean()) / 255.0] * len(part))
    canvas.lines(lines[1], width=3.4, colour=np.array(colours[1]), alpha=0.45, zorder=3.3)
    canvas.lines(lines[0], width=4.6, colour=canvas.theme.ink, zorder=3.4)
    canvas.lines(lines[0], width=3.4, colour=np.array(colours[0]), zorder=3.5)


def _label_traces(
    canvas: Canvas,
    traces: Sequence[TraceLine],
    projection: off_screen.Projection,
    frame: off_screen.Rect,
) -> None:
    occupancy = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    occupancy.add_rects(canvas.rects)
    spots = [projection.project(trace.actual_mm) for trace in traces]
    occupancy.add_lines(spots)
    occupancy.add_lines([projection.project(trace.nominal_mm) for trace in traces])
    middle = np.concatenate(spots).mean(axis=0)
    names = _points(traces)
    for trace, line in zip(traces, spots, strict=True):
        away = np.argsort(-np.hypot(*(line - middle).T))
        name = f"{names[trace.trace.point_mm]} " if len(names) > 1 else ""
        text = f"{name}{trace.trace.label}: {spell_fixed(trace.largest_um)} {MICROMETRE}"
        text = text.replace("-", MINUS)
        placed = write_label(canvas, text, line[away[:24:4]], frame, occupancy, size=SIZES.small)
        if placed is not None:
            placed.draw_leader(canvas, canvas.theme.muted)


def _points(traces: Sequence[TraceLine]) -> dict[Vector, str]:
    points = dict.fromkeys(trace.trace.point_mm for trace in traces)
    return {point: f"P{number}" for number, point in enumerate(points, 1)}


def trace_entry(text: str) -> LegendEntry:
    def symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
        canvas.line([(x, y), (x + width, y)], width=4.6)
        canvas.line([(x, y), (x + width, y)], width=3.4, colour="#2f8f8e", zorder=3.1)

    return LegendEntry(symbol, text)
