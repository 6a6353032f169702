"""What a circle of radial readings comes to: centre, radius, ellipse, hysteresis (ISO 230-4)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.bench.plan import Plan
from warpspace.units import UM_PER_MM_URAD, Array

FULL_DEG = 314.0
"""Arcs that reach so far round count as full circles: eight points have gaps of 45°."""
HALF_DEG = 180.0
"""An ellipse is told from a displaced centre from half a circle upwards."""


@dataclass(frozen=True)
class CircleFit:
    """Parts of a trace of radial readings.

    Attributes
    ----------
    radial_um : ndarray, [m], µm
        Readings about the least-squares centre.
    centre_um : tuple of float, (2,), µm
    radius_um : float, µm
        Mean radius minus nominal radius.
    deviation_um : float, µm
        Largest minus smallest radial deviation of all readings: bidirectional circular deviation.
    by_sense : mapping of float to float, µm
        The same of each sense, about the one centre: +1 counter-clockwise, −1 clockwise.
    hysteresis_um : float or None, µm
        Largest difference between the senses at one angle; None where only one was run.
    squareness_urad, scale_difference_um : float or None
        Out of the sin 2φ and cos 2φ parts; None on arcs that are too short.
    """

    radial_um: Array
    centre_um: tuple[float, float]
    radius_um: float
    deviation_um: float
    by_sense: Mapping[float, float]
    hysteresis_um: float | None
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
    """Fit centre, radius and ellipse to the readings of a circular plan.

    Parameters
    ----------
    plan : Plan
        With marks angle_deg, sense, along, up (the direction of the bar along the two axes of the
        plane), radius_mm and gain_sign. With the mark as_read the centre is an error of the
        machine, not of the set-up, and stays in: the ball beside a rotary axis turns with it.
    readings : ndarray, [m], µm

    Returns
    -------
    CircleFit

    Notes
    -----
    Least squares of ``1, cos φ, sin φ, cos 2φ, sin 2φ``; of the first three where the arc is
    shorter than half a circle. A squareness γ gives ∓γ·R/2·sin 2φ. ISO 230-4, 3.3 to 3.6.
    """
    marks = plan.marks
    along, up, sense = marks["along"], marks["up"], marks["sense"]
    parts = [np.ones(len(along)), along, up]
    elliptic = covered_deg(marks["angle_deg"]) >= HALF_DEG - 1e-6
    if elliptic:
        parts += [along**2 - up**2, 2.0 * along * up]
    design = np.stack(parts, -1)
    fit = np.linalg.lstsq(design, readings, rcond=None)[0]
    as_read = "as_read" in marks
    radial = readings if as_read else readings - design[:, 1:3] @ fit[1:3]
    squareness = None
    if elliptic:
        gain = marks["gain_sign"][0] * marks["radius_mm"][0] * UM_PER_MM_URAD
        squareness = float(2.0 * fit[4] / gain)
    senses = [sign for sign in (1.0, -1.0) if (sense == sign).any()]
    return CircleFit(
        radial,
        (float(fit[1]), float(fit[2])),
        float(fit[0]),
        float(np.ptp(radial)),
        {sign: float(np.ptp(radial[sense == sign])) for sign in senses},
        _hysteresis(marks["angle_deg"], sense, radial) if len(senses) == 2 else None,
        squareness,
        float(fit[3]) if elliptic else 0.0,
    )


def _hysteresis(angle_deg: Array, sense: Array, radial: Array) -> float:
    """Largest difference between the senses, at the angles of the first."""
    turned = np.mod(angle_deg, 360.0)
    one, other = sense > 0.0, sense < 0.0
    order = np.argsort(turned[other], kind="stable")
    there = np.interp(turned[one], turned[other][order], radial[other][order], period=360.0)
    return float(np.abs(radial[one] - there).max())
