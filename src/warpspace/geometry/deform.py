"""Exaggerated displacement: the one place where errors become something to look at."""

import math

from warpspace.machine.limits import EXAGGERATION
from warpspace.units import MM_PER_UM, Array

TARGET_FRACTION = 0.1
"""Largest displacement on screen, as a fraction of the volume's longest edge, that auto aims at."""
NEUTRAL_EXAGGERATION = 1000.0
"""What auto chooses where nothing is displaced."""
_ROUND = (1.0, 2.0, 5.0, 10.0)


def deform(nominal_mm: Array, error_um: Array, exaggeration: float) -> Array:
    """Displace points by their exaggerated error.

    Parameters
    ----------
    nominal_mm : ndarray, [..., 3], mm
    error_um : ndarray, [..., 3], µm
    exaggeration : float
        Display factor; 1 is true scale.

    Returns
    -------
    ndarray, [..., 3], mm
        Where the points are drawn.
    """
    return nominal_mm + (exaggeration * MM_PER_UM) * error_um


def auto_exaggeration(largest_um: float, longest_edge_mm: float) -> float:
    """Choose a round display factor.

    Parameters
    ----------
    largest_um : float, µm
        Largest displacement.
    longest_edge_mm : float, mm
        Longest edge of the volume.

    Returns
    -------
    float
        The number 1, 2 or 5 × 10ⁿ nearest (in ratio) to the one that makes the largest displacement
        a tenth of the longest edge; 1000 where nothing is displaced.
    """
    largest_mm = largest_um * MM_PER_UM  # zero also where an error is too small to be divided by
    if not largest_mm > 0.0 or not longest_edge_mm > 0.0:
        return NEUTRAL_EXAGGERATION
    wanted = TARGET_FRACTION * longest_edge_mm / largest_mm
    wanted = min(max(wanted, 1.0), EXAGGERATION[1])
    decade = 10.0 ** math.floor(math.log10(wanted))
    return min((step * decade for step in _ROUND), key=lambda value: abs(math.log(value / wanted)))


def round_down(value: float) -> float:
    """Give the largest 1, 2 or 5 × 10ⁿ that is not above a positive value (scale bars)."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step * decade for step in _ROUND if step * decade <= value * (1.0 + 1e-9))
