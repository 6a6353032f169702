"""Machines side by side within the same tolerances: one scale of length, one of colours."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.concepts import LETTERS, Concept, compare_concepts
from warpspace.bodies.placed import PlacedBody
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.map3d import draw_map
from warpspace.outputs.drawing.render import Projection, Rect, fit_projection
from warpspace.outputs.drawing.settings import FigureSettings, shared_colours
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    LegendEntry,
    isoline_symbol,
    line_entry,
    metadata,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import isoline_words
from warpspace.outputs.figures.machine import bodies_of, draw_bodies
from warpspace.picture.model import ConceptPicture, picture_concept, view_words
from warpspace.picture.words import LOOP_WORDS, tolerance_words
from warpspace.scene.model import Scene
from warpspace.units import Array, spell, spell_count, spell_short

BODY_ALPHA = 0.55
CELL_HEAD, CELL_FOOT, AXIS_LABELS = 30.0, 74.0, 50.0
"""Room in px above a picture for its title, below it for its numbers, and for labels of axes."""
STRIP_MARGIN = 0.05
"""Room around a picture that stands alone, by the shorter side of its cell."""


@dataclass(frozen=True, slots=True)
class _Machine:
    """A machine to be drawn: its volume, its bodies."""

    picture: ConceptPicture
    placed: tuple[PlacedBody, ...]


def draw_concepts(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw machines within the same tolerances side by side."""
    if settings.strip:
        return _draw_strip(scenes, settings, exact=exact)
    plan = replace(settings.concepts, loop=Loop(settings.loop))
    concepts = compare_concepts(scenes, plan)
    machines, scale = _machines(concepts, settings)
    title = f"Concepts within {'their own' if plan.own_tolerances else 'the same'} tolerances"
    first = concepts[0]
    facts = [
        *([] if plan.own_tolerances else [tolerance_words(first.scene.tolerances)]),
        f"{spell_count(plan.samples)} sampled machines each, {plan.drawn}",
        "largest |E| of each" if plan.over == "max" else "|E| at a random point of each",
        LOOP_WORDS[first.sampled.view.loop],
        view_words(settings.view, (2, 2, 2)),
    ]
    legend = [line_entry("working volume, RMS of |E|", lambda theme: theme.ink)]
    if isolines := isoline_words(scale):
        legend.append(LegendEntry(isoline_symbol, isolines))
    drawn = [concept.scene for concept in concepts]
    sheet = start_sheet(
        "concepts", settings, title, facts, drawn, legend, exact=exact, errors=False
    )
    canvas = sheet.canvas
    cells = _cells(sheet.content, len(machines))
    rooms = [_room(canvas, cell) for cell in cells]
    maps, factor = _draw_machines(canvas, machines, rooms, settings)
    for letter, cell, concept in zip(LETTERS, cells, concepts, strict=False):
        _draw_words(canvas, cell, letter, concept)
    sheet.draw_panel(
        scale, "RMS |E|  [µm]", [],
        [(f"mean {letter}", f"{spell(one.sampled.mean_um)} µm")
         for letter, one in zip(LETTERS, concepts, strict=False)],
        (factor, None),
    )  # fmt: skip
    return sheet.finish(1.0, maps)


def _draw_strip(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    plan = replace(settings.concepts, samples=1, loop=Loop(settings.loop))
    machines, _ = _machines(compare_concepts(scenes, plan), settings)
    canvas = Canvas(*settings.size, settings.theme, exact=exact)
    width, height = float(canvas.width), canvas.height / len(machines)
    margin = STRIP_MARGIN * min(width, height)
    rooms = [
        (margin, top - height + margin, width - margin, top - margin)
        for top in (canvas.height - height * index for index in range(len(machines)))
    ]
    maps, _ = _draw_machines(canvas, machines, rooms, settings)
    title = "Concepts"
    about = metadata(title, scenes, settings, 1.0, "concepts")
    return Drawing(canvas.figure, title, about, maps, tuple(canvas.rects))


def _machines(
    concepts: Sequence[Concept], settings: FigureSettings
) -> tuple[list[_Machine], ColourScale]:
    pictures = [picture_concept(concept, settings.grid) for concept in concepts]
    scale = shared_colours(replace(settings, component="norm"), pictures)
    pictures = [replace(picture, colours=scale) for picture in pictures]
    return [_Machine(picture, bodies_of(picture, 1.0)) for picture in pictures], scale


def _draw_machines(
    canvas: Canvas,
    machines: Sequence[_Machine],
    rooms: Sequence[Rect],
    settings: FigureSettings,
) -> tuple[tuple[DrawnMap, ...], float]:
    """Draw machines into their rooms in one scale; give the maps and the px of a mm."""
    seen = [_points_mm(machine.picture, machine.placed) for machine in machines]
    factor = min(
        fit_projection(settings.view, points, room).px_per_mm
        for points, room in zip(seen, rooms, strict=True)
    )
    maps: list[DrawnMap] = []
    for machine, points, room in zip(machines, seen, rooms, strict=True):
        projection = _centred(points, room, settings.view, factor)
        draw_bodies(
            canvas, machine.placed, projection, opacity=BODY_ALPHA, nominal=False, zorder=0.8
        )
        maps.append(
            draw_map(
                canvas, machine.picture, room, settings.view, labels=False,
                projection=projection, annotate=None, ghost=False, axes=not settings.strip,
            )
        )  # fmt: skip
    return tuple(maps), factor


def _cells(rect: Rect, count: int) -> list[Rect]:
    left, bottom, right, top = rect
    columns = min(count, max(1, round(math.sqrt(count * (right - left) / (top - bottom)))))
    rows = math.ceil(count / columns)
    width, height = (right - left) / columns, (top - bottom) / rows
    return [
        (left + c * width, top - (r + 1) * height, left + (c + 1) * width, top - r * height)
        for r, c in (divmod(index, columns) for index in range(count))
    ]


def _room(canvas: Canvas, cell: Rect) -> Rect:
    left, bottom, right, top = cell
    side = min(canvas.px(AXIS_LABELS), 0.15 * (right - left))
    foot = min(canvas.px(CELL_FOOT + AXIS_LABELS), 0.45 * (top - bottom))
    head = min(canvas.px(CELL_HEAD), 0.15 * (top - bottom))
    return (left + side, bottom + foot, right - side, top - head)


def _points_mm(picture: ConceptPicture, placed: Sequence[PlacedBody]) -> Array:
    parts = [picture.grid.nominal_mm.reshape(-1, 3), *(part.vertices_mm for part in placed)]
    if not picture.grid.longest_edge_mm > 0.0:
        parts.append(picture.grid.bounds_mm + 0.5 * picture.size_mm * np.array([[-1.0], [1.0]]))
    return np.concatenate(parts)


def _centred(points: Array, room: Rect, view: str, px_per_mm: float) -> Projection:
    fitted = fit_projection(view, points, room)
    scaled = replace(fitted, px_per_mm=px_per_mm)
    spots = scaled.project(points)
    middle = (spots.min(axis=0) + spots.max(axis=0)) / 2.0
    wanted = np.array([(room[0] + room[2]) / 2.0, (room[1] + room[3]) / 2.0])
    return scaled.moved(wanted - middle)


def _draw_words(canvas: Canvas, cell: Rect, letter: str, concept: Concept) -> None:
    left, bottom, right, top = cell
    room = right - left - canvas.px(16.0)
    x, scene, found = left + canvas.px(8.0), concept.scene, concept.sampled
    head, size = canvas.fit(f"{letter}  {scene.title}", room, SIZES.heading, "bold")
    canvas.text(x, top - canvas.px(4.0), head, size=size, weight="bold", va="top")
    numbers = [
        f"mean {spell(found.mean_um)} µm",
        f"P95 {spell(found.p95_um)} µm",
        f"max {spell(found.max_um)} µm",
    ]
    if found.probability is not None:
        kept = 100.0 * found.probability.probability
        numbers.append(f"{kept:.1f} % within {spell_short(found.probability.spec_um)} µm")
    lines = (
        f"chain {scene.machine.chain}",
        " · ".join(numbers),
        " · ".join(
            f"{row.key} {100.0 * row.share:.0f} % ({parameter(row.key).name})"
            for row in concept.leading
        ),
    )
    for index, line in enumerate(reversed(lines)):
        text, size = canvas.fit(line, room, SIZES.small)
        y = bottom + canvas.px(10.0 + 21.0 * index)
        canvas.text(x, y, text, size=size, colour=canvas.theme.muted)
