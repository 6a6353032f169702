"""The first-order model: one geometric Jacobian column per parameter.

A translation error moves a point along its direction; a rotation error about direction d at frame
origin p moves point P by d × (P − p). The lever P − p is the explanation of every gain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpspace.kinematics.chain import branch_frames, tool_axis
from warpspace.kinematics.conventions.convention import AxisFrames
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.parameters import Parameter, parameter
from warpspace.units import UM_PER_MM_URAD, Array

_SIDES: dict[Loop, tuple[tuple[str, float], ...]] = {
    Loop.TOOL: (("tool", 1.0),),
    Loop.WORKPIECE: (("workpiece", 1.0),),
    Loop.RELATIVE: (("tool", 1.0), ("workpiece", -1.0)),
}


@dataclass(frozen=True, slots=True)
class Column:
    """One column of the geometric Jacobian.

    Attributes
    ----------
    direction : ndarray, [..., 3]
        Unit vector in R along or about which the error acts.
    lever_mm : ndarray, [..., 3], mm
        From the origin of the frame the error sits in to the point.
    position : ndarray, [..., 3], µm/µm or µm/µrad
        Displacement of the point per unit of the error.
    sign : float
        +1, or −1 for the workpiece branch in the relative loop; already in `position`.
    """

    direction: Array
    lever_mm: Array
    position: Array
    sign: float


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
    """Build the Jacobian column of one parameter.

    Parameters
    ----------
    model : Model
    row : Parameter
    frames : AxisFrames
        Nominal frames of the parameter's axis.
    point_mm : array_like, [..., 3], mm
        Nominal point in R.
    sign : float, optional
        −1 for the workpiece branch of the relative loop.

    Returns
    -------
    Column
    """
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
    """Build the Jacobian columns of all parameters that act in a loop.

    Parameters
    ----------
    model : Model
    loop : Loop
    keys : sequence of str
        Parameter keys; those whose axis is not in the loop are left out of the result.
    coordinates : mapping of str to ndarray, [...], mm or degrees
    point_mm : array_like, [..., 3], mm
        Nominal point in R.

    Returns
    -------
    dict of str to Column
    """
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
    First order in all errors; `warpspace.kinematics.deviation.exact_error` has all of them.
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
