"""The exact chain: every transformation in full, multiplied out.

Per axis ``T = Trans(offset) · Rot(fixed) · E0 · Motion(direction·q) · E(q)``, or what another
convention makes of the last three; E0 and E(q) are ``Trans(δ) · Rot(ε)`` with the full rotation of
the vector ε.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike

from warpspace.kinematics import transforms
from warpspace.kinematics.conventions.convention import AxisFrames
from warpspace.kinematics.model import (
    TOOL_AXIS,
    Coordinates,
    Loop,
    Model,
)
from warpspace.machine.axes import DIRECTIONS
from warpspace.machine.description import Axis, Vector
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array

ErrorValues = Mapping[str, Array]
"""Parameter key to values at the coordinates, [...], µm or µrad."""


def motion(axis: Axis, position: Array) -> Array:
    """Build the nominal motion of an axis.

    Parameters
    ----------
    axis : Axis
    position : ndarray, [...], mm or degrees

    Returns
    -------
    ndarray, [..., 4, 4]
    """
    signed = axis.direction * np.asarray(position, dtype=float)
    if axis.is_linear:
        return transforms.translation(signed[..., None] * np.eye(3)[axis.index])
    return transforms.rigid(transforms.axis_rotation(axis.index, np.deg2rad(signed)), np.zeros(3))


def error_transform(axis: str, values: ErrorValues, *, constant: bool) -> Array | None:
    """Build ``Trans(δ)·Rot(ε)`` of an axis; None where no parameter of it is given.

    Parameters
    ----------
    axis : str
        Name of the axis.
    values : mapping of str to ndarray, [...], µm or µrad
    constant : bool
        Whether to take the constant or the component errors.

    Returns
    -------
    ndarray, [..., 4, 4] or None
    """
    middle = "0" if constant else ""
    keys = [f"E{letter}{middle}{axis}" for letter in DIRECTIONS]
    if not any(key in values for key in keys):
        return None
    parts = np.broadcast_arrays(*(np.asarray(values.get(key, 0.0), dtype=float) for key in keys))
    shift = np.stack(parts[:3], -1) * MM_PER_UM
    turn = np.stack(parts[3:], -1) * RAD_PER_URAD
    return transforms.rigid(transforms.vector_rotation(turn), shift)


def branch_frames(model: Model, side: str, coordinates: Coordinates) -> Iterator[AxisFrames]:
    """Walk the nominal frames of a branch from the frame of the machine outwards.

    Parameters
    ----------
    model : Model
    side : str
        "tool" or "workpiece".
    coordinates : mapping of str to ndarray, [...], mm or degrees

    Yields
    ------
    AxisFrames
    """
    pose = np.eye(4)
    for axis in model.machine.branch(side):
        before = pose @ transforms.placed(axis.offset_mm, axis.rotation_deg)
        pose = before @ motion(axis, coordinates[axis.name])
        yield AxisFrames(axis, before, pose)


def branch_pose(
    model: Model, side: str, coordinates: Coordinates, values: ErrorValues | None = None
) -> Array:
    """Multiply out the pose of the tool or workpiece frame in R.

    Parameters
    ----------
    model : Model
    side : str
        "tool" or "workpiece".
    coordinates : mapping of str to ndarray, [...], mm or degrees
    values : mapping of str to ndarray, [...], µm or µrad, optional
        Errors at the coordinates; without them the pose is nominal.

    Returns
    -------
    ndarray, [..., 4, 4]
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
    """Give the nominal position of the functional point of a loop in R.

    Parameters
    ----------
    model : Model
    loop : Loop
        The workpiece loop has the workpiece point, the others the tool point.
    coordinates : mapping of str to ndarray, [...], mm or degrees

    Returns
    -------
    ndarray, [..., 3], mm
    """
    if loop is Loop.WORKPIECE:
        pose = branch_pose(model, "workpiece", coordinates)
        return transforms.apply(pose, model.workpiece_point_mm)
    return transforms.apply(branch_pose(model, "tool", coordinates), model.tool_point_mm)


def tool_axis(model: Model, coordinates: Coordinates) -> Array:
    """Give the nominal direction of the tool axis in R, unit vectors, [..., 3]."""
    return transforms.rotate(branch_pose(model, "tool", coordinates)[..., :3, :3], TOOL_AXIS)


def exact_error(
    model: Model,
    loop: Loop,
    coordinates: Coordinates,
    values: ErrorValues,
    point_mm: ArrayLike,
) -> tuple[Array, Array]:
    """Evaluate the error of a loop with full rotations and all products.

    Parameters
    ----------
    model : Model
    loop : Loop
    coordinates : mapping of str to ndarray, [...], mm or degrees
    values : mapping of str to ndarray, [...], µm or µrad
        Errors at the coordinates.
    point_mm : array_like, [..., 3], mm
        Nominal point in R, which the tool and the workpiece point share.

    Returns
    -------
    error_um : ndarray, [..., 3], µm
        Position error in R, actual − nominal; for the relative loop tool minus workpiece.
    orientation_urad : ndarray, [..., 3], µrad
        Rotation vector that takes the nominal tool axis to the actual one; it has no part about
        the tool axis itself.
    """
    point = np.asarray(point_mm, dtype=float)
    nominal_axis = tool_axis(model, coordinates)
    moved = {side: np.eye(4) for side in ("tool", "workpiece")}
    for side in moved:
        if loop in (Loop.RELATIVE, Loop(side)):
            actual = branch_pose(model, side, coordinates, values)
            moved[side] = actual @ transforms.inverse(branch_pose(model, side, coordinates))
    tool, workpiece = moved["tool"], moved["workpiece"]
    if loop is Loop.WORKPIECE:
        shift, actual_axis = _shift(workpiece, point), _turned(workpiece, nominal_axis)
        rotation = _between(nominal_axis, actual_axis)
    else:
        shift = _shift(tool, point) - _shift(workpiece, point)
        rotation = _between(_turned(workpiece, nominal_axis), _turned(tool, nominal_axis))
    shape = np.broadcast_shapes(shift.shape, rotation.shape, point.shape)
    return (
        np.broadcast_to(shift * UM_PER_MM, shape).copy(),
        np.broadcast_to(rotation * URAD_PER_RAD, shape).copy(),
    )


def _shift(moved: Array, point: Array) -> Array:
    """Displacement of a point by a small rigid motion, without cancellation of large numbers."""
    return transforms.rotate(moved[..., :3, :3] - np.eye(3), point) + moved[..., :3, 3]


def _turned(moved: Array, direction: Array) -> Array:
    """Turn directions by the rotation part of a transformation."""
    return transforms.rotate(moved[..., :3, :3], direction)


def _between(start: Array, end: Array) -> Array:
    """Rotation vector that takes one unit vector to another the short way, rad, [..., 3]."""
    cross = np.cross(start, end)
    sine = np.linalg.norm(cross, axis=-1, keepdims=True)
    cosine = np.sum(start * end, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    return cross * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)


def point_in_branch(model: Model, side: str, coordinates: Coordinates, point: Vector) -> Array:
    """Give the nominal position in R of a point of the tool or workpiece frame, [..., 3], mm."""
    return transforms.apply(branch_pose(model, side, coordinates), point)
