"""Skew factors of printer firmware: Klipper and Marlin evaluate them alike.

Klipper, klippy/extras/skew_correction.py, a port of Marlin's planner: of the diagonals AC and BD
and the side AD of a printed part, with side = √(2·AC² + 2·BD² − 4·AD²) / 2, the factor is
tan(π/2 − acos((AC² − side² − AD²) / (2·side·AD))); x is moved by −y·XY − z·(XZ − XY·YZ), and y by
−z·YZ.
"""

import math
from collections.abc import Mapping

from warpspace.formats.compensation.linear_fit import fit_linear
from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.source import Source
from warpspace.formats.terms import Affine

AXES = ("X", "Y", "Z")
PLANES = ("XY", "XZ", "YZ")
MOST = 1.0
"""Of a factor (Marlin, SKEW_FACTOR_MAX)."""
SIDE_MM = 100.0
"""Side of the part that a factor is spelled by."""


def skew_factor(ac: float, bd: float, ad: float) -> float:
    """Give the skew factor of a part from its lengths, mm.

    Raises
    ------
    ValueError
        If there is no such parallelogram.
    """
    side = math.sqrt(2.0 * ac * ac + 2.0 * bd * bd - 4.0 * ad * ad) / 2.0
    return math.tan(
        math.pi / 2.0 - math.acos((ac * ac - side * side - ad * ad) / (2.0 * side * ad))
    )


def skew_lengths(factor: float) -> tuple[float, float, float]:
    """Give diagonals and side of a rhombus that has a skew factor, mm: AC, BD, AD."""
    angle = math.pi / 2.0 - math.atan(factor)
    return 2.0 * SIDE_MM * math.cos(angle / 2.0), 2.0 * SIDE_MM * math.sin(angle / 2.0), SIDE_MM


def factor_of(lengths: tuple[float, float, float], source: Source, line: int, what: str) -> float:
    """Give the factor of measured lengths.

    Raises
    ------
    SceneError
        If no part has them.
    """
    ac, bd, ad = lengths
    # the diagonals of a parallelogram are together longer than twice a side, and differ by less
    if min(lengths) > 0.0 and ac + bd > 2.0 * ad > abs(ac - bd):
        return skew_factor(ac, bd, ad)
    found = f"{what}: AC {ac:g}, BD {bd:g}, AD {ad:g} mm are no parallelogram"
    raise source.problem(f"{found}; expected two diagonals and a side", line)


def skew_term(factors: Mapping[str, float]) -> Affine:
    """Give the corrections of skew factors by plane."""
    xy, xz, yz = (factors.get(plane, 0.0) for plane in PLANES)
    return Affine(AXES, ((0.0, -xy, -(xz - xy * yz)), (0.0, 0.0, -yz), (0.0, 0.0, 0.0)))


def fitted_factors(wanted: Wanted) -> dict[str, float]:
    """Give the factors that leave the smallest RMS over the volume."""
    found = fit_linear(wanted, (("X", "Y"), ("X", "Z"), ("Y", "Z")))
    xy, yz = -found.get(("X", "Y"), 0.0), -found.get(("Y", "Z"), 0.0)
    xz = -found.get(("X", "Z"), 0.0) + xy * yz
    return {"XY": xy, "XZ": xz, "YZ": yz}
