"""Motion of the tool relative to the workpiece: what instruments read and controllers correct.

A reading (positioning, straightness, angle, squareness, twist) is a component of this motion, in
the frame of the workpiece, along or about the programmed positive direction of an axis. Errors that
produce a reading are found by their effect on it, whatever the side, the sense and the frame of the
axes.
"""

import numpy as np

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames, branch_pose, nominal_point
from warpspace.kinematics.model import AxisFrames, Coordinates, Loop, Model
from warpspace.machine.axes import is_linear
from warpspace.machine.definition import Machine
from warpspace.units import Array

NEGLIGIBLE = 1e-9  # share of a parameter in a reading
SIDES = {"tool": 1.0, "workpiece": -1.0}


def relative_point(model: Model, coordinates: Coordinates) -> Array:
    """Compute the nominal tool point in the frame of the workpiece, [..., 3], mm."""
    pose = branch_pose(model, "workpiece", coordinates)
    return transforms.apply(transforms.inverse(pose), nominal_point(model, Loop.TOOL, coordinates))


def axis_frames(model: Model, coordinates: Coordinates, axis: str) -> tuple[AxisFrames, float]:
    """Return the frames of an axis in R, and +1 if it carries the tool, −1 if the workpiece.

    The errors of the axis displace the tool relative to the workpiece by this sign.
    """
    for side, sign in SIDES.items():
        for frames in branch_frames(model, side, coordinates):
            if frames.axis.name == axis:
                return frames, sign
    raise UnknownNameError("axis", axis, model.machine.axes)


def programmed_direction(model: Model, coordinates: Coordinates, axis: str) -> Array:
    """Compute the direction in which a positive command moves the tool over the workpiece.

    That of a rotary axis is the direction about which the tool turns relative to the workpiece, by
    the right-hand rule.

    Returns
    -------
    ndarray, [..., 3]
        Unit vectors in R.
    """
    frames, sign = axis_frames(model, coordinates, axis)
    return sign * frames.axis.direction * np.asarray(frames.before)[..., :3, frames.axis.index]


def _at_zero(machine: Machine) -> tuple[Model, dict[str, Array]]:
    return Model(machine), {axis: np.zeros(()) for axis in machine.axes}


def reading_errors(
    machine: Machine, moving: str, sensed: str, *, angle: bool = False
) -> dict[str, float]:
    """Find the component errors of an axis that produce a reading along or about another one.

    Parameters
    ----------
    machine : Machine
        Its rotary axes stand at zero.
    moving : str
        Axis that moves, and whose errors are read.
    sensed : str
        Axis along whose programmed direction a linear instrument senses; for a rotary axis, or with
        `angle`, the rotation about it is read.

    Returns
    -------
    dict of str to float
        Share of each parameter, µm or µrad, in a reading of 1 µm or µrad.
    """
    model, zero = _at_zero(machine)
    frames, sign = axis_frames(model, zero, moving)
    letters = "ABC" if angle or not is_linear(sensed) else "XYZ"
    shares = sign * np.asarray(frames.after)[:3, :3].T @ programmed_direction(model, zero, sensed)
    return {
        f"E{letter}{moving}": float(share)
        for letter, share in zip(letters, shares, strict=True)
        if abs(share) > NEGLIGIBLE
    }


def angle_error(machine: Machine, first: str, second: str) -> tuple[str, float]:
    """Find the constant error that changes the angle between two linear axes.

    Returns
    -------
    key : str
    change : float
        Change of the angle between the programmed positive directions, µrad/µrad; positive where a
        positive error makes it wider.
    """
    key = machine.squareness_key(first, second)
    if not key:
        raise OptionError(
            f"{first} and {second} of the machine {machine.chain}: no constant error changes the"
            " angle between them"
        )
    return key, angle_change(machine, key, first, second)


def angle_change(machine: Machine, key: str, first: str, second: str) -> float:
    """Compute the change of the angle between two axes per unit of a constant rotation."""
    model, zero = _at_zero(machine)
    directions = [programmed_direction(model, zero, axis) for axis in (first, second)]
    turned = axis_frames(model, zero, key[3:])[0]
    about = np.asarray(turned.before)[:3, "ABC".index(key[1])]
    carried = machine.chain.carried_by(key[3:])
    turns = [
        np.cross(about, direction) if axis in carried else np.zeros(3)
        for axis, direction in zip((first, second), directions, strict=True)
    ]
    cosine = directions[0] @ directions[1]
    change = -(turns[0] @ directions[1] + directions[0] @ turns[1])
    return float(change / np.sqrt(1.0 - cosine**2))
