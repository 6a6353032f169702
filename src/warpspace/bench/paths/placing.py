"""Where axes have to stand: directions of motion, axes of rotation, the tool held on a point."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames, branch_pose, nominal_point
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.axes import direction_index
from warpspace.machine.description import Machine
from warpspace.scene.model import Scene
from warpspace.units import Array

FLAT = 1e-9
"""Determinant of three directions of motion below which they lie in a plane."""
SLACK = 1e-6
"""mm or degrees by which a path may seem to leave a range: rounding."""


@dataclass(frozen=True, slots=True)
class AxisLine:
    """Where a rotary axis lies.

    Attributes
    ----------
    origin_mm : ndarray, [..., 3], mm
        Of its frame, in R.
    direction : ndarray, [..., 3]
        Unit vector that positive errors turn about, by the right-hand rule.
    across, upright : ndarray, [..., 3]
        The two following directions of its frame before the motion: x and y for C.
    sign : float
        +1 where it carries the tool, −1 where the workpiece: what turns the tool against the
        workpiece the other way.
    """

    origin_mm: Array
    direction: Array
    across: Array
    upright: Array
    sign: float


def linear_axis(machine: Machine, name: str) -> str:
    """Give the name of a linear axis; the first one for an empty name.

    Raises
    ------
    OptionError, UnknownNameError
        If there is no such axis, or it turns.
    """
    known = [axis.name for axis in machine.axes.values() if axis.is_linear]
    return _named(machine, name, known, "linear")


def rotary_axis(machine: Machine, name: str) -> str:
    """Give the name of a rotary axis; the last one in the list (C before B) for an empty name.

    Raises
    ------
    OptionError, UnknownNameError
        If there is no such axis, or it is linear.
    """
    known = [axis.name for axis in machine.axes.values() if not axis.is_linear]
    return _named(machine, name, known[::-1], "rotary")


def _named(machine: Machine, name: str, known: list[str], kind: str) -> str:
    """Find an axis of a kind."""
    if not known:
        raise OptionError(f"the machine {machine.chain} has no {kind} axis")
    if not name:
        return known[0]
    if name not in machine.axes:
        raise UnknownNameError("axis", name, machine.axes)
    if name not in known:
        raise OptionError(f"axis {name} is not {kind}; expected one of {', '.join(sorted(known))}")
    return name


def relative_point(model: Model, coordinates: Coordinates) -> Array:
    """Nominal tool point minus the origin of the workpiece frame, in R, [..., 3], mm."""
    tool = nominal_point(model, Loop.TOOL, coordinates)
    return tool - branch_pose(model, "workpiece", coordinates)[..., :3, 3]


def motion_direction(model: Model, coordinates: Coordinates, axis: str) -> Array:
    """Give the direction in which a linear axis moves the tool against the workpiece.

    Returns
    -------
    ndarray, [..., 3]
        In R, per unit of its position.
    """
    further = {**coordinates, axis: coordinates[axis] + 1.0}
    return relative_point(model, further) - relative_point(model, coordinates)


def axis_line(model: Model, coordinates: Coordinates, axis: str) -> AxisLine:
    """Find where a rotary axis lies nominally."""
    for side, sign in (("tool", 1.0), ("workpiece", -1.0)):
        for frames in branch_frames(model, side, coordinates):
            if frames.axis.name == axis:
                index = frames.axis.index
                before = np.asarray(frames.before)
                first, second = (index + 1) % 3, (index + 2) % 3
                return AxisLine(
                    before[..., :3, 3],
                    before[..., :3, index],
                    before[..., :3, first],
                    before[..., :3, second],
                    sign,
                )
    raise UnknownNameError("axis", axis, model.machine.axes)


def following_axes(model: Model) -> tuple[str, str, str]:
    """Give the three linear axes that hold the tool on a point: the first along each direction.

    Raises
    ------
    OptionError
        If the machine has no linear axis along one of them.
    """
    found: dict[int, str] = {}
    for axis in model.machine.axes.values():
        if axis.is_linear:
            found.setdefault(direction_index(axis.name), axis.name)
    if len(found) != 3:
        raise OptionError(
            f"the machine {model.machine.chain} has not three linear axes; expected one along each"
            " of x, y and z"
        )
    return found[0], found[1], found[2]


def follow(model: Model, coordinates: Mapping[str, Array], target_mm: Array) -> dict[str, Array]:
    """Hold the nominal tool point on points of the workpiece frame, as a control with TCP does.

    Parameters
    ----------
    model : Model
    coordinates : mapping of str to ndarray, [n], mm or degrees
        Rotary axes where they are to stand; linear ones anywhere.
    target_mm : ndarray, [..., 3], mm
        In the workpiece frame.

    Returns
    -------
    dict of str to ndarray, [n], mm or degrees

    Raises
    ------
    OptionError
        If the machine has no three linear axes, or these cannot reach every point.
    """
    names = following_axes(model)
    start = dict(coordinates)

    def gap(at: Coordinates) -> Array:
        target = transforms.apply(branch_pose(model, "workpiece", at), target_mm)
        return nominal_point(model, Loop.TOOL, at) - target

    away = gap(start)
    moves = np.stack([gap({**start, name: start[name] + 1.0}) - away for name in names], axis=-1)
    if np.abs(np.linalg.det(moves)).min() < FLAT:
        raise OptionError(
            f"{', '.join(names)} move in one plane in some pose and cannot follow the point"
        )
    steps = np.linalg.solve(moves, -away[..., None])[..., 0]
    for index, name in enumerate(names):
        start[name] = start[name] + steps[..., index]
    return start


def ball_point(model: Model, coordinates: Coordinates) -> Array:
    """Give where the nominal tool point is on the workpiece, in its frame, [..., 3], mm."""
    pose = branch_pose(model, "workpiece", coordinates)
    return transforms.apply(transforms.inverse(pose), nominal_point(model, Loop.TOOL, coordinates))


def within_travel(machine: Machine, coordinates: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Tell at which sites all linear axes are within their travel, [n]."""
    inside = np.ones((), dtype=bool)
    for name, values in coordinates.items():
        axis = machine.axes[name]
        if axis.is_linear:
            low, high = axis.travel
            inside = inside & (values >= low - SLACK) & (values <= high + SLACK)
    return np.asarray(inside)


def check_travel(scene: Scene, coordinates: Mapping[str, Array], what: str) -> None:
    """Refuse a path that leaves the travel of an axis.

    Raises
    ------
    OptionError
        With the axes, where they would go, and what they have.
    """
    problems: list[str] = []
    for name, values in coordinates.items():
        axis = scene.machine.axes[name]
        low, high = axis.travel
        least, most = float(np.min(values)), float(np.max(values))
        if least < low - SLACK or most > high + SLACK:
            problems.append(
                f"{name} would run {least:g} … {most:g} {axis.unit}, it has {low:g} … {high:g}"
            )
    if problems:
        raise OptionError(f"{what} leaves the travel: {'; '.join(problems)}")
