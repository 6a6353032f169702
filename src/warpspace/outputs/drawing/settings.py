"""Options of a figure, and the common style: colours of paper and ink, sizes of text.

Colours of errors come from `warpspace.geometry.colour`; the colours here are muted.
Sizes are pixels of a 1600 × 1200 figure; a figure of another size multiplies them by its factor.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from warpspace.exceptions import OptionError
from warpspace.geometry.colour import COMPONENTS
from warpspace.kinematics.model import Loop
from warpspace.machine import limits
from warpspace.picture import model
from warpspace.picture.formatting import range_words
from warpspace.scene.model import Scene, common_loop

if TYPE_CHECKING:
    from warpspace.analysis.commands.concepts import Concepts

REFERENCE_SIZE: Final = (1600, 1200)
FONT: Final = "DejaVu Sans"
FIGURE_ENDINGS: Final = (".png", ".svg", ".pdf")
SMALLEST_FACTOR: Final = 0.5
"""Text never gets smaller than this share of its size in a 1600 × 1200 figure."""
PRINT: Final = 1.3
"""Factor on sizes, so that text is legible in a figure printed 17 cm wide."""
PRINTED_PX: Final = 685  # width of a figure in a report: 174 mm
PRINTED_FACTOR: Final = 0.7  # factor on text and lines there: small text has 7 pt


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of a figure."""

    name: str
    paper: str  # background, main text, secondary text, hair lines
    ink: str
    muted: str
    faint: str
    accent: str  # displacements: arrows, their labels and the error scale bar
    ghost: str  # the nominal volume
    grid: str  # lines on the coloured surface
    isoline: str
    band: str  # tolerance bands
    series: Sequence[str]  # curves and bars
    body: str  # machine bodies


_THEMES = tomllib.loads((files("warpspace.outputs.drawing") / "themes.toml").read_text("utf-8"))
LIGHT, DARK = (Theme(name, **_THEMES[name]) for name in ("light", "dark"))


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of text and lines, px of a 1600 × 1200 figure."""

    title: float = 28.0
    subtitle: float = 17.0
    heading: float = 18.0
    text: float = 16.0
    small: float = 14.0
    margin: float = 52.0
    panel: float = 258.0
    hair: float = 0.9
    thin: float = 1.2
    line: float = 1.9
    bold: float = 2.6


SIZES: Final = Sizes()

SAVE_RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": [FONT],
    "svg.hashsalt": "warpspace",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "path.simplify": False,
    "agg.path.chunksize": 0,
}
"""Settings of matplotlib for drawing and saving figures reproducibly, byte by byte."""


def factor(width: int, height: int) -> float:
    """Choose the factor on text and lines for a figure of another size."""
    ratio = min(width / REFERENCE_SIZE[0], height / REFERENCE_SIZE[1])
    return PRINT * ratio if ratio >= 1.0 else max(PRINT * ratio**0.85, SMALLEST_FACTOR)


@dataclass(frozen=True, slots=True)
class FigureSettings:
    """Options of a figure."""

    component: str = "norm"  # "norm", "x", "y" or "z"
    # "auto" or None; display factor of displacements; "auto" chooses a round one, None takes the
    # scene's
    exaggeration: model.Exaggeration = None
    view: str = "iso"  # "iso", "front", "right" or "top"
    # px; width and height; vector formats take 100 px for an inch
    size: tuple[int, int] = (1600, 1200)
    dark: bool = False  # light ink on a dark ground
    loop: str | None = None  # "tool", "workpiece" or "relative"; None for that of the scene
    grid: int = 21  # nodes per axis of the working volume
    # µm or µrad; end of the colour range (of a signed component also its negative start); None for
    # a round value above the whole map
    range_top: float | None = None
    range_fixed: bool = False  # that end was set by the user; stated in the figure
    # restrictions to state in the figure, for instance "excluded: EA0Z"
    conditions: tuple[str, ...] = ()
    caption: str = ""  # lines of text below the drawing
    concepts: "Concepts | None" = None  # sampling of machines that are compared side by side
    prepared: Any = None  # what the figure would compute first: placed bodies, or adjustments
    # for a report, which has heading, footer and statistics itself: the figure omits them and has
    # its printed size
    printed: bool = False

    def __post_init__(self) -> None:
        if self.component not in COMPONENTS:
            expected = ", ".join(COMPONENTS)
            raise OptionError(f"component {self.component!r}; expected one of {expected}")
        if self.view not in model.VIEWS:
            raise OptionError(f"view {self.view!r}; expected one of {', '.join(model.VIEWS)}")
        model.fixed_exaggeration(self.exaggeration, None)
        low, high = limits.RANGE_TOP
        if self.range_top is not None and not low <= self.range_top <= high:
            problem = f"range_top {self.range_top:g}; expected a number above 0"
            raise OptionError(f"{problem}, from {low:g} to {high:,.0f}")
        check_size(self.size)

    @property
    def theme(self) -> Theme:
        return DARK if self.dark else LIGHT

    @property
    def chosen_loop(self) -> Loop | None:
        return Loop(self.loop) if self.loop else None

    def for_scenes(self, scenes: Sequence[Scene]) -> "FigureSettings":
        """Return the settings with the loop in which all scenes are drawn."""
        return replace(self, loop=common_loop(scenes, self.loop))


Step = tuple[str, str, Sequence[Scene], FigureSettings]
"""A step of a story: its text, and name, scenes and settings of its figure."""


def check_size(size: tuple[int, int]) -> None:
    width, height = size
    least, most = limits.MIN_FIGURE_PX, limits.MAX_FIGURE_SIDE_PX
    area = limits.MAX_FIGURE_AREA_PX
    small = width < least[0] or height < least[1]
    if small or max(size) > most or width * height > area:
        raise OptionError(
            f"size {width}x{height}; expected {least[0]}x{least[1]} to {most} px a side and"
            f" {area // 1_000_000} million px in all, for instance 1600x1200"
        )


def evaluate_for(
    settings: FigureSettings, scene: Scene, quantity: str = "position"
) -> model.ScenePicture:
    picture = model.evaluate_picture(
        scene,
        grid=settings.grid,
        loop=settings.loop,
        exaggeration=settings.exaggeration,
        component=settings.component,
        quantity=quantity,
    )
    (picture,) = share_colours(settings, [picture])
    conditions, scale = [*picture.conditions, *settings.conditions], picture.scale
    if settings.range_fixed and settings.range_top is not None:
        conditions.append(range_words(scale.low, scale.high, scale.unit))
    return replace(picture, conditions=tuple(conditions))


def share_colours(
    settings: FigureSettings, pictures: Sequence[model.ScenePicture]
) -> list[model.ScenePicture]:
    """Apply one colour scale to pictures."""
    values, quantity = [picture.values for picture in pictures], pictures[0].quantity
    scale = model.choose_scale(values, settings.component, quantity, settings.range_top)
    return [replace(picture, colours=scale) for picture in pictures]
