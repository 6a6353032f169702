"""A sheet to draw on in pixels, and free places for labels on it.

matplotlib draws text and lines, at any size and in any format.

Labels are measured before they are drawn, at sizes not chosen yet, and placed by the box of their
ink: matplotlib's text paths provide both, while `Text.get_window_extent` measures only drawn text
and returns the height of a full line, up to 8 px more.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.patheffects import Normal, Stroke
from matplotlib.textpath import text_to_path

from warpspace.outputs.drawing.off_screen import Rect, resample
from warpspace.outputs.drawing.settings import FONT, PRINTED_FACTOR, SIZES, Theme, factor
from warpspace.units import Array

Points = Array | Sequence[tuple[float, float]] | Sequence[Array]  # [n, 2], px
_REPLACEMENT = "\N{WHITE VERTICAL RECTANGLE}"


@lru_cache(maxsize=8)
def _font(weight: str) -> FontProperties:
    return FontProperties(family=[FONT], weight=weight, size=100.0)


@lru_cache(maxsize=4096)
def text_extent(text: str, weight: str) -> tuple[float, float]:
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

    def __init__(
        self, width: int, height: int, theme: Theme, *, exact: bool = True, printed: bool = False
    ) -> None:
        self.width, self.height, self.theme, self.exact = width, height, theme, exact
        self.printed = printed
        self.factor = PRINTED_FACTOR if printed else factor(width, height)
        self.margin = self.px(SIZES.margin) * min(1.0, width / self.px(1000.0))
        self.figure = Figure(
            figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=theme.paper, layout=None
        )
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(0.0, height)
        self.axes.set_autoscale_on(False)
        self.rects: list[Rect] = []

    def px(self, size: float) -> float:
        """Scale a length given for a 1600 × 1200 figure."""
        return size * self.factor

    def text_size(
        self, text: str, size: float = SIZES.text, weight: str = "normal"
    ) -> tuple[float, float]:
        width, height = text_extent(clean(text), weight)
        return width * self.px(size), height * self.px(size)

    def fit(
        self, text: str, max_width: float, size: float = SIZES.text, weight: str = "normal"
    ) -> tuple[str, float]:
        text = clean(text)
        max_width *= 0.98  # drawn text may be slightly wider than measured
        width = self.text_size(text, size, weight)[0]
        if width <= max_width:
            return text, size
        smaller = max(min(SIZES.small / size, 1.0) if self.printed else 0.7, max_width / width)
        size *= smaller
        if width * smaller <= max_width * 1.0001:
            return text, size
        keep = len(text)
        while keep > 1 and self.text_size(text[:keep] + _ELLIPSIS, size, weight)[0] > max_width:
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
        max_width: float = math.inf,
    ) -> Rect:
        text, size = self.fit(text, max_width, size, weight)
        drawn = self.axes.text(
            x, y, text, ha=ha, va=va, rotation=rotation, zorder=zorder, parse_math=False,
            color=colour or self.theme.ink, fontsize=self.px(size) * POINTS_PER_PX,
            fontfamily=[FONT], fontweight=weight, rotation_mode="anchor", clip_on=False,
        )  # fmt: skip
        if halo:
            stroke = Stroke(linewidth=self.px(0.25 * size) * POINTS_PER_PX, foreground=halo)
            drawn.set_path_effects([stroke, Normal()])
        extent = self.text_size(text, size, weight)
        rect = _text_rect(x, y, extent, ha, va, rotation)
        self.rects += [rect] if rotation % 90.0 == 0.0 else _pieces(rect, extent, rotation)
        return rect

    def line(
        self, points: Points, *, width: float = SIZES.line, zorder: float = 3.0, **style: Any
    ) -> None:
        self.lines([np.asarray(points, dtype=float)], width=width, zorder=zorder, **style)

    def lines(
        self,
        lines: Sequence[Array],
        *,
        width: float = SIZES.hair,
        colour: str | Array | None = None,
        alpha: float = 1.0,
        dashes: tuple[float, float] | None = None,
        zorder: float = 2.0,
        cap: Literal["butt", "round"] = "round",
    ) -> None:
        """Draw polylines in one colour or one each; sizes are for a 1600 × 1200 figure."""
        if not lines:
            return
        points = self.px(width) * POINTS_PER_PX
        style = "solid" if dashes is None else (0.0, (dashes[0] / width, dashes[1] / width))
        self.axes.add_collection(
            LineCollection(
                lines, linewidths=points, colors=self.theme.ink if colour is None else colour,
                alpha=alpha, linestyles=[style], zorder=zorder, clip_on=False,
                capstyle="butt" if dashes else cap, joinstyle="round",
            ),
            autolim=False,
        )  # fmt: skip

    def polygon(
        self, points: Points, colour: str, *, alpha: float = 1.0, zorder: float = 3.0
    ) -> None:
        style = {"facecolor": colour, "edgecolor": "none", "alpha": alpha, "zorder": zorder}
        patch = Polygon(np.asarray(points), closed=True, linewidth=0.0, clip_on=False, **style)
        self.axes.add_patch(patch)

    def disc(
        self, centre: Array, radius: float, colour: str | Array, *, alpha: float = 1.0
    ) -> None:
        """Fill a disc; the radius is for a 1600 × 1200 figure."""
        self.axes.add_patch(
            Circle((float(centre[0]), float(centre[1])), self.px(radius), facecolor=colour,
                   edgecolor="none", alpha=alpha, zorder=4.1, clip_on=False)
        )  # fmt: skip

    def ring(self, centre: Array, radius: float) -> None:
        for width, colour in ((4.5, self.theme.paper), (2.2, self.theme.accent)):
            self.axes.add_patch(
                Circle((float(centre[0]), float(centre[1])), self.px(radius), fill=False,
                       edgecolor=colour, linewidth=self.px(width) * POINTS_PER_PX, zorder=4.2)
            )  # fmt: skip

    def rectangle(
        self, x_left: float, bottom: float, width: float, height: float, **patch: Any
    ) -> None:
        self.axes.add_patch(Rectangle((x_left, bottom), width, height, clip_on=False, **patch))

    def image(self, rgba: np.ndarray[Any, Any], rect: Rect, zorder: float = 1.0) -> None:
        """Place an image (first row at the top) into a box: left, bottom, right, top, px."""
        x_left, bottom, right, top = rect
        self.axes.imshow(
            rgba, extent=(x_left, right, bottom, top), origin="upper", interpolation="nearest",
            aspect="auto", zorder=zorder, clip_on=False,
        )  # fmt: skip
        self.axes.set_xlim(0.0, self.width)
        self.axes.set_ylim(0.0, self.height)

    def arrow(self, start: Array, end: Array, *, alpha: float = 1.0, zorder: float = 4.0) -> None:
        """Draw a displacement; a short one gets a head that fits."""
        vector = end - start
        length = float(np.hypot(*vector))
        if length < 1e-6:
            return
        along = vector / length
        across = np.array([-along[1], along[0]])
        head = min(self.px(16.0), 0.75 * length)
        neck = end - head * along
        style: dict[str, Any] = {"colour": self.theme.accent, "alpha": alpha, "zorder": zorder}
        if length > head * 1.01:
            self.line([start, neck + 0.2 * head * along], width=SIZES.bold, cap="butt", **style)
        side = 0.34 * head * across
        self.polygon([neck + side, end, neck - side], **style)


def _pieces(rect: Rect, extent: tuple[float, float], rotation: float) -> list[Rect]:
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


def _text_rect(
    x: float, y: float, extent: tuple[float, float], ha: str, va: str, rotation: float
) -> Rect:
    width, height = extent
    x_left = {"left": 0.0, "center": -width / 2, "right": -width}[ha]
    low = {"baseline": 0.0, "bottom": 0.0, "top": -height}.get(va, -height / 2)
    c, s = math.cos(math.radians(rotation)), math.sin(math.radians(rotation))
    a, b = np.meshgrid((x_left, x_left + width), (low, low + height))
    xs, ys = x + a * c - b * s, y + a * s + b * c
    return float(xs.min()), float(ys.min()), float(xs.max()), float(ys.max())


_ANGLES = (2.0 * math.pi * turn / 24 for turn in range(24))
_DIRECTIONS = tuple((math.cos(angle), math.sin(angle)) for angle in _ANGLES)
_DISTANCES = (8.0, 14.0, 22.0, 34.0, 50.0, 70.0, 100.0, 140.0)
LEADER_FROM = 20.0
"""Labels farther than this from their point, px of a 1600 × 1200 figure, get a leader."""
TEXT_COST, LINE_COST, BODY_COST = 40.0, 6.0, 1.2


class Occupancy:
    """A coarse grid of the areas that are drawn on already."""

    def __init__(self, width: float, height: float, cell: float) -> None:
        self.cell = max(cell, 1.0)
        shape = math.ceil(height / self.cell) + 1, math.ceil(width / self.cell) + 1
        self.cost = np.zeros(shape)

    def _window(self, rect: Rect) -> tuple[slice, slice]:
        x_left, bottom, right, top = (value / self.cell for value in rect)
        rows = slice(max(0, math.floor(bottom)), max(0, math.ceil(top)))
        return rows, slice(max(0, math.floor(x_left)), max(0, math.ceil(right)))

    def add_rects(self, rects: Iterable[Rect], weight: float = TEXT_COST) -> None:
        for rect in rects:
            self.cost[self._window(rect)] += weight

    def add_lines(self, lines: Iterable[Array], weight: float = LINE_COST) -> None:
        for line in lines:
            columns, rows = (resample(line, self.cell) / self.cell).astype(int).T
            inside = (rows >= 0) & (rows < self.cost.shape[0])
            inside &= (columns >= 0) & (columns < self.cost.shape[1])
            self.cost[rows[inside], columns[inside]] += weight

    def add_mask(self, mask: np.ndarray, rect: Rect, weight: float = BODY_COST) -> None:
        """Mark where a raster (first row at the top) is not empty."""
        rows, columns = self._window(rect)
        y = (np.arange(rows.start, min(rows.stop, self.cost.shape[0])) + 0.5) * self.cell
        x = (np.arange(columns.start, min(columns.stop, self.cost.shape[1])) + 0.5) * self.cell
        height, width = mask.shape
        i = np.clip((rect[3] - y) / (rect[3] - rect[1]) * height, 0, height - 1).astype(int)
        j = np.clip((x - rect[0]) / (rect[2] - rect[0]) * width, 0, width - 1).astype(int)
        self.cost[rows.start : rows.start + len(y), columns.start : columns.start + len(x)] += (
            weight * mask[np.ix_(i, j)]
        )

    def between(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        spots = (np.linspace(start, end, 24) / self.cell).astype(int)
        columns, rows = np.clip(spots, 0, np.array(self.cost.shape[::-1]) - 1).T
        return 2.0 if float(self.cost[rows, columns].max()) >= TEXT_COST else 0.0

    def at(self, rect: Rect) -> float:
        """Cost of covering a box, per cell of it."""
        window = self.cost[self._window(rect)]
        return float(window.mean() + 0.4 * window.max()) if window.size else math.inf


@dataclass(frozen=True, slots=True)
class PlacedLabel:
    """A placed label."""

    centre: tuple[float, float]  # px
    rect: Rect  # px
    anchor: tuple[float, float]  # px; the labelled point
    distance: float  # px; from the anchor to the nearest point of the box
    cost: float  # of the area it covers; 0 for a free area

    def draw_leader(self, canvas: Canvas, colour: str, zorder: float = 3.0) -> None:
        x = min(max(self.anchor[0], self.rect[0]), self.rect[2])
        y = min(max(self.anchor[1], self.rect[1]), self.rect[3])
        canvas.line([(x, y), self.anchor], width=SIZES.hair, colour=colour, zorder=zorder)


def place_label(
    anchors: Points, size: tuple[float, float], frame: Rect, occupancy: Occupancy, unit: float
) -> PlacedLabel | None:
    best: PlacedLabel | None = None
    best_score = math.inf
    half_w, half_h = size[0] / 2.0 + 3.0 * unit, size[1] / 2.0 + 3.0 * unit
    for anchor in ((float(x), float(y)) for x, y in anchors):
        for distance in _DISTANCES:
            if 0.012 * distance >= best_score:
                break
            for c, s in _DIRECTIONS:
                # as far out as puts the box's edge at the distance
                reach = min(half_w / max(abs(c), 1e-9), half_h / max(abs(s), 1e-9))
                x = anchor[0] + c * (distance * unit + reach)
                y = anchor[1] + s * (distance * unit + reach)
                rect = (x - half_w, y - half_h, x + half_w, y + half_h)
                outside = rect[0] < frame[0] or rect[1] < frame[1]
                if outside or rect[2] > frame[2] or rect[3] > frame[3]:
                    continue
                cost = occupancy.at(rect)
                score = cost + 0.012 * distance
                if score < best_score and distance > LEADER_FROM:
                    score += occupancy.between(anchor, (x - c * reach, y - s * reach))
                if score < best_score:
                    best_score = score
                    best = PlacedLabel((x, y), rect, anchor, distance * unit, cost)
    if best is not None:
        occupancy.add_rects([best.rect])
    return best


def write_label(
    canvas: Canvas,
    text: str,
    anchors: Points,
    frame: Rect,
    occupancy: Occupancy,
    *,
    size: float = SIZES.text,
    weight: str = "normal",
    **style: Any,
) -> PlacedLabel | None:
    """Write a label in free space beside one of several points; None where no space is free."""
    extent = canvas.text_size(text, size, weight)
    placed = place_label(anchors, extent, frame, occupancy, canvas.factor)
    if placed is not None:
        style |= {"ha": "center", "va": "center_baseline", "halo": canvas.theme.paper}
        canvas.text(*placed.centre, text, size=size, weight=weight, **style)
    return placed
