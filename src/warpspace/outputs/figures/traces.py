"""Traces of the rotary axes: the circles that points of the workpiece should and do run through."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.machine.description import Vector
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.labels import Occupancy, place_label
from warpspace.outputs.drawing.render import Projection, Raster, Rect, fit_projection, split_visible
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.sheet import (
    Drawing,
    LegendEntry,
    Row,
    line_entry,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.machine import bodies_of, draw_bodies
from warpspace.picture.model import choose_exaggeration, choose_scale, evaluate_picture
from warpspace.picture.traces import TraceLine, evaluate_traces, trace_lines
from warpspace.picture.words import quantity_words, spell_vector
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, MINUS, Array, spell

PIECE = 2
"""Samples of a trace in one piece of one colour."""
FADED = 0.55


def draw_traces(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the nominal and the actual traces of a scene's rotary axes."""
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
    # twice: traces are seen edge-on, a tenth of their reach is plenty
    factor = choose_exaggeration(
        settings.exaggeration,
        scene.exaggeration,
        2.0 * largest,
        float(np.ptp(nominal, axis=0).max()),
    )
    traces = trace_lines([replace(group, exaggeration=factor) for group in groups])
    coloured = [component_values(line.error_um, settings.component) for line in traces]
    values = np.concatenate(coloured)
    scale = choose_scale([values], settings.component, end=settings.range_top)
    picture = evaluate_picture(scene, grid=2, loop="workpiece", exaggeration=factor)
    turning = [axis.name for axis in scene.machine.axes.values() if not axis.is_linear]
    placed = bodies_of(picture, factor, only=(*turning, "w"))  # others would hide the traces
    title = f"Traces of the rotary axes: {scene.title}"
    facts = [
        fact for fact in scene_facts(picture, factor) if not fact.startswith(("working", "2 "))
    ]
    facts.append("nothing moves these points: no error of a rotary axis" if largest == 0.0 else "")
    sheet = start_sheet(
        "traces", settings, title, [fact for fact in facts if fact], scenes, _legend(), exact=exact
    )
    canvas = sheet.canvas
    points = [nominal, *(line.actual_mm for line in traces)]
    points += [part.vertices_mm for part in placed]
    inset = canvas.px(70.0)
    left, bottom, right, top = sheet.content
    room = (left + inset, bottom + inset / 2, right - inset, top - inset / 2)
    projection = fit_projection(settings.view, np.concatenate(points), room)
    raster = draw_bodies(canvas, placed, projection, opacity=FADED)
    _draw_lines(canvas, traces, coloured, scale, projection, raster)
    _label(canvas, traces, projection, sheet.content)
    bars = (projection.px_per_mm, factor)
    norms = np.concatenate([np.linalg.norm(trace.error_um, axis=-1) for trace in traces])
    rows: list[Row] = [
        ("max |E|", f"{spell(largest)} {MICROMETRE}"),
        ("mean |E|", f"{spell(float(norms.mean()))} {MICROMETRE}"),
        ("max at", f"{spell_vector(nominal[int(np.argmax(norms))])} mm"),
        *((name, f"{spell_vector(point)} mm") for point, name in _points(traces).items()),
    ]
    marks = [("max", float(values.max())), ("mean", float(values.mean()))]
    heading = quantity_words(settings.component)
    sheet.draw_panel(scale, heading, marks, rows, bars)
    return sheet.finish(factor)


def _draw_lines(
    canvas: Canvas,
    traces: Sequence[TraceLine],
    coloured: Sequence[Array],
    scale: ColourScale,
    projection: Projection,
    raster: Raster | None,
) -> None:
    theme = canvas.theme
    seen: list[Array] = []
    hidden: list[Array] = []
    seen_colours: list[Array] = []
    hidden_colours: list[Array] = []
    for trace, values in zip(traces, coloured, strict=True):
        before, behind = split_visible(trace.nominal_mm, projection, raster)
        for parts, width, alpha in ((before, SIZES.thin, 1.0), (behind, SIZES.hair, 0.5)):
            canvas.lines(
                parts, width=width, colour=theme.muted, alpha=alpha, dashes=(7.0, 5.0), zorder=3.0
            )
        for start in range(0, len(values) - 1, PIECE):
            piece = slice(start, start + PIECE + 1)
            colour = scale.colours(values[piece].mean()) / 255.0
            before, behind = split_visible(trace.actual_mm[piece], projection, raster)
            seen += before
            hidden += behind
            seen_colours += [colour] * len(before)
            hidden_colours += [colour] * len(behind)
    canvas.lines(hidden, width=3.4, colour=np.array(hidden_colours), alpha=0.45, zorder=3.3)
    canvas.lines(seen, width=4.6, colour=theme.ink, zorder=3.4)
    canvas.lines(seen, width=3.4, colour=np.array(seen_colours), zorder=3.5)


def _label(
    canvas: Canvas,
    traces: Sequence[TraceLine],
    projection: Projection,
    frame: Rect,
) -> None:
    taken = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    taken.add_rects(canvas.rects)
    spots = [projection.project(trace.actual_mm) for trace in traces]
    taken.add_lines(spots)
    taken.add_lines([projection.project(trace.nominal_mm) for trace in traces])
    middle = np.concatenate(spots).mean(axis=0)
    names = _points(traces)
    for trace, line in zip(traces, spots, strict=True):
        away = np.argsort(-np.hypot(*(line - middle).T))
        anchors = [(float(line[at][0]), float(line[at][1])) for at in away[:24:4]]
        name = f"{names[trace.trace.point_mm]} " if len(names) > 1 else ""
        text = f"{name}{trace.trace.label}: {spell(trace.largest_um)} {MICROMETRE}"
        text = text.replace("-", MINUS)
        size = canvas.text_size(text, SIZES.small)
        placed = place_label(anchors, size, frame, taken, canvas.factor)
        if placed is None:
            continue
        canvas.text(
            *placed.centre, text, size=SIZES.small, halo=canvas.theme.paper,
            ha="center", va="center_baseline",
        )  # fmt: skip
        x = min(max(placed.anchor[0], placed.rect[0]), placed.rect[2])
        y = min(max(placed.anchor[1], placed.rect[1]), placed.rect[3])
        canvas.line([(x, y), placed.anchor], width=SIZES.hair, colour=canvas.theme.muted)


def _points(traces: Sequence[TraceLine]) -> dict[Vector, str]:
    points = dict.fromkeys(trace.trace.point_mm for trace in traces)
    return {point: f"P{number}" for number, point in enumerate(points, 1)}


def _legend() -> list[LegendEntry]:
    return [
        line_entry("nominal trace", lambda theme: theme.muted, SIZES.thin, (7.0, 5.0)),
        LegendEntry(_trace_symbol, "actual trace, exaggerated, coloured by its error"),
    ]


def _trace_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    canvas.line([(x, y), (x + width, y)], width=4.6)
    canvas.line([(x, y), (x + width, y)], width=3.4, colour="#2f8f8e", zorder=3.1)
