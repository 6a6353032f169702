"""Two scenes and their difference: one scale, one exaggeration, one projection."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.analysis.statistics import Statistics
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.content import Drawing, DrawnMap
from warpspace.outputs.drawing.map3d import draw_map, fit_map
from warpspace.outputs.drawing.panel import draw_colour_bar, draw_scale_bars
from warpspace.outputs.drawing.projection import Rect
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for, shared_colours
from warpspace.outputs.drawing.sheet import map_legend, metadata, scene_facts, start_sheet
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import isoline_words
from warpspace.picture.comparison import (
    CHANGE,
    DIFFERENCE_LENGTH,
    STATISTICS,
    scene_change,
    share_exaggeration,
    statistics_change,
)
from warpspace.picture.scene_picture import ScenePicture
from warpspace.picture.views import view_words
from warpspace.picture.words import quantity_words, spell, spell_signed
from warpspace.scene.model import Scene


def draw_comparison(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw two scenes and their difference side by side.

    Parameters
    ----------
    scenes : sequence of Scene, (2,)
    settings : FigureSettings
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing
    """
    pictures = share_exaggeration(
        [evaluate_for(settings, scene) for scene in scenes],
        settings.exaggeration,
        scenes[0].exaggeration,
    )
    contents: list[ScenePicture] = [*pictures, scene_change(pictures[0], pictures[1])]
    scale = shared_colours(settings, contents)
    contents = [replace(content, colours=scale) for content in contents]
    exaggeration = pictures[0].exaggeration
    title = f"Comparison: {scenes[0].title}  –  {scenes[1].title}"
    facts = [
        *scene_facts(pictures[0], exaggeration),
        view_words(settings.view, pictures[0].grid.shape),
    ]
    legend = map_legend(isoline_words(scale, pictures[0].values), diverging=scale.diverging)
    sheet = start_sheet(settings, title, facts, scenes, legend, exact=exact, panel=False)
    canvas = sheet.canvas
    left, bottom, right, top = sheet.content
    middle = ((left + right) / 2.0, (bottom + top) / 2.0)
    head = canvas.px(30.0)
    cells = [
        (left, middle[1], middle[0], top),
        (middle[0], middle[1], right, top),
        (left, bottom, middle[0], middle[1]),
    ]
    rooms = [(c[0], c[1], c[2], c[3] - head) for c in cells]
    shared = fit_map(canvas, contents, rooms[0], settings.view)
    names = [
        f"A  {scenes[0].title}",
        f"B  {scenes[1].title}",
        f"{CHANGE}:  {_change_words(settings.component)}",
    ]
    maps: list[DrawnMap] = []
    for name, content, cell, room in zip(names, contents, cells, rooms, strict=True):
        shift = np.array([room[0] - rooms[0][0], room[1] - rooms[0][1]])
        projection = shared.moved(shift)
        maps.append(draw_map(canvas, content, room, settings.view, projection=projection))
        text, size = canvas.fit(name, cell[2] - cell[0] - 2.0 * head, SIZES.heading, "bold")
        canvas.text(
            cell[0] + head, cell[3] - canvas.px(4.0), text, size=size, weight="bold", va="top"
        )
    found = [content.statistics for content in contents]
    corner = (middle[0] + canvas.px(60.0), bottom, right, middle[1] - canvas.px(6.0))
    _draw_corner(canvas, corner, maps[0], found, settings)
    about = metadata(title, scenes, settings, exaggeration, "comparison")
    return Drawing(canvas.figure, title, about, tuple(maps), tuple(canvas.rects))


def _change_words(component: str) -> str:
    """Say what the map of the change shows."""
    return DIFFERENCE_LENGTH if component == "norm" else f"change of the {component} component"


def _draw_corner(
    canvas: Canvas,
    rect: Rect,
    drawn: DrawnMap,
    found: Sequence[Statistics],
    settings: FigureSettings,
) -> None:
    """Draw the shared colour bar, a table of statistics and the scale bars."""
    left, bottom, right, top = rect
    text, size = canvas.fit(
        f"{quantity_words(settings.component)}, all three maps", right - left, SIZES.heading, "bold"
    )
    canvas.text(left, top, text, size=size, weight="bold", va="top")
    bar = (left + canvas.px(4.0), bottom + canvas.px(20.0), left + canvas.px(34.0))
    draw_colour_bar(canvas, (bar[0], bar[1], bar[2], top - canvas.px(44.0)), drawn.scale)
    start = left + canvas.px(130.0)
    columns = [start + (right - start) * share for share in (0.34, 0.51, 0.71, 0.99)]
    y = top - canvas.px(62.0)
    for x, name in zip(columns, ("A", "B", CHANGE, DIFFERENCE_LENGTH), strict=True):
        canvas.text(x, y, name, weight="bold", ha="right")
    change = statistics_change(found[0], found[1])
    for name, key in STATISTICS.items():
        y -= canvas.px(28.0)
        canvas.text(start, y, f"{name}  [µm]", colour=canvas.theme.muted)
        a, b, difference = (getattr(part, key) for part in found)
        texts = (spell(a), spell(b), spell_signed(change[key]), spell(difference))
        for x, text in zip(columns, texts, strict=True):
            canvas.text(x, y, text, ha="right")
    box = (start, bottom + canvas.px(10.0), right, y)
    draw_scale_bars(canvas, box, drawn.projection.px_per_mm, drawn.exaggeration)
