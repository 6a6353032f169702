"""Reference lines of straightness and squareness: end points, least squares, minimum zone."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpspace.units import Array

REFERENCES = ("end_points", "least_squares", "minimum_zone")
"""ISO 230-1, 3.4.10 to 3.4.12."""
WORDS = {
    "end_points": "end-point line",
    "least_squares": "least-squares line",
    "minimum_zone": "minimum-zone line",
}


@dataclass(frozen=True, slots=True)
class ReferenceLine:
    """A straight line through deviations.

    Attributes
    ----------
    name : str
        One of `REFERENCES`.
    slope : float, µrad
        µm per mm, times a thousand.
    offset : float, µm
        At position zero.
    deviation_um : float, µm
        Largest minus smallest distance from the line.
    """

    name: str
    slope: float
    offset: float
    deviation_um: float

    def at(self, position_mm: Array) -> Array:
        """Give the line at positions, [n], µm."""
        return self.offset + self.slope * 1e-3 * position_mm


def reference_lines(position_mm: Array, deviation_um: Array) -> dict[str, ReferenceLine]:
    """Lay the three reference lines through deviations.

    Parameters
    ----------
    position_mm : ndarray, [n], mm
        At least two different ones.
    deviation_um : ndarray, [n], µm

    Returns
    -------
    dict of str to ReferenceLine

    Notes
    -----
    The minimum zone is the one of smallest height: two parallel lines that hold all points, one of
    which lies on an edge of their convex hull.
    """
    order = np.argsort(position_mm, kind="stable")
    x, y = position_mm[order], deviation_um[order]
    middle = x.mean()
    spread = x - middle
    slopes = {
        "end_points": (y[-1] - y[0]) / (x[-1] - x[0]),
        "least_squares": float(spread @ (y - y.mean()) / (spread @ spread)),
        "minimum_zone": _narrowest(x, y),
    }
    found: dict[str, ReferenceLine] = {}
    for name, slope in slopes.items():
        rest = y - slope * x
        low, high = float(rest.min()), float(rest.max())
        offset = {
            "end_points": float(rest[0]),
            "least_squares": float(y.mean() - slope * middle),
            "minimum_zone": (low + high) / 2.0,
        }[name]
        found[name] = ReferenceLine(name, float(slope) * 1e3, offset, high - low)
    return found


def _narrowest(x: Array, y: Array) -> float:
    """Slope of the narrowest band around points in order of x."""
    edges = sorted({*_hull_slopes(x, y), *_hull_slopes(x, -y, -1.0)})

    def height(number: int) -> float:
        return float(np.ptp(y - edges[number] * x))

    low, high = 0, len(edges) - 1  # the height is a convex function of the slope
    while low < high:
        middle = (low + high) // 2
        if height(middle) <= height(middle + 1):
            high = middle
        else:
            low = middle + 1
    return edges[low]


def _hull_slopes(x: Array, y: Array, sign: float = 1.0) -> list[float]:
    """Slopes of the lower side of a convex hull, points in order of x."""
    hull: list[tuple[float, float]] = []
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        if hull and hull[-1][0] == px:
            if hull[-1][1] <= py:
                continue
            hull.pop()
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (by - ay) * (px - ax) < (py - ay) * (bx - ax):
                break
            hull.pop()
        hull.append((px, py))
    return [sign * (by - ay) / (bx - ax) for (ax, ay), (bx, by) in pairwise(hull)]
