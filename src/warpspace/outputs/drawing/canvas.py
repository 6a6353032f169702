"""A sheet to draw on in pixels: matplotlib draws text and lines, at any size and in any format.

Labels are measured before they are drawn, at sizes still to be chosen, and placed by the box of
their ink: matplotlib's text paths give both, while `Text.get_window_extent` measures only drawn
text and gives the height of a whole line, up to 8 px more.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.textpath import text_to_path

from warpspace.outputs.drawing.style import FONT, SIZES, Theme, factor
from warpspace.units import Array

_REPLACEMENT = "\N{WHITE VERTICAL RECTANGLE}"


@lru_cache(maxsize=8)
def _font(weight: str) -> FontProperties:
    return FontProperties(family=[FONT], weight=weight, size=100.0)


@lru_cache(maxsize=4096)
def text_extent(text: str, weight: str) -> tuple[float, float]:
    """Width and height of a line of text of size 1."""
    width, height, _ = text_to_path.get_text_width_height_descent(text, _font(weight), ismath=False)
    return width / 100.0, height / 100.0


@lru_cache(maxsize=1)
def _glyphs() -> frozenset[int]:
    return frozenset(get_font(findfont(_font("normal"))).get_charmap())


def clean(text: str) -> str:
    """Make text drawable: one line, no control characters, no missing glyphs."""
    flat = " ".join(text.split())
    return "".join(c if ord(c) in _glyphs() else _REPLACEMENT for c in flat if c.isprintable())


DPI = 100.0
POINTS_PER_PX = 72.0 / DPI
_ELLIPSIS = "…"


class Canvas:
    """A figure whose coordinates are its pixels, origin bottom left."""

    def __init__(self, width: int, height: int, theme: Theme, *, exact: bool = True) -> None:
        self.width, self.height, self.theme, self.exact = width, height, theme, exact
        self.factor = factor(width, height)
        self.figure = Figure(
            figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=theme.paper, layout=None
        )
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(0.0, height)
        self.axes.set_autoscale_on(False)
        self.rects: list[tuple[float, float, float, float]] = []

    def px(self, size: float) -> float:
        """Scale a length given for a 1600 × 1200 figure."""
        return size * self.factor

    def text_size(
        self, text: str, size: float = SIZES.text, weight: str = "normal"
    ) -> tuple[float, float]:
        """Measure a line of text, px."""
        width, height = text_extent(clean(text), weight)
        return width * self.px(size), height * self.px(size)

    def fit(
        self, text: str, room: float, size: float = SIZES.text, weight: str = "normal"
    ) -> tuple[str, float]:
        """Shrink a line of text into a width, shorten it where that is not enough."""
        text = clean(text)
        room *= 0.98  # what is drawn may be a little wider than what was measured
        width = self.text_size(text, size, weight)[0]
        if width <= room:
            return text, size
        smaller = max(0.7, room / width)
        size *= smaller
        if width * smaller <= room * 1.0001:
            return text, size
        keep = len(text)
        while keep > 1 and self.text_size(text[:keep] + _ELLIPSIS, size, weight)[0] > room:
            keep -= 1
        return text[:keep].rstrip(" ·,") + _ELLIPSIS, size

    def text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = SIZES.text,
        colour: str | None = None,
        weight: str = "normal",
        ha: str = "left",
        va: str = "baseline",
        rotation: float = 0.0,
        halo: str | None = None,
        zorder: float = 6.0,
    ) -> tuple[float, float, float, float]:
        """Write a line of text."""
        text = clean(text)
        drawn = self.axes.text(
            x, y, text, ha=ha, va=va, rotation=rotation, zorder=zorder, parse_math=False,
            color=colour or self.theme.ink, fontsize=self.px(size) * POINTS_PER_PX,
            fontfamily=[FONT], fontweight=weight, rotation_mode="anchor", clip_on=False,
        )  # fmt: skip
        if halo:
            stroke = Stroke(linewidth=self.px(0.25 * size) * POINTS_PER_PX, foreground=halo)
            drawn.set_path_effects([stroke, Normal()])
        extent = self.text_size(text, size, weight)
        rect = self._text_rect(x, y, extent, ha, va, rotation)
        self.rects += [rect] if rotation % 90.0 == 0.0 else self._pieces(rect, extent, rotation)
        return rect

    @staticmethod
    def _pieces(
        rect: tuple[float, float, float, float], extent: tuple[float, float], rotation: float
    ) -> list[tuple[float, float, float, float]]:
        width, height = extent
        count = max(1, math.ceil(width / height))
        c, s = math.cos(math.radians(rotation)), math.sin(math.radians(rotation))
        across, up = 0.5 * width / count * abs(c), 0.5 * width / count * abs(s)
        if abs(c) >= abs(s):
            up += 0.5 * height * abs(c)
        else:
            across += 0.5 * height * abs(s)
        middle = ((rect[0] + rect[2]) / 2.0, (rect[1] + rect[3]) / 2.0)
        along = [width * ((index + 0.5) / count - 0.5) for index in range(count)]
        places = [(middle[0] + step * c, middle[1] + step * s) for step in along]
        return [(x - across, y - up, x + across, y + up) for x, y in places]

    @staticmethod
    def _text_rect(
        x: float, y: float, extent: tuple[float, float], ha: str, va: str, rotation: float
    ) -> tuple[float, float, float, float]:
        width, height = extent
        left = {"left": 0.0, "center": -width / 2, "right": -width}[ha]
        low = {"baseline": 0.0, "bottom": 0.0, "top": -height}.get(va, -height / 2)
        c, s = math.cos(math.radians(rotation)), math.sin(math.radians(rotation))
        ends = [(a, b) for a in (left, left + width) for b in (low, low + height)]
        xs = [x + a * c - b * s for a, b in ends]
        ys = [y + a * s + b * c for a, b in ends]
        return min(xs), min(ys), max(xs), max(ys)

    def line(
        self,
        points: Array | Sequence[tuple[float, float]],
        *,
        width: float = SIZES.line,
        colour: str | None = None,
        alpha: float = 1.0,
        dashes: tuple[float, float] | None = None,
        zorder: float = 3.0,
        cap: Literal["butt", "round"] = "round",
    ) -> None:
        """Draw a polyline; width and dashes are for a 1600 × 1200 figure."""
        xy = np.asarray(points, dtype=float)
        line = Line2D(
            xy[:, 0], xy[:, 1], linewidth=self.px(width) * POINTS_PER_PX, zorder=zorder,
            color=colour or self.theme.ink, alpha=alpha, solid_capstyle=cap,
            solid_joinstyle="round", dash_capstyle="butt", clip_on=False,
        )  # fmt: skip
        if dashes is not None:
            line.set_linestyle((0.0, (dashes[0] / width, dashes[1] / width)))
        self.axes.add_line(line)

    def lines(
        self,
        lines: Sequence[Array],
        *,
        width: float = SIZES.hair,
        colour: str | Array | None = None,
        alpha: float = 1.0,
        dashes: tuple[float, float] | None = None,
        zorder: float = 2.0,
    ) -> None:
        """Draw many polylines at once, in one colour or one each; sizes as for `line`."""
        if not lines:
            return
        points = self.px(width) * POINTS_PER_PX
        style = "solid" if dashes is None else (0.0, (dashes[0] / width, dashes[1] / width))
        self.axes.add_collection(
            LineCollection(
                lines, linewidths=points, colors=self.theme.ink if colour is None else colour,
                alpha=alpha, linestyles=[style], zorder=zorder, clip_on=False,
                capstyle="butt" if dashes else "round", joinstyle="round",
            ),
            autolim=False,
        )  # fmt: skip

    def polygon(
        self,
        points: Array | Sequence[tuple[float, float]] | Sequence[Array],
        colour: str,
        *,
        alpha: float = 1.0,
        zorder: float = 3.0,
    ) -> None:
        """Fill a polygon."""
        self.axes.add_patch(
            Polygon(np.asarray(points), closed=True, facecolor=colour, edgecolor="none",
                    linewidth=0.0, alpha=alpha, zorder=zorder, clip_on=False)
        )  # fmt: skip

    def disc(
        self, centre: Array, radius: float, colour: str | Array, *, alpha: float = 1.0
    ) -> None:
        """Fill a disc; the radius is for a 1600 × 1200 figure."""
        self.axes.add_patch(
            Circle((float(centre[0]), float(centre[1])), self.px(radius), facecolor=colour,
                   edgecolor="none", alpha=alpha, zorder=4.1, clip_on=False)
        )  # fmt: skip

    def ring(self, centre: Array, radius: float) -> None:
        """Draw a ring around a point, seen on any ground."""
        for width, colour in ((4.5, self.theme.paper), (2.2, self.theme.accent)):
            self.axes.add_patch(
                Circle((float(centre[0]), float(centre[1])), self.px(radius), fill=False,
                       edgecolor=colour, linewidth=self.px(width) * POINTS_PER_PX, zorder=4.2)
            )  # fmt: skip

    def rectangle(
        self, left: float, bottom: float, width: float, height: float, **patch: Any
    ) -> None:
        """Draw a rectangle; styles as in matplotlib."""
        self.axes.add_patch(Rectangle((left, bottom), width, height, clip_on=False, **patch))

    def image(
        self,
        rgba: np.ndarray[Any, Any],
        rect: tuple[float, float, float, float],
        zorder: float = 1.0,
    ) -> None:
        """Place an image (first row at the top) into a box: left, bottom, right, top, px."""
        left, bottom, right, top = rect
        self.axes.imshow(
            rgba, extent=(left, right, bottom, top), origin="upper", interpolation="nearest",
            aspect="auto", zorder=zorder, clip_on=False,
        )  # fmt: skip
        self.axes.set_xlim(0.0, self.width)
        self.axes.set_ylim(0.0, self.height)

    def arrow(
        self,
        start: Array,
        end: Array,
        *,
        colour: str | None = None,
        width: float = SIZES.bold,
        alpha: float = 1.0,
        zorder: float = 4.0,
    ) -> None:
        """Draw an arrow; short ones get a head that fits."""
        vector = np.asarray(end, dtype=float) - np.asarray(start, dtype=float)
        length = float(np.hypot(*vector))
        if length < 1e-6:
            return
        along = vector / length
        across = np.array([-along[1], along[0]])
        head = min(self.px(16.0), 0.75 * length)
        neck = np.asarray(end) - head * along
        colour = colour or self.theme.accent
        if length > head * 1.01:
            self.line(
                [tuple(start), tuple(neck + 0.2 * head * along)],
                width=width, colour=colour, alpha=alpha, zorder=zorder, cap="butt",
            )  # fmt: skip
        side = 0.34 * head * across
        self.polygon([neck + side, end, neck - side], colour, alpha=alpha, zorder=zorder)
