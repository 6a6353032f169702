"""The column beside a map: colour bar with marks, statistics, scale bars."""

from collections.abc import Sequence

import numpy as np

from warpspace.geometry.colour import ColourScale, colour_table
from warpspace.geometry.deform import round_down
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.projection import Rect
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.words import spell_factor, spell_short
from warpspace.units import MM_PER_UM

Row = tuple[str, str]


def draw_panel(
    canvas: Canvas,
    rect: Rect,
    scale: ColourScale,
    heading: str,
    marks: Sequence[tuple[str, float]],
    rows: Sequence[Row],
    bars: tuple[float, float | None] | None,
) -> None:
    """Draw colour bar, statistics and scale bars from top to bottom.

    Parameters
    ----------
    canvas : Canvas
    rect : tuple of float, (4,), px
    scale : ColourScale
    heading : str
        What the colours mean, with unit.
    marks : sequence of (str, float)
        Values marked beside the bar.
    rows : sequence of (str, str)
        Statistics, first one bold.
    bars : tuple of (float, float or None) or None
        Pixels per mm and exaggeration of the map the scale bars belong to; no bar for
        displacements where that is None.
    """
    left, bottom, right, top = rect
    y = bottom
    if bars is not None:
        y = draw_scale_bars(canvas, (left, bottom, right, top), *bars) + canvas.px(24.0)
    step = canvas.px(27.0)
    room = top - y - canvas.px(150.0)
    shown = rows[: max(1, int(room / step))]
    for index, (name, value) in enumerate(reversed(shown)):
        weight = "bold" if index == len(shown) - 1 else "normal"
        height = y + index * step
        text, size = canvas.fit(value, 0.8 * (right - left), SIZES.text, weight)
        canvas.text(right, height, text, size=size, weight=weight, ha="right")
        space = right - left - canvas.text_size(text, size, weight)[0] - canvas.px(8.0)
        label, small = canvas.fit(name, space)
        canvas.text(left, height, label, size=small, colour=canvas.theme.muted)
    y += len(shown) * step + canvas.px(26.0)
    text, size = canvas.fit(heading, right - left, SIZES.heading, "bold")
    canvas.text(left, top, text, size=size, weight="bold", va="top")
    high = top - canvas.px(40.0)
    low = max(y, high - canvas.px(560.0))
    draw_colour_bar(
        canvas, (left + canvas.px(64.0), low, left + canvas.px(94.0), high), scale, marks
    )


def draw_colour_bar(
    canvas: Canvas, rect: Rect, scale: ColourScale, marks: Sequence[tuple[str, float]] = ()
) -> None:
    """Draw a colour bar with numbers on its right and marked values on its left."""
    left, low, right, high = rect
    theme = canvas.theme
    table = colour_table(diverging=scale.diverging)[::-1, None, :]
    opaque = np.concatenate([table, np.full((len(table), 1, 1), 255, np.uint8)], -1)
    canvas.image(opaque, (left, low, right, high), zorder=2.0)
    canvas.rectangle(
        left, low, right - left, high - low, fill=False, edgecolor=theme.muted,
        linewidth=canvas.px(1.0) * 0.72, zorder=2.6,
    )  # fmt: skip
    span = scale.high - scale.low
    height = canvas.text_size("0", SIZES.text)[1]
    every = 1
    while (high - low) / max(1, (len(scale.ticks) - 1) / every) < 1.6 * height:
        every += 1
    zero = min(range(len(scale.ticks)), key=lambda i: abs(scale.ticks[i]))
    for index, tick in enumerate(scale.ticks):
        y = low + (tick - scale.low) / span * (high - low)
        if scale.low < tick < scale.high:
            colour = theme.grid if scale.diverging else theme.isoline
            canvas.line([(left, y), (right, y)], width=SIZES.thin, colour=colour, zorder=2.5)
        if (index - zero) % every:
            continue
        canvas.line([(right, y), (right + canvas.px(7.0), y)], width=SIZES.thin, colour=theme.muted)
        canvas.text(right + canvas.px(13.0), y, spell_short(tick), va="center_baseline")
    _draw_marks(canvas, rect, scale, marks)


def _draw_marks(
    canvas: Canvas, rect: Rect, scale: ColourScale, marks: Sequence[tuple[str, float]]
) -> None:
    """Mark values on the left of a colour bar; their names give way to each other."""
    left, low, _, high = rect
    distance = canvas.px(19.0)
    ordered = sorted(marks, key=lambda mark: mark[1])
    spots = [low + float(scale.fraction(np.asarray(value))) * (high - low) for _, value in ordered]
    heights = list(spots)
    for index in range(1, len(heights)):
        heights[index] = max(heights[index], heights[index - 1] + distance)
    over = heights[-1] - (high + canvas.px(6.0)) if heights else 0.0
    if over > 0.0:
        heights[-1] -= over
        for index in range(len(heights) - 2, -1, -1):
            heights[index] = min(heights[index], heights[index + 1] - distance)
    for (name, value), spot, height in zip(ordered, spots, heights, strict=True):
        beyond = " ↑" if value > scale.high else " ↓" if value < scale.low else ""
        tip = left - canvas.px(2.0)
        side = canvas.px(5.0)
        base = tip - canvas.px(9.0)
        canvas.polygon(
            [(tip, spot), (base, spot + side), (base, spot - side)], canvas.theme.ink, zorder=3.0
        )
        if abs(height - spot) > canvas.px(1.0):
            canvas.line([(base, spot), (base - canvas.px(5.0), height)], width=SIZES.hair)
        canvas.text(
            base - canvas.px(7.0), height, name + beyond, size=SIZES.small, ha="right",
            va="center_baseline",
        )  # fmt: skip


def draw_scale_bars(
    canvas: Canvas, rect: Rect, px_per_mm: float, exaggeration: float | None
) -> float:
    """Draw one bar for lengths and one for displacements, both as seen in the picture plane.

    Parameters
    ----------
    canvas : Canvas
    rect : tuple of float, (4,), px
        They stand at its bottom.
    px_per_mm : float
    exaggeration : float or None
        None draws no bar for displacements.

    Returns
    -------
    float, px
        Height above which the box is free.
    """
    left, y, right, _ = rect
    room = min(right - left, canvas.px(190.0))
    theme = canvas.theme
    y += canvas.px(6.0)
    if exaggeration is not None:
        px_per_um = px_per_mm * MM_PER_UM * exaggeration
        length = round_down(room / px_per_um)
        _draw_bar(canvas, left, y, length * px_per_um, theme.accent)
        name = f"{spell_short(length)} µm displacement ({spell_factor(exaggeration)})"
        text, size = canvas.fit(name, right - left, SIZES.small)
        canvas.text(left, y + canvas.px(13.0), text, size=size, colour=theme.accent)
        y += canvas.px(52.0)
    length = round_down(room / px_per_mm)
    _draw_bar(canvas, left, y, length * px_per_mm, theme.ink)
    text, size = canvas.fit(f"{spell_short(length)} mm geometry", right - left, SIZES.small)
    canvas.text(left, y + canvas.px(13.0), text, size=size)
    return y + canvas.px(34.0)


def _draw_bar(canvas: Canvas, x: float, y: float, length: float, colour: str) -> None:
    """Draw one scale bar with feet."""
    foot = canvas.px(6.0)
    points = [(x, y - foot), (x, y), (x + length, y), (x + length, y - foot)]
    canvas.line(points, width=SIZES.line, colour=colour, cap="butt")
