"""Where labels go: next to what they name, off the lines, inside the figure."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.outputs.drawing.projection import Rect
from warpspace.units import Array

_ANGLES = tuple(2.0 * math.pi * turn / 24 for turn in range(24))
_DISTANCES = (8.0, 14.0, 22.0, 34.0, 50.0, 70.0, 100.0, 140.0)
LEADER_FROM = 20.0
"""Labels farther than this from what they name, px of a 1600 × 1200 figure, get a leader."""
TEXT_COST, LINE_COST, BODY_COST = 40.0, 6.0, 1.2


class Occupancy:
    """A coarse picture of what is drawn already.

    Parameters
    ----------
    width, height : float, px
        Of the figure.
    cell : float, px
        Side of a cell.
    """

    def __init__(self, width: float, height: float, cell: float) -> None:
        self.cell = max(cell, 1.0)
        shape = math.ceil(height / self.cell) + 1, math.ceil(width / self.cell) + 1
        self.cost = np.zeros(shape)

    def _window(self, rect: Rect) -> tuple[slice, slice]:
        """Cells that a box touches."""
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
    """A placed label.

    Attributes
    ----------
    centre : tuple of float, (2,), px
    rect : tuple of float, (4,), px
    anchor : tuple of float, (2,), px
        The point it names.
    distance : float, px
        From the anchor to the nearest point of the box.
    cost : float
        What it covers; 0 where it covers nothing.
    """

    centre: tuple[float, float]
    rect: Rect
    anchor: tuple[float, float]
    distance: float
    cost: float


def place_label(
    anchors: Sequence[tuple[float, float]],
    size: tuple[float, float],
    frame: Rect,
    taken: Occupancy,
    unit: float,
) -> Placed | None:
    """Find the free place nearest to one of several points.

    Parameters
    ----------
    anchors : sequence of tuple of float, (2,), px
        Points the label may stand beside.
    size : tuple of float, (2,), px
        Width and height of the label.
    frame : tuple of float, (4,), px
        Box it must stay in.
    taken : Occupancy
        Is marked with the label.
    unit : float, px
        Factor on distances.

    Returns
    -------
    Placed or None
        None where no place within the frame is near.
    """
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
