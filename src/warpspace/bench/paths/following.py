"""Circles about a rotary axis that the linear axes follow: the control compensates (TCP)."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from warpspace.bench.paths.placing import (
    axis_line,
    ball_point,
    check_travel,
    follow,
    rotary_axis,
    within_travel,
)
from warpspace.bench.plan import Plan, build_plan
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.scene.model import Scene
from warpspace.units import Array

BAR_MM = 100.0
"""Length of a bar beside a rotary axis: what across it does is of second order."""
SHARE = 0.3
"""Radius that is chosen: share of the shortest edge of the working volume."""


@dataclass(frozen=True)
class FollowedCircle:
    """What circle is run.

    Attributes
    ----------
    axis : str
        The rotary axis.
    radius_mm : float or None, mm
        Distance of the ball from it.
    bar : str
        "radial", "tangential" or "axial".
    at : mapping of str to float
    """

    axis: str
    radius_mm: float
    bar: str
    at: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass(frozen=True)
class Followed:
    """Poses of a rotary axis with the tool on a point of the workpiece.

    Attributes
    ----------
    axis : str
    coordinates : dict of str to ndarray, [n], mm or degrees
    point_mm : ndarray, [n, 3], mm
        The ball, in R.
    ball_mm : ndarray, [3], mm
        The ball, in the workpiece frame.
    """

    axis: str
    coordinates: dict[str, Array]
    point_mm: Array
    ball_mm: Array


def stand_of(scene: Scene, at: Mapping[str, float]) -> dict[str, Array]:
    """Give where all axes stand, scalars."""
    positions = scene.workspace.positions
    return complete_coordinates(scene.machine, {**positions, **at}, positions)


def default_ball(
    scene: Scene, model: Model, axis: str, stand: Mapping[str, Array], radius_mm: float | None
) -> Array:
    """Choose where a ball stands, in the workpiece frame, [3], mm.

    At the height of the middle of the working volume; on a table that turns at the radius from its
    axis, or at a share of the shortest edge of the volume.
    """
    middle = np.asarray(ball_point(model, stand))
    line = axis_line(model, stand, axis)
    if line.sign > 0.0:  # the workpiece stands still: the tool swivels about the ball
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
    turn = scene.machine.axes[axis].direction * float(stand[axis])
    theta = np.deg2rad(turn)
    placed = line.origin_mm + height * line.direction
    placed = placed + radius * (np.cos(theta) * line.across + np.sin(theta) * line.upright)
    return transforms.apply(transforms.inverse(pose), placed)


def followed(
    scene: Scene,
    model: Model,
    axis: str,
    angle_deg: Array,
    ball_mm: Array,
    at: Mapping[str, float],
) -> Followed:
    """Turn a rotary axis with the tool held on a ball.

    Raises
    ------
    OptionError
        If the path leaves the travel of an axis.
    """
    coordinates = {
        name: np.broadcast_to(values, angle_deg.shape)
        for name, values in {**stand_of(scene, at), axis: angle_deg}.items()
    }
    coordinates = follow(model, coordinates, ball_mm)
    check_travel(scene, coordinates, f"the path about {axis}")
    point = nominal_point(model, Loop.TOOL, coordinates)
    return Followed(axis, coordinates, np.broadcast_to(point, (len(angle_deg), 3)), ball_mm)


def reachable(
    scene: Scene,
    model: Model,
    axis: str,
    ball_mm: Array,
    at: Mapping[str, float],
    start: float | None,
    end: float | None,
    points: int,
) -> Array:
    """Choose the positions of a rotary axis, [points], degrees.

    Where no ends are given: the part of its travel around where it stands, at most a turn, along
    which the linear axes can follow.

    Raises
    ------
    OptionError
        If there is none.
    """
    low, high = scene.machine.axes[axis].travel
    stand = stand_of(scene, at)
    here = float(np.clip(stand[axis], low, high))
    if high - low > 360.0:
        low = max(low, min(here - 180.0, high - 360.0))
        high = low + 360.0
    if start is not None or end is not None:
        first, last = low if start is None else start, high if end is None else end
        if not first < last:
            raise OptionError(f"{axis} from {first:g} to {last:g}°; expected start below end")
        return np.linspace(first, last, points)
    fine = np.unique(np.append(np.linspace(low, high, 721), here))
    coordinates = {
        name: np.broadcast_to(values, fine.shape) for name, values in {**stand, axis: fine}.items()
    }
    inside = np.broadcast_to(
        within_travel(scene.machine, follow(model, coordinates, ball_mm)), fine.shape
    )
    at_here = int(np.searchsorted(fine, here))
    if not inside[at_here]:
        spelled = ", ".join(f"{value:.4g}" for value in ball_mm)
        raise OptionError(
            f"the tool cannot reach the ball at ({spelled}) mm of the workpiece with"
            f" {axis} = {here:g}; give --ball x,y,z within the travel"
        )
    outside = np.flatnonzero(~inside)
    before, after = outside[outside < at_here], outside[outside > at_here]
    first = float(fine[before[-1] + 1] if len(before) else fine[0])
    last = float(fine[after[0] - 1] if len(after) else fine[-1])
    if last - first < 1.0:
        raise OptionError(
            f"{axis} could turn by {last - first:.2g}° only before a linear axis reaches its end;"
            " give --ball x,y,z nearer to the axis"
        )
    return np.linspace(first, last, points)


def circle_directions(model: Model, path: Followed) -> dict[str, Array]:
    """Give the radial, tangential and axial directions at the ball in every pose, [n, 3]."""
    line = axis_line(model, path.coordinates, path.axis)
    shape = path.point_mm.shape
    axial = np.broadcast_to(line.direction, shape)
    arm = path.point_mm - line.origin_mm
    arm = arm - np.sum(arm * axial, axis=-1, keepdims=True) * axial
    length = np.linalg.norm(arm, axis=-1, keepdims=True)
    if length.min() < 1e-3:
        raise OptionError(f"the ball lies on {path.axis}; expected a distance from it")
    radial = arm / length
    tangential: Array = np.asarray(np.cross(axial, radial), dtype=np.float64)
    return {"radial": radial, "tangential": tangential, "axial": axial}


def lay_followed(
    scene: Scene, model: Model, wanted: FollowedCircle, angle_deg: Array, sense: Array
) -> Plan:
    """Lay the plan of a ball bar beside a rotary axis; see `FollowedCircle`."""
    axis = rotary_axis(scene.machine, wanted.axis)
    stand = stand_of(scene, wanted.at)
    ball = default_ball(scene, model, axis, stand, wanted.radius_mm)
    path = followed(scene, model, axis, angle_deg, ball, wanted.at)
    directions = circle_directions(model, path)
    count = len(angle_deg)
    theta = np.deg2rad(angle_deg)
    return build_plan(
        path.coordinates,
        path.point_mm,
        directions[wanted.bar],
        place=f"{axis} turns · ball {wanted.radius_mm:g} mm from it · {wanted.bar} bar",
        marks={
            "angle_deg": angle_deg,
            "sense": sense,
            "along": np.cos(theta),
            "up": np.sin(theta),
            "radius_mm": np.full(count, wanted.radius_mm),
            "gain_sign": np.ones(count),
            "as_read": np.ones(count),
        },
        length_mm=BAR_MM,
        travel=travels(path.coordinates, sense),
        setup={
            **{f"ball_{name}_um": np.sum(column * directions[wanted.bar], axis=-1)
               for name, column in ball_columns(model, path.coordinates).items()},
            "bar_um": np.ones(count),
        },
    )  # fmt: skip


def ball_columns(model: Model, coordinates: Mapping[str, Array]) -> dict[str, Array]:
    """Give how a reading moves with the ball's place along x, y, z of the workpiece, [n, 3] each.

    A ball that stands further along x is missed by as much: the tool against it moves along −x.
    """
    pose = np.asarray(branch_pose(model, "workpiece", coordinates))
    count = np.broadcast_shapes(*(np.shape(values) for values in coordinates.values()))
    pose = np.broadcast_to(pose, (*count, 4, 4))
    return {name: -pose[..., :3, index] for index, name in enumerate("xyz")}


def travels(coordinates: Mapping[str, Array], sense: Array) -> dict[str, Array]:
    """Give the direction in which each axis has come along a path, [n], stretch by stretch."""
    found: dict[str, Array] = {}
    starts = np.flatnonzero(np.diff(sense, prepend=np.nan) != 0.0)
    for name, values in coordinates.items():
        step = np.diff(values, prepend=np.nan)
        step[starts] = np.nan
        for start in starts:  # the first point of a stretch is reached as the second one is
            step[start] = step[start + 1] if start + 1 < len(step) else 0.0
        step = np.where(np.abs(np.nan_to_num(step)) < 1e-9, 0.0, np.nan_to_num(step))
        if step.any():
            found[name] = np.sign(step)
    return found
