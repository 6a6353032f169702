"""Compensation: what is written is read back, evaluated as the controller does, and applied."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.exceptions import OptionError
from warpspace.formats.compensation.compensate import Plan, compensate
from warpspace.formats.compensation.corrector import build_corrector
from warpspace.formats.compensation.sweep import sweep
from warpspace.formats.importing import read_errors
from warpspace.formats.kind import ReadOptions
from warpspace.formats.kinds import fanuc_3d
from warpspace.formats.registry import formats, recognise
from warpspace.formats.source import source_of_text
from warpspace.formats.to_scene import into_scene
from warpspace.machine.errors import Constant, ErrorSet, Harmonics, Poly, Table
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.pipeline import evaluate

WRITTEN = [one.name for one in formats() if one.can_write]
NODES = 9


def scene_with(errors: str, name: str = "dvf5000", workspace: str = ""):
    """Give a scene of errors."""
    return parse_scene(
        f'machine = "{name}"\n[workspace]\n{workspace}\nX = [-275, 275]\nY = [-225, 225]\n'
        f"Z = [-480, -80]\n[errors]\n{errors}\n",
        "scene",
    )


def read_back(found, scene, format_name=""):
    """Import what was written."""
    sources = [
        source_of_text(
            text, f"compensation{add}" if add else f"compensation{found.format.endings[0]}"
        )
        for add, text in found.files.items()
    ]
    reading = read_errors(sources, ReadOptions(scene.machine), format_name)
    assert reading.recognised is not bool(format_name)
    bare = replace(scene, errors=ErrorSet())
    return into_scene(reading, bare, "", "written").scene


@pytest.mark.parametrize("name", WRITTEN)
def test_each_format_recognises_its_own_file_and_reads_it(name: str) -> None:
    scene = load_scene("dvf5000_first")
    found = compensate(scene, Plan(name, 5 if name not in ("marlin", "klipper") else None), NODES)
    sources = [
        source_of_text(text, f"compensation{add or found.format.endings[0]}")
        for add, text in found.files.items()
    ]
    assert recognise(sources).name == name
    assert found.after_statistics.rms_um < found.before_statistics.rms_um
    read_back(found, scene)


@pytest.mark.parametrize("name", ["csv", "iso-text", "isg-csv"])
def test_parameters_written_and_read_give_the_same_field(name: str) -> None:
    errors = (
        "EXX = { poly = [0, 0.02] }\nEYX = { table = [[-275, 0], [10, 3], [275, 4.1]] }\n"
        "EAX = { ramp = 5.5 }\nEBZ = { ramp = -7.25 }\nEC0Y = 23.1\nEA0Z = 33.9\n"
    )
    if name != "iso-text":
        errors += (
            'EXY = { table2 = { axes = ["Y", "Z"], Y = [-225, 0, 225], Z = [-480, -80],'
            " values = [[0, 1], [2, 5], [-1, 3]] } }\n"
        )
    scene = scene_with(errors)
    written = compensate(scene, Plan(name, 3), NODES)
    back = read_back(written, scene)
    assert set(back.errors) == set(scene.errors)
    there, here = evaluate(scene, grid=7), evaluate(back, grid=7)
    # six printed decimals of a micrometre or microradian, levers below 1.5 m
    assert np.abs(there.error_um - here.error_um).max() < 5e-6
    assert written.after_statistics.max_um < 0.02


@pytest.mark.parametrize("name", ["sinumerik-enc", "linuxcnc-comp", "sinumerik-cec", "heidenhain"])
def test_positioning_errors_come_back_from_their_tables(name: str) -> None:
    scene = scene_with("EXX = { table = [[-275, 1], [0, -2], [275, 4]] }\nEZZ = { ramp = 6 }")
    back = read_back(compensate(scene, Plan(name, 3), NODES), scene)
    at = np.linspace(-275, 275, 12)
    # heidenhain prints 0.0001 mm
    near = 0.06 if name == "heidenhain" else 1e-3
    expected = scene.errors.evaluate("EXX", at)
    assert back.errors.evaluate("EXX", at) == pytest.approx(expected, abs=near)
    height = np.linspace(-480, -80, 5)
    assert back.errors.evaluate("EZZ", height) == pytest.approx(
        scene.errors.evaluate("EZZ", height), abs=near
    )


def test_cross_tables_correct_an_angle_with_its_lever_by_a_product() -> None:
    scene = scene_with("EAY = { ramp = 40 }")
    heidenhain = compensate(scene, Plan("heidenhain", 5), NODES)
    sinumerik = compensate(scene, Plan("sinumerik-cec", 5), NODES)
    assert "$AN_CEC_MULT_BY_TABLE" in sinumerik.files[""]
    assert heidenhain.after_statistics.max_um > 1.0
    assert sinumerik.after_statistics.max_um < 0.01
    back = read_back(sinumerik, scene)
    assert any(len(curve.arguments) == 2 for curve in back.errors.functions.values())
    there, here = evaluate(scene, grid=5), evaluate(back, grid=5)
    assert np.abs(there.error_um - here.error_um).max() < 0.01


def test_a_full_grid_leaves_the_square_of_its_pitch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fanuc_3d, "MOST_COUNT", 10**6)  # no rounding beside the interpolation
    scene = scene_with(
        "EXX = { harmonics = [[1, 20, 0]] }\nEYY = { harmonics = [[1, 15, 40]] }"
        "\nEAZ = { ramp = 9 }"
    )
    left = [
        compensate(scene, Plan("fanuc-3d", points, resolution=1e-6), 32).after_statistics.rms_um
        for points in (5, 9, 17)
    ]
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.1)
    assert left[1] / left[2] == pytest.approx(4.0, rel=0.1)


def test_a_coarse_detection_unit_leaves_half_a_unit_an_axis() -> None:
    scene = scene_with("EXX = { ramp = 20 }\nEYY = { ramp = 11 }")
    for unit in (1e-3, 5e-3):
        left = compensate(scene, Plan("fanuc-3d", 12, resolution=unit), NODES)
        assert left.after_statistics.max_um <= np.sqrt(3.0) * unit * 500.0 + 0.01
        assert left.after_statistics.max_um > 0.2 * unit * 500.0


def test_the_magnification_grows_until_the_corrections_fit() -> None:
    scene = scene_with("EXX = 500")
    text = compensate(scene, Plan("fanuc-3d", 2), 3).files[""]
    assert "# magnification = 4" in text
    with pytest.raises(OptionError, match="more than 127"):
        compensate(scene_with("EXX = 50000"), Plan("fanuc-3d", 2), 3)


def test_fanuc_grid_comes_back_as_errors_of_two_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fanuc_3d, "MOST_COUNT", 10**6)
    scene = scene_with("EXX = { ramp = 30 }\nEAY = { ramp = 40 }\nEC0Y = 50")
    written = compensate(scene, Plan("fanuc-3d", 5, resolution=1e-5), NODES)
    back = read_back(written, scene)
    there, here = evaluate(scene, grid=5), evaluate(back, grid=5)
    assert np.abs(there.error_um - here.error_um).max() < 0.02


def test_matrix_and_skew_correct_squareness_about_a_point_held_still() -> None:
    base = scene_with("EC0Y = 120\nEA0Z = -40\nEB0Z = 75")
    scene = replace(base, reference={"X": 0.0, "Y": 0.0, "Z": -280.0})
    for name in ("linuxcnc-matrix", "klipper", "marlin"):
        found = compensate(scene, Plan(name), NODES)
        assert found.before_statistics.max_um > 20.0
        assert found.after_statistics.max_um < 0.6, name
        back = replace(read_back(found, base), reference=scene.reference)
        assert back.errors.amplitude("EC0Y") == pytest.approx(120.0, abs=1.0)
        assert back.errors.amplitude("EA0Z") == pytest.approx(-40.0, abs=1.0)
        assert back.errors.amplitude("EB0Z") == pytest.approx(75.0, abs=1.0)


@pytest.mark.parametrize("sign", ["error", "correction"])
@pytest.mark.parametrize("name", ["sinumerik-enc", "sinumerik-cec", "heidenhain", "fanuc-3d"])
def test_the_other_sign_is_written_read_and_leaves_the_same(name: str, sign: str) -> None:
    scene = scene_with("EXX = { ramp = 30 }\nEAY = { ramp = 40 }")
    usual = compensate(scene, Plan(name, 3), NODES).after_statistics.max_um
    other = compensate(scene, Plan(name, 3, sign=sign), NODES).after_statistics.max_um
    assert other == pytest.approx(usual, abs=1e-4)


@pytest.mark.parametrize(
    "name",
    [
        "machine_c_frame_mill",
        "machine_gantry_mill",
        "machine_head_head_cb",
        "machine_printer_3d",
        "machine_table_head_bc",
        "machine_trunnion_bc",
    ],
)
def test_axes_on_either_side_are_moved_the_right_way(name: str) -> None:
    scene = load_scene(name)
    corrector = build_corrector(scene, "relative")
    grid = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    moves = corrector.moves(grid)
    left, _ = corrector.residual(grid, moves)
    before, _ = corrector.residual(grid, {})
    assert np.abs(before).max() > 1e-4
    assert np.abs(left).max() < 1e-7
    found = compensate(scene, Plan("fanuc-3d", 5, loop="relative"), NODES)
    assert found.after_statistics.rms_um < 0.4 * found.before_statistics.rms_um


def test_tables_of_a_machine_that_moves_its_workpiece_come_back_as_its_errors() -> None:
    base = load_scene("machine_c_frame_mill")
    errors = ErrorSet(
        {
            "EXX": Poly(base.axis_span("X"), (1.0, 0.03)),
            "EZY": Table(base.axis_span("Y"), ((-100.0, 0.0), (100.0, 8.0))),
        }
    )
    scene = replace(base, errors=errors)
    back = read_back(compensate(scene, Plan("sinumerik-cec", 9, loop="relative"), NODES), scene)
    there = evaluate(scene, grid=5, loop="relative")
    here = evaluate(back, grid=5, loop="relative")
    assert np.abs(there.error_um - here.error_um).max() < 0.6


def test_orientation_is_corrected_where_the_format_has_a_place_for_it() -> None:
    scene = load_scene("machine_head_head_cb")
    plain = compensate(scene, Plan("sinumerik-cec", 5), NODES)
    both = compensate(scene, Plan("sinumerik-cec", 5, orientation=True), NODES)
    tilt = [np.linalg.norm(one.after.orientation_urad, axis=-1).mean() for one in (plain, both)]
    assert tilt[1] < 0.8 * tilt[0]
    assert both.after_statistics.max_um < 0.05
    with pytest.raises(OptionError, match="position only"):
        compensate(scene, Plan("isg-csv", 5, orientation=True), NODES)
    with pytest.raises(OptionError, match="no rotary axis"):
        compensate(load_scene("machine_gantry_mill"), Plan("csv", 5, orientation=True), NODES)


def test_orientation_is_corrected_by_rotary_axes_under_the_workpiece_too() -> None:
    scene = load_scene("dvf5000_first")
    assert compensate(scene, Plan("sinumerik-cec", 5), NODES).loop == "tool"
    both = compensate(scene, Plan("sinumerik-cec", 5, orientation=True), NODES)
    assert both.loop == "relative"
    assert set(both.axes) == {"X", "Y", "Z", "B", "C"}
    assert both.tilt_urad(both.after)[0] < 0.6 * both.tilt_urad(both.before)[0]
    with pytest.raises(OptionError, match="expected loop relative"):
        compensate(scene, Plan("sinumerik-cec", 5, orientation=True, loop="tool"), NODES)


def test_what_a_format_cannot_hold_is_said_and_stays() -> None:
    scene = scene_with(
        'EXY = { table2 = { axes = ["Y", "Z"], Y = [-225, 225], Z = [-480, -80],'
        " values = [[0, 8], [2, 5]] } }"
    )
    found = compensate(scene, Plan("iso-text", 5), NODES)
    assert found.after_statistics.max_um == pytest.approx(found.before_statistics.max_um)
    assert any("no place for EXY" in note for note in found.notes)


@pytest.mark.parametrize(
    ("plan", "fragment"),
    [
        (Plan("rtl"), "read only"),
        (Plan("heidenhain", 300), "takes 2 to 256 points"),
        (Plan("fanuc-3d", 40), "takes 2 to 25 points"),
        (Plan("fanuc-3d", {"Q": 3}), "expected one of X, Y, Z"),
        (Plan("sinumerik-enc", 1), "takes 2"),
        (Plan("sinumerik-enc", 3, resolution=-1.0), "--resolution"),
        (Plan("csv", 3, sign="error"), "--sign"),
    ],
)
def test_what_cannot_be_written_is_refused(plan: Plan, fragment: str) -> None:
    with pytest.raises(OptionError) as caught:
        compensate(load_scene("dvf5000_first"), plan, 3)
    assert fragment in str(caught.value)


def test_a_sweep_compares_kinds_by_their_size() -> None:
    scene = scene_with("EXX = { harmonics = [[1, 20, 0]] }")
    before, steps, left_out = sweep(scene, Plan(""), ("sinumerik-enc", "marlin"), (9, 33))
    assert [(one.format, one.points) for one in steps] == [
        ("sinumerik-enc", 9),
        ("sinumerik-enc", 33),
        ("marlin", 0),
    ]
    assert steps[1].after.max_um < steps[0].after.max_um < before.max_um
    assert steps[0].numbers == 27
    assert not left_out
    scara = replace(load_scene("machine_scara"), errors=ErrorSet())
    _, steps, left_out = sweep(scara, Plan(""), (), (3,))
    assert steps
    assert any(text.startswith("fanuc-3d: ") for text in left_out)


def test_constants_of_the_alternative_model_turn_with_the_axis() -> None:
    """E₀·R·E₀⁻¹ of the exact chain is what the translated errors give, to first order."""
    text = "[A0C]\nVALUE = 0.00003\n[Y0C]\nVALUE = 0.004\n[C0C]\nVALUE = 0.00001\n"
    base = load_scene("dvf5000_nominal")
    reading = read_errors(
        [source_of_text(text, "e.exc")], ReadOptions(base.machine, variant="alternative")
    )
    scene = into_scene(reading, base, "", "e.exc").scene
    assert isinstance(scene.errors.functions["EAC"], Harmonics)
    at = {"X": 0.0, "Y": 0.0, "Z": 0.0, "B": 0.0, "C": np.array([0.0, 30.0, 90.0, 200.0])}
    found = evaluate(scene, at=at, loop="workpiece").error_um
    assert np.abs(found[0]).max() < 1e-9
    plain = replace(
        base,
        errors=ErrorSet(
            {
                "EA0C": Constant((0, 1), 30.0),
                "EY0C": Constant((0, 1), 4.0),
                "EC0C": Constant((0, 1), 10.0),
            }
        ),
        model=replace(base.model, own_component_errors=(("C", "before_motion"),)),
    )
    from warpspace.kinematics import transforms
    from warpspace.kinematics.chain import branch_pose, error_transform, point_in_branch
    from warpspace.kinematics.model import complete_coordinates

    coordinates = complete_coordinates(base.machine, at)
    displaced = error_transform("C", {"EA0C": 30.0, "EY0C": 4.0, "EC0C": 10.0}, constant=True)
    nominal = branch_pose(base.model, "workpiece", coordinates)
    frames = branch_pose(base.model, "workpiece", {**coordinates, "C": np.zeros(4)})
    # displacement of the C frame in front of its rotation, taken back behind it
    turned = transforms.inverse(frames) @ nominal
    expected = frames @ displaced @ turned @ transforms.inverse(displaced)
    point = point_in_branch(base.model, "workpiece", coordinates, base.model.workpiece_point_mm)
    shift = transforms.apply(expected, np.array(base.model.workpiece_point_mm)) - point
    assert found == pytest.approx(shift * 1e3, abs=1e-3)
    assert np.abs(evaluate(plain, at=at, loop="workpiece").error_um[0]).max() > 1.0


@pytest.mark.parametrize("name", ["machine_gantry_mill", "machine_scara"])
@pytest.mark.parametrize("form", ["csv", "iso-text", "isg-csv", "sinumerik-cec", "sinumerik-enc"])
def test_a_machine_without_errors_has_nothing_to_correct(form: str, name: str) -> None:
    scene = replace(load_scene(name), errors=ErrorSet())
    assert compensate(scene, Plan(form, 3), 5).after_statistics.max_um == pytest.approx(0.0)
