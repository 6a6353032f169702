"""The point somebody asks about."""

from collections.abc import Mapping
from dataclasses import dataclass

from warpspace.app.state.leaf import Unreadable, spell_numbers
from warpspace.kinematics.model import Loop
from warpspace.machine.description import Vector
from warpspace.scene.files import parse_number

TRACE_EXPECTED = "expected a loop and a traced point"
FARTHEST_MM = 1e5  # farthest point of a workpiece that a link may ask about


@dataclass(frozen=True, slots=True)
class Picked:
    """A point somebody asks about; it stays where the axes stand while errors change."""

    # mm or degrees; axis positions: those of the linear axes for a point of the surface (the rotary
    # ones stand where the state has them), those of all axes for a point of a trace
    at: Mapping[str, float]
    # loop of a trace; None for a point of the surface, which follows the loop of the view
    loop: Loop | None = None
    # or None; the traced point in the workpiece (or tool) frame; None for the surface
    point_mm: Vector | None = None


def spell_trace(picked: Picked) -> str:
    """Spell which trace a point lies on: loop and traced point; `read_trace` reads it back."""
    return f"{picked.loop},{spell_numbers(picked.point_mm or ())}"


def read_trace(text: str) -> Picked:
    """Read which trace a point lies on; where the axes stand is still to come."""
    loop, _, point = text.partition(",")
    try:
        x, y, z = map(parse_number, point.split(","))
    except ValueError:
        raise Unreadable(TRACE_EXPECTED) from None
    if loop not in [*Loop] or max(abs(x), abs(y), abs(z)) > FARTHEST_MM:
        raise Unreadable(TRACE_EXPECTED)
    return Picked({}, Loop(loop), (x, y, z))
