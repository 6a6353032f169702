"""URDF in and out: poses against the kinematics of yourdfpy."""

import re

import numpy as np
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st

from chains import models
from warpspace.exceptions import SceneError
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.kinematics.transforms import inverse
from warpspace.outputs.exports.urdf_export import build_robot
from warpspace.scene.library import parse_scene
from warpspace.scene.urdf import imported_text, place_robot, read_robot

SINGLE_PRECISION_MM = 0.02
"""yourdfpy holds joint positions in single precision: 1e-7 of up to 20 m, and of as long levers."""
number = st.integers(-2000, 2000).map(lambda n: n / 1000.0)


def tool_in_workpiece_mm(machine, at):
    """Pose of the tool frame in the workpiece frame, mm."""
    coordinates = complete_coordinates(machine, at)
    model = Model(machine)
    tool, workpiece = (branch_pose(model, side, coordinates) for side in ("tool", "workpiece"))
    return inverse(workpiece) @ tool


def pose_by_yourdfpy_mm(robot, at, tool="tool", workpiece="workpiece"):
    model = yourdfpy.URDF(robot, build_scene_graph=True, load_meshes=False)
    model.update_cfg(at)
    pose = np.array(model.get_transform(tool, workpiece))
    pose[:3, 3] *= 1000.0
    return pose


def in_si(machine, at):
    linear = {name: axis.is_linear for name, axis in machine.axes.items()}
    return {name: q / 1000.0 if linear[name] else np.deg2rad(q) for name, q in at.items()}


@given(models(), st.randoms(use_true_random=False))
def test_an_exported_machine_has_the_poses_of_yourdfpy(model, random):
    machine = model.machine
    at = {name: random.uniform(*axis.travel) for name, axis in machine.axes.items()}
    found = pose_by_yourdfpy_mm(build_robot(machine, {}), in_si(machine, at))
    assert found == pytest.approx(tool_in_workpiece_mm(machine, at), abs=SINGLE_PRECISION_MM)


JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{x} {y} {z}" rpy="{r} {p} {w}"/><axis xyz="{a} {b} {c}"/>
<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>"""


@st.composite
def robots(draw):
    kinds = st.sampled_from(("revolute", "prismatic", "continuous", "fixed"))
    parts, links = [], ["base"]
    for branch, end in (("s", "tool"), ("q", "workpiece")):
        parent = "base"
        chosen = [*draw(st.lists(kinds, min_size=1, max_size=4)), "fixed"]
        for index, kind in enumerate(chosen):
            child = end if index == len(chosen) - 1 else f"{branch}{index}"
            axis = draw(st.tuples(number, number, number).filter(lambda v: max(map(abs, v)) > 0.1))
            unit = np.array(axis) / np.linalg.norm(axis)
            plain = draw(st.sampled_from(((1, 0, 0), (0, -1, 0), (0, 0, 1), tuple(unit.tolist()))))
            values = {key: draw(number) for key in "xyzrpw"}
            text = JOINT.format(
                name=f"j_{branch}{index}", kind=kind, parent=parent, child=child,
                a=plain[0], b=plain[1], c=plain[2], low=-1.5, high=2.0, **values,
            )  # fmt: skip
            parts.append(text)
            links.append(child)
            parent = child
    return (
        '<robot name="r">'
        + "".join(f'<link name="{n}"/>' for n in links)
        + "".join(parts)
        + "</robot>"
    )


@given(robots(), st.randoms(use_true_random=False))
def test_an_imported_robot_has_the_poses_of_yourdfpy(tmp_path_factory, text, random):
    path = tmp_path_factory.mktemp("urdf") / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    robot, _ = read_robot(path)
    moving = [joint for joint in robot.joints if joint.type != "fixed"]
    if not moving:
        with pytest.raises(SceneError, match="0 moving joints"):
            place_robot(robot, "robot")
        return
    found = place_robot(robot, "robot")
    scene = parse_scene(imported_text(found.machine, "robot.urdf", found.notes, {}), "robot")
    assert not list(scene.errors)  # an import has the errors of its source: none
    machine = scene.machine
    axis_of = {
        note.split("'")[1]: note.rpartition(" ")[2] for note in found.notes if " is axis " in note
    }
    at = {axis_of[joint.name]: random.uniform(-100.0, 100.0) for joint in moving}
    si = {joint.name: in_si(machine, at)[axis_of[joint.name]] for joint in moving}
    found_mm = tool_in_workpiece_mm(machine, at)
    assert found_mm == pytest.approx(pose_by_yourdfpy_mm(robot, si), abs=SINGLE_PRECISION_MM)


FANUC = """revolute,0 0 0.35,0 0 0,0 0 1 revolute,0.15 0 0,0 0 0,0 1 0
revolute,0 0 0.25,0 0 0,0 -1 0 revolute,0 0 0.075,0 0 0,-1 0 0
revolute,0.29 0 0,0 0 0,0 -1 0 revolute,0.08 0 0,0 0 0,-1 0 0
fixed,0 0 0,3.14159265359 -1.57079632679 0,0 0 1"""
GEN3 = """continuous,0 0 0.15643,3.1416 0 0,0 0 1 revolute,0 0.005375 -0.12838,1.5708 0 0,0 0 1
continuous,0 -0.21038 -0.006375,-1.5708 0 0,0 0 1 revolute,0 0.006375 -0.21038,1.5708 0 0,0 0 1
continuous,0 -0.20843 -0.006375,-1.5708 0 0,0 0 1 revolute,0 0.00017505 -0.10593,1.5708 0 0,0 0 1
continuous,0 -0.10593 -0.00017505,-1.5708 0 0,0 0 1 fixed,0 0 -0.059525,3.1416 0 0,0 0 1"""
FANUC_AT = {"C": 20.0, "B1": 30.0, "B2": -15.0, "A1": 40.0, "B3": 50.0, "A2": -60.0}


def robot_of(rows):
    """A chain of joints of public robots: type, origin, roll pitch yaw, axis."""
    joints = re.findall(r"(\w+),([^,]+),([^,]+),(\S+ \S+ \S+)", rows)
    text = "".join(f'<link name="l{n}"/>' for n in range(len(joints) + 1))
    for n, (kind, xyz, rpy, axis) in enumerate(joints):
        limit = "" if kind == "fixed" else '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
        text += (
            f'<joint name="j{n}" type="{kind}"><origin xyz="{xyz}" rpy="{rpy}"/>'
            f'<axis xyz="{axis}"/>'
            f'<parent link="l{n}"/><child link="l{n + 1}"/>{limit}</joint>'
        )
    return f'<robot name="r">{text}</robot>'


@pytest.mark.parametrize(
    ("rows", "at", "expected"),
    [(FANUC, FANUC_AT, (552.834, 243.136, 411.313)), (GEN3, {}, None)],
)
def test_public_robots_have_their_poses_and_no_errors(tmp_path, rows, at, expected):
    path = tmp_path / "robot.urdf"
    path.write_text(robot_of(rows), encoding="utf-8")
    robot, _ = read_robot(path)
    found = place_robot(robot, "robot")
    scene = parse_scene(imported_text(found.machine, "robot.urdf", found.notes, {}), "robot")
    assert not list(scene.errors)
    at = at or dict.fromkeys(scene.machine.axes, 0.0)
    pose = tool_in_workpiece_mm(scene.machine, at)
    if expected is None:  # stretched upwards
        expected = pose_by_yourdfpy_mm(robot, {}, robot.links[-1].name, robot.links[0].name)[:3, 3]
    assert pose[:3, 3] == pytest.approx(np.array(expected), abs=1e-2)


@given(models())
def test_a_machine_comes_back_with_its_names_and_places(model):
    machine = model.machine
    back = place_robot(build_robot(machine, {}), "back").machine
    at = {name: sum(axis.travel) / 3.0 for name, axis in machine.axes.items()}
    assert len(back.axes) == len(machine.axes)
    if back.chain == machine.chain:
        expected = tool_in_workpiece_mm(machine, at)
        assert tool_in_workpiece_mm(back, at) == pytest.approx(expected, abs=1e-6)
        for name, axis in machine.axes.items():
            assert back.axes[name].travel == pytest.approx(axis.travel, abs=1e-6)
