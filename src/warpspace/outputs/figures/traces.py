"""Traces of the rotary axes: the circles that points of the workpiece should and do run through."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.geometry.deform import auto_exaggeration, deform
from warpspace.geometry.traces import Trace, build_traces
from warpspace.machine.description import Vector
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.labels import Occupancy, place_label
from warpspace.outputs.drawing.lines import split_visible
from warpspace.outputs.drawing.panel import Row, draw_panel
from warpspace.outputs.drawing.projection import Projection, Rect, fit_projection
from warpspace.outputs.drawing.render import Raster, render_bodies
from warpspace.outputs.drawing.settings import FigureSettings, choose_scale, given_exaggeration
from warpspace.outputs.drawing.sheet import LegendEntry, metadata, scene_facts, start_sheet
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import quantity_words
from warpspace.outputs.figures.machine import draw_body_edges, place_bodies
from warpspace.picture.words import MINUS, spell, spell_point
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import evaluate_picture
from warpspace.units import MICROMETRE, Array

PIECE = 2
"""Samples of a trace in one piece of one colour."""
BODIES = "BCAw"
"""Frames whose bodies stand around the traces; the other bodies would hide them."""
FADED = 0.55


@dataclass(frozen=True, slots=True)
class DrawnTrace:
    """One trace with its errors.

    Attributes
    ----------
    trace : Trace
    nominal_mm, error_um : ndarray, [n, 3]
    values : ndarray, [n]
        What the colour shows.
    """

    trace: Trace
    nominal_mm: Array
    error_um: Array
    values: Array

    @property
    def largest_um(self) -> float:
        """Largest error along it, µm."""
        return float(np.linalg.norm(self.error_um, axis=-1).max())


def draw_traces(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the nominal and the actual traces of a scene's rotary axes.

    Parameters
    ----------
    scenes : sequence of Scene, (1,)
    settings : FigureSettings
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing

    Raises
    ------
    OptionError
        If the machine has no rotary axis, or the scene no points to trace.
    """
    scene = scenes[0]
    traces = _evaluate(scene, settings.component)
    if not traces:
        raise OptionError(
            f"figure 'traces': {scene.name} has no traces; expected a machine with a rotary axis"
            " and points in [points_mm] traces"
        )
    largest = max(trace.largest_um for trace in traces)
    nominal = np.concatenate([trace.nominal_mm for trace in traces])
    factor = given_exaggeration(settings, scene)
    if factor is None:
        factor = auto_exaggeration(2.0 * largest, float(np.ptp(nominal, axis=0).max()))
    values = np.concatenate([trace.values for trace in traces])
    scale = choose_scale(settings, values)
    picture = evaluate_picture(scene, grid=2, loop="workpiece")
    placed = place_bodies(picture, factor, settings.theme, BODIES)
    title = f"Traces of the rotary axes: {scene.title}"
    facts = [
        fact for fact in scene_facts(picture, factor) if not fact.startswith(("working", "2 "))
    ]
    facts.append("nothing moves these points: no error of a rotary axis" if largest == 0.0 else "")
    sheet = start_sheet(
        settings, title, [fact for fact in facts if fact], scenes, _legend(), exact=exact
    )
    canvas = sheet.canvas
    drawn = [deform(trace.nominal_mm, trace.error_um, factor) for trace in traces]
    points = [nominal, *drawn, *(part.body.vertices_mm for part in placed)]
    inset = canvas.px(70.0)
    left, bottom, right, top = sheet.content
    room = (left + inset, bottom + inset / 2, right - inset, top - inset / 2)
    projection = fit_projection(settings.view, np.concatenate(points), room)
    raster: Raster | None = None
    if placed:
        raster = render_bodies([part.body for part in placed], projection)
        rgba = (raster.reduced() if canvas.exact else raster.rgba).copy()
        rgba[..., 3] = (rgba[..., 3] * FADED).astype(np.uint8)
        canvas.image(rgba, raster.rect)
        draw_body_edges(canvas, placed, projection, raster)
    _draw_lines(canvas, traces, drawn, scale, projection, raster)
    _label(canvas, traces, drawn, projection, sheet.content)
    bars = (projection.px_per_mm, factor)
    norms = np.concatenate([np.linalg.norm(trace.error_um, axis=-1) for trace in traces])
    rows: list[Row] = [
        ("max |E|", f"{spell(largest)} {MICROMETRE}"),
        ("mean |E|", f"{spell(float(norms.mean()))} {MICROMETRE}"),
        ("max at", f"{spell_point(nominal[int(np.argmax(norms))])} mm"),
        *((name, f"{spell_point(point)} mm") for point, name in _points(traces).items()),
    ]
    marks = [("max", float(values.max())), ("mean", float(values.mean()))]
    heading = quantity_words(settings.component)
    draw_panel(canvas, sheet.panel, scale, heading, marks, rows, bars)
    about = metadata(title, scenes, settings, factor, "traces")
    return Drawing(canvas.figure, title, about, (), tuple(canvas.rects))


def _evaluate(scene: Scene, component: str) -> list[DrawnTrace]:
    """Evaluate the errors along all traces of a scene."""
    found: list[DrawnTrace] = []
    groups = build_traces(scene.model, scene.trace_points_mm, scene.workspace.positions)
    for group in groups:
        view = View(group.loop)
        field = evaluate_first_order(
            scene.model, scene.errors, group.coordinates, view, group.nominal_mm
        )
        values = component_values(field.error_um, component)
        found += [
            DrawnTrace(trace, group.nominal_mm[i], field.error_um[i], values[i])
            for i, trace in enumerate(group.traces)
        ]
    return found


def _draw_lines(
    canvas: Canvas,
    traces: Sequence[DrawnTrace],
    drawn: Sequence[Array],
    scale: ColourScale,
    projection: Projection,
    raster: Raster | None,
) -> None:
    """Draw nominal traces grey, actual ones coloured; faint where the table hides them."""
    theme = canvas.theme
    for trace, actual in zip(traces, drawn, strict=True):
        seen, hidden = split_visible(trace.nominal_mm, projection, raster)
        canvas.lines(seen, width=SIZES.thin, colour=theme.muted, dashes=(7.0, 5.0), zorder=3.0)
        canvas.lines(
            hidden, width=SIZES.hair, colour=theme.muted, alpha=0.5, dashes=(7.0, 5.0), zorder=3.0
        )
        for start in range(0, len(actual) - 1, PIECE):
            piece = actual[start : start + PIECE + 1]
            middle = trace.values[start : start + PIECE + 1].mean()
            colour = scale.colours(np.asarray(middle)) / 255.0
            seen, hidden = split_visible(piece, projection, raster)
            canvas.lines(seen, width=4.6, colour=theme.ink, zorder=3.4)
            canvas.lines(seen, width=3.4, colour=colour, zorder=3.5)
            canvas.lines(hidden, width=3.4, colour=colour, alpha=0.45, zorder=3.3)


def _label(
    canvas: Canvas,
    traces: Sequence[DrawnTrace],
    drawn: Sequence[Array],
    projection: Projection,
    frame: Rect,
) -> None:
    """Name each trace beside its outermost point."""
    taken = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    taken.add_rects(canvas.rects)
    spots = [projection.project(line) for line in drawn]
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


def _points(traces: Sequence[DrawnTrace]) -> dict[Vector, str]:
    """Give numbers to the points that run through the traces."""
    points = dict.fromkeys(trace.trace.point_mm for trace in traces)
    return {point: f"P{number}" for number, point in enumerate(points, 1)}


def _legend() -> list[LegendEntry]:
    """Build the legend."""
    return [
        LegendEntry(
            lambda c, x, y, w: c.line(
                [(x, y), (x + w, y)], width=SIZES.thin, colour=c.theme.muted, dashes=(7.0, 5.0)
            ),
            "nominal trace",
        ),
        LegendEntry(_trace_symbol, "actual trace, exaggerated, coloured by its error"),
    ]


def _trace_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a coloured line with a dark rim."""
    canvas.line([(x, y), (x + width, y)], width=4.6)
    canvas.line([(x, y), (x + width, y)], width=3.4, colour="#2f8f8e", zorder=3.1)
