"""A repair: the volume before and after the best set of adjustments, and bars of every effect."""

from collections.abc import Sequence
from dataclasses import replace

from warpspace.analysis.repair import Repair, RepairResult
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import REPAIR_NODES
from warpspace.outputs.charts.blocks import draw_beside, legend_handles
from warpspace.outputs.charts.paper import on_ground, style
from warpspace.outputs.drawing.canvas import POINTS_PER_PX, Canvas
from warpspace.outputs.drawing.map3d import draw_maps_alike
from warpspace.outputs.drawing.render import Rect
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for, shared_colours
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    draw_colour_bar,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import FONT, SIZES
from warpspace.outputs.figures.error_map import isoline_words
from warpspace.picture.comparison import share_exaggeration
from warpspace.picture.model import ScenePicture
from warpspace.picture.words import quantity_words
from warpspace.scene.model import Scene
from warpspace.units import spell

MAPS_SHARE = 0.5
"""Of the height of the content."""
TEXT_PX = 12.0


def draw_repair(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the volume before and after the best repair, with what each error does to it."""
    scene = scenes[0]
    found = Repair(loop=Loop(settings.loop), grid=min(settings.grid, REPAIR_NODES[1])).run(scene)
    after = found.changes()[-1].scene if found.repairs else scene
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
    sheet = start_sheet("repair", settings, title, facts, [scene], legend, exact=exact, panel=False)
    canvas = sheet.canvas
    left, bottom, right, top = sheet.content
    split = bottom + (1.0 - MAPS_SHARE) * (top - bottom)
    maps = _draw_maps(canvas, (left, split, right, top), (before, repaired), settings)
    with on_ground(settings.theme), style():
        size, legend = canvas.px(TEXT_PX) * POINTS_PER_PX, canvas.px(30.0)
        width, height = canvas.width, canvas.height
        box = (left / width, bottom / height, (right - left) / width)
        bars = found.bars()
        draw_beside(canvas.figure, bars, (*box, (split - legend - bottom) / height), size)
        canvas.figure.legend(
            handles=legend_handles(bars), loc="upper left", ncols=4, frameon=False,
            bbox_to_anchor=(left / width, split / height), prop={"family": [FONT], "size": size},
        )  # fmt: skip
    return sheet.finish(before.exaggeration, maps)


def _adjusted(found: RepairResult) -> str:
    if not found.repairs:
        return "nothing to adjust"
    parts = ", ".join(
        f"{key} {found.present[key]:.3g} → {value:.3g} {parameter(key).unit}"
        for key, value in found.repairs[-1].adjust.items()
    )
    return f"adjusted for the smallest {found.objective.upper()}: {parts}"


def _draw_maps(
    canvas: Canvas, rect: Rect, pictures: Sequence[ScenePicture], settings: FigureSettings
) -> tuple[DrawnMap, ...]:
    left, bottom, right, top = rect
    bar = canvas.px(200.0)
    half = (right - left - bar) / 2.0
    cells = [(left + half * i, bottom, left + half * (i + 1), top) for i in range(2)]
    names = [
        f"{name}: mean {spell(found.mean_um)} · RMS {spell(found.rms_um)} ·"
        f" max {spell(found.max_um)} µm"
        for name, found in zip(
            ("Before", "After"), (picture.statistics for picture in pictures), strict=True
        )
    ]
    maps = draw_maps_alike(canvas, pictures, names, cells, settings.view)
    start = right - bar + canvas.px(50.0)
    text, size = canvas.fit(quantity_words(settings.component), bar - canvas.px(50.0), SIZES.text)
    canvas.text(start, top - canvas.px(4.0), text, size=size, va="top")
    box = (start, bottom + canvas.px(40.0), start + canvas.px(30.0), top - canvas.px(60.0))
    draw_colour_bar(canvas, box, maps[0].scale)
    return maps
