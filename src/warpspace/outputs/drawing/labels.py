"""Where labels go: next to what they name, off the lines, inside the figure."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.geometry.surfaces import corners
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.render import Projection, Raster, Rect
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.model import Picture
from warpspace.units import MICROMETRE, Array, spell, spell_short

_ANGLES = tuple(2.0 * math.pi * turn / 24 for turn in range(24))
_DISTANCES = (8.0, 14.0, 22.0, 34.0, 50.0, 70.0, 100.0, 140.0)
LEADER_FROM = 20.0
"""Labels farther than this from what they name, px of a 1600 × 1200 figure, get a leader."""
TEXT_COST, LINE_COST, BODY_COST = 40.0, 6.0, 1.2


class Occupancy:
    """A coarse picture of what is drawn already."""

    def __init__(self, width: float, height: float, cell: float) -> None:
        self.cell = max(cell, 1.0)
        shape = math.ceil(height / self.cell) + 1, math.ceil(width / self.cell) + 1
        self.cost = np.zeros(shape)

    def _window(self, rect: Rect) -> tuple[slice, slice]:
        left, bottom, right, top = (value / self.cell for value in rect)
        rows = slice(max(0, math.floor(bottom)), max(0, math.ceil(top)))
        return rows, slice(max(0, math.floor(left)), max(0, math.ceil(right)))

    def add_rects(self, rects: Iterable[Rect], weight: float = TEXT_COST) -> None:
        """Mark boxes."""
        for rect in rects:
            self.cost[self._window(rect)] += weight

    def add_lines(self, lines: Iterable[Array], weight: float = LINE_COST) -> None:
        """Mark polylines, [n, 2], px."""
        for line in lines:
            count = np.maximum(1, np.ceil(np.hypot(*np.diff(line, axis=0).T) / self.cell)).astype(
                int
            )
            along = np.concatenate([[0.0], np.cumsum(np.repeat(1.0 / count, count))])
            known = np.arange(len(line))
            x, y = (np.interp(along, known, line[:, axis]) for axis in range(2))
            rows, columns = (y / self.cell).astype(int), (x / self.cell).astype(int)
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
        """Cost of a leader: high where it runs over text."""
        steps = np.linspace(0.0, 1.0, 24)
        rows = ((start[1] + (end[1] - start[1]) * steps) / self.cell).astype(int)
        columns = ((start[0] + (end[0] - start[0]) * steps) / self.cell).astype(int)
        rows = np.clip(rows, 0, self.cost.shape[0] - 1)
        columns = np.clip(columns, 0, self.cost.shape[1] - 1)
        return 2.0 if float(self.cost[rows, columns].max()) >= TEXT_COST else 0.0

    def at(self, rect: Rect) -> float:
        """Cost of covering a box, per cell of it."""
        window = self.cost[self._window(rect)]
        return float(window.mean() + 0.4 * window.max()) if window.size else math.inf


@dataclass(frozen=True, slots=True)
class Placed:
    """A placed label."""

    centre: tuple[float, float]  # px
    rect: Rect  # px
    anchor: tuple[float, float]  # px; the point it names
    distance: float  # px; from the anchor to the nearest point of the box
    cost: float  # what it covers; 0 where it covers nothing


def place_label(
    anchors: Sequence[tuple[float, float]],
    size: tuple[float, float],
    frame: Rect,
    taken: Occupancy,
    unit: float,
) -> Placed | None:
    """Find the free place nearest to one of several points."""
    best: Placed | None = None
    best_score = math.inf
    half_w, half_h = size[0] / 2.0 + 3.0 * unit, size[1] / 2.0 + 3.0 * unit
    for anchor in anchors:
        for distance in _DISTANCES:
            if 0.012 * distance >= best_score:
                break
            for angle in _ANGLES:
                c, s = math.cos(angle), math.sin(angle)
                # as far out as puts the box's edge at the distance
                reach = min(
                    half_w / abs(c) if abs(c) > 1e-9 else math.inf,
                    half_h / abs(s) if abs(s) > 1e-9 else math.inf,
                )
                x = anchor[0] + c * (distance * unit + reach)
                y = anchor[1] + s * (distance * unit + reach)
                rect = (x - half_w, y - half_h, x + half_w, y + half_h)
                outside = rect[0] < frame[0] or rect[1] < frame[1]
                if outside or rect[2] > frame[2] or rect[3] > frame[3]:
                    continue
                cost = taken.at(rect)
                score = cost + 0.012 * distance
                if score < best_score and distance > LEADER_FROM:
                    score += taken.between(anchor, (x - c * reach, y - s * reach))
                if score < best_score:
                    best_score = score
                    best = Placed((x, y), rect, anchor, distance * unit, cost)
    if best is not None:
        taken.add_rects([best.rect])
    return best


ARROW_COST = 12.0
_SHARES = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8)
_CANDIDATE_LINES = 3


def label_isolines(
    canvas: Canvas,
    by_level: Mapping[float, Sequence[Array]],
    colour: str,
    halo: str,
    taken: Occupancy,
) -> None:
    """Write each level once, along a long visible piece of its line."""
    for level, lines in by_level.items():
        text = spell_short(level)
        size = canvas.text_size(text, SIZES.small)
        found: tuple[float, float, float, float] | None = None
        for line in sorted(lines, key=_length, reverse=True)[:_CANDIDATE_LINES]:
            if _length(line) < 4.0 * size[0]:
                continue
            for share in _SHARES:
                x, y, angle = _beside(line, share, size)
                box = (x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2)
                cost = taken.at(box)
                if found is None or cost < found[0] - 0.05:
                    found = (cost, x, y, angle)
        if found is None:
            continue
        rect = canvas.text(
            found[1], found[2], text, size=SIZES.small, colour=colour, halo=halo, ha="center",
            va="center_baseline", rotation=found[3], zorder=3.1,
        )  # fmt: skip
        taken.add_rects([rect])


def _length(line: Array) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _beside(line: Array, share: float, size: tuple[float, float]) -> tuple[float, float, float]:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    spots = share * along[-1] + np.array([-0.5, 0.0, 0.5]) * size[0]
    x, y = (np.interp(spots, along, line[:, axis]) for axis in range(2))
    angle = (float(np.degrees(np.arctan2(y[2] - y[0], x[2] - x[0]))) + 90.0) % 180.0 - 90.0
    lift = 0.85 * size[1]
    tilt = np.radians(angle)
    return float(x[1] - lift * np.sin(tilt)), float(y[1] + lift * np.cos(tilt)), angle


def draw_corners(
    canvas: Canvas,
    picture: Picture,
    projection: Projection,
    raster: Raster | None,
    taken: Occupancy,
    frame: Rect | None,
) -> None:
    """Draw the displacement of the corners and label those that can be seen."""
    nominal, drawn = picture.grid.nominal_mm.reshape(-1, 3), picture.drawn_mm.reshape(-1, 3)
    length = np.linalg.norm(picture.field.error_um.reshape(-1, 3), axis=-1)
    worst = int(np.argmax(length))
    found = corners(picture.shape).tolist()
    depth = projection.depth_mm(nominal[found])
    front = float(depth.min()) + 0.02 * float(np.ptp(depth)) + 1.0
    wanted: list[tuple[str, Array, Array]] = []
    for corner, deep in zip(found, depth, strict=True):
        tail, tip = projection.project(nominal[corner]), projection.project(drawn[corner])
        ends = np.stack([nominal[corner], drawn[corner]])
        near = bool(deep <= front) or _visible(projection, ends, raster)
        opacity = 1.0 if near else 0.4
        canvas.arrow(tail, tip, alpha=opacity, zorder=4.0 if near else 3.4)
        if np.hypot(*(tip - tail)) > 0.1:
            canvas.disc(tail, 4.0, canvas.theme.accent, alpha=opacity)
            taken.add_lines([np.stack([tail, tip])], ARROW_COST)
        if near:
            wanted.append((_amount(length[corner], largest=corner == worst), tail, tip))
    if worst not in found and _visible(projection, drawn[worst][None], raster):
        spot = projection.project(drawn[worst])
        canvas.ring(spot, 7.0)
        wanted.append((_amount(length[worst], largest=True), spot, spot))
    if frame is not None:
        _write(canvas, wanted, frame, taken)


def _amount(length_um: float, *, largest: bool) -> str:
    tail = " max" if largest and length_um > 0.0 else ""
    return f"{spell(float(length_um))} {MICROMETRE}{tail}"


def _write(
    canvas: Canvas, wanted: Sequence[tuple[str, Array, Array]], frame: Rect, taken: Occupancy
) -> None:
    colour = canvas.theme.accent
    for text, tail, tip in wanted:
        size = canvas.text_size(text, SIZES.text, "bold")
        anchors = [(float(p[0]), float(p[1])) for p in (tip, tail, (tip + tail) / 2.0)]
        placed = place_label(anchors, size, frame, taken, canvas.factor)
        if placed is None:
            continue
        canvas.text(
            *placed.centre, text, size=SIZES.text, weight="bold", colour=colour,
            ha="center", va="center_baseline", halo=canvas.theme.paper,
        )  # fmt: skip
        if placed.distance > canvas.px(LEADER_FROM):
            x = min(max(placed.anchor[0], placed.rect[0]), placed.rect[2])
            y = min(max(placed.anchor[1], placed.rect[1]), placed.rect[3])
            canvas.line([(x, y), placed.anchor], width=SIZES.hair, colour=colour, zorder=3.9)


def _visible(projection: Projection, points_mm: Array, raster: Raster | None) -> bool:
    """Tell whether any of some points can be seen: not behind the body."""
    if raster is None:
        return True
    surface = raster.depth_at(projection.project(points_mm), spread=True)
    return bool(np.any(projection.depth_mm(points_mm) <= surface + 2.0 / projection.px_per_mm))
