"""Small rigid motions that keep their digits: a rotation by its half-angle vector, and a shift.

Matrices near the unit matrix lose the digits of small angles; here every number is as small as what
it stands for, so that products and inverses are exact to its last digits.
"""

from dataclasses import dataclass

import numpy as np

from warpspace.kinematics import transforms
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array


@dataclass(frozen=True, slots=True)
class SmallMotion:
    """``Trans(shift) · Rot``, the transformation of errors, in a batch.

    Attributes
    ----------
    half : ndarray, [..., 3]
        Direction of the rotation axis times the sine of half the angle.
    shift_mm : ndarray, [..., 3], mm
    """

    half: Array
    shift_mm: Array

    @classmethod
    def from_errors(cls, shift_um: Array, turn_urad: Array) -> "SmallMotion":
        """Build the motion of errors, [..., 3] each."""
        angle = np.asarray(turn_urad, dtype=float) * RAD_PER_URAD
        size = np.linalg.norm(angle, axis=-1, keepdims=True)
        share = np.sinc(size / (2.0 * np.pi)) / 2.0  # sin(a/2) / a
        return cls(angle * share, np.asarray(shift_um, dtype=float) * MM_PER_UM)

    def to_errors(self) -> tuple[Array, Array]:
        """Give shift and rotation vector, [..., 3] each, µm and µrad."""
        sine = np.linalg.norm(self.half, axis=-1, keepdims=True)
        safe = np.where(sine > 0.0, sine, 1.0)
        share = np.where(sine > 0.0, 2.0 * np.arcsin(np.minimum(sine, 1.0)) / safe, 2.0)
        return self.shift_mm * UM_PER_MM, self.half * share * URAD_PER_RAD

    def __matmul__(self, other: "SmallMotion") -> "SmallMotion":
        """Multiply: the other motion first, then this one."""
        half = (
            self._cosine * other.half + other._cosine * self.half + np.cross(self.half, other.half)
        )
        return SmallMotion(half, self.shift_mm + other.shift_mm + self.arm(other.shift_mm))

    @property
    def _cosine(self) -> Array:
        """Cosine of half the angle, [..., 1]."""
        return np.sqrt(1.0 - np.sum(self.half**2, axis=-1, keepdims=True))

    def arm(self, lever_mm: Array) -> Array:
        """Give what the rotation alone moves a point by, ``(Rot − 1) · lever``, [..., 3], mm."""
        across = np.cross(self.half, lever_mm)
        return 2.0 * (self._cosine * across + np.cross(self.half, across))

    @property
    def inverse(self) -> "SmallMotion":
        """The motion back."""
        back = SmallMotion(-self.half, -self.shift_mm)
        return SmallMotion(-self.half, back.shift_mm + back.arm(back.shift_mm))

    def seen_from(self, pose: Array) -> "SmallMotion":
        """Give ``pose · motion · pose⁻¹``.

        Parameters
        ----------
        pose : ndarray, [..., 4, 4]
            A rigid transformation of any size.
        """
        turn, place = pose[..., :3, :3], pose[..., :3, 3]
        turned = SmallMotion(transforms.rotate(turn, self.half), np.zeros(3))
        shift = transforms.rotate(turn, self.shift_mm) - turned.arm(place)
        return SmallMotion(turned.half, shift)
