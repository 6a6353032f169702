"""The bundled machines: what each comes with, and its poses against other implementations."""

import numpy as np
import pytest
import trimesh

from warpspace import evaluate, load_scene
from warpspace.bodies.placed import load_bodies
from warpspace.kinematics.chain import body_motions
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.machine.description import build_machine
from warpspace.outputs.exports.meshes import write_glb
from warpspace.picture.model import evaluate_picture
from warpspace.scene.library import scene_names
from warpspace.scene.machines import load_machine, machine_names, machine_picture

MACHINES = machine_names()
LIBRARY = tuple(name for name in MACHINES if name != "dvf5000")
POSES = 20


def poses(machine, positions):
    coordinates = {name: np.asarray(value) for name, value in positions.items()}
    found = body_motions(Model(machine), {}, complete_coordinates(machine, coordinates))
    return {name: motion.nominal for name, motion in found.items()}


def tip(machine, **positions):
    found = poses(machine, positions)
    return (np.linalg.inv(found["w"]) @ found["t"])[:3, 3]


def random_positions(machine, rng):
    return {name: rng.uniform(*axis.travel) for name, axis in machine.axes.items()}


def test_every_machine_has_a_scene_a_source_and_a_picture():
    for name in MACHINES:
        machine = load_machine(name)
        assert len(machine.source) > 20, name
        assert machine.title not in ("", name)
        assert machine_picture(name) is not None, name
    assert {f"machine_{name}" for name in LIBRARY} <= set(scene_names())


@pytest.mark.parametrize("name", MACHINES)
def test_positive_linear_axes_move_the_tool_with_their_name_over_the_workpiece(name):
    # ISO 841, whichever side moves, with all rotary axes at zero
    machine = load_machine(name)
    for axis in machine.axes.values():
        if not axis.is_linear:
            continue
        found = poses(machine, {axis.name: 0.0})
        way = (np.linalg.inv(found["w"]) @ found[axis.name])[:3, axis.index]
        moved = tip(machine, **{axis.name: 1.0}) - tip(machine, **{axis.name: 0.0})
        np.testing.assert_allclose(moved, way, atol=1e-12)


@pytest.mark.parametrize("name", MACHINES)
def test_nominal_poses_agree_with_pinocchio(name):
    pin = pytest.importorskip("pinocchio")
    machine, rng = load_machine(name), np.random.default_rng(11)
    model, ends = pin.Model(), {}
    sides = ((machine.chain.tool, ("S", "t")), (machine.chain.workpiece, ("w",)))
    for side, fixed_frames in sides:
        parent = 0
        for frame in side:
            axis = machine.axes[frame]
            turn = pin.rpy.rpyToMatrix(*np.deg2rad(axis.rotation_deg))
            unit = axis.direction * np.eye(3)["XYZABC".index(frame[0]) % 3]
            kind = (
                pin.JointModelPrismaticUnaligned
                if axis.is_linear
                else pin.JointModelRevoluteUnaligned
            )
            place = pin.SE3(turn, np.array(axis.offset_mm, dtype=float))
            parent = model.addJoint(parent, kind(unit), place, frame)
        behind = pin.SE3.Identity()
        for frame in fixed_frames:
            turn = pin.rpy.rpyToMatrix(*np.deg2rad(machine.fixed_deg.get(frame, (0.0, 0.0, 0.0))))
            behind = behind * pin.SE3(turn, np.array(machine.fixed_mm[frame], dtype=float))
        ends[fixed_frames[-1]] = (parent, behind)
    data = model.createData()
    for _ in range(POSES):
        positions, q = random_positions(machine, rng), np.zeros(model.nq)
        for frame, axis in machine.axes.items():
            value = positions[frame] if axis.is_linear else np.deg2rad(positions[frame])
            q[model.joints[model.getJointId(frame)].idx_q] = value
        pin.forwardKinematics(model, data, q)
        found = poses(machine, positions)
        for frame, (joint, behind) in ends.items():
            expected = (data.oMi[joint] * behind).homogeneous
            np.testing.assert_allclose(found[frame], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dy", [0.0, 23.0])
def test_trunnion_a_c_moves_like_xyzac_trt_kins(dy):
    # trtfuncs_math.h, xyzac_forward_math, conventional directions, rotary point and tool offset 0;
    # the centre of the table lies (0, −dy, −dz) off the A axis
    dz = 60.0
    machine = build_machine(
        "wCAFXYZt", offset_mm={"A": (0, dy, dz), "C": (0, -dy, -dz)},
    )  # fmt: skip
    rng = np.random.default_rng(3)
    for _ in range(POSES):
        x, y, z = rng.uniform(-200, 200, 3)
        a, c = rng.uniform(-120, 120), rng.uniform(0, 360)
        sa, ca, sc, cc = *_sin_cos(a), *_sin_cos(c)
        # their angles carry the tool to the workpiece: ours of the table are opposite
        expected = (
            cc * x - sc * ca * (y - dy) + sc * sa * (z - dz) - sc * dy,
            sc * x + cc * ca * (y - dy) - cc * sa * (z - dz) + cc * dy,
            sa * (y - dy) + ca * (z - dz) + dz,
        )
        np.testing.assert_allclose(tip(machine, X=x, Y=y, Z=z, A=-a, C=-c), expected, atol=1e-9)
    library = load_machine("trunnion_ac")
    assert library.axes["A"].offset_mm[2] == -library.axes["C"].offset_mm[2]


@pytest.mark.parametrize("dx", [0.0, -17.0])
def test_trunnion_b_c_moves_like_xyzbc_trt_kins(dx):
    # trtfuncs_math.h, xyzbc_forward_math
    dz = 70.0
    machine = build_machine("wCBFXYZt", offset_mm={"B": (dx, 0, dz), "C": (-dx, 0, -dz)})
    rng = np.random.default_rng(4)
    for _ in range(POSES):
        x, y, z = rng.uniform(-200, 200, 3)
        b, c = rng.uniform(-110, 110), rng.uniform(0, 360)
        sb, cb, sc, cc = *_sin_cos(b), *_sin_cos(c)
        expected = (
            cc * cb * (x - dx) - sc * y + cc * sb * (z - dz) + cc * dx,
            sc * cb * (x - dx) + cc * y + sc * sb * (z - dz) + sc * dx,
            -sb * (x - dx) + cb * (z - dz) + dz,
        )
        np.testing.assert_allclose(tip(machine, X=x, Y=y, Z=z, B=-b, C=-c), expected, atol=1e-9)


def test_table_and_head_of_the_library_move_like_maxkins():
    # maxkins.c, max_forward with conventional-directions 1, without U, V and W
    machine, rng = load_machine("table_head_bc"), np.random.default_rng(6)
    pivot = -machine.fixed_mm["S"][2] - machine.fixed_mm["t"][2]
    zero = tip(machine, X=0, Y=0, Z=0, B=0, C=0)
    for _ in range(POSES):
        x, y, z = rng.uniform(-250, 250, 3)
        b, c = rng.uniform(-110, 110), rng.uniform(0, 360)
        (sb, cb), (sc, cc) = _sin_cos(b), _sin_cos(c)
        mx = x - pivot * sb
        expected = (cc * mx - sc * y, sc * mx + cc * y, z - pivot * cb + pivot)
        # their angle C carries the tool to the workpiece: ours of the table is opposite
        moved = tip(machine, X=x, Y=y, Z=z, B=b, C=-c) - zero
        np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_fork_head_of_the_library_moves_like_5axiskins():
    # 5axiskins_math.h, fiveaxis_forward_math: spherical coordinates about the pivot
    machine, rng = load_machine("head_head_cb"), np.random.default_rng(5)
    pivot = -machine.fixed_mm["S"][2] - machine.fixed_mm["t"][2]
    zero = tip(machine, X=0, Y=0, Z=0, B=0, C=0)
    for _ in range(POSES):
        x, y, z = rng.uniform(-700, 0, 3)
        b, c = rng.uniform(-110, 110), rng.uniform(-360, 360)
        polar, azimuth = np.deg2rad(180.0 - b), np.deg2rad(c)
        expected = np.array([
            x + pivot * np.sin(polar) * np.cos(azimuth),
            y + pivot * np.sin(polar) * np.sin(azimuth),
            z + pivot + pivot * np.cos(polar),
        ])  # fmt: skip
        moved = tip(machine, X=x, Y=y, Z=z, B=b, C=c) - zero
        np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_nutating_head_of_the_library_moves_like_xyzacb_trsrn():
    # xyzacb_trsrn.comp, TCP kinematics forward, table at zero: nut-angle 45°, x- and y-offset 0;
    # y is what the program says, whether the table moves or the tool
    machine, rng = load_machine("nutating_head"), np.random.default_rng(6)
    length = np.linalg.norm(machine.fixed_mm["S"]) - machine.fixed_mm["t"][2]
    sv = cv = np.sqrt(0.5)
    zero = tip(machine, X=0, Y=0, Z=0, B=0, C=0)
    for _ in range(POSES):
        x, y, z = rng.uniform(-400, 0, 3)
        b, c = rng.uniform(-180, 180), rng.uniform(-360, 360)
        ss, cs, sp, cp = *_sin_cos(b), *_sin_cos(c)
        s, t = cs + cv * cv * (1 - cs), sv * cv * (1 - cs)
        expected = np.array([
            x - (cp * sv * ss - sp * t) * length,
            y - (sp * sv * ss + cp * t) * length,
            z - s * length + length,
        ])  # fmt: skip
        moved = tip(machine, X=x, Y=y, Z=z, B=b, C=c) - zero
        np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_nutating_head_lays_the_tool_down_at_180_degrees():
    machine = load_machine("nutating_head")
    upright, lying = (poses(machine, {"B": b})["t"][:3, 2] for b in (0.0, 180.0))
    np.testing.assert_allclose(upright, (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(lying, (0, 1, 0), atol=1e-12)


def test_scara_of_the_library_moves_like_scarakins():
    # scarakins_math.h, scara_forward_math with d6 = 0; Z counts upwards here
    machine, rng = load_machine("scara"), np.random.default_rng(8)
    inner, outer = machine.axes["C2"].offset_mm[0], machine.axes["Z"].offset_mm[0]
    height = poses(machine, {"C1": 0.0, "C2": 0.0, "Z": 0.0})["t"][2, 3]
    for _ in range(POSES):
        one, two, z = rng.uniform(-130, 130), rng.uniform(-140, 140), rng.uniform(-80, 70)
        a, b = np.deg2rad(one), np.deg2rad(one + two)
        expected = (
            inner * np.cos(a) + outer * np.cos(b),
            inner * np.sin(a) + outer * np.sin(b),
            height + z,
        )
        found = poses(machine, {"C1": one, "C2": two, "Z": z})["t"][:3, 3]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def _sin_cos(angle_deg):
    angle = np.deg2rad(angle_deg)
    return np.sin(angle), np.cos(angle)


@pytest.mark.parametrize("name", LIBRARY)
def test_library_scene_has_errors_in_every_loop_axis_and_exports(name, tmp_path):
    scene = load_scene(f"machine_{name}")
    assert scene.tolerances.missing(scene.parameter_keys) == ()
    assert np.abs(evaluate(scene, grid=3, loop="relative").error_um).max() > 1.0
    write_glb(evaluate_picture(scene, grid=3), tmp_path / "a.glb")
    names = set(trimesh.load_scene(tmp_path / "a.glb").geometry)
    assert {body.name for body in load_bodies(scene.machine)} <= names
