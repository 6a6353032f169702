"""Charts laid out: the same for the app and for figures."""

import math
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.distribution import round_width
from warpspace.bench.outcome import Chart
from warpspace.units import Array

BASE = 0.62
"""Radius of the circle of no deviation; the plot reaches to 1."""
RINGS = 2
"""Rings of round deviations on either side of it."""
REACH = 0.36
"""Room that these take on either side."""
LEAST = 1e-3
"""A nanometre: charts draw smaller deviations, µm or µrad, as none."""


@dataclass(frozen=True, slots=True)
class PolarLayout:
    """A polar chart: 0° to the right, counter-clockwise.

    Attributes
    ----------
    ring : float, µm or µrad
        Deviation from one ring to the next.
    unit : str
    rings : tuple of (float, float)
        Deviation and radius of every ring, outwards; zero is the circle of no deviation.
    curves : tuple of ndarray, [n, 2]
        In the order of the chart's.
    """

    ring: float
    unit: str
    rings: tuple[tuple[float, float], ...]
    curves: tuple[Array, ...]


def lay_polar(chart: Chart) -> PolarLayout:
    """Lay out a polar chart.

    Parameters
    ----------
    chart : Chart
        Of kind "polar".

    Returns
    -------
    PolarLayout
    """
    largest = max((float(np.abs(curve.y).max()) for curve in chart.curves), default=0.0)
    ring = round_width(largest / RINGS * (1.0 - 1e-6)) if largest > LEAST else 1.0
    per_unit = REACH / (RINGS * ring)
    curves: list[Array] = []
    for curve in chart.curves:
        theta = np.deg2rad(curve.x)
        radius = BASE + per_unit * curve.y
        curves.append(np.stack([radius * np.cos(theta), radius * np.sin(theta)], axis=-1))
    unit = "µrad" if "µrad" in chart.y_label else "µm"
    rings = tuple((step * ring, BASE + per_unit * step * ring) for step in range(-RINGS, RINGS + 1))
    return PolarLayout(ring, unit, rings, tuple(curves))


def round_factor(most: float) -> float:
    """Give the largest of 1, 2, 5 × 10ⁿ that is not above a number."""
    if not most > 0.0 or not math.isfinite(most):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(most))
    return decade * next(step for step in (5.0, 2.0, 1.0) if step * decade <= most * (1.0 + 1e-9))
