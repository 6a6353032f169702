"""The error map: the bent working volume, coloured by its error."""

from collections.abc import Mapping, Sequence

from warpspace.geometry.colour import ColourScale
from warpspace.geometry.isolines import isoline_levels
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.map3d import draw_map
from warpspace.outputs.drawing.panel import Row, draw_panel
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for
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
from warpspace.picture.coordinates import list_axes, spell_coordinate
from warpspace.picture.model import Picture
from warpspace.picture.views import view_words
from warpspace.picture.words import quantity_words, spell, spell_short
from warpspace.scene.model import Scene
from warpspace.units import Array


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
    picture = evaluate_for(settings, scenes[0])
    scene = picture.scene
    title = f"{map_title(settings.component)}: {scene.title}"
    canvas = new_canvas(settings, exact=exact)
    facts = [*scene_facts(picture, picture.exaggeration), view_words(settings.view, picture.shape)]
    top = draw_heading(canvas, title, facts)
    isolines = isoline_words(picture.scale, picture.values)
    bottom = draw_footer(canvas, [scene], map_legend(isolines, diverging=picture.scale.diverging))
    drawn = draw_map(canvas, picture, content_rect(canvas, top, bottom), settings.view)
    draw_panel(
        canvas,
        panel_rect(canvas, top, bottom),
        picture.scale,
        quantity_words(settings.component),
        value_marks(picture),
        statistics_rows(picture),
        (drawn.projection.px_per_mm, picture.exaggeration),
    )
    facts_of_file = metadata(title, [scene], settings, picture.exaggeration, "error-map")
    return Drawing(canvas.figure, title, facts_of_file, (drawn,), tuple(canvas.rects))


def map_title(component: str) -> str:
    """Name the map of a component."""
    return "Volumetric error map" if component == "norm" else f"Error map, {component} component"


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


def value_marks(picture: Picture) -> list[tuple[str, float]]:
    """Choose the values marked beside the colour bar."""
    values = picture.values
    if picture.component == "norm":
        found = picture.statistics
        return [("mean", found.mean_um), ("P95", found.p95_um), ("max", found.max_um)]
    return [
        ("min", float(values.min())),
        ("mean", float(values.mean())),
        ("max", float(values.max())),
    ]


def place_rows(at: Mapping[str, float], point_mm: Sequence[float]) -> list[Row]:
    """Spell a point in both ways, one row each: axis positions, and a point of R."""
    linear = {name: value for name, value in at.items() if is_linear(name)}
    point = " ".join(
        f"{name} {spell_coordinate(value)}" for name, value in zip("xyz", point_mm, strict=True)
    )
    axes: list[Row] = [("max, axes", list_axes(linear))] if linear else []
    return [*axes, ("max, in R", point)]


def statistics_rows(picture: Picture) -> list[Row]:
    """Spell the statistics, the most important first."""
    found = picture.statistics
    rows: list[Row] = [
        ("max |E|", f"{spell(found.max_um)} µm"),
        ("mean |E|", f"{spell(found.mean_um)} µm"),
        ("P95", f"{spell(found.p95_um)} µm"),
        ("RMS", f"{spell(found.rms_um)} µm"),
        *(place_rows(found.max_at_axes, found.max_at_mm) if found.max_um > 0.0 else ()),
    ]
    if picture.component != "norm":
        values = picture.values
        low, high = spell(float(values.min())), spell(float(values.max()))
        rows.insert(0, (f"{picture.component} component", f"{low} … {high} µm"))
    return rows
