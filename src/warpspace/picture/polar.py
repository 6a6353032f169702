"""Polar plots of error motions, laid out: the same for the app and for figures."""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.axis_motion import LEAST, Motion
from warpspace.analysis.distribution import round_width
from warpspace.units import Array

BASE = 0.62
"""Radius of the circle of no deviation; the plot reaches to 1."""
RINGS = 2
"""Rings of round deviations on either side of it."""
REACH = 0.36
"""Room that these take on either side."""
WORDS = {1: "once a turn", 2: "twice a turn"}


@dataclass(frozen=True, slots=True)
class PolarPlot:
    """One deviation around the position of its axis: 0° to the right, counter-clockwise.

    Attributes
    ----------
    ring : float, µm or µrad
        Deviation from one ring to the next.
    rings : tuple of (float, float)
        Deviation and radius of every ring, outwards; zero is the circle of no deviation.
    curve, about_line : ndarray, [n, 2]
        The deviation, and what remains of it about the axis average line.
    varies : bool
        Whether there is any deviation.
    """

    ring: float
    rings: tuple[tuple[float, float], ...]
    curve: Array
    about_line: Array
    varies: bool


def polar_plot(motion: Motion, angle_deg: Array) -> PolarPlot:
    """Lay out the polar plot of a deviation.

    Parameters
    ----------
    motion : Motion
    angle_deg : ndarray, [n], degrees
        Position of the axis.
    """
    largest = float(max(np.abs(motion.values).max(), np.abs(motion.about_line).max()))
    varies = largest > LEAST
    ring = round_width(largest / RINGS * (1.0 - 1e-6)) if varies else 1.0
    per_unit = REACH / (RINGS * ring)
    theta = np.deg2rad(angle_deg)
    ways = np.stack([np.cos(theta), np.sin(theta)], axis=-1)

    def place(values: Array) -> Array:
        return (BASE + per_unit * values)[:, None] * ways

    steps = range(-RINGS, RINGS + 1)
    return PolarPlot(
        ring,
        tuple((step * ring, BASE + per_unit * step * ring) for step in steps),
        place(motion.values),
        place(motion.about_line),
        varies,
    )


def turn_words(times: int | None) -> str:
    """Say how often a deviation comes back: ``twice a turn``; a dash where it does not vary."""
    return "–" if times is None else WORDS.get(times, f"{times} times a turn")
