"""The first-order model: one geometric Jacobian column per parameter, and what bodies do by it.

A translation error moves a point along its direction; a rotation error about direction d at frame
origin p moves point P by d × (P − p). The lever P − p is the explanation of every gain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames, tool_axis
from warpspace.kinematics.model import AxisFrames, Coordinates, Loop, Model, batch_shape
from warpspace.machine.parameters import Parameter, axis_parameters, parameter
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM_URAD, Array

_SIDES: dict[Loop, tuple[tuple[str, float], ...]] = {
    Loop.TOOL: (("tool", 1.0),),
    Loop.WORKPIECE: (("workpiece", 1.0),),
    Loop.RELATIVE: (("tool", 1.0), ("workpiece", -1.0)),
}


@dataclass(frozen=True, slots=True)
class Column:
    """One column of the geometric Jacobian."""

    direction: Array  # [..., 3]; unit vector in R along or about which the error acts
    lever_mm: Array  # [..., 3]; from the origin of the frame the error sits in to the point
    position: Array  # [..., 3], µm/µm or µm/µrad; displacement of the point per unit of the error
    sign: float  # +1, or −1 for the workpiece branch in the relative loop; already in `position`


def rotation_gain(lever_mm: ArrayLike, direction: ArrayLike) -> Array:
    """Displacement of a point per unit of a small rotation.

    Parameters
    ----------
    lever_mm : array_like, [..., 3], mm
        From the rotating frame's origin to the point.
    direction : array_like, [..., 3]
        Unit vector of the rotation axis.

    Returns
    -------
    ndarray, [..., 3], µm/µrad
        First order: direction × lever, a millimetre times a microradian being a nanometre.
    """
    x, y, z = np.moveaxis(np.asarray(lever_mm, dtype=float), -1, 0)
    a, b, c = np.moveaxis(np.asarray(direction, dtype=float) * UM_PER_MM_URAD, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], -1)


def column(
    model: Model, row: Parameter, frames: AxisFrames, point_mm: ArrayLike, sign: float = 1.0
) -> Column:
    """Build the Jacobian column of one parameter."""
    pose = model.convention(row.axis).frame(frames, row)
    direction = pose[..., :3, row.direction]
    lever = np.asarray(point_mm, dtype=float) - pose[..., :3, 3]
    gain = rotation_gain(lever, direction) if row.is_rotation else direction
    return Column(direction, lever, sign * gain, sign)


def columns(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    coordinates: Coordinates,
    point_mm: ArrayLike,
) -> dict[str, Column]:
    """Build the Jacobian columns of parameters that act in a loop, at points, [..., 3], mm."""
    rows = [parameter(key) for key in keys]
    return {
        row.key: column(model, row, frames, point_mm, sign)
        for side, sign in _SIDES[loop]
        for frames in branch_frames(model, side, coordinates)
        for row in rows
        if row.axis == frames.axis.name
    }


def jacobian(
    model: Model,
    loop: Loop,
    keys: Sequence[str],
    coordinates: Coordinates,
    point_mm: ArrayLike,
) -> tuple[Array, Array]:
    """Build the Jacobian of position and tool-axis orientation.

    Parameters
    ----------
    model : Model
    loop : Loop
    keys : sequence of str, (K,)
        Parameter keys; one whose axis is not in the loop gives zeros.
    coordinates : mapping of str to ndarray, [...], mm or degrees
    point_mm : array_like, [..., 3], mm
        Nominal point in R.

    Returns
    -------
    position : ndarray, [K, ..., 3], µm/µm or µm/µrad
        Displacement in R per unit.
    orientation : ndarray, [K, ..., 3], µrad/µrad
        Rotation vector of the tool axis per unit, without the part about the axis itself.

    Notes
    -----
    First order in all errors; `warpspace.kinematics.deviation.loop_error` has all of them.
    """
    point = np.asarray(point_mm, dtype=float)
    shape = np.broadcast_shapes((*batch_shape(coordinates), 3), point.shape)
    position = np.zeros((len(keys), *shape))
    orientation = np.zeros((len(keys), *shape))
    about = tool_axis(model, coordinates)
    found = columns(model, loop, keys, coordinates, point)
    for index, key in enumerate(keys):
        if (col := found.get(key)) is None:
            continue
        position[index] = col.position
        if parameter(key).is_rotation:
            along = np.sum(col.direction * about, axis=-1, keepdims=True)
            orientation[index] = col.sign * (col.direction - along * about)
    return position, orientation


# --- Where the bodies of a machine stand, and how each of them moves because of the errors --------
# Every body takes the small motion of all errors between the frame and itself. To first order that
# is one rotation vector and one displacement a body; drawn larger by a factor it is an affine map
# that takes each point exactly where the deformed grid has it.

BASE = "R"


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """Nominal place of a body and its small motion."""

    nominal: Array  # [4, 4]; pose of the body's frame in R
    rotation_rad: Array  # [3]; small rotation vector in R
    displacement_mm: Array  # [3]; displacement of the point of the body at the origin of R

    def drawn(self, exaggeration: float) -> Array:
        """Give the affine map, [4, 4], from the body's frame to where it is drawn in R."""
        bend = np.eye(4)
        bend[:3, :3] += exaggeration * transforms.skew(self.rotation_rad)
        bend[:3, 3] = exaggeration * self.displacement_mm
        return bend @ self.nominal


def body_motions(
    model: Model, values: Mapping[str, Array | float], coordinates: Coordinates
) -> dict[str, BodyMotion]:
    """Find the place and the small motion of every body: R, every axis, S, t and w.

    Values are errors at one position of every axis, µm or µrad; absent is zero. S and t ride on the
    last axis of the tool.
    """
    still = np.zeros(3)
    found = {BASE: BodyMotion(np.eye(4), still, still)}
    for side in ("tool", "workpiece"):
        pose, rotation, displacement = np.eye(4), still, still
        for frames in branch_frames(model, side, coordinates):
            pose = frames.after
            for row in axis_parameters(frames.axis.name):
                value = float(values.get(row.key, 0.0))
                if value == 0.0:
                    continue
                col = column(model, row, frames, np.zeros(3))
                displacement = displacement + col.position * value * MM_PER_UM
                if row.is_rotation:
                    rotation = rotation + col.direction * value * RAD_PER_URAD
            found[frames.axis.name] = BodyMotion(pose, rotation, displacement)
        for name, offset, turned in model.machine.end_frames(side):
            pose = pose @ transforms.placed(offset, turned)
            found[name] = BodyMotion(pose, rotation, displacement)
    return found
