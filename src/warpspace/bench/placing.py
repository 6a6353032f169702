"""Poses of tests: directions of motion, axes of rotation, tool held on a point."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.kinematics.relative_motion import (
    angle_error,
    axis_frames,
    programmed_direction,
    relative_point,
)
from warpspace.machine.axes import direction_index
from warpspace.machine.definition import Machine
from warpspace.machine.limits import FULL_TURN_DEG
from warpspace.scene.model import Scene
from warpspace.units import Array

FLAT = 1e-9  # determinant of three directions of motion below which they lie in a plane
SLACK = 1e-6  # mm or degrees; rounding by which a path may exceed a range


@dataclass(frozen=True, slots=True)
class AxisLine:
    """Position and directions of a rotary axis."""

    origin_mm: Array  # [..., 3]; of its frame, in R
    # [..., 3]; unit vector that positive errors turn about, by the right-hand rule
    direction: Array
    # [..., 3]; the two following directions of its frame before the motion: x and y for C
    across: Array
    upright: Array
    # +1 if it carries the tool, −1 if the workpiece: the tool then turns relative to the workpiece
    # in the opposite sense
    sign: float


def find_axis(machine: Machine, name: str, kind: Literal["linear", "rotary"]) -> str:
    """Return the name of an axis; for an empty name the first linear or the last rotary one."""
    axes = [axis.name for axis in machine.axes.values() if axis.is_linear == (kind == "linear")]
    if not axes:
        raise OptionError(f"the machine {machine.chain} has no {kind} axis")
    if not name:
        return axes[0 if kind == "linear" else -1]
    if name not in machine.axes:
        raise UnknownNameError("axis", name, machine.axes)
    if name not in axes:
        raise OptionError(f"axis {name} is not {kind}; expected one of {', '.join(sorted(axes))}")
    return name


def tool_offset(model: Model, coordinates: Coordinates) -> Array:
    """Compute nominal tool point − origin of the workpiece frame, in R, [..., 3], mm."""
    tool = nominal_point(model, Loop.TOOL, coordinates)
    return tool - branch_pose(model, "workpiece", coordinates)[..., :3, 3]


def tool_points(model: Model, coordinates: Coordinates, count: int) -> Array:
    """Compute the nominal tool points in R, one per site, [count, 3], mm."""
    return np.broadcast_to(nominal_point(model, Loop.TOOL, coordinates), (count, 3))


def motion_direction(model: Model, coordinates: Coordinates, axis: str) -> Array:
    """Compute the motion of the tool relative to the workpiece per unit of an axis, [..., 3]."""
    advanced = {**coordinates, axis: coordinates[axis] + 1.0}
    return tool_offset(model, advanced) - tool_offset(model, coordinates)


def axis_line(model: Model, coordinates: Coordinates, axis: str) -> AxisLine:
    frames, sign = axis_frames(model, coordinates, axis)
    before, index = np.asarray(frames.before), frames.axis.index
    along, across, upright = (before[..., :3, (index + step) % 3] for step in range(3))
    return AxisLine(before[..., :3, 3], along, across, upright, sign)


def linear_axes(machine: Machine) -> dict[int, str]:
    """Return the first linear axis along each direction, in the order of the machine."""
    axes: dict[int, str] = {}
    for axis in machine.axes.values():
        if axis.is_linear:
            axes.setdefault(direction_index(axis.name), axis.name)
    return axes


def following_axes(model: Model) -> tuple[str, str, str]:
    """Return the three linear axes that hold the tool on a point."""
    axes = linear_axes(model.machine)
    if len(axes) != 3:
        raise OptionError(
            f"the machine {model.machine.chain} lacks three linear axes; expected one along each"
            " of x, y and z"
        )
    return axes[0], axes[1], axes[2]


def follow(model: Model, coordinates: Mapping[str, Array], target_mm: Array) -> dict[str, Array]:
    """Compute the positions that hold the tool point on points of the workpiece, [..., 3]."""
    names, shape = following_axes(model), batch_shape(coordinates)
    start = {name: np.broadcast_to(values, shape) for name, values in coordinates.items()}

    target = transforms.apply(branch_pose(model, "workpiece", start), target_mm)
    gap = nominal_point(model, Loop.TOOL, start) - target
    moves = np.stack([motion_direction(model, start, name) for name in names], axis=-1)
    if np.abs(np.linalg.det(moves)).min() < FLAT:
        raise OptionError(
            f"{', '.join(names)} move in one plane in some pose and cannot follow the point"
        )
    steps = -transforms.rotate(np.asarray(np.linalg.inv(moves), dtype=np.float64), gap)
    return start | {name: start[name] + steps[..., at] for at, name in enumerate(names)}


def within_travel(machine: Machine, coordinates: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Check at which sites all axes are within their travel, [n]; a full turn has no end."""
    inside = np.ones((), dtype=bool)
    for name, values in coordinates.items():
        low, high = machine.axes[name].travel
        if machine.axes[name].is_linear or high - low < FULL_TURN_DEG:
            inside = inside & (values >= low - SLACK) & (values <= high + SLACK)
    return np.asarray(inside)


def check_travel(scene: Scene, coordinates: Mapping[str, Array], what: str) -> None:
    problems: list[str] = []
    for name, values in coordinates.items():
        axis = scene.machine.axes[name]
        low, high = axis.travel
        lowest, highest = float(np.min(values)), float(np.max(values))
        if lowest < low - SLACK or highest > high + SLACK:
            problems.append(
                f"{name} would run {lowest:g} … {highest:g} {axis.unit}, it has {low:g} … {high:g}"
            )
    if problems:
        raise OptionError(f"{what} leaves the travel: {'; '.join(problems)}")


PLANES = ("XY", "XZ", "YZ")


@dataclass(frozen=True)
class AxisPlane:
    """A plane of two axes in one pose of a machine."""

    key: str  # the constant that changes the angle between them
    first_direction: Array  # [3]; unit vectors in R: programmed positive directions
    second_direction: Array
    # change of the angle per unit of the squareness, with the sign changed: the distance that a
    # positive squareness moves the second axis along the first one, per distance along the second
    sign: float


def plane_axes(machine: Machine, plane: str) -> tuple[str, str]:
    if plane not in PLANES:
        raise OptionError(f"plane {plane!r}; expected one of {', '.join(PLANES)}")
    for name in plane:
        if name not in machine.axes:
            raise OptionError(f"plane {plane}: the machine {machine.chain} has no axis {name}")
    return plane[0], plane[1]


def find_plane(model: Model, stand: Coordinates, plane: str) -> AxisPlane:
    first, second = plane_axes(model.machine, plane)
    along, up = (programmed_direction(model, stand, axis) for axis in (first, second))
    key, change = angle_error(model.machine, first, second)
    return AxisPlane(key, along, up, -change)


SHARE = 0.3  # default radius as a share of the shortest edge of the working volume


def default_ball(
    scene: Scene, model: Model, axis: str, stand: Mapping[str, Array], radius_mm: float | None
) -> Array:
    """Choose the position of a ball in the workpiece frame, [3], mm."""
    middle = np.asarray(relative_point(model, stand))
    line = axis_line(model, stand, axis)
    if line.sign > 0.0:  # the tool swivels about the ball
        return middle
    pose = np.asarray(branch_pose(model, "workpiece", stand))
    tool = transforms.apply(pose, middle)
    height = float((tool - line.origin_mm) @ line.direction)
    edges = [
        high - low
        for name, (low, high) in scene.workspace.ranges.items()
        if scene.machine.axes[name].is_linear and low < high
    ]
    radius = radius_mm if radius_mm is not None else SHARE * min(edges, default=100.0)
    theta = np.deg2rad(scene.machine.axes[axis].direction * float(stand[axis]))
    ball = line.origin_mm + height * line.direction
    ball = ball + radius * (np.cos(theta) * line.across + np.sin(theta) * line.upright)
    return transforms.apply(transforms.inverse(pose), ball)


def ball_setup(
    model: Model, coordinates: Mapping[str, Array], direction: Array
) -> dict[str, Array]:
    """Compute the readings per unit of the ball's position along x, y, z of the workpiece, [m].

    A ball displaced along +x reads as a displacement of the tool along −x. The directions are those
    of all poses, [n, 3], once or repeated.
    """
    count = np.broadcast_shapes(*(np.shape(values) for values in coordinates.values()))
    pose = np.broadcast_to(branch_pose(model, "workpiece", coordinates), (*count, 4, 4))
    pose = np.tile(pose, (len(direction) // len(pose), 1, 1))
    moved = -np.sum(pose[:, :3, :3] * direction[:, :, None], axis=1)
    return {f"ball_{name}_um": moved[:, index] for index, name in enumerate("xyz")}


def travel_directions(coordinates: Mapping[str, Array], sense: Array) -> dict[str, Array]:
    """Compute the direction of travel of each axis along a path, [n], per stretch."""
    directions: dict[str, Array] = {}
    starts = np.flatnonzero(np.diff(sense, prepend=np.nan) != 0.0)
    for name, values in coordinates.items():
        step = np.diff(values, prepend=0.0, append=values[-1:])
        # the first point of a stretch is reached as the second one is
        step[starts] = np.where(np.isin(starts + 1, starts), 0.0, step[starts + 1])
        step = np.where(np.abs(step[:-1]) < 1e-9, 0.0, step[:-1])
        if step.any():
            directions[name] = np.sign(step)
    return directions
