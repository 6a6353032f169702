"""From text to a scene and to other conventions: defaults, spans, readings, machines, evaluate."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.analysis.commands.convert import Target, convert_scene, field_difference
from warpspace.exceptions import SceneError, WarpspaceError
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import ComponentErrors
from warpspace.machine import errors
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.scene_writer import Notation, scene_to_toml

DVF = 'machine = "dvf5000"\n'


def test_everything_but_the_machine_has_a_default():
    scene = parse_scene(DVF, "bare")
    assert (scene.name, scene.title, scene.description) == ("bare", "bare", "")
    assert scene.workspace.ranges["X"] == (-275.0, 275.0)
    assert scene.workspace.ranges["Z"] == (-480.0, 0.0)
    assert scene.workspace.ranges["B"] == scene.workspace.ranges["C"] == (0.0, 0.0)
    assert scene.model.component_errors == ComponentErrors.AFTER_MOTION
    assert (scene.exaggeration, scene.reference) == (None, None)
    assert list(scene.errors) == []
    assert not scene.tolerances


def test_every_kind_of_error_function_is_built(tmp_path):
    (tmp_path / "m.csv").write_text("q,yaw,pitch\n-275,1,-4\n275,2,6\n", encoding="utf-8")
    text = DVF + (
        "[workspace]\nZ = [-480, -80]\n[errors]\nEXX = 3\nEAZ = { ramp = -22.5 }\n"
        "EYX = { poly = [0, 0.02] }\nEXC = { harmonics = [[1, 3, 90]] }\n"
        "EZX = { table = [[-275, 0], [275, 4.1]] }\n"
        'EBX = { csv = "m.csv", column = "pitch" }\n'
    )
    functions = parse_scene(text, "all", folder=tmp_path).errors.functions
    travel, turn = (-275.0, 275.0), (0.0, 360.0)
    assert functions["EXX"] == errors.Constant(travel, 3.0)
    assert functions["EAZ"] == errors.Ramp((-480.0, -80.0), -22.5)
    assert functions["EYX"] == errors.Poly(travel, (0, 0.02))
    assert functions["EXC"] == errors.Harmonics(turn, ((1, 3, 90),))
    assert functions["EZX"] == errors.TableCurve(travel, ((-275, 0), (275, 4.1)))
    assert functions["EBX"] == errors.TableCurve(travel, ((-275.0, -4.0), (275.0, 6.0)))


def test_ramp_runs_over_the_travel_where_the_axis_stands_still():
    scene = parse_scene(DVF + "[workspace]\nZ = -100\n[errors]\nEAZ = { ramp = 8 }\n", "x")
    assert scene.errors.evaluate("EAZ", np.array([-480.0, 0.0])).tolist() == [0.0, 8.0]


def test_csv_is_refused_where_there_is_no_folder():
    text = DVF + '[errors]\nEBX = { csv = "/etc/hostname", column = "pitch" }\n'
    with pytest.raises(SceneError, match="CSV files are not read here"):
        parse_scene(text, "upload")


def test_constant_beyond_the_default_ones_becomes_a_parameter_of_the_scene():
    free = '[convention]\nreference_axis = "free"\n[errors]\nEC0X = 5\n[tolerances]\nEY0X = 3\n'
    scene = parse_scene(DVF + free, "x")
    assert len(scene.parameter_keys) == 43
    assert {"EC0X", "EY0X"} < set(scene.parameter_keys)
    assert parse_scene(scene_to_toml(scene), "x") == scene


def test_tolerances_are_a_half_width_or_a_range():
    text = DVF + "[tolerances]\ndefault = { rotation = 20 }\nEXB = 5\nEAX = { centre = -8, "
    tolerances = parse_scene(text + "half_width = 6 }\n", "x").tolerances
    assert tolerances.individual == {
        "EXB": errors.Tolerance(0.0, 5.0),
        "EAX": errors.Tolerance(-8.0, 6.0),
    }
    assert tolerances.default == {"rotation": 20.0}


def test_the_placement_of_the_workpiece_is_left_out_where_the_scene_says_so():
    scene = parse_scene(DVF + "[view]\nplaced = true\n", "x")
    assert scene.placed
    assert parse_scene(scene_to_toml(scene), "x").placed
    assert not parse_scene(DVF, "x").placed


def test_reference_is_a_point_even_where_the_scene_names_one_axis():
    scene = parse_scene(DVF + "[view]\nreference = { Y = 100 }\nexaggeration = 2000\n", "x")
    assert scene.reference == {"X": 0.0, "Y": 100.0, "Z": -240.0}
    assert scene.exaggeration == 2000.0


NUTATING = """
title = "Two tables and a nutating head"
[machine]
chain = "wC2FXYZC1B1t"
[machine.offset_mm]
B1 = [0, 0, -100]
[machine.rotation_deg]
B1 = [45, 0, 0]
t = [0, 10, -20]
[convention]
component_errors = { linear = "after_motion", rotary = "before_motion", C1 = "after_motion" }
[workspace]
C1 = 30
[errors]
EXC1 = 5.0
EA0C2 = 20.0
EBB1 = { table = [[-90, 0.0], [90, 12.0]] }
"""


def test_repeated_letters_rotations_and_mixed_conventions_are_read_and_written():
    scene = parse_scene(NUTATING, "nutating")
    machine, model = scene.machine, scene.model
    assert machine.axis("B1").rotation_deg == (45.0, 0.0, 0.0)
    assert machine.end_frames("tool")[1] == ("t", (0.0, 0.0, 0.0), (0.0, 10.0, -20.0))
    names = {axis: model.convention(axis).name for axis in machine.axes}
    assert names == {
        **dict.fromkeys(("X", "Y", "Z", "C1"), "after_motion"),
        **dict.fromkeys(("B1", "C2"), "before_motion"),
    }
    again = parse_scene(scene_to_toml(scene), "nutating")
    assert again == scene


def test_rotary_axes_span_the_volume_of_a_robot():
    scene = parse_scene(
        'title = "r"\n[machine]\nchain = "wFZC1C2t"\n'
        "offset_mm = { C2 = [300, 0, 0], t = [250, 0, 0] }\n"
        "[workspace]\nZ = [0, 100]\nC1 = [-90, 90]\nC2 = [10, 150]\n[errors]\nECC1 = 50\n",
        "robot",
    )
    assert scene.workspace.volume_axes == ("C1", "C2", "Z")
    grid = build_grid(scene.model, scene.workspace, (7, 5, 3))
    assert grid.shape == (7, 5, 3)
    reach = np.hypot(grid.nominal_mm[..., 0], grid.nominal_mm[..., 1])
    assert reach[0, 0, 0] == pytest.approx(np.hypot(300 + 250 * np.cos(np.radians(10)),
                                                    250 * np.sin(np.radians(10))))  # fmt: skip
    assert evaluate(scene, grid=5).norm_um.max() == pytest.approx(0.05 * reach.max())


def test_a_direction_against_iso_841_is_remarked_on_again_when_it_was_saved():
    text = '[machine]\nchain = "wCYFXZt"\ndirection = { Y = 1, C = 1 }\n'
    scene = parse_scene(text, "x")
    effects = {"Y": "moves the tool towards −Y", "C": "turns the tool about −C"}
    assert scene.notes == tuple(
        f"machine.direction.{on} = 1: positive {on} {effect} over the workpiece, against ISO 841"
        for on, effect in effects.items()
    )
    assert parse_scene(scene_to_toml(scene), "x").notes == scene.notes


def test_a_rotation_of_zero_is_none():
    text = 'title = "z"\n[machine]\nchain = "wFXt"\nrotation_deg = { t = [0, 0, 0] }\n'
    scene = parse_scene(text, "z")
    assert scene.machine.fixed_deg == {}
    assert parse_scene(scene_to_toml(scene), "z") == scene


MEASURED = (
    DVF
    + """[errors]
EXX = 3
[uncertainty]
EXX = 0.4
EYX = { table = [[-275, 0.1], [275, 0.2]] }
EC0Y = 1
[measured.EXX]
runs = [
  { direction = "+", points = [[-275, 1], [275, 2]] },
  { direction = "-", points = [[275, 1.5], [-275, 2.5]] },
  { points = [[0, 0.5]] },
]
"""
)


def test_they_are_read_and_reload_equal():
    scene = parse_scene(MEASURED, "s")
    assert scene.uncertainty["EXX"] == errors.Constant((-275.0, 275.0), 0.4)
    assert scene.uncertainty["EYX"] == errors.TableCurve(
        (-275.0, 275.0), ((-275.0, 0.1), (275.0, 0.2))
    )
    runs = scene.measured["EXX"].runs
    assert [run.direction for run in runs] == ["+", "-", ""]
    assert runs[1].points == ((275.0, 1.5), (-275.0, 2.5))
    assert parse_scene(scene_to_toml(scene), "s") == scene


def test_readings_come_by_direction():
    runs = (
        errors.TravelRun("+", ((0.0, 1.0),)),
        errors.TravelRun("-", ((0.0, 2.0),)),
        errors.TravelRun("+", ((5.0, 3.0),)),
    )
    measurement = errors.Measurement(runs)
    assert measurement.count == 3
    np.testing.assert_array_equal(measurement.scatter["+"], [[0.0, 1.0], [5.0, 3.0]])
    np.testing.assert_array_equal(measurement.scatter["-"], [[0.0, 2.0]])


def test_readings_may_stand_in_a_file_beside_the_scene(tmp_path):
    (tmp_path / "runs.csv").write_text(
        "X,EYX,EXX,run,direction\n-275,9,1,1,+\n275,9,2,1,+\n275,9,1.5,1,-\n-275,9,2.5,2,-\n"
    )
    text = DVF + '[measured.EXX]\ncsv = "runs.csv"\ncolumn = "EXX"\n'
    (tmp_path / "s.toml").write_text(text)
    scene = load_scene(tmp_path / "s.toml")
    assert scene.measured["EXX"].runs == (
        errors.TravelRun("+", ((-275.0, 1.0), (275.0, 2.0))),
        errors.TravelRun("-", ((275.0, 1.5),)),
        errors.TravelRun("-", ((-275.0, 2.5),)),
    )
    assert parse_scene(scene_to_toml(scene), "s") == scene  # needs no other file


FIRST = load_scene("dvf5000_first")


def test_workpiece_loop_takes_its_functional_point_at_points_and_the_node_over_the_grid():
    point = evaluate(FIRST, at={"B": 0.0}, loop="workpiece").nominal_mm
    np.testing.assert_allclose(point, [0.0, 275.0, 450.0], atol=1e-12)
    grids = [evaluate(FIRST, grid=2, loop=loop).nominal_mm for loop in ("tool", "workpiece")]
    np.testing.assert_array_equal(*grids)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"at": {"X": 0.0}, "grid": 5}, "not both"),
        ({"frame": "tool"}, "frame 'tool'; expected one of machine, workpiece"),
        ({"grid": 2.5}, "expected whole numbers"),
        ({"at": {"X": [1.0, 2.0], "Y": [1.0, 2.0, 3.0]}}, "one batch shape"),
        ({"at": {"X": 1e9}}, "EAX reaches 1e.07 µrad"),
    ],
)
def test_impossible_argument_is_refused_with_what_was_expected(arguments, reason):
    with pytest.raises(WarpspaceError, match=reason):
        evaluate(FIRST, **arguments)


SAME = 3e-9
HELD = {"X": 0.0, "Y": 0.0, "Z": -280.0}
TARGETS = {
    "order": Target(component_errors=dict.fromkeys("XYZBC", "before_motion")),
    "one kind": Target(component_errors={"B": "before_motion", "C": "before_motion"}),
    "line": Target(straightness=dict.fromkeys("XYZ", "minimum_zone")),
    "zero": Target(zero_at={"X": 0.0, "Y": 0.0}),
    "over": Target(notation=Notation("over_90")),
    "under": Target(notation=Notation("under_90")),
    "abbe": Target(notation=Notation(measuring_line_mm={"X": (0.0, 150.0, -80.0)})),
    "all": Target(
        straightness={"X": "least_squares"},
        zero_at={"Y": 10.0},
        notation=Notation("over_90", {"Y": (20.0, 0.0, 300.0)}),
    ),
}


@pytest.mark.parametrize("name", TARGETS)
def test_the_file_reads_back_to_the_same_field(name):
    found = convert_scene(FIRST, TARGETS[name])
    read = parse_scene(found.text, FIRST.name)
    assert read == found.scene
    assert max(*field_difference(FIRST, read), found.largest_um, found.largest_urad) < SAME
    # the program's own notation again: the same errors
    assert parse_scene(scene_to_toml(read), FIRST.name).errors == read.errors


def test_the_check_sees_a_difference():
    other = replace(FIRST, errors=FIRST.errors.with_amplitude("EC0Y", 23.2, (-225.0, 225.0)))
    largest_um, _ = field_difference(FIRST, other)
    assert largest_um > 1e-3


def test_numbers_are_written_with_the_sign_that_the_file_says():
    found = convert_scene(FIRST, TARGETS["over"])
    assert 'squareness = "over_90"' in found.text
    assert "EB0Z = -18.1" in found.text
    assert found.changed == {"EB0Z": (18.1, -18.1)}
    assert found.scene.errors.amplitude("EB0Z") == 18.1


def test_a_held_point_becomes_constants_and_a_held_point_again():
    held = replace(FIRST, reference=HELD)
    found = convert_scene(held, Target(reference="constants"))
    assert found.scene.reference is None
    assert found.largest_um < SAME
    assert {"EX0X", "EY0X"} <= {*found.changed}
    back = convert_scene(found.scene, Target(reference=HELD))
    assert back.scene.reference == HELD
    assert back.largest_um < 1e-6  # the point is held to a picometre
    assert field_difference(held, back.scene)[0] < SAME


def test_readings_of_other_curves_are_left_out_and_named():
    text = scene_to_toml(FIRST) + "\n[measured.EAX]\nruns = [{ points = [[0, 1]] }]\n"
    text += "[measured.EZY]\nruns = [{ points = [[0, 1]] }]\n"
    scene = parse_scene(text, "s")
    found = convert_scene(scene, Target(component_errors={"Y": "before_motion"}))
    assert [*found.scene.measured] == ["EAX"]
    assert found.notes == ("readings of EZY are omitted: they belong to other curves",)
