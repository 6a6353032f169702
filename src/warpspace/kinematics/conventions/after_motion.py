"""Component errors after the motion: they ride on the moving body."""

from typing import ClassVar

from warpspace.kinematics.conventions.convention import AxisFrames, Convention
from warpspace.machine.parameters import Parameter
from warpspace.units import Array


class AfterMotion(Convention):
    """``T = Trans(offset) · E0 · Motion · E``: the errors turn with a rotary table."""

    name: ClassVar[str] = "after_motion"
    title: ClassVar[str] = "after motion (moving body)"
    place: ClassVar[str] = "after the motion"
    meaning: ClassVar[str] = "ride on the moving body"

    def factors(
        self, constant: Array | None, motion: Array, component: Array | None
    ) -> tuple[Array | None, ...]:
        """Put component errors behind the motion."""
        return constant, motion, component

    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        """Give constants the frame before the motion, component errors the one after it."""
        return frames.before if row.is_constant else frames.after
