"""The error map: the bent working volume, coloured by its error."""

from collections.abc import Sequence

from warpspace.geometry.colour import ColourScale, component_values
from warpspace.geometry.faces import MIN_CUT_NODES
from warpspace.geometry.isolines import isoline_levels
from warpspace.geometry.surfaces import Shape
from warpspace.outputs.drawing.content import Drawing, MapContent
from warpspace.outputs.drawing.map3d import draw_map
from warpspace.outputs.drawing.panel import Row, draw_panel
from warpspace.outputs.drawing.settings import FigureSettings, choose_exaggeration, choose_scale
from warpspace.outputs.drawing.sheet import (
    content_rect,
    draw_footer,
    draw_heading,
    map_legend,
    metadata,
    new_canvas,
    panel_rect,
    scene_facts,
)
from warpspace.picture.words import spell, spell_point, spell_short
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import ScenePicture, evaluate_picture
from warpspace.units import Array

VIEW_WORDS = {
    "front": "front view, from the operator",
    "right": "view from the right",
    "top": "view from above",
}


def draw_error_map(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the error map of a scene.

    Parameters
    ----------
    scenes : sequence of Scene, (1,)
    settings : FigureSettings
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing
    """
    picture = evaluate_picture(scenes[0], grid=settings.grid, loop=settings.loop)
    return draw_picture(picture, settings, exact=exact)


def draw_picture(picture: ScenePicture, settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the error map of an evaluated scene."""
    scene = picture.scene
    exaggeration = choose_exaggeration(settings, picture)
    values = component_values(picture.field.error_um, settings.component)
    scale = choose_scale(settings, values)
    title = f"{map_title(settings.component)}: {scene.title}"
    canvas = new_canvas(settings, exact=exact)
    facts = [*scene_facts(picture, exaggeration), view_words(settings.view, picture.grid.shape)]
    top = draw_heading(canvas, title, facts)
    bottom = draw_footer(
        canvas, [scene], map_legend(isoline_words(scale, values), diverging=scale.diverging)
    )
    drawn = draw_map(
        canvas,
        MapContent(picture.grid.nominal_mm, picture.field.error_um, values, scale, exaggeration),
        content_rect(canvas, top, bottom),
        settings.view,
    )
    draw_panel(
        canvas,
        panel_rect(canvas, top, bottom),
        scale,
        quantity_words(settings.component),
        value_marks(picture, values, settings.component),
        statistics_rows(picture, values, settings.component),
        (drawn.projection.px_per_mm, exaggeration),
    )
    facts_of_file = metadata(title, [scene], settings, exaggeration, "error-map")
    return Drawing(canvas.figure, title, facts_of_file, (drawn,), tuple(canvas.rects))


def map_title(component: str) -> str:
    """Name the map of a component."""
    return "Volumetric error map" if component == "norm" else f"Error map, {component} component"


def quantity_words(component: str, unit: str = "µm") -> str:
    """Say what colours mean."""
    return f"|E|  [{unit}]" if component == "norm" else f"{component} component of E  [{unit}]"


def view_words(view: str, shape: Shape) -> str:
    """Say where the volume is looked at from, and what of it is cut away."""
    if view == "iso":
        return "octant towards the viewer cut away" if min(shape) >= MIN_CUT_NODES else "iso view"
    return VIEW_WORDS[view]


def isoline_words(scale: ColourScale, values: Array | None = None) -> str:
    """Say how far apart isolines are; empty where there are none among the values."""
    levels = isoline_levels(scale)
    if values is not None:
        volume = sum(count > 1 for count in values.shape) > 1
        low, high = float(values.min()), float(values.max())
        levels = tuple(level for level in levels if volume and low < level < high)
    if not levels:
        return ""
    step = scale.ticks[1] - scale.ticks[0]
    return f"isolines every {spell_short(step)} {scale.unit}"


def value_marks(picture: ScenePicture, values: Array, component: str) -> list[tuple[str, float]]:
    """Choose the values marked beside the colour bar."""
    if component == "norm":
        found = picture.statistics
        return [("mean", found.mean_um), ("P95", found.p95_um), ("max", found.max_um)]
    return [
        ("min", float(values.min())),
        ("mean", float(values.mean())),
        ("max", float(values.max())),
    ]


def statistics_rows(picture: ScenePicture, values: Array, component: str) -> list[Row]:
    """Spell the statistics, the most important first."""
    found = picture.statistics
    rows: list[Row] = [
        ("max |E|", f"{spell(found.max_um)} µm"),
        ("mean |E|", f"{spell(found.mean_um)} µm"),
        ("P95", f"{spell(found.p95_um)} µm"),
        ("RMS", f"{spell(found.rms_um)} µm"),
        ("max at", f"{spell_point(found.max_at_mm)} mm" if found.max_um > 0.0 else "–"),
    ]
    if component != "norm":
        low, high = spell(float(values.min())), spell(float(values.max()))
        rows.insert(0, (f"{component} component", f"{low} … {high} µm"))
    return rows
