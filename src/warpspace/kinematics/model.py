"""Kinematic model: a machine, its functional points and its conventions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import Parameter, TravelDirection
from warpspace.machine.curves.curve import Coordinates
from warpspace.machine.definition import ORIGIN, Axis, Machine, Vector
from warpspace.plugins import Registry
from warpspace.units import Array

Factor: TypeAlias = Array | None  # of a product of transformations, [..., 4, 4]; None is ignored


@dataclass(frozen=True, slots=True)
class AxisFrames:
    """Nominal frames of one axis in R: where its constant and its component errors act."""

    axis: Axis
    before: Array  # [..., 4, 4]; after the offset, before the motion
    after: Array  # [..., 4, 4]; after the motion


class Convention(ABC):
    """The order of the constant errors, the motion and the component errors of an axis."""

    name: ClassVar[str]  # in scene files, for instance "after_motion"
    title: ClassVar[str]  # in lists of choices
    # place of component errors in the product, for instance "after the motion"
    place: ClassVar[str]
    meaning: ClassVar[str]  # predicate of the sentence "Component errors …"

    @abstractmethod
    def factors(self, constant: Factor, motion: Array, component: Factor) -> tuple[Factor, ...]:
        """Return the factors of the exact chain after the offset, from the frame outwards.

        Parameters
        ----------
        constant, component : ndarray, [..., 4, 4], or None
            ``Trans(δ) · Rot(ε)`` of the constant and of the component errors; None without
            errors.
        motion : ndarray, [..., 4, 4]
            Nominal motion of the axis.

        Returns
        -------
        tuple of ndarray, [..., 4, 4], or None
            Multiplied from left to right; None is ignored.
        """

    @abstractmethod
    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        """Return the nominal frame of a parameter, to first order.

        Parameters
        ----------
        frames : AxisFrames
        row : Parameter
            A constant or a component error of the axis.

        Returns
        -------
        ndarray, [..., 4, 4]
            Pose in R. Its columns are the directions of errors, its origin is the centre of
            rotations. It must be the derivative of `factors`.
        """

    @property
    def sentence(self) -> str:
        return f"Component errors {self.meaning} ({self.place})."


class AfterMotion(Convention):
    """``T = Trans(offset) · E0 · Motion · E``: the errors turn with a rotary table."""

    name = "after_motion"
    title = "after motion (moving body)"
    place = "after the motion"
    meaning = "ride on the moving body"

    def factors(self, constant: Factor, motion: Array, component: Factor) -> tuple[Factor, ...]:
        return constant, motion, component

    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        return frames.before if row.is_constant else frames.after


class BeforeMotion(Convention):
    """``T = Trans(offset) · E0 · E · Motion``: the errors keep the directions before the motion."""

    name = "before_motion"
    title = "before motion (fixed directions)"
    place = "before the motion"
    meaning = "act in fixed directions"

    def factors(self, constant: Factor, motion: Array, component: Factor) -> tuple[Factor, ...]:
        return constant, component, motion

    def frame(self, frames: AxisFrames, row: Parameter) -> Array:
        del row
        return frames.before


_CONVENTIONS: Registry[Convention] = Registry(
    "convention", {convention.name: convention for convention in (AfterMotion(), BeforeMotion())}
)
find_convention = _CONVENTIONS.find
register_convention, unregister_convention = _CONVENTIONS.register, _CONVENTIONS.unregister


def convention_names() -> tuple[str, ...]:
    return tuple(convention.name for convention in _CONVENTIONS.members())


class Loop(StrEnum):
    """Structural loop of an error."""

    TOOL = "tool"
    WORKPIECE = "workpiece"
    RELATIVE = "relative"


class ComponentErrors(StrEnum):
    """Names of the conventions for component errors that come with warpspace."""

    AFTER_MOTION = "after_motion"
    BEFORE_MOTION = "before_motion"


TOOL_AXIS: Vector = (0.0, 0.0, 1.0)  # direction of the tool axis in the tool frame


@dataclass(frozen=True, slots=True)
class Model:
    """Machine with functional points and conventions for the evaluation of its errors."""

    machine: Machine
    # name of the convention for component errors: one of `ComponentErrors`, or a registered one
    component_errors: str = ComponentErrors.AFTER_MOTION
    tool_point_mm: Vector = ORIGIN  # functional point in the tool frame
    workpiece_point_mm: Vector = ORIGIN  # functional point in the workpiece frame
    # exceptions: name of the axis and of its convention
    own_component_errors: tuple[tuple[str, str], ...] = ()
    direction: str = TravelDirection.MEAN

    def convention(self, axis: str) -> Convention:
        return find_convention(dict(self.own_component_errors).get(axis, self.component_errors))

    @property
    def convention_value(self) -> str | dict[str, str]:
        """Convention in scene files: one name, or one for each axis."""
        names = {axis: self.convention(axis).name for axis in self.machine.axes}
        distinct = {*names.values()}
        return names if len(distinct) > 1 else distinct.pop()


def batch_shape(coordinates: Coordinates) -> tuple[int, ...]:
    """Return the batch shape to which the positions of all axes broadcast."""
    return np.broadcast_shapes(*(np.shape(values) for values in coordinates.values()))


def complete_coordinates(
    machine: Machine,
    positions: Mapping[str, ArrayLike],
    default: Mapping[str, float] | None = None,
) -> dict[str, Array]:
    """Complete positions with the default ones, else zero, for every axis of the machine."""
    for name in positions:
        if name not in machine.axes:
            raise UnknownNameError("axis", name, machine.axes)
    complete = {**dict.fromkeys(machine.axes, 0.0), **(default or {}), **positions}
    coordinates = {name: _finite(name, complete[name]) for name in machine.axes}
    try:
        batch_shape(coordinates)
    except ValueError:
        shapes = ", ".join(f"{name} {values.shape}" for name, values in coordinates.items())
        raise OptionError(f"axis positions of shapes {shapes}; expected one batch shape") from None
    return coordinates


def _finite(name: str, value: ArrayLike) -> Array:
    try:
        positions = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        positions = np.asarray(np.nan)
    if not np.isfinite(positions).all():
        raise OptionError(f"axis {name} at {value!r}; expected finite numbers")
    return positions
