"""From the joints of a robot to the axes of a machine: names, offsets, rotations, travels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpspace.exceptions import SceneError, near_miss
from warpspace.kinematics.transforms import inverse
from warpspace.machine.axes import MAX_AXES, direction_index, is_axis_name, is_linear
from warpspace.machine.description import (
    Chain,
    Machine,
    Range,
    build_machine,
    default_travel,
)
from warpspace.machine.limits import MIN_SPAN
from warpspace.scene.urdf.frames import PARALLEL, axis_frame, relative_places
from warpspace.scene.urdf.reading import MOVING, path_to, root_of
from warpspace.units import Array

LARGEST = 1e9
"""Metres, or the length of a direction: beyond, products overflow."""

MM_PER_M = 1000.0
TOOL_NAMES = ("tool", "tcp", "tool0", "tool_tip", "t", "ee_link", "flange")
WORKPIECE_NAMES = ("workpiece", "work", "w", "table")


@dataclass(frozen=True, slots=True)
class Placed:
    """A machine read from a robot, and what became of its parts.

    Attributes
    ----------
    machine : Machine
    frame_of : dict of str to (str, ndarray)
        By link: the frame of the machine it rides on, and its pose in that frame with all joints at
        zero, [4, 4], mm.
    notes : list of str
        What was taken in another way, or has no place.
    """

    machine: Machine
    frame_of: dict[str, tuple[str, Array]]
    notes: list[str] = field(default_factory=list[str])


def place_robot(robot: Any, source: str, tool: str = "", workpiece: str = "") -> Placed:
    """Find the chain of a robot between workpiece and tool.

    Parameters
    ----------
    robot : yourdfpy.urdf.Robot
        A tree of links.
    source : str
        What it is called in messages.
    tool, workpiece : str, optional
        Names of links; by default links with such names, the only end of the tree, and the root.

    Returns
    -------
    Placed

    Raises
    ------
    SceneError
        If there is no such link, the ends are not clear, or a joint between them cannot be an axis.

    Notes
    -----
    Each axis gets a frame whose directions are those of the root where its joint moves along or
    about x, y or z of it, and else a frame turned by the smallest rotation that takes that
    direction to the joint's. Nominal poses of tool and workpiece are those of the robot.
    """
    ends = _end(robot, source, "tool", tool), _end(robot, source, "workpiece", workpiece)
    paths = [path_to(robot, end) for end in ends]
    shared = 0
    while shared < min(map(len, paths)) and paths[0][shared] is paths[1][shared]:
        shared += 1
    notes = [
        f"joint {joint.name!r} carries both tool and workpiece: left out"
        for joint in paths[0][:shared]
        if joint.type != "fixed"
    ]
    branches = [path[shared:] for path in paths]
    _check_joints([joint for branch in branches for joint in branch], source)
    start = _pose_mm(paths[0][:shared])
    poses: dict[str, Array] = {"R": np.eye(4)}
    travel: dict[str, Range] = {}
    direction: dict[str, int] = {}
    branch_axes: list[list[str]] = []
    still = {joint.name for branch in branches for joint in branch if _stands(joint)}
    notes += [f"joint {name!r} has one position only: taken as fixed at zero" for name in still]
    joints = [
        joint
        for branch in branches
        for joint in branch
        if joint.type in MOVING and joint.name not in still
    ]
    for joint in joints:
        length = float(np.linalg.norm(joint.axis))
        if abs(length - 1.0) > 1e-3:
            notes.append(f"joint {joint.name!r}: its axis has the length {length:g}; taken as 1")
    if not 1 <= len(joints) <= MAX_AXES:
        found = f"{len(joints)} moving joints between workpiece and tool"
        raise SceneError(source, [f"has {found}; expected one to {MAX_AXES}"])
    moving = {joint.name for joint in joints}
    directions = {
        joint.name: _direction(joint, _pose_mm(branch[: index + 1]))
        for branch in branches
        for index, joint in enumerate(branch)
        if joint.name in moving
    }
    names = _axis_names(joints, directions)
    for branch in branches:
        own: list[str] = []
        for index, joint in enumerate(branch):
            if joint.name not in moving:
                continue
            axis = names[joint.name]
            pose = _pose_mm(branch[: index + 1])
            poses[axis], direction[axis] = axis_frame(pose[:3, 3], directions[joint.name])
            travel[axis] = _travel(joint, axis, notes)
            own.append(axis)
        branch_axes.append(own)
    chain = Chain(tuple(branch_axes[1]), tuple(branch_axes[0]))
    poses |= {"t": _pose_mm(branches[0]), "w": _pose_mm(branches[1])}
    offsets, rotations = relative_places(poses, chain)
    machine = build_machine(
        chain,
        offset_mm=offsets,
        rotation_deg=rotations,
        travel=travel,
        direction={axis: sign for axis, sign in direction.items() if sign < 0},
        name="machine",
        title=str(robot.name or ""),
    )
    notes += [f"joint {name!r} is axis {axis}" for name, axis in names.items() if name != axis]
    links = _frames_of_links(robot, names, still, poses, start)
    return Placed(machine, links, notes)


def _end(robot: Any, source: str, what: str, wanted: str) -> str:
    """Find the link of the tool or of the workpiece."""
    links = [link.name for link in robot.links]
    if wanted:
        if wanted not in links:
            raise SceneError(source, [f"has no link {wanted!r}{near_miss(wanted, links)}"])
        return wanted
    lower = {name.lower(): name for name in reversed(links)}
    known = TOOL_NAMES if what == "tool" else WORKPIECE_NAMES
    if found := next((lower[name] for name in known if name in lower), ""):
        return found
    if what == "workpiece":
        return root_of(robot)
    parents = {joint.parent for joint in robot.joints}
    leaves = [name for name in links if name not in parents]
    carried = [name for name in leaves if any(j.type in MOVING for j in path_to(robot, name))]
    if len(carried) == 1:
        return carried[0]
    shown = ", ".join(map(repr, (carried or leaves)[:8]))
    raise SceneError(source, [f"ends in {shown}; expected --tool LINK to say which is the tool"])


def _check_joints(joints: Sequence[Any], source: str) -> None:
    """Refuse joints of a chain that cannot be axes."""
    problems: list[str] = []
    for joint in joints:
        if joint.mimic is not None:
            problems.append(
                f"joint {joint.name!r} mimics {joint.mimic.joint!r}; expected joints between"
                " workpiece and tool that move on their own"
            )
        elif joint.type in ("floating", "planar"):
            problems.append(
                f"joint {joint.name!r} is {joint.type}; expected joints with one axis each"
            )
        elif joint.type in MOVING and not _finite_direction(joint):
            problems.append(f"joint {joint.name!r}: its axis is no direction")
        if joint.origin is not None and not (np.abs(joint.origin) < LARGEST).all():
            problems.append(f"joint {joint.name!r}: its origin is no finite number")
    if problems:
        raise SceneError(source, problems)


def _finite_direction(joint: Any) -> bool:
    """Tell whether the axis of a joint is a direction."""
    axis = np.asarray(joint.axis, dtype=float)
    if axis.shape != (3,) or not np.isfinite(axis).all():
        return False
    return PARALLEL < math.hypot(*axis) < LARGEST


def _stands(joint: Any) -> bool:
    """Tell whether a joint that could move has one position only."""
    limit = joint.limit
    if joint.type not in ("revolute", "prismatic") or limit is None:
        return False
    if None in (limit.lower, limit.upper):
        return False
    per_unit = MM_PER_M if joint.type == "prismatic" else 180.0 / np.pi
    return bool(abs(limit.upper - limit.lower) * per_unit < MIN_SPAN)


def _pose_mm(joints: Sequence[Any]) -> Array:
    """Multiply the origins of joints, all at zero, [4, 4], mm."""
    pose = np.eye(4)
    for joint in joints:
        if joint.origin is not None:
            step = np.array(joint.origin, dtype=float)
            step[:3, 3] *= MM_PER_M
            pose = pose @ step
    return pose


def _direction(joint: Any, pose: Array) -> Array:
    """Give the direction of a joint in R, [3]."""
    axis = np.asarray(joint.axis, dtype=float)
    return pose[:3, :3] @ (axis / np.linalg.norm(axis))


def _axis_names(joints: Sequence[Any], directions: dict[str, Array]) -> dict[str, str]:
    """Name the axes: as their joints where that fits, else by direction, repeated with digits."""
    letters = {
        joint.name: ("XYZ" if joint.type == "prismatic" else "ABC")[
            int(np.argmax(np.abs(directions[joint.name])))
        ]
        for joint in joints
    }
    found: dict[str, str] = {}
    for joint in joints:
        name, letter = joint.name, letters[joint.name]
        fits = is_axis_name(name) and is_linear(name) == is_linear(letter)
        if fits and direction_index(name) == direction_index(letter):
            found[name] = name
    for joint in joints:
        if joint.name in found:
            continue
        letter = letters[joint.name]
        alone = sum(other == letter for other in letters.values()) == 1
        names = [letter] if alone else []
        names += [f"{letter}{digit}" for digit in range(1, 10)]
        found[joint.name] = next(name for name in names if name not in found.values())
    return {joint.name: found[joint.name] for joint in joints}


def _travel(joint: Any, axis: str, notes: list[str]) -> Range:
    """Give the travel of an axis, mm or degrees."""
    limit = joint.limit
    if joint.type == "continuous":
        return (0.0, 360.0) if direction_index(axis) == 2 else (-180.0, 180.0)
    ends = () if limit is None else (limit.lower, limit.upper)
    if len(ends) != 2 or None in ends or not np.isfinite(np.array(ends, float)).all():
        low, high = default_travel(axis)
        notes.append(f"joint {joint.name!r} has no limits: axis {axis} gets {low:g} … {high:g}")
        return low, high
    per_unit = MM_PER_M if joint.type == "prismatic" else 180.0 / np.pi
    low, high = sorted(round(float(end) * per_unit, 9) for end in ends)
    if ends[0] > ends[1]:
        notes.append(f"joint {joint.name!r}: its lower limit is above the upper one; exchanged")
    return low, high


def _frames_of_links(
    robot: Any, names: dict[str, str], still: set[str], poses: dict[str, Array], start: Array
) -> dict[str, tuple[str, Array]]:
    """Tell which frame of the machine every link rides on; links of other joints are left out."""
    found: dict[str, tuple[str, Array]] = {}
    for link in robot.links:
        joints = path_to(robot, link.name)
        moving = [joint for joint in joints if joint.type != "fixed" and joint.name not in still]
        if any(joint.name not in names for joint in moving):
            continue
        frame = names[moving[-1].name] if moving else "R"
        pose = inverse(poses[frame]) @ inverse(start) @ _pose_mm(joints)
        found[link.name] = (frame, pose)
    return found
