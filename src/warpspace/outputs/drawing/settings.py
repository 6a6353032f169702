"""What a figure is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from warpspace.analysis.concepts import Concepts
from warpspace.exceptions import OptionError
from warpspace.geometry.colour import COMPONENTS, ColourScale
from warpspace.machine.limits import MAX_FIGURE_AREA_PX as LARGEST_AREA
from warpspace.machine.limits import MAX_FIGURE_SIDE_PX as LARGEST_SIDE
from warpspace.machine.limits import MIN_FIGURE_PX as SMALLEST_SIZE
from warpspace.machine.limits import RANGE_TOP
from warpspace.outputs.drawing.style import DARK, LIGHT, Theme
from warpspace.picture.model import (
    VIEWS,
    Exaggeration,
    Picture,
    ScenePicture,
    choose_scale,
    evaluate_picture,
    given_exaggeration,
)
from warpspace.picture.words import range_words
from warpspace.scene.model import Scene


@dataclass(frozen=True, slots=True)
class FigureSettings:
    """Options of a figure."""

    component: str = "norm"  # "norm", "x", "y" or "z"
    # "auto" or None; display factor of displacements; "auto" chooses a round one, None takes the
    # scene's
    exaggeration: Exaggeration = None
    view: str = "iso"  # "iso", "front", "right" or "top"
    # px; width and height; vector formats take 100 px for an inch
    size: tuple[int, int] = (1600, 1200)
    dark: bool = False  # light ink on a dark ground
    loop: str = "tool"  # "tool", "workpiece" or "relative"
    grid: int = 21  # nodes per axis of the working volume
    # µm or µrad; where the colours end (a signed component's begin at its negative); None for a
    # round value that holds all of the map
    range_top: float | None = None
    range_fixed: bool = False  # whether somebody chose that end: the figure then says so
    # what the figure must say beside its scenes, for instance "excluded: EA0Z"
    conditions: tuple[str, ...] = ()
    # how machines are sampled that are set side by side
    concepts: Concepts = field(default_factory=Concepts)
    # whether machines side by side are pictures alone, one below the other, each as high as the
    # others: for a page that has words and colour bar of its own
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
    """Refuse sizes that cannot be drawn."""
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
    """Evaluate the picture that a figure of a scene draws."""
    picture = evaluate_picture(
        scene,
        grid=settings.grid,
        loop=settings.loop,
        exaggeration=settings.exaggeration,
        component=settings.component,
        quantity=quantity,
    )
    scale = shared_colours(settings, [picture])
    conditions = (*picture.conditions, *settings.conditions)
    if settings.range_fixed and settings.range_top is not None:
        conditions = (*conditions, range_words(scale.low, scale.high, scale.unit))
    return replace(picture, colours=scale, conditions=conditions)


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
