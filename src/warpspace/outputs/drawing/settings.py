"""What a figure is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from warpspace.exceptions import OptionError
from warpspace.geometry.colour import COMPONENTS, ColourScale
from warpspace.machine.limits import MAX_FIGURE_AREA_PX as LARGEST_AREA
from warpspace.machine.limits import MAX_FIGURE_SIDE_PX as LARGEST_SIDE
from warpspace.machine.limits import MIN_FIGURE_PX as SMALLEST_SIZE
from warpspace.machine.limits import RANGE_TOP
from warpspace.outputs.drawing.style import DARK, LIGHT, Theme
from warpspace.picture.exaggeration import Exaggeration, given_exaggeration
from warpspace.picture.model import Picture, choose_scale
from warpspace.picture.scene_picture import ScenePicture, evaluate_picture
from warpspace.picture.views import VIEWS
from warpspace.picture.words import range_words
from warpspace.scene.concepts import ConceptPlan
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class FigureSettings:
    """Options of a figure.

    Attributes
    ----------
    component : str
        "norm", "x", "y" or "z".
    exaggeration : float, "auto" or None
        Display factor of displacements; "auto" chooses a round one, None takes the scene's.
    view : str
        "iso", "front", "right" or "top".
    size : tuple of int, (2,), px
        Width and height; vector formats take 100 px for an inch.
    dark : bool
        Light ink on a dark ground.
    loop : str
        "tool", "workpiece" or "relative".
    grid : int
        Nodes per axis of the working volume.
    range_top : float or None, µm or µrad
        Where the colours end (a signed component's begin at its negative); None for a round value
        that holds all of the map.
    range_fixed : bool
        Whether somebody chose that end: the figure then says so.
    conditions : tuple of str
        What the figure must say beside its scenes, for instance "excluded: EA0Z".
    concepts : ConceptPlan
        How machines are sampled that are set side by side.
    strip : bool
        Whether machines side by side are pictures alone, one below the other, each as high as the
        others: for a page that has words and colour bar of its own.

    Raises
    ------
    OptionError
        If a value cannot be drawn with.
    """

    component: str = "norm"
    exaggeration: Exaggeration = None
    view: str = "iso"
    size: tuple[int, int] = (1600, 1200)
    dark: bool = False
    loop: str = "tool"
    grid: int = 21
    range_top: float | None = None
    range_fixed: bool = False
    conditions: tuple[str, ...] = ()
    concepts: ConceptPlan = field(default_factory=ConceptPlan)
    strip: bool = False

    def __post_init__(self) -> None:
        """Check the values."""
        if self.component not in COMPONENTS:
            expected = ", ".join(COMPONENTS)
            raise OptionError(f"component {self.component!r}; expected one of {expected}")
        if self.view not in VIEWS:
            raise OptionError(f"view {self.view!r}; expected one of {', '.join(VIEWS)}")
        given_exaggeration(self.exaggeration, None)
        low, high = RANGE_TOP
        if self.range_top is not None and not low <= self.range_top <= high:
            found = f"range_top {self.range_top:g}; expected a number above 0"
            raise OptionError(f"{found}, from {low:g} to {high:,.0f}")
        check_size(self.size)

    @property
    def theme(self) -> Theme:
        """Colours of paper and ink."""
        return DARK if self.dark else LIGHT


def check_size(size: tuple[int, int]) -> None:
    """Refuse sizes that cannot be drawn.

    Raises
    ------
    OptionError
        With the limits.
    """
    width, height = size
    small = width < SMALLEST_SIZE[0] or height < SMALLEST_SIZE[1]
    if small or max(size) > LARGEST_SIDE or width * height > LARGEST_AREA:
        raise OptionError(
            f"size {width}x{height}; expected {SMALLEST_SIZE[0]}x{SMALLEST_SIZE[1]} to"
            f" {LARGEST_SIDE} px a side and {LARGEST_AREA // 1_000_000} million px in all,"
            " for instance 1600x1200"
        )


def evaluate_for(
    settings: FigureSettings, scene: Scene, quantity: str = "position"
) -> ScenePicture:
    """Evaluate the picture that a figure of a scene draws.

    Parameters
    ----------
    settings : FigureSettings
    scene : Scene
    quantity : str, optional
        What is coloured: the "position" or the "orientation" error.

    Returns
    -------
    ScenePicture
    """
    picture = evaluate_picture(
        scene,
        grid=settings.grid,
        loop=settings.loop,
        exaggeration=settings.exaggeration,
        component=settings.component,
        quantity=quantity,
    )
    scale = shared_colours(settings, [picture])
    conditions = (*picture.conditions, *settings.conditions, *range_facts(settings, scale))
    return replace(picture, colours=scale, conditions=conditions)


def range_facts(settings: FigureSettings, scale: ColourScale) -> tuple[str, ...]:
    """Say where somebody has chosen the end of the colours."""
    if not settings.range_fixed or settings.range_top is None:
        return ()
    return (range_words(scale.low, scale.high, scale.unit),)


def shared_colours(settings: FigureSettings, pictures: Sequence[Picture]) -> ColourScale:
    """Choose the colours of pictures that share one bar."""
    return choose_scale(
        [picture.values for picture in pictures],
        settings.component,
        pictures[0].quantity,
        settings.range_top,
    )


def spell_settings(settings: FigureSettings, exaggeration: float, **more: Any) -> str:
    """Spell the settings for metadata, ``key=value`` with commas between."""
    values = {
        "component": settings.component,
        "view": settings.view,
        "loop": settings.loop,
        "grid": settings.grid,
        "exaggeration": f"{exaggeration:.10g}",
        "size": f"{settings.size[0]}x{settings.size[1]}",
        "theme": settings.theme.name,
        **({} if settings.range_top is None else {"range": f"{settings.range_top:.10g}"}),
        **more,
    }
    return ", ".join(f"{key}={value}" for key, value in values.items())
