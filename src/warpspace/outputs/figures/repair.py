"""A repair: the volume before and after the best set of adjustments, and bars of every effect."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpspace.analysis.repair import Repairs
from warpspace.machine.limits import REPAIR_NODES
from warpspace.machine.parameters import parameter
from warpspace.outputs.charts.paper import on_ground, style
from warpspace.outputs.charts.repair import draw_repair_bars, repair_key
from warpspace.outputs.drawing.canvas import DPI, POINTS_PER_PX, Canvas
from warpspace.outputs.drawing.content import Drawing, DrawnMap
from warpspace.outputs.drawing.map3d import draw_map, fit_map
from warpspace.outputs.drawing.panel import draw_colour_bar
from warpspace.outputs.drawing.projection import Rect
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for, shared_colours
from warpspace.outputs.drawing.sheet import map_legend, metadata, scene_facts, start_sheet
from warpspace.outputs.drawing.style import FONT, SIZES
from warpspace.outputs.figures.error_map import isoline_words
from warpspace.picture.comparison import share_exaggeration
from warpspace.picture.scene_picture import ScenePicture
from warpspace.picture.words import quantity_words, spell
from warpspace.scene import repairs as scene_repairs
from warpspace.scene.model import Scene

MAPS_SHARE = 0.5
"""Of the height of the content."""
TEXT_PX = 15.0


def draw_repair(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the volume before and after the best repair, with what each error does to it.

    Parameters
    ----------
    scenes : sequence of Scene, (1,)
    settings : FigureSettings
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing
        Squareness and alignment are adjusted so that the RMS is smallest, up to three of them.
    """
    scene = scenes[0]
    found = scene_repairs.repair(
        scene, loop=settings.loop, grid=min(settings.grid, REPAIR_NODES[1])
    )
    after = scene_repairs.repaired(scene, found.repairs[-1].adjust) if found.repairs else scene
    pictures = share_exaggeration(
        [evaluate_for(settings, one) for one in (scene, after)],
        settings.exaggeration,
        scene.exaggeration,
    )
    scale = shared_colours(settings, pictures)
    before, repaired = (replace(picture, colours=scale) for picture in pictures)
    title = f"Repair: {scene.title}"
    facts = [*scene_facts(before, before.exaggeration), _adjusted(found)]
    legend = map_legend(isoline_words(scale, before.values), diverging=scale.diverging)
    sheet = start_sheet(settings, title, facts, [scene], legend, exact=exact, panel=False)
    canvas = sheet.canvas
    left, bottom, right, top = sheet.content
    split = bottom + (1.0 - MAPS_SHARE) * (top - bottom)
    maps = _draw_maps(canvas, (left, split, right, top), (before, repaired), settings)
    with on_ground(settings.theme), style():
        _draw_bars(canvas, (left, bottom, right, split), found)
    about = metadata(title, [scene], settings, before.exaggeration, "repair")
    return Drawing(canvas.figure, title, about, maps, tuple(canvas.rects))


def _adjusted(found: Repairs) -> str:
    """Say what the picture after the repair is."""
    if not found.repairs:
        return "nothing to adjust"
    parts = ", ".join(
        f"{key} {found.present[key]:.3g} → {value:.3g} {parameter(key).unit}"
        for key, value in found.repairs[-1].adjust.items()
    )
    return f"adjusted for the smallest {found.plan.objective.upper()}: {parts}"


def _draw_maps(
    canvas: Canvas, rect: Rect, pictures: Sequence[ScenePicture], settings: FigureSettings
) -> tuple[DrawnMap, ...]:
    """Draw both volumes side by side, and the colours they share."""
    left, bottom, right, top = rect
    bar = canvas.px(200.0)
    half = (right - left - bar) / 2.0
    head = canvas.px(30.0)
    cells = [(left + half * i, bottom, left + half * (i + 1), top - head) for i in range(2)]
    shared = fit_map(canvas, pictures, cells[0], settings.view)
    maps: list[DrawnMap] = []
    for name, picture, cell in zip(("Before", "After"), pictures, cells, strict=True):
        shift = np.array([cell[0] - cells[0][0], cell[1] - cells[0][1]])
        maps.append(draw_map(canvas, picture, cell, settings.view, projection=shared.moved(shift)))
        numbers = picture.statistics
        words = (
            f"{name}: mean {spell(numbers.mean_um)} · RMS {spell(numbers.rms_um)} ·"
            f" max {spell(numbers.max_um)} µm"
        )
        text, size = canvas.fit(words, half - 1.5 * head, SIZES.heading, "bold")
        canvas.text(cell[0] + head, top - canvas.px(4.0), text, size=size, weight="bold", va="top")
    start = right - bar + canvas.px(50.0)
    text, size = canvas.fit(quantity_words(settings.component), bar - canvas.px(50.0), SIZES.text)
    canvas.text(start, top - canvas.px(4.0), text, size=size, va="top")
    box = (start, bottom + canvas.px(40.0), start + canvas.px(30.0), top - canvas.px(60.0))
    draw_colour_bar(canvas, box, maps[0].scale)
    return tuple(maps)


def _draw_bars(canvas: Canvas, rect: Rect, found: Repairs) -> None:
    """Draw the bars below the maps."""
    left, bottom, right, top = rect
    figure = canvas.figure
    labels, gap = canvas.px(400.0), canvas.px(24.0)
    low, high = bottom + canvas.px(46.0), top - canvas.px(64.0)
    width = (right - left - labels - 2.0 * gap) / 3.0
    size = canvas.px(TEXT_PX) * POINTS_PER_PX
    axes = [
        figure.add_axes(
            (
                (left + labels + i * (width + gap)) / canvas.width,
                low / canvas.height,
                width / canvas.width,
                max(high - low, DPI) / canvas.height,
            )
        )
        for i in range(3)
    ]
    draw_repair_bars(axes, found, size)
    for panel in axes[1:]:
        panel.set_ylim(axes[0].get_ylim())
        panel.set_yticks([])
    figure.legend(
        handles=repair_key(),
        loc="upper left",
        bbox_to_anchor=((left + canvas.px(20.0)) / canvas.width, top / canvas.height),
        ncols=4,
        frameon=False,
        prop={"family": [FONT], "size": size},
    )
