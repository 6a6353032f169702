"""What a convention says: where the component errors of an axis act, exactly and to first order."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from warpspace.machine.description import Axis
from warpspace.machine.parameters import Parameter
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class AxisFrames:
    """Nominal frames of one axis in R: where its constant and its component errors act.

    Attributes
    ----------
    axis : Axis
    before : ndarray, [..., 4, 4]
        After the offset, before the motion.
    after : ndarray, [..., 4, 4]
        After the motion.
    """

    axis: Axis
    before: Array
    after: Array


class Convention(ABC):
    """The order of the constant errors, the motion and the component errors of an axis.

    Attributes
    ----------
    name : str
        As scene files have it, for instance "after_motion".
    title : str
        In lists of choices.
    place : str
        Where component errors stand in the product, for instance "after the motion".
    meaning : str
        What component errors do, after the words "component errors".
    """

    name: ClassVar[str]
    title: ClassVar[str]
    place: ClassVar[str]
    meaning: ClassVar[str]

    @abstractmethod
    def factors(
        self, constant: Array | None, motion: Array, component: Array | None
    ) -> tuple[Array | None, ...]:
        """Give the factors of the exact chain behind the offset, from the frame outwards.

        Parameters
        ----------
        constant, component : ndarray, [..., 4, 4], or None
            ``Trans(δ) · Rot(ε)`` of the constant and of the component errors; None where there are
            none.
        motion : ndarray, [..., 4, 4]
            Nominal motion of the axis.

        Returns
        -------
        tuple of ndarray, [..., 4, 4], or None
            Multiplied from left to right; None is left out.
        """

    @abstractmethod
    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        """Give the nominal frame that a parameter acts in, to first order.

        Parameters
        ----------
        frames : AxisFrames
        row : Parameter
            A constant or a component error of the axis.

        Returns
        -------
        ndarray, [..., 4, 4]
            Pose in R. Its columns are the directions of errors, its origin is what rotations turn
            about. It must be the derivative of `factors`.
        """

    @property
    def short_words(self) -> str:
        """Words for the foot of a figure or page."""
        return f"component errors {self.place}"

    @property
    def sentence(self) -> str:
        """Sentence that says what the convention means, for reports."""
        return f"Component errors {self.meaning} ({self.place})."
