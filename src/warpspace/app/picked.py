"""The point somebody asks about."""

from collections.abc import Mapping
from dataclasses import dataclass

from warpspace.kinematics.model import Loop
from warpspace.machine.description import Vector


@dataclass(frozen=True, slots=True)
class Picked:
    """A point somebody asks about; it stays where the axes stand while errors change.

    Attributes
    ----------
    at : mapping of str to float, mm or degrees
        Axis positions: those of the linear axes for a point of the surface (the rotary ones stand
        where the state has them), those of all axes for a point of a trace.
    loop : Loop or None
        Loop of a trace; None for a point of the surface, which follows the loop of the view.
    point_mm : tuple of float, (3,), mm, or None
        The traced point in the workpiece (or tool) frame; None for the surface.
    """

    at: Mapping[str, float]
    loop: Loop | None = None
    point_mm: Vector | None = None
