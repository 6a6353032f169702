"""What the font can draw, and how much room it takes.

Labels are measured before they are drawn, at sizes still to be chosen, and placed by the box of
their ink: matplotlib's text paths give both, while `Text.get_window_extent` measures only drawn
text and gives the height of a whole line, up to 8 px more.
"""

from functools import lru_cache

from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.textpath import text_to_path

from warpspace.outputs.drawing.style import FONT

_REPLACEMENT = "\N{WHITE VERTICAL RECTANGLE}"


@lru_cache(maxsize=8)
def _font(weight: str) -> FontProperties:
    """Font of a weight."""
    return FontProperties(family=[FONT], weight=weight, size=100.0)


@lru_cache(maxsize=4096)
def text_extent(text: str, weight: str) -> tuple[float, float]:
    """Width and height of a line of text of size 1."""
    width, height, _ = text_to_path.get_text_width_height_descent(text, _font(weight), ismath=False)
    return width / 100.0, height / 100.0


@lru_cache(maxsize=1)
def _glyphs() -> frozenset[int]:
    """Character codes the font can draw."""
    return frozenset(get_font(findfont(_font("normal"))).get_charmap())


def clean(text: str) -> str:
    """Make text drawable: one line, no control characters, no missing glyphs."""
    flat = " ".join(text.split())
    return "".join(c if ord(c) in _glyphs() else _REPLACEMENT for c in flat if c.isprintable())
