"""The exact chain as one reads it: whole poses, multiplied out at every point of a batch."""

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import ErrorValues, branch_pose, tool_axis
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.units import UM_PER_MM, URAD_PER_RAD, Array


def plain_exact_error(
    model: Model, loop: Loop, coordinates: Coordinates, values: ErrorValues, point_mm: Array
) -> tuple[Array, Array]:
    """Position error in µm and rotation vector of the tool axis in µrad, [..., 3] each."""
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
