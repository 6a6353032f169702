"""Planes of two linear axes: which way these run in R, and the squareness between them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.bench.paths.placing import motion_direction
from warpspace.exceptions import OptionError
from warpspace.kinematics.chain import branch_frames
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.description import Machine
from warpspace.machine.parameters import parameter
from warpspace.units import Array

PLANES: Mapping[str, tuple[str, str, str]] = {
    "XY": ("X", "Y", "EC0Y"),
    "XZ": ("X", "Z", "EB0Z"),
    "YZ": ("Y", "Z", "EA0Z"),
}
"""Its axes, and the squareness between them."""


@dataclass(frozen=True)
class Plane:
    """A plane of two axes where a machine stands.

    Attributes
    ----------
    first, second : str
        Axes.
    key : str
        Squareness between them: it turns the second axis.
    along, up : ndarray, [3]
        Unit vectors in R: positive directions of the frames of both axes.
    sign : float
        Sign of the distance that a positive squareness moves the second axis along the first one,
        per distance along the second: −1 for Y about z (towards −x), +1 for Z about y (towards +x),
        −1 for Z about x (towards −y).
    ways : tuple of float, (2,)
        +1, or −1 where an axis moves the tool against the workpiece the other way than its frame
        points: a table, or a direction of −1.
    """

    first: str
    second: str
    key: str
    along: Array
    up: Array
    sign: float
    ways: tuple[float, float]


def axis_vector(model: Model, coordinates: Coordinates, axis: str, letter: str = "") -> Array:
    """Give the direction of the frame of an axis in R, [..., 3].

    Parameters
    ----------
    model : Model
    coordinates : mapping of str to ndarray, mm or degrees
    axis : str
    letter : str, optional
        Direction of the frame, one of X Y Z A B C; that along which the axis moves by default.
    """
    index = "XYZABC".index(letter) % 3 if letter else model.machine.axes[axis].index
    for side in ("tool", "workpiece"):
        for frames in branch_frames(model, side, coordinates):
            if frames.axis.name == axis:
                return np.asarray(frames.before)[..., :3, index]
    raise OptionError(f"the machine {model.machine.chain} has no axis {axis}")


def plane_axes(machine: Machine, plane: str) -> tuple[str, str, str]:
    """Look up the axes of a plane and the squareness between them.

    Raises
    ------
    OptionError
        If there is no such plane, or the machine lacks one of its axes.
    """
    if plane not in PLANES:
        raise OptionError(f"plane {plane!r}; expected one of {', '.join(PLANES)}")
    for name in PLANES[plane][:2]:
        if name not in machine.axes:
            raise OptionError(f"plane {plane}: the machine {machine.chain} has no axis {name}")
    return PLANES[plane]


def find_plane(model: Model, stand: Coordinates, plane: str) -> Plane:
    """Lay a plane on a machine; see `plane_axes`."""
    first, second, key = plane_axes(model.machine, plane)
    along, up = axis_vector(model, stand, first), axis_vector(model, stand, second)
    about = axis_vector(model, stand, parameter(key).axis, key[1])
    sign = float(np.sign(np.cross(about, up) @ along))
    ways = tuple(
        float(np.sign(motion_direction(model, stand, name) @ vector))
        for name, vector in ((first, along), (second, up))
    )
    return Plane(first, second, key, along, up, sign, (ways[0], ways[1]))
