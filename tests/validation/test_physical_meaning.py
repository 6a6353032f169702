"""What instruments read and controllers do on moving tables, carried axes and rotated frames."""

import numpy as np
import pytest

from physical_machine import Body, PhysicalMachine, with_errors
from warpspace.analysis.commands.distance import Distance
from warpspace.analysis.commands.form import Form
from warpspace.analysis.commands.line import Line
from warpspace.analysis.commands.uncertainty import Uncertainty
from warpspace.analysis.statistics import volume_statistics
from warpspace.bench.base import run_test
from warpspace.bench.kinds.positioning import Positioning
from warpspace.bench.kinds.straightness import Squareness
from warpspace.calibration.calibrate import Calibrate, calibrate
from warpspace.calibration.registry import parse_readings
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.compensate import Compensate
from warpspace.formats.registry import ReadOptions, read_errors
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics.relative_motion import relative_point
from warpspace.scene.library import load_scene, parse_scene, scene_path
from warpspace.scene.model import evaluate


def machine(name, errors="", workspace=""):
    return parse_scene(f'machine = "{name}"\n{workspace}\n[errors]\n{errors}\n', name)


def imported(text, file, name):
    base = machine(name)
    reading = read_errors([source_of_text(text, file)], ReadOptions(base.machine, axis="X"))
    return build_imported_scene(reading, base, "", file).scene


def compensated(scene, name):
    return Compensate(formats=(name,)).run(scene, lambda _: None)


@pytest.mark.parametrize("name", ["dvf5000", "bridge_cmm", "gantry_mill", "printer_3d"])
def test_one_skew_factor_corrects_one_squareness(name):
    found = compensated(machine(name, "EA0Z = 2000"), "marlin")
    assert found.files[""].splitlines()[-1] == "M852 I0.0 J0.0 K-0.002"
    assert found.after_statistics.rms_um < 1.0 < 50.0 < found.before_statistics.rms_um
    assert found.unplaced.after_statistics.rms_um > found.after_statistics.rms_um


@pytest.mark.parametrize("letter", "IJK")
@pytest.mark.parametrize("name", ["printer_3d", "bridge_cmm", "c_frame_mill", "gantry_mill"])
def test_an_imported_skew_factor_is_written_again(name, letter):
    """Also where the volume of a printer is nearly a cube, or one axis carries the other."""
    found = compensated(imported(f"M852 {letter}-0.01\n", "a.gcode", name), "marlin")
    expected = " ".join(f"{each}{'-0.01' if each == letter else '0.0'}" for each in "IJK")
    assert found.files[""].splitlines()[-1] == f"M852 {expected}"
    assert found.after_statistics.mean_um < 0.05 * found.before_statistics.mean_um


def test_diagonals_of_a_square_that_is_skewed_by_10_mrad():
    scene = imported("M852 J-0.01\n", "a.gcode", "printer_3d")
    found = run_test(scene, Squareness(plane="XZ")).model
    assert abs(found.outcome["end_points_urad"]) == pytest.approx(10_000.0, abs=1.0)
    ends = (((0.0, 0.0), (100.0, 100.0)), ((100.0, 0.0), (0.0, 100.0)))
    diagonals = [
        Distance(
            start=tuple(zip("XZ", start, strict=True)), end=tuple(zip("XZ", end, strict=True)),
            loop="relative", exact=True,
        ).run(scene, lambda _: None).difference_um
        for start, end in ends
    ]  # fmt: skip
    # sides of 100 mm at 90° + 10 mrad: ±100·√2·(√(1 ± sin 10 mrad) - 1) mm
    assert sorted(diagonals) == pytest.approx([-708.9, 705.3], abs=0.5)


def test_a_klipper_table_leaves_less_than_a_micrometre():
    found = compensated(machine("printer_3d", "EA0Z = 2000"), "klipper")
    assert found.after_statistics.max_um < 1.0 < 140.0 < found.before_statistics.max_um
    (command,) = (line for line in found.files[""].splitlines() if line.startswith("SET_SKEW"))
    assert imported(command, "a.cfg", "printer_3d").errors.functions[
        "EA0Z"
    ].amplitude == pytest.approx(2000.0, abs=0.1)


GANTRY = """title = "gantry"
[machine]
chain = "wFYXZt"
[machine.travel]
Y = [-400, 400]
X = [-400, 400]
Z = [-50, 50]
[machine.gantry]
Y = { span_mm = 1000 }
[workspace]
X = [-400, 400]
Y = [-400, 400]
Z = [-50, 50]
[errors]
EYY = { guides = [-5350, 5350] }
"""


def test_the_skew_of_a_gantry_is_that_of_its_guides_over_their_distance():
    found = compensated(parse_scene(GANTRY, "gantry"), "marlin")
    assert found.files[""].splitlines()[-1] == "M852 I0.0107 J0.0 K0.0"
    assert found.after_statistics.mean_um == pytest.approx(11.5, abs=0.05)
    before_um = found.unplaced.before_statistics.mean_um  # 2142.9 with 28 nodes per axis
    assert before_um == pytest.approx(2140.0, abs=0.1)


def test_a_placement_rotates_in_full():
    scene = machine("dvf5000", "EA0C = 10_000\nEB0B = 5_000")  # turn and shift the part as a whole
    field = evaluate(scene, grid=4, exact=True, placed=True)
    assert field.norm_um.max() < 1e-3
    scene = parse_scene(
        'machine = "printer_3d"\n[convention]\nreference_axis = "free"\n[errors]\nEB0X = 1e4', "s"
    )
    found = compensated(scene, "marlin")  # J alone, 10 mrad; its second order remains
    assert found.files[""].splitlines()[-1] == "M852 I0.0 J-0.01 K0.0"
    assert found.after_statistics.mean_um < 2.75


@pytest.mark.parametrize(
    ("name", "angles"),
    [("lathe_mill", (13.0, 1.49, -15.16)), ("horizontal_b_table", (37.12, -25.91, -8.0))],
)
def test_form_in_rotated_frames(name, angles):
    scene = load_scene(f"machine_{name}")
    deviations = Form(loop="relative").run(scene, lambda _: None).deviations
    values = [each.value for each in deviations if each.kind == "squareness"]
    assert values == pytest.approx(angles, abs=0.02)


@pytest.mark.parametrize(("text", "file"), [
    ("M852 I0.01\n", "a.gcode"), ("setp matrixkins.C_xy -0.01\n", "a.hal"),
])  # fmt: skip
@pytest.mark.parametrize("name", ["bridge_cmm", "c_frame_mill", "gantry_mill"])
def test_a_skew_is_a_squareness_also_where_one_axis_carries_the_other(name, text, file):
    found = run_test(imported(text, file, name), Squareness(plane="XY")).model
    change = 1.0 if name == "gantry_mill" else -1.0  # of the angle, per unit of its parameter
    assert found.outcome["end_points_urad"] * change == pytest.approx(-10_000.0, abs=1.0)


TABLE = "X [mm],EXX [um]\n0,0\n100,5\n200,10\n"
RTL = (
    "HEADER::\nTARGET DATA::\nTarget-count: 3\nTargets: 0 100 200\nFlags: 0 0 2 0\nUSER-TEXT::\n"
    "Axis:X\nRUNS::\nRun-count:2\nDEVIATIONS::\n"
    "1 1 0\n1 2 5\n1 3 10\n2 3 10\n2 2 5\n2 1 0\nEOF::\n"
)
ENC = "".join(
    f"$AA_ENC_COMP{name}={value}\n"
    for name, value in (
        ("[0,0,X1]", 0), ("[0,1,X1]", 0.005), ("[0,2,X1]", 0.01), ("_STEP[0,X1]", 100),
        ("_MIN[0,X1]", 0), ("_MAX[0,X1]", 200), ("_IS_MODULO[0,X1]", 0),
    )
)  # fmt: skip
COMP = "0 0 0\n100 100.005 100.005\n200 200.010 200.010\n"


@pytest.mark.parametrize(("text", "file"), [
    (TABLE, "x.csv"), (COMP, "x.comp"), (RTL, "r.rtl"), (ENC, "x.ini"),
])  # fmt: skip
def test_a_laser_reads_along_the_programmed_direction_of_a_table(text, file):
    scene = imported(text, file, "c_frame_mill")  # X carries the workpiece
    error = evaluate(scene, at={"X": 200.0}, loop="relative", frame="workpiece").error_um
    assert error == pytest.approx((10.0, 0.0, 0.0), abs=1e-6)
    written = compensated(scene, "sinumerik-enc").files[""]
    assert "$AA_ENC_COMP[0,20,X]" in written
    values = [float(line.split("=")[1]) for line in written.splitlines() if "COMP[0," in line]
    assert max(values) == pytest.approx(0.01, abs=1e-4)


@pytest.mark.parametrize("name", ["head_head_cb", "horizontal_b_table", "trunnion_bc"])
def test_the_angle_of_a_rotary_axis_is_read_about_its_programmed_direction(name):
    scene = imported("B [deg],EBB [urad]\n-90,0\n90,20\n", "b.csv", name)
    run = run_test(scene, Positioning(axis="B")).model
    targets = run.plan.marks["target"]
    expected = np.interp(targets, [-90.0, 90.0], [0.0, 20.0])
    assert run.readings - run.readings[0] == pytest.approx(expected - expected[0], abs=1e-6)


def test_a_distance_on_a_table_has_the_error_of_its_scale():
    text = "EXX = { ramp = 20 }\n[uncertainty]\nEXX = 1.0"
    ends = ((("X", -400.0),), (("X", 400.0),))
    found = Distance(start=ends[0], end=ends[1]).run(machine("c_frame_mill", text), lambda _: None)
    assert found.difference_um == pytest.approx(-20.0)
    # u = 1 µm at each end of the distance
    assert found.expanded_uncertainty["u95_difference_um"] == pytest.approx(2.83, abs=5e-3)


def test_the_twist_of_a_beam_has_the_sign_of_the_side_that_moves():
    text = (
        "[probe]\ny_offset: -25\n[axis_twist_compensation]\ncalibrate_start_x: -100\n"
        "calibrate_end_x: 100\nz_compensations: -0.01, 0.01\n"
    )
    for name, sign in (("c_frame_mill", -1.0), ("gantry_mill", 1.0)):  # X carries the workpiece
        scene = imported(text, "printer.cfg", name)
        angles = scene.errors.evaluate_at("EAX", {"X": np.array([-100.0, 0.0, 100.0])})
        assert angles == pytest.approx(sign * np.array([400.0, 0.0, -400.0]))


@pytest.mark.parametrize(("points", "length_mm"), [({}, 1067.7), ({"X": (-400, 400)}, 800.0)])
def test_a_line_has_its_length_on_the_part(points, length_mm):
    ends = [tuple((axis, at[end]) for axis, at in points.items()) for end in (0, 1)]
    found = Line(start=ends[0], end=ends[1], loop="relative").run(
        load_scene("machine_c_frame_mill"), lambda _: None
    )
    assert found.length_mm == pytest.approx(length_mm, abs=0.05)


def test_a_table_is_exact_on_a_part_that_its_own_errors_incline():
    scene = machine("printer_3d", "EC0Y = 10000")
    branches = (
        tuple(
            Body(axis.name, axis.offset_mm, axis.rotation_deg, axis.direction)
            for axis in scene.machine.branch(side)
        )
        for side in ("workpiece", "tool")
    )
    spindle = np.add(scene.machine.fixed_mm["S"], scene.machine.fixed_mm["t"])
    simulated = PhysicalMachine(*branches, scene.workspace.ranges, tuple(spindle))
    simulated = with_errors(simulated, {"EC0Y": 10_000.0})
    found = compensated(scene, "sinumerik-cec")
    for q in simulated.nodes(3):
        moves = found.controller.moves({axis: np.asarray(at) for axis, at in q.items()})
        remaining = simulated.corrected_um(q, {axis: float(at) for axis, at in moves.items()})
        assert np.abs(remaining).max() < 0.01
    assert found.after_statistics.max_um < 0.01 < 1000.0 < found.before_statistics.max_um


def test_the_default_loop_of_a_moving_table_is_that_of_the_part():
    scene = load_scene("machine_fixed_spindle")
    grid = build_grid(scene.model, scene.workspace)
    assert volume_statistics(evaluate(scene), grid).mean_um == pytest.approx(17.1, abs=0.05)
    assert volume_statistics(evaluate(scene, loop="tool"), grid).max_um == 0.0
    text = scene_path("machine_fixed_spindle").read_text("utf-8")
    text += "[uncertainty]\n" + "".join(f"{key} = 1.0\n" for key in scene.errors)
    uncertain = parse_scene(text, "spindle")
    found = Uncertainty(limit_um=15.0, nodes=5, samples=500).run(uncertain, lambda _: None)
    assert (found.probability_worst, found.probability_everywhere) == (0.0, 0.0)


R_TEST = """angle_deg,x_um,y_um,z_um
0,30.35,-23.625,1.5738
25,30.35,-23.625,1.6586
50,30.35,-23.625,1.4325
75,30.35,-23.625,0.9377
100,30.35,-23.625,0.2669
125,30.35,-23.625,-0.4541
150,30.35,-23.625,-1.0902
"""
"""Readings of rigid bodies: a table B that turns as in ISO 841, with the errors below."""


def test_an_r_test_of_a_table_that_turns_as_in_iso_841_has_its_errors():
    errors = {"EX0B": 20.0, "EZ0B": 15.0, "EA0B": 25.0, "EC0B": -30.0}
    kind = "r-test:axis=B:ball=40,345,15"
    scene = machine("horizontal_b_table")
    found = calibrate(scene, [parse_readings(R_TEST, "r", scene, kind)], Calibrate(fit=(*errors,)))
    assert {row.key: row.value for row in found.parameters} == pytest.approx(errors, abs=0.02)


def test_readings_that_fit_either_sense_of_a_table_are_asked_about(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text(R_TEST, "utf-8")
    kind = "r-test:axis=B:ball=40,345,15"
    asked = Calibrate(data=(str(file),), kinds=(kind,), fit=("EX0B", "EZ0B", "EA0B", "EC0B"))
    (note,) = (
        note
        for note in asked.run(machine("horizontal_b_table"), lambda _: None).notes
        if note.startswith("B may turn in the other sense")
    )
    assert "machine.direction.B = 1" in note


def test_a_sense_that_circles_of_the_linear_axes_tell_is_not_asked_about():
    found = Calibrate(data=("tcp_off.csv",)).run(load_scene("fork_head_bc"), lambda _: None)
    assert not [note for note in found.notes if "may turn in the other sense" in note]


@pytest.mark.parametrize(("b", "c", "expected"), [
    (90.0, 0.0, (-2.0, 0.0, 1.0)), (0.0, 90.0, (0.0, -1.0, 2.0)),
])  # fmt: skip
def test_a_table_turns_against_its_letter(b, c, expected):
    """ISO 841: a point of the part at (1, 0, 2) under B90 or C90."""
    text = """[machine]
chain = "wCBFXYZt"
direction = { B = -1, C = -1 }
[workspace]
X = [-300, 300]
Y = [-250, 250]
Z = [-400, 400]
B = 0
C = 0
"""
    model = parse_scene(text, "trunnion").model
    at = dict(zip("XYZBC", (*expected, b, c), strict=True))
    coordinates = {axis: np.asarray(value) for axis, value in at.items()}
    assert relative_point(model, coordinates) == pytest.approx((1.0, 0.0, 2.0), abs=1e-9)


POINTS = "-200,-200,-300,5,0,0 200,-200,-300,25,0,0 -200,200,-300,-5,0,0 200,200,-100,15,0,0"


@pytest.mark.parametrize(
    ("header", "before"),
    [
        ("X_mm,Y_mm,Z_mm,ex_um,ey_um,ez_um", ""),
        ("Pt,operator,date,X_mm,Y_mm,Z_mm,ex_um,ey_um,ez_um", "P1,hans,2024-05-01,"),
        ("Pt,operator,date,X [mm],Y [mm],Z [mm],EX [um],EY [um],EZ [um]", "P1,hans,2024-05-01,"),
    ],
)
def test_points_are_fitted_whatever_other_columns_there_are(header, before):
    """Squareness of 25 µrad, and 20 µm over 400 mm of X: dx = 10 + X/20 - Y/40."""
    scene = parse_scene(
        '[machine]\nchain = "wFXYZt"\n[workspace]\nX = [-200, 200]\nY = [-200, 200]\n'
        "Z = [-300, -100]\n", "s",
    )  # fmt: skip
    rows = "\n".join(before + row for row in POINTS.split())
    readings = parse_readings(f"{header}\n{rows}\n", "t.csv", scene, "points")
    found = calibrate(scene, [readings], Calibrate(fit=("EC0Y", "EXX:ramp")))
    values = {row.key: row.value for row in found.parameters}
    assert values == pytest.approx({"EC0Y": 25.0, "EXX": 20.0}, abs=0.01)


ROBOT = (
    (-52.068972, -2.989293, -110.435323, -66.585144, -117.984042, -0.047965, -0.507, -3343.152),
    (-52.068972, -107.895401, 110.435323, -182.536905, -117.984042, -0.042501, 1.845, -3343.686),
    (-48.230785, 2.052661, -109.111218, -86.249056, -131.031437, -8.869272, -3.208, -3343.832),
    (-66.743854, -7.529811, -116.049164, -56.421274, -103.297988, -0.047282, 93.830, -3308.586),
)


def test_joints_in_radians_and_with_decimal_commas_are_read_alike():
    scene = load_scene("ur10")
    rows = [(*row, -426.95) for row in ROBOT]
    units = ("deg", "rad")
    scales = (1.0, np.pi / 180.0)
    coordinates: list[np.ndarray] = []
    for unit, scale in zip(units, scales, strict=True):
        header = ";".join(f"j{n}_{unit}" for n in range(1, 7)) + ";x_mm;y_mm;z_mm\n"
        lines = [";".join(repr(float(q * scale)) for q in row[:6]) for row in rows]
        lines = [
            f"{line};{';'.join(map(repr, row[6:]))}" for line, row in zip(lines, rows, strict=True)
        ]
        text = header + "\n".join(lines).replace(".", ",")
        readings = parse_readings(text, "r.csv", scene, "positions")
        coordinates.append(np.array([readings.coordinates[axis] for axis in scene.machine.axes]))
    assert coordinates[0][:, 0] == pytest.approx(np.array(ROBOT[0][:6]))
    assert coordinates[1] == pytest.approx(coordinates[0], abs=1e-9)
