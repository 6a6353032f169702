"""Compensation: what is written is read back, evaluated as the controller does, and applied."""

from contextlib import suppress
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from warpspace.exceptions import OptionError, SceneError
from warpspace.formats.compensation.compensate import Compensate, compensate, sweep
from warpspace.formats.compensation.corrections import build_corrector
from warpspace.formats.kinds import fanuc_3d
from warpspace.formats.registry import ReadOptions, formats, read_errors, recognise
from warpspace.formats.source import source_of_text
from warpspace.formats.terms import AxisTable, Product
from warpspace.formats.to_scene import build_imported_scene
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, error_transform, nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.axes import TravelDirection
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import ErrorSet, Harmonics, Poly, TableCurve
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.model import evaluate, with_direction


@cache
def scene_with(errors):
    return parse_scene(
        'machine = "dvf5000"\n[workspace]\nX = [-275, 275]\nY = [-225, 225]\nZ = [-480, -80]\n'
        f"[errors]\n{errors}\n",
        "scene",
    )


def corrected(scene, name, points=None, nodes=9, **plan):
    return compensate(scene, Compensate(formats=(name,), points=points, **plan), nodes)


def sources_of(found):
    files, ending = found.files.items(), found.format.endings[0]
    return [source_of_text(text, f"compensation{add or ending}") for add, text in files]


def read_back(found, scene):
    reading = read_errors(sources_of(found), ReadOptions(scene.machine))
    assert reading.recognised
    return build_imported_scene(reading, replace(scene, errors=ErrorSet()), "", "written").scene


WRITTEN = {one.name: one for one in formats() if one.can_write}
SURFACE = (
    'EXY = { table2 = { axes = ["Y", "Z"], Y = [-225, 0, 225], Z = [-480, -80],'
    " values = [[0, 1], [2, 5], [-1, 3]] } }\n"
)


def largest_difference_um(one, other, grid=5, loop="tool"):
    fields = [evaluate(scene, grid=grid, loop=loop).error_um for scene in (one, other)]
    return np.abs(fields[0] - fields[1]).max()


@pytest.mark.parametrize("name", WRITTEN)
def test_each_format_recognises_its_own_file_and_reads_it(name):
    scene = load_scene("dvf5000_first")
    found = corrected(scene, name, 5 if WRITTEN[name].has_grid else None)
    assert recognise(sources_of(found)).name == name
    assert found.after_statistics.rms_um < found.before_statistics.rms_um
    read_back(found, scene)


@pytest.mark.parametrize("name", ["csv", "iso-text", "isg-csv"])
def test_parameters_written_and_read_give_the_same_field(name):
    errors = (
        "EXX = { poly = [0, 0.02] }\nEYX = { table = [[-275, 0], [10, 3], [275, 4.1]] }\n"
        "EAX = { ramp = 5.5 }\nEBZ = { ramp = -7.25 }\nEC0Y = 23.1\nEA0Z = 33.9\n"
    )
    scene = scene_with(errors + SURFACE * (name != "iso-text"))
    written = corrected(scene, name, 3)
    back = read_back(written, scene)
    assert set(back.errors) == set(scene.errors)
    # six printed decimals of a micrometre or microradian, levers below 1.5 m
    assert largest_difference_um(scene, back, 7) < 5e-6
    assert written.after_statistics.max_um < 0.02


@pytest.mark.parametrize("name", ["sinumerik-enc", "linuxcnc-comp", "sinumerik-cec", "heidenhain"])
def test_positioning_errors_come_back_from_their_tables(name):
    scene = scene_with("EXX = { table = [[-275, 1], [0, -2], [275, 4]] }\nEZZ = { ramp = 6 }")
    back = read_back(corrected(scene, name, 3), scene)
    for key, at in (("EXX", np.linspace(-275, 275, 12)), ("EZZ", np.linspace(-480, -80, 5))):
        near = 0.06 if name == "heidenhain" else 1e-3  # it prints 0.0001 mm
        expected = pytest.approx(scene.errors.evaluate(key, at), abs=near)
        assert back.errors.evaluate(key, at) == expected


def test_cross_tables_correct_an_angle_with_its_lever_by_a_product():
    scene = scene_with("EAY = { ramp = 40 }")
    sinumerik = corrected(scene, "sinumerik-cec", 5)
    assert "$AN_CEC_MULT_BY_TABLE" in sinumerik.files[""]
    assert corrected(scene, "heidenhain", 5).after_statistics.max_um > 1.0
    assert sinumerik.after_statistics.max_um < 0.01
    back = read_back(sinumerik, scene)
    assert any(len(curve.arguments) == 2 for curve in back.errors.functions.values())
    assert largest_difference_um(scene, back) < 0.01


def test_a_full_grid_leaves_the_square_of_its_pitch(monkeypatch):
    monkeypatch.setattr(fanuc_3d, "MAX_COUNT", 10**6)  # no rounding beside the interpolation
    scene = scene_with(
        "EXX = { harmonics = [[1, 20, 0]] }\nEYY = { harmonics = [[1, 15, 40]] }"
        "\nEAZ = { ramp = 9 }"
    )
    left = np.array([
        corrected(scene, "fanuc-3d", points, 32, resolution=1e-6).after_statistics.rms_um
        for points in (5, 9, 17)
    ])  # fmt: skip
    assert left[:-1] / left[1:] == pytest.approx([4.0, 4.0], rel=0.1)
    # and comes back as errors of two axes
    scene = scene_with("EXX = { ramp = 30 }\nEAY = { ramp = 40 }\nEC0Y = 50")
    back = read_back(corrected(scene, "fanuc-3d", 5, resolution=1e-5), scene)
    assert largest_difference_um(scene, back) < 0.02


@pytest.mark.parametrize("unit", [1e-3, 5e-3])
def test_a_coarse_detection_unit_leaves_half_a_unit_an_axis(unit):
    scene = scene_with("EXX = { ramp = 20 }\nEYY = { ramp = 11 }")
    left = corrected(scene, "fanuc-3d", 12, resolution=unit).after_statistics.max_um
    assert 0.2 * unit * 500.0 < left <= np.sqrt(3.0) * unit * 500.0 + 0.01


def test_the_magnification_grows_until_the_corrections_fit():
    text = corrected(scene_with("EXX = 500"), "fanuc-3d", 2, 3).files[""]
    assert "# magnification = 4" in text
    with pytest.raises(OptionError, match="more than 127"):
        corrected(scene_with("EXX = 50000"), "fanuc-3d", 2, 3)


@pytest.mark.parametrize("name", ["linuxcnc-matrix", "klipper", "marlin"])
def test_matrix_and_skew_correct_squareness_about_a_point_held_still(name):
    base = scene_with("EC0Y = 120\nEA0Z = -40\nEB0Z = 75")
    found = corrected(replace(base, reference={"X": 0.0, "Y": 0.0, "Z": -280.0}), name)
    assert found.before_statistics.max_um > 20.0
    assert found.after_statistics.max_um < 0.6
    back = read_back(found, base)
    for key in base.errors:
        assert back.errors.amplitude(key) == pytest.approx(base.errors.amplitude(key), abs=1.0)


@pytest.mark.parametrize("name", ["sinumerik-enc", "sinumerik-cec", "heidenhain", "fanuc-3d"])
def test_either_sign_is_written_read_and_leaves_the_same(name):
    scene = scene_with("EXX = { ramp = 30 }\nEAY = { ramp = 40 }")
    found = [corrected(scene, name, 3, 5, sign=sign) for sign in (None, "error", "correction")]
    usual, *signed = (one.after_statistics.max_um for one in found)
    assert signed == pytest.approx([usual, usual], abs=1e-4)


MACHINES = "c_frame_mill gantry_mill head_head_cb printer_3d table_head_bc trunnion_bc"


@pytest.mark.parametrize("name", MACHINES.split())
def test_axes_on_either_side_are_moved_the_right_way(name):
    scene = load_scene(f"machine_{name}")
    corrector = build_corrector(scene, "relative")
    grid = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    left, _ = corrector.residual(grid, corrector.moves(grid))
    before, _ = corrector.residual(grid, {})
    assert np.abs(before).max() > 1e-4
    assert np.abs(left).max() < 1e-7
    found = corrected(scene, "fanuc-3d", 5, loop="relative")
    assert found.after_statistics.rms_um < 0.4 * found.before_statistics.rms_um


def test_an_axis_against_iso_841_is_said():
    scene = load_scene("machine_c_frame_mill")
    axes = dict(scene.machine.axes)
    axes["X"] = replace(axes["X"], direction=1)
    against = replace(scene, model=replace(scene.model, machine=replace(scene.machine, axes=axes)))
    said = corrected(against, "fanuc-3d", 3, 3).assumed[-2:]
    moves = "the tool moves over the workpiece in the {} direction, {} ISO 841"
    assert said[0].startswith("positive Y, Z: " + moves.format("positive", "according to"))
    assert said[1] == "positive X: " + moves.format("negative", "contrary to")


def test_tables_of_a_machine_that_moves_its_workpiece_come_back_as_its_errors():
    base = load_scene("machine_c_frame_mill")
    exx = Poly(base.axis_span("X"), (1.0, 0.03))
    ezy = TableCurve(base.axis_span("Y"), ((-100.0, 0.0), (100.0, 8.0)))
    scene = replace(base, errors=ErrorSet({"EXX": exx, "EZY": ezy}))
    back = read_back(corrected(scene, "sinumerik-cec", 9, loop="relative"), scene)
    assert largest_difference_um(scene, back, loop="relative") < 0.6


def test_orientation_is_corrected_where_the_format_has_a_place_for_it():
    scene = load_scene("machine_head_head_cb")
    plain = corrected(scene, "sinumerik-cec", 5)
    both = corrected(scene, "sinumerik-cec", 5, orientation=True)
    tilt = [np.linalg.norm(one.after.orientation_urad, axis=-1).mean() for one in (plain, both)]
    assert tilt[1] < 0.8 * tilt[0]
    assert both.after_statistics.max_um < 0.05


def test_orientation_is_corrected_by_rotary_axes_under_the_workpiece_too():
    scene = load_scene("dvf5000_first")
    assert set(corrected(scene, "sinumerik-cec", 5).axes) == {"X", "Y", "Z"}
    both = corrected(scene, "sinumerik-cec", 5, orientation=True)
    assert both.loop == "relative"
    assert set(both.axes) == {"X", "Y", "Z", "B", "C"}
    assert both.tilt_urad(both.after)[0] < 0.6 * both.tilt_urad(both.before)[0]


def test_what_a_format_cannot_hold_is_said_and_stays():
    found = corrected(scene_with(SURFACE), "iso-text", 5)
    assert found.after_statistics.max_um == pytest.approx(found.before_statistics.max_um)
    assert any("cannot represent EXY" in note for note in found.notes)


def test_a_sweep_compares_kinds_by_their_size():
    scene = scene_with("EXX = { harmonics = [[1, 20, 0]] }")
    found = sweep(scene, Compensate(formats=("sinumerik-enc", "marlin"), sweep=(9, 33)))
    tried = [(one.format, one.points) for one in found.steps]
    assert tried == [("sinumerik-enc", 9), ("sinumerik-enc", 33), ("marlin", 0)]
    assert found.steps[1].after.max_um < found.steps[0].after.max_um < found.before.max_um
    assert found.steps[0].numbers == 27
    assert not found.left_out
    found = sweep(replace(load_scene("machine_scara"), errors=ErrorSet()), Compensate(sweep=(3,)))
    assert found.steps
    assert any(text.startswith("fanuc-3d: ") for text in found.left_out)


def test_constants_of_the_alternative_model_turn_with_the_axis():
    """E₀·R·E₀⁻¹ of the exact chain is what the translated errors give, to first order."""
    text = "[A0C]\nVALUE = 0.00003\n[Y0C]\nVALUE = 0.004\n[C0C]\nVALUE = 0.00001\n"
    base = load_scene("dvf5000_nominal")
    options = ReadOptions(base.machine, variant="alternative")
    reading = read_errors([source_of_text(text, "e.exc")], options)
    scene = build_imported_scene(reading, base, "", "e.exc").scene
    assert isinstance(scene.errors.functions["EAC"], Harmonics)
    at = {"X": 0.0, "Y": 0.0, "Z": 0.0, "B": 0.0, "C": np.array([0.0, 30.0, 90.0, 200.0])}
    found = evaluate(scene, at=at, loop="workpiece").error_um
    assert np.abs(found[0]).max() < 1e-9  # a constant of the axis would move the point here too
    coordinates = complete_coordinates(base.machine, at)
    displaced = error_transform("C", {"EA0C": 30.0, "EY0C": 4.0, "EC0C": 10.0}, constant=True)
    nominal = branch_pose(base.model, "workpiece", coordinates)
    frames = branch_pose(base.model, "workpiece", {**coordinates, "C": np.zeros(4)})
    # displacement of the C frame in front of its rotation, taken back behind it
    turned = transforms.inverse(frames) @ nominal
    expected = frames @ displaced @ turned @ transforms.inverse(displaced)
    point = nominal_point(base.model, Loop.WORKPIECE, coordinates)
    shift = transforms.apply(expected, np.array(base.model.workpiece_point_mm)) - point
    assert found == pytest.approx(shift * 1e3, abs=1e-3)


@pytest.mark.parametrize("name", ["machine_gantry_mill", "machine_scara"])
@pytest.mark.parametrize("form", ["csv", "iso-text", "isg-csv", "sinumerik-cec", "sinumerik-enc"])
def test_a_machine_without_errors_has_nothing_to_correct(form, name):
    scene = replace(load_scene(name), errors=ErrorSet())
    assert corrected(scene, form, 3, 5).after_statistics.max_um == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("name", "asked", "left_um"),
    [
        ("klipper", False, 0.1), ("marlin", False, 0.1), ("linuxcnc-matrix", False, 0.01),
        ("sinumerik-cec", True, 0.01), ("heidenhain", True, 0.2), ("fanuc-3d", True, 1.0),
    ],
)  # fmt: skip
def test_a_part_on_a_moving_bed_is_corrected_where_it_has_its_shape(name, asked, left_um):
    text = 'title = "p"\nmachine = "printer_3d"\n[errors]\nEC0Y = 1000\n'
    scene = replace(parse_scene(text, "p"), placed=asked)
    found = corrected(scene, name, 3 if asked else None, stem="p")
    assert 43.0 < found.before_statistics.rms_um < 46.0
    assert found.after_statistics.rms_um < left_um
    assert found.assumed[-1].startswith("best-fit placement")
    assert ("cannot correct them" in found.assumed[-1]) is not asked


POSITIONING = "EXX = { forward = { poly = [4, 0.01] }, backward = { poly = [-4, 0.01] } }"
ROLL = "EAY = { forward = { ramp = 30 }, backward = { ramp = 10 } }\nEYY = { ramp = 6 }\nEC0Y = 20"
SURFACES = (
    'EXY = { forward = { table2 = { axes = ["Y", "Z"], Y = [-225, 100, 225], Z = [-480, -80],'
    ' values = [[0, 1], [2, 5.5], [-1, 3]] } }, backward = { table2 = { axes = ["Y", "Z"],'
    " Y = [-225, 225], Z = [-480, -200, -80], values = [[0, 2, 1], [4, 2.25, 5]] } } }"
)
BOTH_HELD = {"csv", "sinumerik-cec"}
"""Formats that hold directions of all errors."""
ONE_HELD = BOTH_HELD | {"linuxcnc-comp", "heidenhain"}
"""Formats that hold that of a positioning error alone."""


@cache
def table(errors, name, direction="mean"):
    scene = with_direction(scene_with(errors), direction)
    points = 3 if WRITTEN[name].has_grid else None
    return corrected(scene, name, points, 5)  # what they hold here is linear


@pytest.mark.parametrize("errors", [POSITIONING, ROLL])
@pytest.mark.parametrize("name", WRITTEN)
def test_every_format_holds_the_directions_or_says_that_it_does_not(name, errors):
    found = table(errors, name)
    there, back = found.directions["forward"], found.directions["backward"]
    pairs = (there.before, back.before), (there.after, back.after)
    reversal = [float((forward - backward).norm_um.max()) for forward, backward in pairs]
    assert reversal[0] > 5.0
    said = [note for note in found.notes if "direction of travel" in note]
    if name in (ONE_HELD if errors == POSITIONING else BOTH_HELD):
        assert reversal[1] < 0.3
        assert not said
        assert there.after_statistics.rms_um < 0.1 * there.before_statistics.rms_um
    else:
        assert reversal[1] > 0.5 * reversal[0]
        (note,) = said
        for fragment in ("EXX" if errors == POSITIONING else "EAY", f"{reversal[1]:.3g} µm after"):
            assert fragment in note
    # the mean of both ways is what a scene looks at that says nothing
    mean = (there.before.error_um + back.before.error_um) / 2.0
    compared = found.unplaced or found
    assert compared.before.error_um == pytest.approx(mean, abs=1e-3)


@pytest.mark.parametrize("name", ["sinumerik-cec", "csv"])
def test_what_is_before_and_after_is_that_of_the_direction_looked_at(name):
    errors = f"{POSITIONING}\n{ROLL}"
    files = table(errors, name).files
    for way in TravelDirection:
        found = table(errors, name, way)
        assert found.files == files, way
        assert found.after_statistics.max_um < 0.02, way
        if way in found.directions:
            assert found.before_statistics == found.directions[way].before_statistics


@pytest.mark.parametrize("name", ["sinumerik-enc", "iso-text", "isg-csv", "fanuc-3d"])
def test_one_value_for_both_directions_is_that_of_the_scene(name):
    for way in ("mean", "forward", "backward"):
        found = table(POSITIONING, name, way)
        assert found.after_statistics.max_um < 0.9, way
        other = "forward" if way == "backward" else "backward"
        assert found.directions[other].after_statistics.rms_um > 3.0


@pytest.mark.parametrize(
    ("name", "near_um"),
    [("sinumerik-cec", 1e-3), ("heidenhain", 0.06), ("linuxcnc-comp", 1e-3), ("csv", 1e-6)],
)
def test_a_reversal_comes_back_from_its_table(name, near_um):
    curve = read_back(table(POSITIONING, name), scene_with(POSITIONING)).errors.functions["EXX"]
    assert isinstance(curve, Directional)
    at = np.array([0.0, 100.0])
    assert curve.forward.evaluate(at) == pytest.approx([4.0, 5.0], abs=near_um)
    assert curve.backward.evaluate(at) == pytest.approx([-4.0, -3.0], abs=near_um)
    for way in ("forward", "backward", "mean"):
        left = table(POSITIONING, name, way).after_statistics
        assert left.max_um < 0.002 + 2.0 * near_um, way


def test_cross_tables_are_of_one_direction_and_backlash_of_one_axis():
    text = table(POSITIONING, "sinumerik-cec").files[""]
    assert "$AN_CEC_DIRECTION[0]=1\n" in text
    assert "$AN_CEC_DIRECTION[1]=-1\n" in text
    roll = scene_with(ROLL)
    back = read_back(table(ROLL, "sinumerik-cec"), roll)
    for way in ("forward", "backward"):
        assert largest_difference_um(with_direction(roll, way), with_direction(back, way)) < 0.02
    files = table(POSITIONING, "heidenhain").files
    assert files["_X.COM"].splitlines()[1].split() == ["NR", "AXISPOS", "BACKLASH", "X"]
    assert "BACKLASH" not in files["_Y.COM"]
    both = table(f"{POSITIONING}\nEYX = {{ ramp = 5 }}", "heidenhain")
    assert "BACKLASH" not in both.files["_X.COM"]
    assert any("direction of travel" in note for note in both.notes)


def test_surfaces_by_direction_stand_in_the_own_table_to_the_printed_digits():
    scene = scene_with(SURFACES)
    found = corrected(scene, "csv", 3)
    assert "Y [mm],Z [mm],direction,EXY [um]\n-225.0,-480.0,+,0.0\n" in found.files[""]
    back = read_back(found, scene)
    at = np.meshgrid(np.linspace(-225, 225, 31), np.linspace(-480, -80, 29), indexing="ij")
    coordinates = dict(zip("YZ", at, strict=True))
    for way in TravelDirection:
        there, here = (one.errors.evaluate_at("EXY", coordinates, way) for one in (scene, back))
        assert here == pytest.approx(there, abs=1e-6), way
    assert found.after_statistics.max_um < 1e-3
    isg = corrected(scene, "isg-csv", 3)
    assert any("direction of travel" in note for note in isg.notes)
    assert isg.after_statistics.max_um < 1e-3


def test_a_product_of_tables_in_one_direction_is_half_in_the_mean():
    first = AxisTable("Y", "X", (0.0, 1.0), (2.0, 2.0), direction=1)
    second = AxisTable("Z", "X", (0.0, 1.0), (3.0, 3.0))
    at = {"Y": np.array(0.5), "Z": np.array(0.5)}
    values = [float(Product(first, second).corrections(at, way)["X"]) for way in (1, -1, 0)]
    assert values == [6.0, 0.0, 3.0]
    twice = Product(first, replace(second, direction=1))
    assert float(twice.corrections(at, 0)["X"]) == 3.0


UNKNOWN = ("UNKNOWN_KEY = 5", "[unknown_section]", "UNKNOWN 1 2 3", "M999 X1", "setp unknown 5")


@pytest.mark.parametrize("name", WRITTEN)
def test_lines_that_are_not_read_are_named_or_refused(name):
    scene = scene_with("EXX = { ramp = 20 }\nEC0Y = 30")
    sources = sources_of(corrected(scene, name))
    for index, line in product(range(len(sources)), UNKNOWN):
        lines = (*sources[index].lines, line)
        changed = [*sources]
        changed[index] = replace(sources[index], lines=lines)
        with suppress(SceneError):
            notes = read_errors(changed, ReadOptions(scene.machine), name).imported.notes
            assert any(line.split()[0] in note for note in notes), line
