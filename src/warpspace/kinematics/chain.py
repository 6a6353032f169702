"""The exact chain: every transformation in full, multiplied out.

Per axis ``T = Trans(offset) · Rot(fixed) · E0 · Motion(direction·q) · E(q)``, or what another
convention makes of the last three; E0 and E(q) are ``Trans(δ) · Rot(ε)`` with the full rotation of
the vector ε.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from warpspace.kinematics import components, transforms
from warpspace.kinematics.components import Triple
from warpspace.kinematics.model import (
    TOOL_AXIS,
    AxisFrames,
    Coordinates,
    Loop,
    Model,
)
from warpspace.machine.axes import DIRECTIONS
from warpspace.machine.description import Axis, Vector
from warpspace.units import MM_PER_UM, RAD_PER_URAD, Array

ErrorValues = Mapping[str, Array]
"""Parameter key to values at the coordinates, [...], µm or µrad."""


def motion(axis: Axis, position: Array) -> Array:
    """Build the nominal motion of an axis at positions, mm or degrees, [..., 4, 4]."""
    signed = axis.direction * np.asarray(position, dtype=float)
    if axis.is_linear:
        return transforms.translation(signed[..., None] * np.eye(3)[axis.index])
    return transforms.rigid(transforms.axis_rotation(axis.index, np.deg2rad(signed)), np.zeros(3))


def error_transform(axis: str, values: ErrorValues, *, constant: bool) -> Array | None:
    """Build ``Trans(δ)·Rot(ε)`` of an axis, [..., 4, 4]; None where no parameter is given."""
    middle = "0" if constant else ""
    keys = [f"E{letter}{middle}{axis}" for letter in DIRECTIONS]
    if not any(key in values for key in keys):
        return None
    parts = np.broadcast_arrays(*(np.asarray(values.get(key, 0.0), dtype=float) for key in keys))
    shift = np.stack(parts[:3], -1) * MM_PER_UM
    turn = np.stack(parts[3:], -1) * RAD_PER_URAD
    return transforms.rigid(transforms.vector_rotation(turn), shift)


def branch_frames(model: Model, side: str, coordinates: Coordinates) -> Iterator[AxisFrames]:
    """Walk the nominal frames of a branch, tool or workpiece, from the frame outwards."""
    pose = np.eye(4)
    for axis in model.machine.branch(side):
        before = pose @ transforms.placed(axis.offset_mm, axis.rotation_deg)
        pose = before @ motion(axis, coordinates[axis.name])
        yield AxisFrames(axis, before, pose)


def branch_pose(
    model: Model, side: str, coordinates: Coordinates, values: ErrorValues | None = None
) -> Array:
    """Multiply out the pose of the tool or workpiece frame in R, [..., 4, 4].

    Without errors at the coordinates it is the nominal one.
    """
    pose = np.eye(4)
    errors = values or {}
    for axis in model.machine.branch(side):
        pose = pose @ transforms.placed(axis.offset_mm, axis.rotation_deg)
        move = motion(axis, coordinates[axis.name])
        constant = error_transform(axis.name, errors, constant=True)
        component = error_transform(axis.name, errors, constant=False)
        for factor in model.convention(axis.name).factors(constant, move, component):
            pose = pose if factor is None else pose @ factor
    for _, offset, rotation in model.machine.end_frames(side):
        pose = pose @ transforms.placed(offset, rotation)
    return pose


def nominal_point(model: Model, loop: Loop, coordinates: Coordinates) -> Array:
    """Give where the tool point or, of its loop, the workpiece point nominally is, [..., 3], mm."""
    if loop is Loop.WORKPIECE:
        return point_in_branch(model, "workpiece", coordinates, model.workpiece_point_mm)
    return point_in_branch(model, "tool", coordinates, model.tool_point_mm)


def tool_axis(model: Model, coordinates: Coordinates) -> Array:
    """Give the nominal direction of the tool axis in R, unit vectors, [..., 3]."""
    return transforms.rotate(branch_pose(model, "tool", coordinates)[..., :3, :3], TOOL_AXIS)


def point_in_branch(model: Model, side: str, coordinates: Coordinates, point: Vector) -> Array:
    """Give the nominal position in R of a point of the tool or workpiece frame, [..., 3], mm.

    The point is taken inwards axis by axis, which over a grid costs little: a linear axis changes
    what it moves along, and no more.
    """
    carried = components.split(np.array(point, dtype=float))
    for _, offset, rotation in reversed(model.machine.end_frames(side)):
        carried = components.move(transforms.placed(offset, rotation), carried)
    axes = [np.shape(coordinates[axis.name]) for axis in model.machine.branch(side)]
    out = np.empty((*np.broadcast_shapes(*axes), 3))
    components.join(carry_inwards(model, side, coordinates, carried), out)
    return out


def carry_inwards(model: Model, side: str, coordinates: Coordinates, point_mm: Triple) -> Triple:
    """Take a point from the frame behind the last axis of a branch to R, components, mm."""
    for axis in reversed(model.machine.branch(side)):
        point_mm = components.move(_nominal_step(axis, coordinates), point_mm)
    return point_mm


def carry_outwards(model: Model, side: str, coordinates: Coordinates, point_mm: Triple) -> Triple:
    """Take a point from R to the frame behind the last axis of a branch, components, mm."""
    for axis in model.machine.branch(side):
        back = transforms.inverse(_nominal_step(axis, coordinates))
        point_mm = components.move(back, point_mm)
    return point_mm


def _nominal_step(axis: Axis, coordinates: Coordinates) -> Array:
    """Offset and motion of an axis, [..., 4, 4]."""
    place = transforms.placed(axis.offset_mm, axis.rotation_deg)
    return place @ motion(axis, coordinates[axis.name])
