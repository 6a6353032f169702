"""Errors of one axis as rigid motions along it, and their conversion back to curves."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import motion
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.axes import DIRECTIONS, TravelDirection
from warpspace.machine.curves.curve import ErrorFunction, Span
from warpspace.machine.curves.polynomial_pieces import SMALL, Pieces, fit_curves
from warpspace.machine.curves.simple import Constant, Directional
from warpspace.machine.curves.table import TableCurve
from warpspace.machine.errors import ErrorSet
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array

# A rotation by its half-angle vector, and a shift.
#
# Matrices near the identity lose the digits of small angles; here all numbers are small, so that
# products and inverses are exact to the last digit.


@dataclass(frozen=True, slots=True)
class SmallMotion:
    """``Trans(shift) · Rot``, the transformation of errors, in a batch."""

    half: Array  # [..., 3]; direction of the rotation axis times the sine of half the angle
    shift_mm: Array  # [..., 3]

    @classmethod
    def from_errors(cls, shift_um: Array, turn_urad: Array) -> "SmallMotion":
        """Build the motion of errors, [..., 3] each."""
        angle = np.asarray(turn_urad, dtype=float) * RAD_PER_URAD
        size = np.linalg.norm(angle, axis=-1, keepdims=True)
        share = np.sinc(size / (2.0 * np.pi)) / 2.0  # sin(a/2) / a
        return cls(angle * share, np.asarray(shift_um, dtype=float) * MM_PER_UM)

    def to_errors(self) -> tuple[Array, Array]:
        """Return shift and rotation vector, [..., 3] each, µm and µrad."""
        sine = np.linalg.norm(self.half, axis=-1, keepdims=True)
        safe = np.where(sine > 0.0, sine, 1.0)
        share = np.where(sine > 0.0, 2.0 * np.arcsin(np.minimum(sine, 1.0)) / safe, 2.0)
        return self.shift_mm * UM_PER_MM, self.half * share * URAD_PER_RAD

    def __matmul__(self, other: "SmallMotion") -> "SmallMotion":
        """Multiply: the other motion first, then this one."""
        half = (
            self._cosine * other.half + other._cosine * self.half + np.cross(self.half, other.half)
        )
        return SmallMotion(half, self.shift_mm + other.shift_mm + self.displacement(other.shift_mm))

    @property
    def _cosine(self) -> Array:
        return np.sqrt(1.0 - np.sum(self.half**2, axis=-1, keepdims=True))

    def displacement(self, lever_mm: Array) -> Array:
        """Compute the displacement by the rotation, ``(Rot − 1) · lever``, [..., 3], mm."""
        across = np.cross(self.half, lever_mm)
        return 2.0 * (self._cosine * across + np.cross(self.half, across))

    @property
    def inverse(self) -> "SmallMotion":
        rotation = SmallMotion(-self.half, np.zeros(3))
        return SmallMotion(-self.half, -self.shift_mm - rotation.displacement(self.shift_mm))

    def conjugate(self, pose: Array) -> "SmallMotion":
        """Compute ``pose · motion · pose⁻¹`` for poses, [..., 4, 4], of any size."""
        turn, place = pose[..., :3, :3], pose[..., :3, 3]
        turned = SmallMotion(transforms.rotate(turn, self.half), np.zeros(3))
        shift = transforms.rotate(turn, self.shift_mm) - turned.displacement(place)
        return SmallMotion(turned.half, shift)


Along = Callable[[Array, SmallMotion], SmallMotion]
"""Function from positions, [n], and their component errors to other component errors."""


@dataclass(frozen=True, slots=True)
class AxisErrors:
    """Errors of one axis, read as motions and written as curves."""

    model: Model
    errors: ErrorSet
    axis: str
    span: Span  # mm or degrees; range over which the conversion holds

    @property
    def order(self) -> str:
        name = self.model.convention(self.axis).name
        if name not in [*ComponentErrors]:
            names = ", ".join(ComponentErrors)
            raise OptionError(
                f"convention {name!r} of {self.axis} cannot be converted; only {names}"
            )
        return name

    def keys(self, *, constant: bool = False) -> tuple[str, ...]:
        """Keys of the six component or constant errors: shifts, then rotations."""
        return tuple(f"E{letter}{'0' * constant}{self.axis}" for letter in DIRECTIONS)

    def pose(self, position: Array) -> Array:
        """Nominal motion of the axis, [..., 4, 4]."""
        return motion(self.model.machine.axes[self.axis], position)

    def at(self, position: Array, direction: str = TravelDirection.MEAN) -> SmallMotion:
        """Evaluate the component errors at positions, [n], without those of two arguments."""
        along = {self.axis: np.asarray(position, dtype=float)}
        values = [
            np.zeros(along[self.axis].shape)
            if self.depends_on_others(key)
            else self.errors.evaluate_at(key, along, direction)
            for key in self.keys()
        ]
        return SmallMotion.from_errors(np.stack(values[:3], -1), np.stack(values[3:], -1))

    def depends_on_others(self, key: str) -> bool:
        """Check whether an error depends on another axis as well."""
        return any(axis != self.axis for axis in self.errors.arguments(key))

    @property
    def constant(self) -> SmallMotion:
        values = [self.errors.amplitude(key) for key in self.keys(constant=True)]
        return SmallMotion.from_errors(np.array(values[:3]), np.array(values[3:]))

    @property
    def kinks(self) -> Array:
        functions = [self.errors.functions.get(key) for key in self.keys()]
        return np.unique(np.concatenate([np.zeros(0), *(f.kinks for f in functions if f)]))

    def points(self, key: str) -> tuple[float, ...]:
        function = self.errors.functions.get(key)
        if isinstance(function, Pieces):
            return function.points
        return function.kinks if isinstance(function, TableCurve) else ()

    def with_components(self, along: Along, *, adds: bool = False) -> ErrorSet:
        self.refuse_two_arguments(adds=adds)
        directions = [TravelDirection.MEAN]
        functions = [self.errors.functions.get(key) for key in self.keys()]
        if any(function and function.has_directions for function in functions):
            directions = [TravelDirection.FORWARD, TravelDirection.BACKWARD]
        changes = [
            fit_curves(self._changes(along, direction), self.span, self.kinks)
            for direction in directions
        ]
        new = [
            fit_curves(self._values(along, direction), self.span, self.kinks)
            for direction in directions
        ]
        chosen = dict(self.errors.functions)
        for index, key in enumerate(self.keys()):
            if all(change[index] is None for change in changes):
                continue
            if self.depends_on_others(key):
                raise OptionError(
                    f"{key} depends on {' and '.join(self.errors.arguments(key))} and would change"
                    " along one of them; this cannot be converted exactly"
                )
            curve = _joined([curves[index] for curves in new], self.span)
            chosen.pop(key, None)
            if isinstance(curve, Pieces):
                curve = replace(curve, points=self.points(key))
            if curve is not None:
                chosen[key] = curve
        return ErrorSet(chosen)

    def refuse_two_arguments(self, *, adds: bool) -> None:
        """Raise OptionError for errors of two arguments that the conversion would change."""
        for key in self.keys():
            if self.depends_on_others(key) and not (adds and key[1] in DIRECTIONS[:3]):
                other = " and ".join(self.errors.arguments(key))
                raise OptionError(
                    f"{key} depends on {other}; errors of {self.axis} cannot be converted exactly"
                    " with it"
                )

    def _values(self, along: Along, direction: str) -> Callable[[Array], Array]:
        def values(position: Array) -> Array:
            return np.concatenate(
                along(position, self.at(position, direction)).to_errors(), axis=-1
            )

        return values

    def _changes(self, along: Along, direction: str) -> Callable[[Array], Array]:
        values = self._values(along, direction)

        def changes(position: Array) -> Array:
            present = np.concatenate(self.at(position, direction).to_errors(), axis=-1)
            difference = values(position) - present
            return np.where(np.abs(difference) > 1e-14 * np.abs(present), difference, 0.0)

        return changes

    def with_constant(self, constant: SmallMotion) -> ErrorSet:
        """Return the set with other constant errors of the axis, without those that are zero."""
        values = np.concatenate(constant.to_errors(), axis=-1)
        chosen = dict(self.errors.functions)
        for key, value in zip(self.keys(constant=True), values.tolist(), strict=True):
            if abs(value - self.errors.amplitude(key)) <= SMALL:
                continue
            chosen.pop(key, None)
            if abs(value) > SMALL:
                chosen[key] = Constant(self.span, value)
        return ErrorSet(chosen)


def _joined(curves: list[ErrorFunction | None], span: Span) -> ErrorFunction | None:
    forward, backward = curves[0], curves[-1]
    if forward == backward:
        return forward
    return Directional(span, forward or Constant(span), backward or Constant(span))
