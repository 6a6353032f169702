"""Volumes side by side: two scenes and their change, a repair, machines within tolerances."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from warpspace.analysis.commands.adjust import ActSet, Adjust
from warpspace.analysis.commands.concepts import (
    LETTERS,
    Concept,
    Concepts,
    compare_concepts,
    expected_um,
)
from warpspace.bodies.placed import PlacedBody, place_bodies
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import build_grid
from warpspace.machine.axes import parameter
from warpspace.machine.limits import REPAIR_NODES
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.map3d import draw_map, draw_maps_alike
from warpspace.outputs.drawing.off_screen import Rect, fit_projection
from warpspace.outputs.drawing.settings import SIZES, FigureSettings, evaluate_for, share_colours
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    draw_colour_bar,
    draw_scale_bars,
    isoline_entries,
    line_entry,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.figures.machine_figures import draw_bodies
from warpspace.outputs.figures.maps import ISOLINE_STEP, isoline_words
from warpspace.picture.comparison import CHANGE, STATISTICS, scene_change, share_exaggeration
from warpspace.picture.formatting import LOOP_WORDS, tolerance_words
from warpspace.picture.model import DIFFERENCE_LENGTH, ScenePicture, view_words
from warpspace.scene.model import Scene, common_loop
from warpspace.units import Array, spell_change, spell_count, spell_fixed, spell_short


def draw_comparison(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    title = f"Comparison of A: {scenes[0].title} and B: {scenes[1].title}"
    return _draw_pair("comparison", title, scenes, settings, [], exact=exact)


def _draw_pair(
    name: str,
    title: str,
    scenes: Sequence[Scene],
    settings: FigureSettings,
    remarks: Sequence[str],
    *,
    exact: bool,
) -> Drawing:
    pictures = [evaluate_for(settings, scene) for scene in scenes]
    first, second = share_colours(settings, share_exaggeration(pictures, settings.exaggeration))
    scale, exaggeration, component = first.scale, first.exaggeration, settings.component
    change = scene_change(first, second)
    if settings.range_fixed:
        change = replace(change, colours=replace(change.scale, low=scale.low, high=scale.high))
    facts = [
        *scene_facts(first, exaggeration),
        view_words(settings.view, first.grid.shape),
        *remarks,
    ]
    isolines = [isoline_words(one.scale, one.values) for one in (first, change)]
    if all(isolines) and isolines[0] != isolines[1]:
        isolines = [f"{isolines[0]}, of {CHANGE} {isolines[1].removeprefix(ISOLINE_STEP)}"]
    legend = map_legend(
        next(filter(None, isolines), ""), first.exceeded_um, diverging=scale.diverging
    )
    sheet = start_sheet(name, settings, title, facts, scenes, legend, exact=exact, panel=False)
    canvas = sheet.canvas
    x_left, bottom, right, top = sheet.content
    middle = ((x_left + right) / 2.0, (bottom + top) / 2.0)
    cells = [
        (x_left, middle[1], middle[0], top),
        (middle[0], middle[1], right, top),
        (x_left, bottom, middle[0], middle[1]),
    ]
    changed = DIFFERENCE_LENGTH if component == "norm" else f"change of the {component} component"
    names = [f"A  {scenes[0].title}", f"B  {scenes[1].title}", f"{CHANGE}:  {changed}"]
    maps = draw_maps_alike(canvas, [first, second, change], names, cells, settings.view)
    corner = (middle[0] + canvas.px(24.0), bottom, right, middle[1] - canvas.px(6.0))
    _draw_corner(canvas, corner, maps)
    return sheet.finish(exaggeration, maps)


def _draw_corner(canvas: Canvas, rect: Rect, maps: Sequence[DrawnMap]) -> None:
    x_left, bottom, right, top = rect
    bar, step = canvas.px(28.0), canvas.px(112.0)
    for name, drawn in (("A and B", maps[0]), (CHANGE, maps[2])):
        max_width, scale = 0.9 * step, drawn.picture.scale
        canvas.text(
            x_left, top, name, size=SIZES.heading, weight="bold", va="top", max_width=max_width
        )
        label = "" if canvas.printed else f"{scale.label}  "
        quantity, high = f"{label}[{scale.unit}]", top - canvas.px(26.0)
        canvas.text(x_left, high, quantity, size=SIZES.small, va="top", max_width=max_width)
        box = (x_left, bottom + canvas.px(20.0), x_left + bar, top - canvas.px(62.0))
        draw_colour_bar(canvas, box, scale)
        x_left += step
    start, drawn = x_left + canvas.px(6.0), maps[0]
    box = (start, bottom + canvas.px(10.0), right, top)
    draw_scale_bars(canvas, box, drawn.projection.px_per_mm, drawn.picture.exaggeration)
    if canvas.printed:
        return
    columns = [start + (right - start) * share for share in (0.27, 0.42, 0.64, 0.99)]
    y = top - canvas.px(62.0)
    canvas.text(start, y, "µm", colour=canvas.theme.muted)
    for x, name in zip(columns, ("A", "B", CHANGE, DIFFERENCE_LENGTH), strict=True):
        canvas.text(x, y, name, weight="bold", ha="right")
    summaries = [drawn.picture.statistics for drawn in maps]
    for name, key in STATISTICS.items():
        y -= canvas.px(28.0)
        canvas.text(start, y, name, colour=canvas.theme.muted)
        a, b, difference = (getattr(part, key) for part in summaries)
        texts = (spell_fixed(a), spell_fixed(b), spell_change(b - a), spell_fixed(difference))
        for x, text in zip(columns, texts, strict=True):
            canvas.text(x, y, text, ha="right")


def draw_adjustment(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    scene = scenes[0]
    grid = min(settings.grid, REPAIR_NODES[1])
    adjustment = settings.prepared or Adjust(loop=settings.chosen_loop, grid=grid).run(scene)
    after, remark = scene, "no adjustment required"
    if adjustment.worthwhile:
        proposed = adjustment.worthwhile[0]
        after = adjustment.changes()[proposed].scene
        parts = ", ".join(
            f"{key} {adjustment.present[key]:.3g} → {value:.3g} {parameter(key).unit}"
            for key, value in adjustment.adjustments[proposed].adjust.items()
        )
        planned = adjustment.adjustments[proposed]
        parts = planned.label if isinstance(planned, ActSet) else parts
        remark = f"adjusted for the smallest {adjustment.objective.upper()}: {parts}"
    after = replace(after, title="after", name=f"{scene.name}_adjusted")
    pair, title = (replace(scene, title="before"), after), f"Adjustment: {scene.title}"
    return _draw_pair("adjust", title, pair, settings, [remark], exact=exact)


BODY_ALPHA = 0.55
CELL_HEAD, CELL_FOOT, AXIS_LABELS = 30.0, 74.0, 50.0
"""Space in px above a picture for its title, below it for its numbers, and for labels of axes."""


def draw_concepts(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    plan = replace(settings.concepts or Concepts(), loop=common_loop(scenes, settings.loop))
    concepts = compare_concepts(scenes, plan)
    pictures = [picture_concept(concept, settings.grid) for concept in concepts]
    pictures = share_colours(replace(settings, component="norm"), pictures)
    scale, first = pictures[0].scale, concepts[0]
    title = f"Concepts within {'their own' if plan.own_tolerances else 'the same'} tolerances"
    facts = [
        *([] if plan.own_tolerances else [tolerance_words(first.scene.tolerances)]),
        f"{spell_count(plan.samples)} sampled machines each, {plan.drawn}",
        "largest |E| of each" if plan.over == "max" else "|E| at a random point of each",
        LOOP_WORDS[first.sampled.case.view.loop],
        view_words(settings.view, (2, 2, 2)),
    ]
    legend = [
        line_entry("working volume, RMS of |E|", lambda theme: theme.ink),
        *isoline_entries(isoline_words(scale)),
    ]
    drawn = [concept.scene for concept in concepts]
    sheet = start_sheet(
        "concepts", settings, title, facts, drawn, legend, exact=exact, errors=False
    )
    canvas = sheet.canvas
    cells = _cells(sheet.content, len(concepts))
    areas = [_picture_area(canvas, cell) for cell in cells]
    maps, px_per_mm = _draw_machines(canvas, pictures, areas, settings)
    for letter, cell, concept in zip(LETTERS, cells, concepts, strict=False):
        _draw_labels(canvas, cell, letter, concept)
    rows = [
        (f"mean {letter}", f"{spell_fixed(one.sampled.mean_um)} µm")
        for letter, one in zip(LETTERS, concepts, strict=False)
    ]
    sheet.draw_panel(
        scale, "RMS |E|  [µm]", [], [] if settings.printed else rows, (px_per_mm, None)
    )
    return sheet.finish(1.0, maps)


def picture_concept(concept: Concept, nodes: int) -> ScenePicture:
    """Build a picture of the nominal volume, coloured by the RMS of |E| within tolerance."""
    scene = concept.scene
    grid = build_grid(scene.model, scene.workspace, nodes)
    expected, zero = expected_um(concept, grid), np.zeros(grid.nominal_mm.shape)
    along_x = np.stack([expected, zero[..., 0], zero[..., 0]], axis=-1)
    view, field = concept.sampled.case.view, ErrorField(grid.nominal_mm, along_x, zero)
    return ScenePicture(view=view, grid=grid, field=field, exaggeration=0.0, scene=scene)


def _draw_machines(
    canvas: Canvas,
    pictures: Sequence[ScenePicture],
    areas: Sequence[Rect],
    settings: FigureSettings,
) -> tuple[tuple[DrawnMap, ...], float]:
    view = settings.view
    bodies = [place_bodies(one.scene, one.view, 1.0) for one in pictures]
    extents = [_points_mm(picture, own) for picture, own in zip(pictures, bodies, strict=True)]
    px_per_mm = min(
        fit_projection(view, points, room).px_per_mm
        for points, room in zip(extents, areas, strict=True)
    )
    maps: list[DrawnMap] = []
    for picture, placed, points, area in zip(pictures, bodies, extents, areas, strict=True):
        projection = fit_projection(view, points, area, px_per_mm)
        draw_bodies(canvas, placed, projection, opacity=BODY_ALPHA, nominal=False, zorder=0.8)
        style: dict[str, Any] = {"labels": False, "annotate": None, "ghost": False}
        maps.append(draw_map(canvas, picture, area, view, projection=projection, **style))
    return tuple(maps), px_per_mm


def _cells(rect: Rect, count: int) -> list[Rect]:
    x_left, bottom, right, top = rect
    columns = min(count, max(1, round(math.sqrt(count * (right - x_left) / (top - bottom)))))
    rows = math.ceil(count / columns)
    width, height = (right - x_left) / columns, (top - bottom) / rows
    return [
        (x_left + c * width, top - (r + 1) * height, x_left + (c + 1) * width, top - r * height)
        for r, c in (divmod(index, columns) for index in range(count))
    ]


def _picture_area(canvas: Canvas, cell: Rect) -> Rect:
    x_left, bottom, right, top = cell
    side = min(canvas.px(AXIS_LABELS), 0.15 * (right - x_left))
    foot = min(canvas.px(CELL_FOOT + AXIS_LABELS), 0.45 * (top - bottom))
    head = min(canvas.px(CELL_HEAD), 0.15 * (top - bottom))
    return (x_left + side, bottom + foot, right - side, top - head)


def _points_mm(picture: ScenePicture, placed: Sequence[PlacedBody]) -> Array:
    parts = [picture.grid.nominal_mm.reshape(-1, 3), *(part.vertices_mm for part in placed)]
    if not picture.grid.longest_edge_mm > 0.0:
        parts.append(picture.grid.bounds_mm + 0.5 * picture.size_mm * np.array([[-1.0], [1.0]]))
    return np.concatenate(parts)


def _draw_labels(canvas: Canvas, cell: Rect, letter: str, concept: Concept) -> None:
    x_left, bottom, right, top = cell
    max_width = right - x_left - canvas.px(16.0)
    x, scene, sampled = x_left + canvas.px(8.0), concept.scene, concept.sampled
    head, high = f"{letter}  {scene.title}", top - canvas.px(4.0)
    canvas.text(x, high, head, size=SIZES.heading, weight="bold", va="top", max_width=max_width)
    values = {"mean": sampled.mean_um, "P95": sampled.p95_um, "max": sampled.max_um}
    numbers = [f"{name} {spell_fixed(value)} µm" for name, value in values.items()]
    if sampled.probability is not None:
        conforming = 100.0 * sampled.probability.probability
        numbers.append(f"{conforming:.1f} % within {spell_short(sampled.probability.spec_um)} µm")
    shares = (
        f"{row.key} {100.0 * row.share:.0f} % ({parameter(row.key).name})"
        for row in concept.leading
    )
    lines = (" · ".join(shares), " · ".join(numbers), f"chain {scene.machine.chain}")
    for index, line in enumerate(lines[-1:] if canvas.printed else lines):
        y = bottom + canvas.px(10.0 + 21.0 * index)
        canvas.text(x, y, line, size=SIZES.small, colour=canvas.theme.muted, max_width=max_width)
