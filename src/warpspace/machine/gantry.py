"""A gantry: one linear axis on two parallel guides, each with a positioning error of its own."""

from dataclasses import dataclass

from warpspace.machine.axes import direction_index

ACROSS = "xyz"
"""Directions in which the guides of a gantry may lie apart."""
_DEFAULT_ACROSS = {"x": "y", "y": "x", "z": "x"}
URAD_PER_UM_OVER_MM = 1000.0
"""A micrometre over a millimetre is a milliradian."""


@dataclass(frozen=True, slots=True)
class Gantry:
    """Two guides of one axis.

    Attributes
    ----------
    axis : str
        Name of a linear axis.
    span_mm : float, mm
        Distance between the guides: the first one lies at −span/2 of the origin of the axis's
        frame, the second at +span/2.
    across : str
        Direction from the first guide to the second: "x", "y" or "z", not that of the axis.
    """

    axis: str
    span_mm: float
    across: str

    @property
    def positioning_key(self) -> str:
        """Key of the positioning error of the axis, which is the mean of the guides'."""
        return f"E{'XYZ'[direction_index(self.axis)]}{self.axis}"

    @property
    def rotation_key(self) -> str:
        """Key of the rotation that the difference between the guides gives."""
        third = 3 - direction_index(self.axis) - ACROSS.index(self.across)
        return f"E{'ABC'[third]}{self.axis}"

    @property
    def rotation_weight(self) -> float:
        """Rotation for each micrometre that the second guide is ahead of the first, µrad/µm.

        Notes
        -----
        A rotation c about the third direction moves a point at p of the direction across by
        c·p·(third × across) along the axis. That is −c·p for X across y, and where the axis, the
        direction across and the third one follow each other like x, y, z; +c·p otherwise.
        """
        cyclic = (ACROSS.index(self.across) - direction_index(self.axis)) % 3 == 1
        return (-1.0 if cyclic else 1.0) * URAD_PER_UM_OVER_MM / self.span_mm


def default_across(axis: str) -> str:
    """Give the direction across that none is given for: the other horizontal one; x for Z."""
    return _DEFAULT_ACROSS["xyz"[direction_index(axis)]]
