"""The stack of bodies under the workpiece while it is built."""

from dataclasses import dataclass

from warpspace.units import Array


@dataclass
class Stack:
    """The stack of bodies under the workpiece while it is built from the top downwards.

    Attributes
    ----------
    centre_mm : ndarray, [2], mm
        Its middle in plan view.
    half_mm : ndarray, [2], mm
        Half edges of its lowest body so far.
    bed_mm : float
        Height of its lower side so far; in the end the top of the bed, mm.
    swept_mm : ndarray, [2], mm
        Half edges of what the moving stack sweeps.
    """

    centre_mm: Array
    half_mm: Array
    bed_mm: float
    swept_mm: Array

    def plan(self, grow: float = 1.0) -> tuple[tuple[float, float], tuple[float, float]]:
        """Give its ranges along x and y, mm."""
        low, high = self.centre_mm - grow * self.half_mm, self.centre_mm + grow * self.half_mm
        return (low[0], high[0]), (low[1], high[1])
