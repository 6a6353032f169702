"""What readings of several tests have in common: circles (ISO 230-4), and charts laid out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Lines
from warpspace.analysis.distribution import round_width
from warpspace.bench.plan import Plan
from warpspace.units import UM_PER_MM_URAD, Array

# --- What a circle of radial readings comes to ----------------------------------------------------
# Centre, radius, ellipse, hysteresis (ISO 230-4).

FULL_DEG = 314.0
"""Arcs that reach so far round count as full circles: eight points have gaps of 45°."""
HALF_DEG = 180.0
"""An ellipse is told from a displaced centre from half a circle upwards."""


@dataclass(frozen=True)
class CircleFit:
    """Parts of a trace of radial readings."""

    radial_um: Array  # [m]; readings about the least-squares centre
    centre_um: tuple[float, float]
    radius_um: float  # mean radius minus nominal radius
    # largest minus smallest radial deviation of all readings about the one centre: G(b), or G where
    # one sense was run
    deviation_um: float
    # µm; G, the same of each sense about its own centre: +1 counter-clockwise, −1 clockwise
    by_sense: Mapping[float, float]
    # D, radius of the least-squares circle of both senses minus nominal radius
    mean_radial_um: float | None
    # H, largest difference between the senses at one angle. Both None where one sense was run.
    hysteresis_um: float | None
    # out of the sin 2φ and cos 2φ parts; None on arcs that are too short
    squareness_urad: float | None
    scale_difference_um: float


def covered_deg(angle_deg: Array) -> float:
    """Tell how far round angles reach: the turn less the largest gap, degrees."""
    sorted_deg = np.unique(np.round(np.mod(angle_deg, 360.0), 6))
    gaps = np.diff(np.append(sorted_deg, sorted_deg[0] + 360.0))
    return 360.0 - float(gaps.max())


def is_full(angle_deg: Array) -> bool:
    """Tell whether angles go all the way round."""
    return covered_deg(angle_deg) >= FULL_DEG


def fit_circle_readings(plan: Plan, readings: Array) -> CircleFit:
    """Fit centre, radius and ellipse to the readings, [m], µm, of a circular plan.

    Its marks are angle_deg, sense, along, up (the direction of the bar along the two axes of the
    plane), radius_mm and gain_sign. With the mark as_read the centre is an error of the machine,
    not of the set-up, and stays in: the ball beside a rotary axis turns with it.

    Notes
    -----
    Least squares of ``1, cos φ, sin φ, cos 2φ, sin 2φ``; of the first three where the arc is
    shorter than half a circle. A squareness γ gives ∓γ·R/2·sin 2φ. G and G(b) are ranges about the
    least-squares centre, never less than the width of the narrowest ring about the path; which of
    the two ISO 230-4 means could not be seen.
    """
    marks = plan.marks
    along, up, sense = marks["along"], marks["up"], marks["sense"]
    design = np.stack([np.ones(len(along)), along, up, along**2 - up**2, 2.0 * along * up], -1)
    as_read = "as_read" in marks

    def centred(rows: NDArray[np.bool_]) -> tuple[Array, Array]:
        elliptic = covered_deg(marks["angle_deg"][rows]) >= HALF_DEG - 1e-6
        part = design[rows, : 5 if elliptic else 3]
        fit = np.asarray(np.linalg.lstsq(part, readings[rows], rcond=None)[0], dtype=np.float64)
        kept = readings[rows]
        return fit, kept if as_read else kept - part[:, 1:3] @ fit[1:3]

    fit, radial = centred(np.ones(len(readings), dtype=bool))
    elliptic = len(fit) == 5
    squareness = None
    if elliptic:
        gain = marks["gain_sign"][0] * marks["radius_mm"][0] * UM_PER_MM_URAD
        squareness = float(2.0 * fit[4] / gain)
    senses = [sign for sign in (1.0, -1.0) if (sense == sign).any()]
    both = len(senses) == 2
    return CircleFit(
        radial,
        (float(fit[1]), float(fit[2])),
        float(fit[0]),
        float(np.ptp(radial)),
        {sign: float(np.ptp(centred(sense == sign)[1])) for sign in senses},
        float(np.linalg.lstsq(design[:, :3], readings, rcond=None)[0][0]) if both else None,
        _hysteresis(marks["angle_deg"], sense, radial) if both else None,
        squareness,
        float(fit[3]) if elliptic else 0.0,
    )


def _hysteresis(angle_deg: Array, sense: Array, radial: Array) -> float:
    turned = np.mod(angle_deg, 360.0)
    one, other = sense > 0.0, sense < 0.0
    order = np.argsort(turned[other], kind="stable")
    there = np.interp(turned[one], turned[other][order], radial[other][order], period=360.0)
    return float(np.abs(radial[one] - there).max())


# --- Charts laid out: the same for the app and for figures ----------------------------------------

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
    """A polar chart: 0° to the right, counter-clockwise."""

    ring: float  # µm or µrad; deviation from one ring to the next
    unit: str
    # deviation and radius of every ring, outwards; zero is the circle of no deviation
    rings: tuple[tuple[float, float], ...]
    curves: tuple[Array, ...]  # [n, 2]; in the order of the chart's


def lay_polar(chart: Lines) -> PolarLayout:
    """Lay out a polar chart."""
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
