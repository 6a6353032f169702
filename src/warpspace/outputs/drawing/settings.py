"""What a figure is asked for."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.geometry.colour import COMPONENTS, ColourScale, build_scale
from warpspace.geometry.deform import MAX_EXAGGERATION, auto_exaggeration
from warpspace.outputs.drawing.projection import VIEWS
from warpspace.outputs.drawing.style import DARK, LIGHT, Theme
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import ScenePicture
from warpspace.units import MICROMETRE, Array

SMALLEST_SIZE = (400, 300)
LARGEST_SIDE = 12_000
LARGEST_AREA = 64_000_000

B_MINUS_A, A_MINUS_B = "B − A", "A − B"


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
    difference : str
        Which way two scenes A and B are subtracted: `B_MINUS_A` or `A_MINUS_B`.
    range_top : float or None, µm or µrad
        Where the colours end (a signed component's begin at its negative); None for a round value
        that holds all of the map.

    Raises
    ------
    OptionError
        If a value cannot be drawn with.
    """

    component: str = "norm"
    exaggeration: float | Literal["auto"] | None = None
    view: str = "iso"
    size: tuple[int, int] = (1600, 1200)
    dark: bool = False
    loop: str = "tool"
    grid: int = 21
    difference: str = B_MINUS_A
    range_top: float | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if self.component not in COMPONENTS:
            expected = ", ".join(COMPONENTS)
            raise OptionError(f"component {self.component!r}; expected one of {expected}")
        if self.view not in VIEWS:
            raise OptionError(f"view {self.view!r}; expected one of {', '.join(VIEWS)}")
        given = self.exaggeration
        if given is not None and given != "auto" and not 0.0 < given <= MAX_EXAGGERATION:
            raise OptionError(
                f"exaggeration {given:g}; expected a number above 0, at most"
                f" {MAX_EXAGGERATION:g}, or auto"
            )
        if self.difference not in (B_MINUS_A, A_MINUS_B):
            raise OptionError(f"difference {self.difference!r}; expected B − A or A − B")
        if self.range_top is not None and not 0.0 < self.range_top < math.inf:
            raise OptionError(f"range_top {self.range_top:g}; expected a number above 0")
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


def given_exaggeration(settings: FigureSettings, scene: Scene) -> float | None:
    """Give the display factor asked for, else the scene's; None where one is to be chosen."""
    if settings.exaggeration == "auto":
        return None
    return scene.exaggeration if settings.exaggeration is None else settings.exaggeration


def choose_exaggeration(settings: FigureSettings, *pictures: ScenePicture) -> float:
    """Choose the display factor that pictures share.

    Parameters
    ----------
    settings : FigureSettings
    *pictures : ScenePicture

    Returns
    -------
    float
        The one asked for, else the first scene's, else a round one for the largest displacement.
    """
    given = given_exaggeration(settings, pictures[0].scene)
    if given is not None:
        return given
    largest = max(picture.statistics.max_um for picture in pictures)
    return auto_exaggeration(largest, max(picture.grid.longest_edge_mm for picture in pictures))


def choose_scale(
    settings: FigureSettings, *values: Array, quantity: str = "E", unit: str = MICROMETRE
) -> ColourScale:
    """Choose the colours of maps that share one bar.

    Parameters
    ----------
    settings : FigureSettings
    *values : ndarray, µm or µrad
        What each map colours.
    quantity, unit : str, optional
        Symbol and unit of what is coloured.

    Returns
    -------
    ColourScale
    """
    largest = max(float(np.abs(part).max()) for part in values)
    return build_scale(
        largest, settings.component, quantity=quantity, unit=unit, end=settings.range_top
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
