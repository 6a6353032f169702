"""The error map: the bent working volume, coloured by its error."""

from collections.abc import Mapping, Sequence

from warpspace.geometry.colour import ColourScale
from warpspace.geometry.surfaces import isoline_levels
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing.map3d import draw_map
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    Row,
    Sheet,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.picture.model import Picture, view_words
from warpspace.picture.words import list_axes, quantity_words, spell_coordinate
from warpspace.scene.model import Scene
from warpspace.units import Array, spell, spell_short

EVERY = "isolines every "


def draw_error_map(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the error map of a scene."""
    picture = evaluate_for(settings, scenes[0])
    scene = picture.scene
    component = settings.component
    what = "Volumetric error map" if component == "norm" else f"Error map, {component} component"
    title = f"{what}: {scene.title}"
    facts = [*scene_facts(picture, picture.exaggeration), view_words(settings.view, picture.shape)]
    legend = map_legend(
        isoline_words(picture.scale, picture.values), diverging=picture.scale.diverging
    )
    sheet = start_sheet("error-map", settings, title, facts, scenes, legend, exact=exact)
    drawn = draw_map(sheet.canvas, picture, sheet.content, settings.view)
    say_statistics(sheet, picture, drawn.projection.px_per_mm)
    return sheet.finish(picture.exaggeration, [drawn])


def say_statistics(
    sheet: Sheet, picture: Picture, px_per_mm: float, *, above: Sequence[Row] = ()
) -> None:
    """Draw colours, statistics and scale bars of a picture beside it."""
    sheet.draw_panel(
        picture.scale,
        quantity_words(picture.component),
        value_marks(picture),
        [*above, *statistics_rows(picture)],
        (px_per_mm, picture.exaggeration),
    )


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
    return f"{EVERY}{spell_short(step)} {scale.unit}"


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
