"""Machines from URDF files, the format of robot simulators."""

import io
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.exceptions import OptionError, SceneError, near_miss
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Model
from warpspace.kinematics.transforms import inverse, roll_pitch_yaw_deg
from warpspace.machine import definition, limits
from warpspace.machine.axes import MAX_AXES, direction_index, is_axis_name, is_linear
from warpspace.machine.errors import ToleranceSet
from warpspace.scene.model import Scene, spanning_axes
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import list_repeated, one_line, read_text
from warpspace.units import Array

MOVING = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*MOVING, "fixed", "floating", "planar")


def read_robot(path: Path) -> tuple[Any, tuple[str, ...]]:
    source = str(path)
    text = read_text(path, limits.MAX_SCENE_BYTES)
    other_tags = _check_xml(text, source)
    robot = _parse(text, source)
    problems = list(_problems(robot))
    if problems:
        raise SceneError(source, problems)
    return robot, other_tags


def _check_xml(text: str, source: str) -> tuple[str, ...]:
    try:
        from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
    except ImportError:
        raise not_installed() from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise SceneError(source, ["defines a document type; expected a plain URDF file"])
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False)
    try:
        root = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as error:
        raise SceneError(source, [f"is not valid XML: {error.msg}"]) from None
    if root.tag != "robot":
        raise SceneError(source, [f"is no URDF: begins with <{root.tag}>; expected <robot>"])
    names = [element.tag for element in root.iter() if isinstance(element.tag, str)]
    for count, limit, what in (
        (len(names), limits.MAX_URDF_ELEMENTS, "elements"),
        (names.count("link"), limits.MAX_LINKS, "links"),
        (names.count("joint"), limits.MAX_LINKS, "joints"),
        (names.count("visual"), limits.MAX_SHAPES, "shapes"),
    ):
        if count > limit:
            raise SceneError(source, [f"has {count:,} {what}; expected at most {limit:,}"])
    if any("xacro" in name for name in names):
        problem = "holds xacro macros; expected plain URDF (`xacro FILE > robot.urdf` expands it)"
        raise SceneError(source, [problem])
    return tuple(
        element.tag
        for element in root
        if isinstance(element.tag, str) and element.tag not in ("link", "joint", "material")
    )


def _parse(text: str, source: str) -> Any:
    try:
        from yourdfpy import URDF
    except ImportError:
        raise not_installed() from None
    try:
        # numbers that are not finite are reported by name later
        with np.errstate(all="ignore"):
            loaded = URDF.load(
                io.BytesIO(text.encode()), build_scene_graph=False, load_meshes=False, mesh_dir=""
            )
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, AssertionError) as error:
        # yourdfpy does not check: missing or invalid entries raise one of these
        reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:200]
        problem = (
            f"is no complete URDF ({reason}); expected links, and joints with parent and child"
        )
        raise SceneError(source, [problem]) from None
    return loaded.robot


def not_installed() -> OptionError:
    return OptionError(
        "URDF files need the package yourdfpy; expected it installed"
        " (pip install 'warpspace[urdf]')"
    )


def _problems(robot: Any) -> Iterable[str]:
    links = [link.name for link in robot.links]
    for what, names in (("link", links), ("joint", [joint.name for joint in robot.joints])):
        for name in sorted(map(str, list_repeated(names))):
            yield f"{what} {name!r} occurs twice; expected each name once"
    if not links:
        yield "has no link"
        return
    parents: dict[str, str] = {}
    link_names = set(links)
    for joint in robot.joints:
        where = f"joint {joint.name!r}"
        if joint.type not in JOINT_TYPES:
            yield f"{where}: type {joint.type!r}; expected one of {', '.join(JOINT_TYPES)}"
        for end in (joint.parent, joint.child):
            if end not in link_names:
                yield f"{where}: there is no link {end!r}"
        if joint.child in parents:
            yield (
                f"link {joint.child!r} hangs on joints {parents[joint.child]!r} and {joint.name!r}:"
                " a loop; expected one parent for each link"
            )
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if not roots:
        yield "every link has a parent: a loop; expected one link that hangs on nothing"
    elif len(roots) > 1:
        listed = ", ".join(map(repr, roots[:6]))
        yield f"links {listed} hang on nothing; expected one such link, the frame of the machine"


def root_of(robot: Any) -> str:
    children = {joint.child for joint in robot.joints}
    return next(link.name for link in robot.links if link.name not in children)


def path_to(robot: Any, link: str) -> list[Any]:
    by_child = {joint.child: joint for joint in robot.joints}
    path: list[Any] = []
    while link in by_child and len(path) <= len(by_child):
        path.append(by_child[link])
        link = by_child[link].parent
    return path[::-1]


PARALLEL = 1e-9  # deviation of a direction from x, y or z below which the frame is not turned


def axis_frame(origin_mm: Array, direction: Array) -> tuple[Array, int]:
    """Return the frame of an axis in R, [4, 4], mm, and the sign of its direction."""
    index = int(np.argmax(np.abs(direction)))
    sign = 1 if direction[index] > 0.0 else -1
    nominal = np.zeros(3)
    nominal[index] = sign
    pose = np.eye(4)
    pose[:3, 3] = origin_mm
    if np.abs(direction - nominal).max() > PARALLEL:
        from scipy.spatial.transform import Rotation

        pose[:3, :3] = Rotation.align_vectors(direction, nominal)[0].as_matrix()
    return pose, sign


def relative_places(
    poses: dict[str, Array], chain: definition.Chain
) -> tuple[dict[str, definition.Vector], dict[str, definition.Vector]]:
    """Turn frames in R into offsets and rotations of each in the frame before it."""
    offsets: dict[str, definition.Vector] = {}
    rotations: dict[str, definition.Vector] = {}
    for branch, end in ((chain.tool, "t"), (chain.workpiece, "w")):
        before = "R"
        for frame in (*branch, end):
            step = inverse(poses[before]) @ poses[frame]
            offsets[frame] = _rounded(step[:3, 3], 10)
            rotations[frame] = _rounded(roll_pitch_yaw_deg(step[:3, :3]), 12)
            before = frame
    return offsets, {frame: turn for frame, turn in rotations.items() if any(turn)}


def _rounded(values: Array, digits: int) -> definition.Vector:
    x, y, z = (round(float(value), digits) + 0.0 for value in values)
    return x, y, z


MOST_DEG = 720.0  # of a limit: an axis that turns further, ±4π, is likely to be in degrees
LARGEST = 1e9  # metres, or the length of a direction: beyond, products overflow

MM_PER_M = 1000.0
TOOL_NAMES = ("tool", "tcp", "tool0", "tool_tip", "t", "ee_link", "flange")
WORKPIECE_NAMES = ("workpiece", "work", "w", "table")


@dataclass(frozen=True, slots=True)
class RobotMachine:
    """A machine read from a robot, and the frames of its links."""

    machine: definition.Machine
    # by link: its frame of the machine, and its pose in that frame, [4, 4] in mm, joints at zero
    frame_of: dict[str, tuple[str, Array]]
    notes: list[str] = field(default_factory=list[str])  # on converted or ignored entries


def place_robot(robot: Any, source: str, tool: str = "", workpiece: str = "") -> RobotMachine:
    """Find the chain of a robot between workpiece and tool.

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
    branch_joints = [joint for branch in branches for joint in branch]
    problems = list(_joint_problems(branch_joints))
    if problems:
        raise SceneError(source, problems)
    fixed_names = [joint.name for joint in branch_joints if _stands(joint)]
    notes += [
        f"joint {name!r} has one position only: taken as fixed at zero" for name in fixed_names
    ]
    moving_joints = (joint for joint in branch_joints if joint.type in MOVING)
    joints = [joint for joint in moving_joints if joint.name not in fixed_names]
    lengths = {joint.name: float(np.linalg.norm(joint.axis)) for joint in joints}
    notes += [
        f"joint {name!r}: its axis has the length {length:g}; taken as 1"
        for name, length in lengths.items()
        if abs(length - 1.0) > 1e-3
    ]
    if not 1 <= len(joints) <= MAX_AXES:
        problem = f"{len(joints)} moving joints between workpiece and tool"
        raise SceneError(source, [f"has {problem}; expected one to {MAX_AXES}"])
    moving = {joint.name for joint in joints}
    places = {
        joint.name: _pose_mm(branch[: index + 1])
        for branch in branches
        for index, joint in enumerate(branch)
        if joint.name in moving  # few; for all links the time is quadratic
    }
    directions = {
        joint.name: places[joint.name][:3, :3] @ (np.asarray(joint.axis) / lengths[joint.name])
        for joint in joints
    }
    names = _axis_names(joints, directions)
    poses = {"R": np.eye(4), "t": _pose_mm(branches[0]), "w": _pose_mm(branches[1])}
    travel: dict[str, definition.Range] = {}
    direction: dict[str, int] = {}
    for joint in joints:
        axis = names[joint.name]
        poses[axis], direction[axis] = axis_frame(places[joint.name][:3, 3], directions[joint.name])
        travel[axis] = _travel(joint, axis, notes)
    sides = (tuple(names[one.name] for one in way if one.name in names) for way in branches[::-1])
    chain = definition.Chain(*sides)
    offsets, rotations = relative_places(poses, chain)
    machine = definition.build_machine(
        chain,
        offset_mm=offsets,
        rotation_deg=rotations,
        travel=travel,
        direction={axis: sign for axis, sign in direction.items() if sign < 0},
        name="machine",
        title=one_line(str(robot.name or "")),
    )
    notes += [f"joint {name!r} is axis {axis}" for name, axis in names.items() if name != axis]
    start = _pose_mm(paths[0][:shared])
    return RobotMachine(machine, _frames_of_links(robot, names, fixed_names, poses, start), notes)


def _end(robot: Any, source: str, what: str, link: str) -> str:
    links = [body.name for body in robot.links]
    if link:
        if link not in links:
            raise SceneError(source, [f"has no link {link!r}{near_miss(link, links)}"])
        return link
    lower = {name.lower(): name for name in reversed(links)}
    for name in TOOL_NAMES if what == "tool" else WORKPIECE_NAMES:
        if name in lower:
            return lower[name]
    if what == "workpiece":
        return root_of(robot)
    parents = {joint.parent for joint in robot.joints}
    leaves = [name for name in links if name not in parents]
    carried = [name for name in leaves if any(j.type in MOVING for j in path_to(robot, name))]
    if len(carried) == 1:
        return carried[0]
    listed = ", ".join(map(repr, (carried or leaves)[:8]))
    raise SceneError(source, [f"ends in {listed}; expected --tool LINK"])


def _joint_problems(joints: Sequence[Any]) -> Iterable[str]:
    for joint in joints:
        where = f"joint {joint.name!r}"
        if joint.mimic is not None:
            expected = "expected joints between workpiece and tool that move on their own"
            yield f"{where} mimics {joint.mimic.joint!r}; {expected}"
        elif joint.type in ("floating", "planar"):
            yield f"{where} is {joint.type}; expected joints with one axis each"
        elif joint.type in MOVING and not _finite_direction(joint):
            yield f"{where}: its axis is no direction"
        if joint.origin is not None and not (np.abs(joint.origin) < LARGEST).all():
            yield f"{where}: its origin is no finite number"


def _finite_direction(joint: Any) -> bool:
    axis = np.asarray(joint.axis, dtype=float)
    if axis.shape != (3,) or not np.isfinite(axis).all():
        return False
    return PARALLEL < math.hypot(*axis) < LARGEST


def _stands(joint: Any) -> bool:
    limit = joint.limit
    if joint.type not in ("revolute", "prismatic") or limit is None:
        return False
    if None in (limit.lower, limit.upper):
        return False
    per_unit = MM_PER_M if joint.type == "prismatic" else 180.0 / np.pi
    return bool(abs(limit.upper - limit.lower) * per_unit < limits.MIN_SPAN)


def _pose_mm(joints: Sequence[Any]) -> Array:
    pose = np.eye(4)
    for joint in joints:
        if joint.origin is not None:
            step = np.array(joint.origin, dtype=float)
            step[:3, 3] *= MM_PER_M
            pose = pose @ step
    return pose


def _axis_names(joints: Sequence[Any], directions: dict[str, Array]) -> dict[str, str]:
    letters = {
        joint.name: ("XYZ" if joint.type == "prismatic" else "ABC")[
            int(np.argmax(np.abs(directions[joint.name])))
        ]
        for joint in joints
    }
    axis_of: dict[str, str] = {}
    for joint in joints:
        name, letter = joint.name, letters[joint.name]
        fits = is_axis_name(name) and is_linear(name) == is_linear(letter)
        if fits and direction_index(name) == direction_index(letter):
            axis_of[name] = name
    for joint in joints:
        if joint.name in axis_of:
            continue
        letter = letters[joint.name]
        is_unique = sum(other == letter for other in letters.values()) == 1
        names = [letter] if is_unique else []
        names += [f"{letter}{digit}" for digit in range(1, 10)]
        axis_of[joint.name] = next(name for name in names if name not in axis_of.values())
    return {joint.name: axis_of[joint.name] for joint in joints}


def _travel(joint: Any, axis: str, notes: list[str]) -> definition.Range:
    limit = joint.limit
    if joint.type == "continuous":
        return (0.0, 360.0) if direction_index(axis) == 2 else (-180.0, 180.0)
    ends = () if limit is None else (limit.lower, limit.upper)
    if len(ends) != 2 or None in ends or not np.isfinite(np.array(ends, float)).all():
        low, high = definition.default_travel(axis)
        notes.append(f"joint {joint.name!r} has no limits: axis {axis} gets {low:g} … {high:g}")
        return low, high
    per_unit = MM_PER_M if joint.type == "prismatic" else 180.0 / np.pi
    low, high = sorted(round(float(end) * per_unit, 9) for end in ends)
    if ends[0] > ends[1]:
        notes.append(f"joint {joint.name!r}: its lower limit is above the upper one; exchanged")
    if joint.type != "prismatic" and max(-low, high) > MOST_DEG:
        notes.append(
            f"joint {joint.name!r}: limits {ends[0]:g} … {ends[1]:g} rad, {low:.4g} … {high:.4g}°,"
            " reach beyond ±4π: are they degrees? URDF has radians"
        )
    return low, high


def _frames_of_links(
    robot: Any, names: dict[str, str], fixed_names: list[str], poses: dict[str, Array], start: Array
) -> dict[str, tuple[str, Array]]:
    frame_of: dict[str, tuple[str, Array]] = {}
    below: dict[str, list[Any]] = {}
    for joint in robot.joints:
        below.setdefault(joint.parent, []).append(joint)
    before = {frame: inverse(pose) @ inverse(start) for frame, pose in poses.items()}
    waiting = [(root_of(robot), "R", np.eye(4))]
    while waiting:
        link, frame, pose = waiting.pop()
        frame_of[link] = (frame, before[frame] @ pose)
        for joint in below.get(link, ()):
            moves = joint.type != "fixed" and joint.name not in fixed_names
            if not moves or joint.name in names:
                onto = names[joint.name] if moves else frame
                waiting.append((joint.child, onto, pose @ _pose_mm([joint])))
    return frame_of


TOLERANCES = {"translation": 10.0, "rotation": 20.0, "squareness": 25.0}
ARM_RANGE = 30.0  # half of the range that a rotary axis spans the volume with, degrees
LONGEST_NOTE = 300


def imported_text(
    machine: definition.Machine, source: str, notes: Sequence[str], meshes: Mapping[str, str]
) -> str:
    scene = Scene(
        name="imported",
        title=machine.title or one_line(source),
        model=Model(machine),
        workspace=Workspace(_ranges(machine)),
        tolerances=ToleranceSet(TOLERANCES),
    )
    head = [f"# Read from {_plain(source)}. Lengths mm, angles degrees."]
    head += [f"# {_plain(note)}" for note in notes]
    parts = ["\n".join(head), scene_to_toml(scene).strip()]
    if meshes:
        lines = ["[bodies]", *(f'{frame} = "{file}"' for frame, file in meshes.items())]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _plain(text: str) -> str:
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    return printable if len(printable) <= LONGEST_NOTE else printable[: LONGEST_NOTE - 1] + "…"


def _ranges(machine: definition.Machine) -> dict[str, definition.Range]:
    spanning = spanning_axes(machine.axes)
    ranges: dict[str, definition.Range] = {}
    for name, axis in machine.axes.items():
        low, high = axis.travel
        at = min(max(0.0, low), high)
        ranges[name] = axis.travel if name in spanning else (at, at)
    free = 3 - len(spanning)
    turning = [name for name in machine.chain.tool if not is_linear(name)]
    if free > 1:
        for name in turning[:free]:
            low, high = machine.axes[name].travel
            middle = min(max(0.0, low + ARM_RANGE), high - ARM_RANGE)
            ends = max(low, middle - ARM_RANGE), min(high, middle + ARM_RANGE)
            ranges[name] = ends if ends[0] < ends[1] else ranges[name]
    return ranges


MAX_LISTED = 6  # names that a remark lists

_NO_PLACE: tuple[tuple[str, str, Callable[[Any], object]], ...] = (
    ("links", "masses and inertias", lambda link: link.inertial is not None),
    ("links", "collision shapes", lambda link: bool(link.collisions)),
    ("links", "materials", lambda link: any(one.material is not None for one in link.visuals)),
    (
        "joints",
        "largest efforts and velocities",
        lambda joint: (
            joint.limit is not None and (joint.limit.effort or joint.limit.velocity) is not None
        ),
    ),
    ("joints", "damping and friction", lambda joint: joint.dynamics is not None),
    ("joints", "safety controllers", lambda joint: joint.safety_controller is not None),
    ("joints", "calibrations", lambda joint: joint.calibration is not None),
)


def omitted_notes(robot: Any, other_tags: Sequence[str], links: Collection[str]) -> list[str]:
    omitted = [link.name for link in robot.links if link.name not in links]
    mimics = [one.name for one in robot.joints if one.child in omitted and one.mimic is not None]
    lists = [
        ("not between workpiece and tool, left out: links", omitted),
        ("mimic joints, left out:", mimics),
        *(
            (
                f"{what} have no place: {kind}",
                [one.name for one in getattr(robot, kind) if has(one)],
            )
            for kind, what, has in _NO_PLACE
        ),
        ("have no place:", list(dict.fromkeys(other_tags))),
    ]
    return [f"{what} {_listed(names)}" for what, names in lists if names]


def _listed(names: Iterable[str]) -> str:
    quoted = [repr(name) for name in names]
    omitted = len(quoted) - MAX_LISTED
    return ", ".join(quoted[:MAX_LISTED]) + (f" and {omitted} more" if omitted > 0 else "")
