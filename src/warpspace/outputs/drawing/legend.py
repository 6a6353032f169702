"""The legend at the bottom of a figure.

Its symbols are drawn with the strokes of the picture itself, and entries for which there is no room
are left out; matplotlib's legend does neither.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.style import SIZES

Symbol = Callable[[Canvas, float, float, float], None]


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """One entry of the legend at the bottom.

    Attributes
    ----------
    symbol : callable
        Draws it, given the canvas, its left end, the height of its middle and its width, px.
    text : str
    """

    symbol: Symbol
    text: str


def draw_legend(
    canvas: Canvas, legend: Sequence[LegendEntry], x: float, y: float, room: float
) -> None:
    """Draw the entries of a legend in a row; those that do not fit are left out."""
    swatch, gap = canvas.px(36.0), canvas.px(10.0)
    end = x + room
    for entry in legend:
        width = swatch + gap + canvas.text_size(entry.text, SIZES.small)[0]
        if x + width > end:
            return
        entry.symbol(canvas, x, y, swatch)
        canvas.text(
            x + swatch + gap, y, entry.text, size=SIZES.small, colour=canvas.theme.muted,
            va="center_baseline",
        )  # fmt: skip
        x += width + canvas.px(34.0)


def grid_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show an edge of the deformed grid."""
    colour = canvas.theme.ink
    canvas.line([(x, y), (x + width, y)], width=SIZES.line, colour=colour)


def dark_isoline_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a dark line on a light ground."""
    height = canvas.px(14.0)
    canvas.rectangle(x, y - height / 2, width, height, facecolor="#d9a98c", edgecolor="none")
    canvas.line([(x, y), (x + width, y)], width=SIZES.thin, colour=canvas.theme.grid, zorder=3.5)


def isoline_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a white line on a coloured ground."""
    height = canvas.px(14.0)
    canvas.rectangle(x, y - height / 2, width, height, facecolor="#2f6b8e", edgecolor="none")
    canvas.line([(x, y), (x + width, y)], width=SIZES.line, colour=canvas.theme.isoline, zorder=3.5)
