"""URDF in and out: poses against the kinematics of yourdfpy, and bad files in words."""

from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from chains import models
from warpspace.bodies.urdf_meshes import frame_meshes
from warpspace.exceptions import SceneError
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.kinematics.transforms import inverse
from warpspace.machine.description import Machine
from warpspace.outputs.exports.urdf import build_robot
from warpspace.scene.library import parse_scene
from warpspace.scene.urdf.left_out import left_out
from warpspace.scene.urdf.placing import place_robot
from warpspace.scene.urdf.reading import read_robot
from warpspace.scene.urdf.text import imported_text

SINGLE_PRECISION_MM = 0.02
"""yourdfpy holds joint positions in single precision: 1e-7 of up to 20 m, and of as long levers."""
number = st.integers(-2000, 2000).map(lambda n: n / 1000.0)


def tool_in_workpiece_mm(machine: Machine, at: dict[str, float]) -> np.ndarray:
    """Pose of the tool frame in the workpiece frame, mm."""
    coordinates = complete_coordinates(machine, at)
    model = Model(machine)
    tool, workpiece = (branch_pose(model, side, coordinates) for side in ("tool", "workpiece"))
    return inverse(workpiece) @ tool


def pose_by_yourdfpy_mm(robot, at: dict[str, float], tool="tool", workpiece="workpiece"):
    """The same by yourdfpy: joints in m and rad."""
    model = yourdfpy.URDF(robot, build_scene_graph=True, load_meshes=False)
    model.update_cfg(at)
    pose = np.array(model.get_transform(tool, workpiece))
    pose[:3, 3] *= 1000.0
    return pose


def pose_by_product_mm(robot, at: dict[str, float]) -> np.ndarray:
    """The same by a product written apart, in double precision; yourdfpy rounds to single."""
    by_child = {joint.child: joint for joint in robot.joints}

    def pose(link: str) -> np.ndarray:
        if link not in by_child:
            return np.eye(4)
        joint, motion = by_child[link], np.eye(4)
        if joint.type == "prismatic":
            motion[:3, 3] = at[joint.name] * joint.axis
        elif joint.type != "fixed":
            motion[:3, :3] = Rotation.from_rotvec(at[joint.name] * joint.axis).as_matrix()
        return pose(joint.parent) @ joint.origin @ motion

    found = np.linalg.solve(pose("workpiece"), pose("tool"))
    found[:3, 3] *= 1000.0
    return found


def in_si(machine: Machine, at: dict[str, float]) -> dict[str, float]:
    linear = {name: axis.is_linear for name, axis in machine.axes.items()}
    return {name: q / 1000.0 if linear[name] else np.deg2rad(q) for name, q in at.items()}


@settings(max_examples=30)
@given(models(), st.randoms(use_true_random=False))
def test_an_exported_machine_has_the_poses_of_yourdfpy(model, random) -> None:
    machine = model.machine
    at = {name: random.uniform(*axis.travel) for name, axis in machine.axes.items()}
    robot, expected = build_robot(machine, {}), tool_in_workpiece_mm(machine, at)
    assert pose_by_product_mm(robot, in_si(machine, at)) == pytest.approx(expected, abs=1e-7)
    found = pose_by_yourdfpy_mm(robot, in_si(machine, at))
    assert found == pytest.approx(expected, abs=SINGLE_PRECISION_MM)


JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{x} {y} {z}" rpy="{r} {p} {w}"/><axis xyz="{a} {b} {c}"/>
<limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>"""


@st.composite
def robots(draw) -> str:
    """URDF texts: two branches of joints in any direction, fixed ones between them."""
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


@settings(max_examples=30)
@given(robots(), st.randoms(use_true_random=False))
def test_an_imported_robot_has_the_poses_of_yourdfpy(tmp_path_factory, text, random) -> None:
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
    machine = scene.machine
    axis_of = {
        note.split("'")[1]: note.rpartition(" ")[2] for note in found.notes if " is axis " in note
    }
    at = {axis_of[joint.name]: random.uniform(-100.0, 100.0) for joint in moving}
    si = {joint.name: in_si(machine, at)[axis_of[joint.name]] for joint in moving}
    found_mm = tool_in_workpiece_mm(machine, at)
    assert found_mm == pytest.approx(pose_by_product_mm(robot, si), abs=1e-6)
    assert found_mm == pytest.approx(pose_by_yourdfpy_mm(robot, si), abs=SINGLE_PRECISION_MM)


@settings(max_examples=30)
@given(models())
def test_a_machine_comes_back_with_its_names_and_places(model) -> None:
    machine = model.machine
    back = place_robot(build_robot(machine, {}), "back").machine
    at = {name: sum(axis.travel) / 3.0 for name, axis in machine.axes.items()}
    assert len(back.axes) == len(machine.axes)
    if [*back.axes] == [*machine.axes]:
        expected = tool_in_workpiece_mm(machine, at)
        assert tool_in_workpiece_mm(back, at) == pytest.approx(expected, abs=1e-6)
        for name, axis in machine.axes.items():
            assert back.axes[name].travel == pytest.approx(axis.travel, abs=1e-6)


LINKS = '<link name="base"/><link name="a"/><link name="tool"/>'
ONE = (
    '<joint name="one" type="prismatic"><parent link="base"/><child link="a"/><axis xyz="1 0 0"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
)
TWO = (
    '<joint name="two" type="revolute"><parent link="a"/><child link="tool"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/>{}</joint>'
)


def read(tmp_path: Path, body: str, **options: str):
    path = tmp_path / "robot.urdf"
    path.write_text(body if body.startswith("<!") else f'<robot name="r">{body}</robot>', "utf-8")
    robot, others = read_robot(path)
    found = place_robot(robot, str(path), **options)
    return found, [*found.notes, *left_out(robot, others, found.frame_of)]


def test_what_has_no_place_is_named(tmp_path: Path) -> None:
    finger = (
        '<link name="finger"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="grip" type="prismatic"><parent link="a"/><child link="finger"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/>'
        '<mimic joint="two"/></joint><transmission name="t"/><gazebo/>'
    )
    found, notes = read(tmp_path, LINKS + ONE + TWO.format("") + finger)
    assert str(found.machine.chain) == "wFXCt"
    text = "\n".join(notes)
    for part in (
        "'finger'",
        "mimic joints, left out: 'grip'",
        "masses",
        "'transmission', 'gazebo'",
    ):
        assert part in text, text
    assert "efforts and velocities" in text


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (LINKS + ONE + TWO.format('<mimic joint="one"/>'), "joint 'two' mimics 'one'"),
        (LINKS + ONE + TWO.format("") + TWO.format("").replace("two", "three").replace(
            'parent link="a"', 'parent link="base"'), "a loop"),
        (LINKS + ONE, "hang on nothing"),
        (LINKS + ONE + TWO.format("").replace('link="a"', 'link="b"'), "there is no link 'b'"),
        (LINKS + ONE + TWO.format("").replace("revolute", "planar"), "'two' is planar"),
        (LINKS + ONE + TWO.format("").replace("revolute", "screw"), "type 'screw'"),
        (LINKS + ONE + TWO.format("").replace("0 0 1", "0 0 0"), "no direction"),
        (LINKS + ONE + TWO.format("").replace("0 0 1", "9e210 0 0"), "no direction"),
        (LINKS + ONE + TWO.format('<origin xyz="1e300 0 0"/>'), "origin is no finite number"),
        (LINKS + ONE + TWO.format('<origin xyz="0 9e999 0"/>'), "origin is no finite number"),
        (LINKS + ONE + TWO.format('<origin rpy="9e999 0 0"/>'), "origin is no finite number"),
        (LINKS + ONE + TWO.format("").replace("0 0 1", "a b c"), "no complete URDF"),
        (LINKS + '<joint name="one" type="fixed"/>', "no complete URDF"),
        (LINKS + ONE + ONE, "joint 'one' is there twice"),
        ("", "has no link"),
        (LINKS[:-4], "is not valid XML"),
        ("<xacro:macro/>" + LINKS, "XML"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><robot name="r">&a;</robot>', "document type"),
        (LINKS.replace("tool", "b") + ONE + TWO.format("").replace('"tool"', '"b"').replace(
            'parent link="a"', 'parent link="base"'), "--tool LINK"),
    ],
)  # fmt: skip
def test_what_is_no_machine_is_said_in_one_message(tmp_path: Path, body: str, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, body)
    assert said in str(caught.value)


def test_tool_and_workpiece_may_be_named(tmp_path: Path) -> None:
    found, _ = read(tmp_path, LINKS + ONE + TWO.format(""), tool="a", workpiece="tool")
    assert str(found.machine.chain) == "wCFt"  # both hang on "one", which carries both
    with pytest.raises(SceneError, match="has no link 'tol'"):
        read(tmp_path, LINKS + ONE + TWO.format(""), tool="tol")


def test_a_direction_that_is_no_unit_vector_is_noted(tmp_path: Path) -> None:
    found, notes = read(tmp_path, LINKS + ONE.replace("1 0 0", "2 0 0") + TWO.format(""))
    assert found.machine.axes["X"].travel == (-1000.0, 1000.0)
    assert any("'one': its axis has the length 2" in note for note in notes)


def test_joints_without_limits_and_with_one_position_are_noted(tmp_path: Path) -> None:
    loose = ONE.replace('<limit lower="-1" upper="1" effort="1" velocity="1"/>', "")
    fixed = TWO.format("").replace('lower="-1" upper="1"', 'lower="1" upper="1"')
    found, notes = read(tmp_path, LINKS + loose + fixed)
    assert str(found.machine.chain) == "wFXt"
    assert any("'one' has no limits" in note for note in notes)
    assert any("'two' has one position" in note for note in notes)


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        ('<box size="0.1 0.1"/>', "its box has no size"),
        ('<box size="-inf 0.1 0.2"/>', "its box has no size"),
        ('<box size="nan 0.1 0.2"/>', "its box has no size"),
        ('<cylinder radius="1e300" length="1"/>', "its cylinder has no size"),
        ('<sphere radius="inf"/>', "its sphere has no size"),
    ],
)
def test_a_shape_without_a_size_is_left_out(tmp_path: Path, shape: str, said: str) -> None:
    text = f"""<robot name="r"><link name="base"/><link name="tool">
      <visual><geometry>{shape}</geometry></visual>
      <visual><origin xyz="1e200 0 0"/><geometry><box size="1 1 1"/></geometry></visual></link>
      <joint name="x" type="prismatic"><parent link="base"/><child link="tool"/>
      <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""
    path = tmp_path / "r.urdf"
    path.write_text(text, encoding="utf-8")
    robot, _ = read_robot(path)
    meshes, notes, _ = frame_meshes(robot, {"tool": ("X", np.eye(4))}, tmp_path)
    assert meshes == {}
    assert any(said in note for note in notes)
    assert any("the place of its shape is no finite number" in note for note in notes)
