"""The one look of all figures: colours of the paper and the ink, sizes of text and lines.

Colour on a body means error and comes from `warpspace.geometry.colour`; everything here is quiet.
Sizes are pixels of a 1600 × 1200 figure; a figure of another size multiplies them by its factor.
"""

from dataclasses import dataclass
from typing import Any, Final

REFERENCE_SIZE: Final = (1600, 1200)
FONT: Final = "DejaVu Sans"
FIGURE_ENDINGS: Final = (".png", ".svg", ".pdf")
SMALLEST_FACTOR: Final = 0.5
"""Text never gets smaller than this share of its size in a 1600 × 1200 figure."""
PRINT: Final = 1.3
"""What sizes are multiplied by, so that text can be read where a figure is printed 17 cm wide."""


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
    series: tuple[str, ...]  # curves and bars
    body: str  # machine bodies


LIGHT = Theme(
    name="light",
    paper="#ffffff",
    ink="#17202b",
    muted="#55637a",
    faint="#d5dae1",
    accent="#c8283c",
    ghost="#8b95a5",
    grid="#0f1722",
    isoline="#ffffff",
    band="#dfe6ee",
    series=("#1f6fb2", "#c8283c", "#2f8f5b", "#8a5fb0", "#c77f1a", "#4c5b6b"),
    body="#b9bdc4",
)
DARK = Theme(
    name="dark",
    paper="#12161c",
    ink="#eef1f5",
    muted="#a3afbf",
    faint="#38424f",
    accent="#ff6b78",
    ghost="#98a4b5",
    grid="#0b0f15",
    isoline="#ffffff",
    band="#263140",
    series=("#62b0ee", "#ff6b78", "#63c590", "#bb95dd", "#e8ab55", "#a9b5c3"),
    body="#848b95",
)


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
"""Settings of matplotlib under which figures are drawn and saved: the same bytes every time."""


def factor(width: int, height: int) -> float:
    """Choose the factor on text and lines for a figure of another size."""
    ratio = min(width / REFERENCE_SIZE[0], height / REFERENCE_SIZE[1])
    return PRINT * ratio if ratio >= 1.0 else max(PRINT * ratio**0.85, SMALLEST_FACTOR)
