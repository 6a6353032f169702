"""Component errors before the motion: they act in fixed directions."""

from typing import ClassVar

from warpspace.kinematics.conventions.convention import AxisFrames, Convention
from warpspace.machine.parameters import Parameter
from warpspace.units import Array


class BeforeMotion(Convention):
    """``T = Trans(offset) · E0 · E · Motion``: the errors keep the directions before the motion."""

    name: ClassVar[str] = "before_motion"
    title: ClassVar[str] = "before motion (fixed directions)"
    place: ClassVar[str] = "before the motion"
    meaning: ClassVar[str] = "act in fixed directions"

    def factors(
        self, constant: Array | None, motion: Array, component: Array | None
    ) -> tuple[Array | None, ...]:
        """Put component errors in front of the motion."""
        return constant, component, motion

    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        """Give all errors the frame before the motion."""
        del row
        return frames.before
