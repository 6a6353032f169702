"""Two scenes and their change: one exaggeration, one projection; the change in its own colours."""

from collections.abc import Sequence
from dataclasses import replace

from warpspace.analysis.statistics import Statistics
from warpspace.geometry.colour import ColourScale
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.map3d import draw_maps_alike
from warpspace.outputs.drawing.render import Rect
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for, shared_colours
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    draw_colour_bar,
    draw_scale_bars,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import EVERY, isoline_words
from warpspace.picture.comparison import (
    CHANGE,
    DIFFERENCE_LENGTH,
    STATISTICS,
    scene_change,
    share_exaggeration,
    statistics_change,
)
from warpspace.picture.model import ScenePicture, view_words
from warpspace.scene.model import Scene
from warpspace.units import spell, spell_signed


def draw_comparison(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw two scenes and their difference side by side."""
    pictures = share_exaggeration(
        [evaluate_for(settings, scene) for scene in scenes],
        settings.exaggeration,
        scenes[0].exaggeration,
    )
    scale = shared_colours(settings, pictures)
    change = scene_change(pictures[0], pictures[1])
    if settings.range_fixed:
        change = replace(change, colours=replace(change.scale, low=scale.low, high=scale.high))
    contents: list[ScenePicture] = [*(replace(one, colours=scale) for one in pictures), change]
    exaggeration = pictures[0].exaggeration
    title = f"Comparison: A {scenes[0].title}, B {scenes[1].title}"
    facts = [
        *scene_facts(pictures[0], exaggeration),
        view_words(settings.view, pictures[0].grid.shape),
    ]
    words = [isoline_words(one.scale, one.values) for one in (contents[0], change)]
    if all(words) and words[0] != words[1]:
        words = [f"{words[0]}, of {CHANGE} {words[1].removeprefix(EVERY)}"]
    legend = map_legend(next(filter(None, words), ""), diverging=scale.diverging)
    sheet = start_sheet(
        "comparison", settings, title, facts, scenes, legend, exact=exact, panel=False
    )
    canvas = sheet.canvas
    left, bottom, right, top = sheet.content
    middle = ((left + right) / 2.0, (bottom + top) / 2.0)
    cells = [
        (left, middle[1], middle[0], top),
        (middle[0], middle[1], right, top),
        (left, bottom, middle[0], middle[1]),
    ]
    component = settings.component
    changed = DIFFERENCE_LENGTH if component == "norm" else f"change of the {component} component"
    names = [f"A  {scenes[0].title}", f"B  {scenes[1].title}", f"{CHANGE}:  {changed}"]
    maps = draw_maps_alike(canvas, contents, names, cells, settings.view)
    found = [content.statistics for content in contents]
    corner = (middle[0] + canvas.px(24.0), bottom, right, middle[1] - canvas.px(6.0))
    _draw_corner(canvas, corner, maps[0], change.scale, found)
    return sheet.finish(exaggeration, maps)


def _draw_corner(
    canvas: Canvas,
    rect: Rect,
    drawn: DrawnMap,
    change_scale: ColourScale,
    found: Sequence[Statistics],
) -> None:
    left, bottom, right, top = rect
    bar, step = canvas.px(28.0), canvas.px(112.0)
    for name, scale in (("A and B", drawn.scale), (CHANGE, change_scale)):
        text, size = canvas.fit(name, 0.9 * step, SIZES.heading, "bold")
        canvas.text(left, top, text, size=size, weight="bold", va="top")
        text, size = canvas.fit(f"{scale.label}  [{scale.unit}]", 0.9 * step, SIZES.small)
        canvas.text(left, top - canvas.px(26.0), text, size=size, va="top")
        box = (left, bottom + canvas.px(20.0), left + bar, top - canvas.px(62.0))
        draw_colour_bar(canvas, box, scale)
        left += step
    start = left + canvas.px(6.0)
    columns = [start + (right - start) * share for share in (0.29, 0.45, 0.63, 0.99)]
    y = top - canvas.px(62.0)
    canvas.text(start, y, "µm", colour=canvas.theme.muted)
    for x, name in zip(columns, ("A", "B", CHANGE, DIFFERENCE_LENGTH), strict=True):
        canvas.text(x, y, name, weight="bold", ha="right")
    change = statistics_change(found[0], found[1])
    for name, key in STATISTICS.items():
        y -= canvas.px(28.0)
        canvas.text(start, y, name, colour=canvas.theme.muted)
        a, b, difference = (getattr(part, key) for part in found)
        texts = (spell(a), spell(b), spell_signed(change[key]), spell(difference))
        for x, text in zip(columns, texts, strict=True):
            canvas.text(x, y, text, ha="right")
    box = (start, bottom + canvas.px(10.0), right, y)
    draw_scale_bars(canvas, box, drawn.projection.px_per_mm, drawn.exaggeration)
