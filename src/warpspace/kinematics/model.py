"""What the kinematic functions work on: a machine, its functional points and its conventions."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics.conventions.convention import Convention
from warpspace.kinematics.conventions.registry import find_convention
from warpspace.machine.description import ORIGIN, Machine, Vector
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

Coordinates = Mapping[str, Array]
"""Axis to positions, [...], broadcastable: mm for linear axes, degrees for rotary ones."""


class Loop(StrEnum):
    """Which structural loop an error is looked at through."""

    TOOL = "tool"
    WORKPIECE = "workpiece"
    RELATIVE = "relative"


class ComponentErrors(StrEnum):
    """Names of the conventions for component errors that come with warpspace."""

    AFTER_MOTION = "after_motion"
    BEFORE_MOTION = "before_motion"


TOOL_AXIS: Vector = (0.0, 0.0, 1.0)
"""Direction of the tool axis in the tool frame."""


@dataclass(frozen=True, slots=True)
class Model:
    """A machine with the points and conventions its errors are evaluated with.

    Attributes
    ----------
    machine : Machine
    component_errors : str
        Name of the convention for component errors: one of `ComponentErrors`, or one that was
        registered.
    own_component_errors : tuple of (str, str)
        Axes that have another one: name of the axis and of its convention.
    tool_point_mm : tuple of float, (3,), mm
        Functional point in the tool frame.
    workpiece_point_mm : tuple of float, (3,), mm
        Functional point in the workpiece frame.
    """

    machine: Machine
    component_errors: str = ComponentErrors.AFTER_MOTION
    tool_point_mm: Vector = ORIGIN
    workpiece_point_mm: Vector = ORIGIN
    own_component_errors: tuple[tuple[str, str], ...] = ()
    direction: str = TravelDirection.MEAN

    def convention(self, axis: str) -> Convention:
        """Give the convention for the component errors of an axis.

        Raises
        ------
        UnknownNameError
            If no convention has the name.
        """
        return find_convention(dict(self.own_component_errors).get(axis, self.component_errors))

    @property
    def convention_names(self) -> tuple[str, ...]:
        """Names of the conventions that axes of the machine have, each once."""
        return tuple(dict.fromkeys(self.convention(axis).name for axis in self.machine.axes))

    @property
    def convention_value(self) -> str | dict[str, str]:
        """The convention as scene files spell it: one name, or the name of each axis."""
        names = self.convention_names
        if len(names) == 1:
            return names[0]
        return {axis: self.convention(axis).name for axis in self.machine.axes}


def batch_shape(coordinates: Coordinates) -> tuple[int, ...]:
    """Give the batch shape that the positions of all axes broadcast to."""
    return np.broadcast_shapes(*(np.shape(values) for values in coordinates.values()))


def complete_coordinates(
    machine: Machine, given: Mapping[str, ArrayLike], default: Mapping[str, float] | None = None
) -> dict[str, Array]:
    """Give every axis of the machine a position.

    Parameters
    ----------
    machine : Machine
    given : mapping of str to array_like, [...], mm or degrees
        Positions by axis.
    default : mapping of str to float, optional
        Positions of the axes not given; zero where absent.

    Returns
    -------
    dict of str to ndarray, [...], mm or degrees

    Raises
    ------
    UnknownNameError
        If an axis is given that the machine does not have.
    OptionError
        If a position is no finite number, or the batches do not fit together.
    """
    for name in given:
        if name not in machine.axes:
            raise UnknownNameError("axis", name, machine.axes)
    complete = {**dict.fromkeys(machine.axes, 0.0), **(default or {}), **given}
    positions = {name: _finite(name, complete[name]) for name in machine.axes}
    try:
        batch_shape(positions)
    except ValueError:
        shapes = ", ".join(f"{name} {values.shape}" for name, values in positions.items())
        raise OptionError(f"axis positions of shapes {shapes}; expected one batch shape") from None
    return positions


def _finite(name: str, value: ArrayLike) -> Array:
    """Give the positions of one axis as an array of finite numbers."""
    try:
        positions = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        positions = np.asarray(np.nan)
    if not np.isfinite(positions).all():
        raise OptionError(f"axis {name} at {value!r}; expected finite numbers")
    return positions
