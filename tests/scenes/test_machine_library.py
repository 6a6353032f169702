"""The bundled machines: what each comes with, and its poses against other implementations."""

import numpy as np
import pytest
import trimesh

from warpspace import evaluate, load_scene
from warpspace.bodies.placed import load_bodies
from warpspace.kinematics.chain import body_motions
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.machine.definition import build_machine
from warpspace.outputs.exports.meshes import write_glb
from warpspace.picture.model import evaluate_picture
from warpspace.scene.library import scene_names
from warpspace.scene.machine_library import load_machine, machine_names, machine_picture

MACHINES = machine_names()
LIBRARY = tuple(name for name in MACHINES if name not in ("dvf5000", "ur10"))
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


def sin_cos(*angles_deg):
    return [value for angle in np.deg2rad(angles_deg) for value in (np.sin(angle), np.cos(angle))]


def xyzac_trt_kins(machine, X, Y, Z, A, C):
    # trtfuncs_math.h, xyzac_forward_math, conventional directions, rotary point and tool offset 0;
    # the centre of the table lies (0, −dy, −dz) off the A axis
    _, dy, dz = np.negative(machine.axes["C"].offset_mm)
    sa, ca, sc, cc = sin_cos(A, C)
    return (
        cc * X - sc * ca * (Y - dy) + sc * sa * (Z - dz) - sc * dy,
        sc * X + cc * ca * (Y - dy) - cc * sa * (Z - dz) + cc * dy,
        sa * (Y - dy) + ca * (Z - dz) + dz,
    )


def xyzbc_trt_kins(machine, X, Y, Z, B, C):
    # trtfuncs_math.h, xyzbc_forward_math
    dx, _, dz = np.negative(machine.axes["C"].offset_mm)
    sb, cb, sc, cc = sin_cos(B, C)
    return (
        cc * cb * (X - dx) - sc * Y + cc * sb * (Z - dz) + cc * dx,
        sc * cb * (X - dx) + cc * Y + sc * sb * (Z - dz) + sc * dx,
        -sb * (X - dx) + cb * (Z - dz) + dz,
    )


def maxkins(machine, X, Y, Z, B, C):
    # maxkins.c, max_forward with conventional-directions 1, without U, V and W
    pivot = -machine.fixed_mm["S"][2] - machine.fixed_mm["t"][2]
    sb, cb, sc, cc = sin_cos(B, C)
    x = X - pivot * sb
    return cc * x - sc * Y, sc * x + cc * Y, Z - pivot * cb


def fiveaxiskins(machine, X, Y, Z, B, C):
    # 5axiskins_math.h, fiveaxis_forward_math: spherical coordinates about the pivot
    pivot = -machine.fixed_mm["S"][2] - machine.fixed_mm["t"][2]
    sp, cp, sc, cc = sin_cos(180.0 - B, C)
    return X + pivot * sp * cc, Y + pivot * sp * sc, Z + pivot * cp


def xyzacb_trsrn(machine, X, Y, Z, B, C):
    # xyzacb_trsrn.comp, TCP kinematics forward, table at zero: nut-angle 45°, x- and y-offset 0;
    # y is what the program says, whether the table moves or the tool
    length = np.linalg.norm(machine.fixed_mm["S"]) - machine.fixed_mm["t"][2]
    sv = cv = np.sqrt(0.5)
    ss, cs, sp, cp = sin_cos(B, C)
    s, t = cs + cv * cv * (1 - cs), sv * cv * (1 - cs)
    return (
        X - (cp * sv * ss - sp * t) * length,
        Y - (sp * sv * ss + cp * t) * length,
        Z - s * length,
    )


def scarakins(machine, C1, C2, Z):
    # scarakins_math.h, scara_forward_math with d6 = 0; Z counts upwards here
    inner, outer = machine.axes["C2"].offset_mm[0], machine.axes["Z"].offset_mm[0]
    s1, c1, s2, c2 = sin_cos(C1, C1 + C2)
    return inner * c1 + outer * c2, inner * s1 + outer * s2, Z


OFF_A = {"A": (0, 23, 60), "C": (0, -23, -60)}
OFF_B = {"B": (-17, 0, 70), "C": (17, 0, -70)}


@pytest.mark.parametrize(
    ("machine", "forward"),
    [
        (load_machine("trunnion_ac"), xyzac_trt_kins),
        (build_machine("wCAFXYZt", offset_mm=OFF_A), xyzac_trt_kins),
        (load_machine("trunnion_bc"), xyzbc_trt_kins),
        (build_machine("wCBFXYZt", offset_mm=OFF_B), xyzbc_trt_kins),
        (load_machine("table_head_bc"), maxkins),
        (load_machine("head_head_cb"), fiveaxiskins),
        (load_machine("nutating_head"), xyzacb_trsrn),
        (load_machine("scara"), scarakins),
    ],
)
def test_machines_move_like_those_of_linuxcnc(machine, forward):
    rng, zero = np.random.default_rng(3), dict.fromkeys(machine.axes, 0.0)
    # their x, y and z count from the table
    start = dict(zip("XYZ", tip(machine, **zero), strict=True))
    # their angles turn the tool relative to the workpiece, as in ISO 841
    tables = {name for name in machine.chain.workpiece if machine.sense(name) < 0}

    def place(at):
        theirs = {q: -at[q] if q in tables else at[q] + start.get(q, 0.0) for q in at}
        return np.array(forward(machine, **theirs))

    for _ in range(POSES):
        at = random_positions(machine, rng)
        moved = tip(machine, **at) - tip(machine, **zero)
        np.testing.assert_allclose(moved, place(at) - place(zero), atol=1e-9)


@pytest.mark.parametrize("name", LIBRARY)
def test_library_scene_has_errors_in_every_loop_axis_and_exports(name, tmp_path):
    scene = load_scene(f"machine_{name}")
    assert scene.tolerances.missing(scene.parameter_keys) == ()
    assert np.abs(evaluate(scene, grid=3, loop="relative").error_um).max() > 1.0
    write_glb(evaluate_picture(scene, grid=3), tmp_path / "a.glb")
    names = set(trimesh.load_scene(tmp_path / "a.glb").geometry)
    assert {body.name for body in load_bodies(scene.machine)} <= names
