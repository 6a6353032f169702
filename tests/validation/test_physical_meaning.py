"""What instruments read and controllers do on moving tables, carried axes and rotated frames."""

import numpy as np
import pytest

from physical_machine import Body, PhysicalMachine, with_errors
from warpspace.analysis.commands.form import Form
from warpspace.analysis.commands.line import Line
from warpspace.analysis.statistics import volume_statistics
from warpspace.bench.base import run_test
from warpspace.bench.kinds.straightness import Squareness
from warpspace.calibration.calibrate import Calibrate, calibrate
from warpspace.calibration.registry import parse_readings
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.compensate import Compensate
from warpspace.formats.registry import ReadOptions, read_errors
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import build_imported_scene
from warpspace.scene.library import load_scene, parse_scene
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
COMP = "0 0 0\n100 100.005 100.005\n200 200.010 200.010\n"


@pytest.mark.parametrize(("text", "file"), [(TABLE, "x.csv"), (COMP, "x.comp")])
def test_a_laser_reads_along_the_programmed_direction_of_a_table(text, file):
    scene = imported(text, file, "c_frame_mill")  # X carries the workpiece
    error = evaluate(scene, at={"X": 200.0}, loop="relative", frame="workpiece").error_um
    assert error == pytest.approx((10.0, 0.0, 0.0), abs=1e-6)
    written = compensated(scene, "sinumerik-enc").files[""]
    assert "$AA_ENC_COMP[0,20,X]" in written
    values = [float(line.split("=")[1]) for line in written.splitlines() if "COMP[0," in line]
    assert max(values) == pytest.approx(0.01, abs=1e-4)


def test_the_twist_of_a_beam_has_the_sign_of_the_side_that_moves():
    text = (
        "[probe]\ny_offset: -25\n[axis_twist_compensation]\ncalibrate_start_x: -100\n"
        "calibrate_end_x: 100\nz_compensations: -0.01, 0.01\n"
    )
    carried, carrying = (
        imported(text, "printer.cfg", name).errors.functions["EAX"].amplitude
        for name in ("c_frame_mill", "gantry_mill")
    )
    assert carrying == pytest.approx(-carried)


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
