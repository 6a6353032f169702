"""Error sets in other conventions: closed forms, the same exact field, and the way back."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import error_transform
from warpspace.kinematics.conversion import (
    angle_sign,
    convert_order,
    convert_reference_line,
    convert_squareness,
    fit_line,
    move_measuring_line,
    squareness_keys,
    zero_at,
)
from warpspace.kinematics.model import Model
from warpspace.machine.curves.polynomial_pieces import Pieces, fit_curves
from warpspace.machine.definition import build_machine
from warpspace.machine.errors import (
    Constant,
    Directional,
    ErrorSet,
    Harmonics,
    Poly,
    TableCurve,
    TwoArguments,
)
from warpspace.scene.library import parse_scene
from warpspace.scene.model import evaluate
from warpspace.scene.scene_writer import covered_spans

SAME = 3e-9
"""µm and µrad: rounding of the exact chain over a metre, times a dozen products."""
TEXT = """machine = "dvf5000"
[convention]
component_errors = "ORDER"
[workspace]
X = [-275, 275]
Y = [-225, 225]
Z = [-480, -80]
[errors]
EXX = { table = [[-275, 0], [-100, 5], [60, -3], [275, 9]] }
EYX = { poly = [2, 0.03, 1e-4] }
EZX = { table = [[-275, 1], [0, 4], [275, -2]] }
EAX = { ramp = 12 }
EBX = { table = [[-275, -8], [30, 14], [275, 3]] }
ECX = { harmonics = [[1, 9, 30]] }
EXY = { forward = { ramp = 4 }, backward = { poly = [1, 0.01] } }
EBY = 8
ECY = { ramp = -15 }
EZZ = { ramp = 7 }
EXZ = { poly = [0, 0.02] }
EC0Y = 20
EA0Z = -14
EB0Z = 9
EXC = { harmonics = [[1, 3, 0], [2, 1, 40]] }
EYC = { harmonics = [[1, 2, 90]] }
EZC = { harmonics = [[3, 1, 0]] }
EAC = { harmonics = [[1, 6, 10]] }
ECC = { harmonics = [[2, 9, 0]] }
EA0C = 11
EX0C = 4
EBB = { ramp = 12 }
EXB = 3
"""


def scene_of(order, direction):
    scene = parse_scene(TEXT.replace("ORDER", order), "s")
    axes = scene.machine.axes
    axes = {**axes, **{name: replace(axes[name], direction=direction) for name in "XC"}}
    machine = replace(scene.machine, axes=axes)
    return replace(scene, model=replace(scene.model, machine=machine))


@pytest.fixture(params=[("after_motion", 1), ("before_motion", 1), ("after_motion", -1)], ids=str)
def scene(request):
    return scene_of(*request.param)


def assert_same_field(one, model, errors):
    random = np.random.default_rng(7)
    spans = covered_spans(one.model, one.workspace)
    at = {axis: random.uniform(*span, 150) for axis, span in spans.items()}
    for way in ("forward", "backward"):
        pair = [replace(one, model=replace(one.model, direction=way))]
        pair.append(replace(one, model=replace(model, direction=way), errors=errors))
        for loop in ("tool", "workpiece", "relative"):
            a, b = (evaluate(each, at=at, loop=loop, exact=True) for each in pair)
            assert np.abs(a.error_um).max() > 10.0
            fields = ((each.error_um, each.orientation_urad) for each in (b, a))
            np.testing.assert_allclose(*fields, rtol=0, atol=SAME)


def assert_same_curves(one, other, spans):
    for key in {*one, *other}:
        at = {key[-1]: np.linspace(*spans[key[-1]], 333)}
        for way in ("forward", "backward"):
            values = (errors.evaluate_at(key, at, way) for errors in (other, one))
            np.testing.assert_allclose(*values, rtol=0, atol=1e-10, err_msg=key)


def spans_of(scene):
    return covered_spans(scene.model, scene.workspace)


def test_fits_give_the_simplest_curve_that_is_exact():
    span, at = (-100.0, 300.0), np.linspace(-100.0, 300.0, 1001)
    table = TableCurve(span, ((-100.0, 1.0), (50.0, 7.0), (300.0, -2.0)))

    def values(q):
        parts = (0.0 * q, 4.0 + 0.0 * q, 1e-3 * q**2, q * table.evaluate(q), np.sin(q / 20.0))
        return np.stack(parts, -1)

    nothing, flat, square, product, wave = fit_curves(values, span, np.array(table.kinks))
    assert nothing is None
    assert flat == Constant(span, 4.0)
    for curve, column in ((square, 2), (product, 3), (wave, 4)):
        np.testing.assert_allclose(curve.evaluate(at), values(at)[:, column], rtol=0, atol=2e-12)
    (alone,) = fit_curves(lambda q: 1e-3 * q[:, None] ** 2, span, np.zeros(0))
    assert isinstance(alone, Poly)
    assert isinstance(wave, Pieces)


def test_pieces_are_held_beyond_their_ends_and_reload():
    text = "EXX = { pieces = [[0, 1, 2], [10, 21, -1]], end = 20, points = [5] }"
    curve = parse_scene(f'machine = "dvf5000"\n[errors]\n{text}\n', "s").errors.functions["EXX"]
    values = curve.evaluate(np.array([-5.0, 0.0, 5.0, 10.0, 15.0, 20.0, 99.0]))
    assert values.tolist() == [1.0, 1.0, 11.0, 21.0, 16.0, 11.0, 11.0]
    rows = [[0.0, 1.0, 2.0], [10.0, 21.0, -1.0]]
    assert curve.to_toml() == {"pieces": rows, "end": 20.0, "points": [5.0]}


def test_a_linear_axis_changes_its_shifts_by_the_arm_of_its_position():
    model = Model(build_machine("wFXt"))
    pitch = ErrorSet({"EBX": Constant((-100.0, 100.0), 10.0)})
    _, found = convert_order(model, pitch, {"X": (-100.0, 100.0)}, {"X": "before_motion"})
    # about y: the point at q along x sinks by q × pitch after the motion, which does not turn the
    # motion itself; before the motion it would, and the shift takes that back
    rises = found.evaluate("EZX", np.array([-100.0, 100.0]))
    np.testing.assert_allclose(rises, [-1.0, 1.0], atol=1e-4)
    assert found.functions["EBX"] == pitch.functions["EBX"]


def test_a_rotary_axis_turns_the_directions_of_its_errors():
    model = Model(build_machine("wFCt"))
    after = ErrorSet({"EXC": Constant((0.0, 360.0), 5.0)})
    _, found = convert_order(model, after, {"C": (0.0, 360.0)}, {"C": "before_motion"})
    at = np.array([0.0, 90.0, 200.0])
    np.testing.assert_allclose(found.evaluate("EXC", at), 5 * np.cos(np.deg2rad(at)), atol=1e-11)
    np.testing.assert_allclose(found.evaluate("EYC", at), 5 * np.sin(np.deg2rad(at)), atol=1e-11)


def test_the_other_order_has_the_same_field_and_the_way_back_the_same_curves(scene):
    spans, axes = spans_of(scene), scene.machine.axes
    present = scene.model.component_errors
    other = "before_motion" if present == "after_motion" else "after_motion"
    model, errors = convert_order(scene.model, scene.errors, spans, dict.fromkeys(axes, other))
    assert model.component_errors == other
    assert_same_field(scene, model, errors)
    again, back = convert_order(model, errors, spans, dict.fromkeys(axes, present))
    assert again == scene.model
    assert_same_curves(scene.errors, back, spans)


def test_the_line_shows_what_a_reflector_there_would_move_by(scene):
    place = np.array([20.0, 150.0, -80.0])
    errors = move_measuring_line(
        scene.model, scene.errors, spans_of(scene), {"X": tuple(place)}, to_origin=False
    )
    x = scene.machine.axes["X"]
    for q in (-200.0, 33.0, 275.0):
        values = {key: scene.errors.evaluate(key, np.array(q)) for key in scene.errors}
        body = error_transform("X", values, constant=False)
        assert body is not None
        moving = place + x.direction * q * np.eye(3)[0]
        point = moving if scene.model.component_errors == "before_motion" else place
        seen = (transforms.apply(body, point) - point) * 1e3
        found = [float(errors.evaluate(f"E{a}X", np.array(q))) for a in "XYZ"]
        np.testing.assert_allclose(found, seen, atol=1e-9)


def test_what_is_zero_at_a_position_was_moved_to_the_constants(scene):
    spans = spans_of(scene)
    positions = {"X": 10.0, "Z": -100.0, "C": 30.0}
    errors = zero_at(scene.model, scene.errors, spans, positions)
    for axis, at in positions.items():
        values = [errors.evaluate(f"E{letter}{axis}", np.array(at)) for letter in "XYZABC"]
        np.testing.assert_allclose(values, 0.0, atol=1e-9)
    assert_same_field(scene, scene.model, errors)


def test_to_other_lines_and_zeros_and_back_are_the_same_curves(scene):
    spans = spans_of(scene)
    lines = {"X": (0.0, 150.0, -80.0), "Y": (20.0, 0.0, 300.0), "C": (5.0, 0.0, 200.0)}
    there = move_measuring_line(scene.model, scene.errors, spans, lines, to_origin=False)
    back = move_measuring_line(scene.model, there, spans, lines, to_origin=True)
    assert_same_curves(scene.errors, back, spans)
    first = {"X": 10.0, "Y": 0.0, "C": 30.0}
    here = zero_at(scene.model, scene.errors, spans, first)
    there = zero_at(scene.model, here, spans, {"X": -200.0, "Y": 5.0, "C": 130.0})
    assert_same_curves(here, zero_at(scene.model, there, spans, first), spans)


POSITION = np.array([0.0, 100.0, 200.0, 300.0, 400.0])
STRAIGHTNESS = np.array([0.0, 4.0, 1.0, 5.0, 2.0])


def test_reference_lines_of_a_curve_by_hand():
    assert fit_line(POSITION, STRAIGHTNESS, "end_point") == pytest.approx((0.0, 0.005))
    slope, offset = np.polyfit(POSITION, STRAIGHTNESS, 1)
    assert fit_line(POSITION, STRAIGHTNESS, "least_squares") == pytest.approx((offset, slope))
    # the upper side through (100, 4) and (300, 5): 0.005 µm/mm, 3.5 µm at zero; the lower side is
    # 3.5 µm below it at (0, 0), (200, 1) and (400, 2) alike
    offset, slope = fit_line(POSITION, STRAIGHTNESS, "minimum_zone")
    assert (offset, slope) == pytest.approx((1.75, 0.005))
    rest = STRAIGHTNESS - offset - slope * POSITION
    assert (rest.max(), rest.min()) == pytest.approx((1.75, -1.75))


def test_no_other_line_has_a_narrower_zone():
    random = np.random.default_rng(5)
    for count in (2, 3, 4, 9, 60):
        position, value = np.sort(random.uniform(0, 500, count)), random.normal(0, 3, count)
        _, slope = fit_line(position, value, "minimum_zone")
        width = np.ptp(value - slope * position)
        for other in slope + np.linspace(-0.1, 0.1, 2001):
            assert np.ptp(value - other * position) >= width - 1e-9


@pytest.mark.parametrize("line", ["end_point", "least_squares", "minimum_zone"])
def test_the_tilt_of_straightness_goes_to_the_squareness(line):
    span = (0.0, 400.0)
    points = tuple(zip(POSITION.tolist(), STRAIGHTNESS.tolist(), strict=True))
    model = Model(build_machine("wFXYt", travel={"X": (0.0, 400.0), "Y": span}))
    errors = ErrorSet({"EXY": TableCurve(span, points), "EC0Y": Constant(span, 20.0)})
    found = convert_reference_line(model, errors, {"X": span, "Y": span}, {"Y": line})
    offset, slope = fit_line(POSITION, STRAIGHTNESS, line)
    # x grows with y: Y leans towards +X, that is by −slope about z; 1 µm/mm is 1000 µrad
    assert found.amplitude("EC0Y") == pytest.approx(20.0 - 1e3 * slope, abs=1e-4)
    assert found.amplitude("EX0Y") == pytest.approx(offset, abs=1e-3)
    assert found.evaluate("ECY", POSITION) == pytest.approx(np.full(5, 1e3 * slope), abs=1e-4)
    left = found.evaluate("EXY", POSITION)
    assert fit_line(POSITION, left, line) == pytest.approx((0.0, 0.0), abs=1e-10)
    np.testing.assert_allclose(left, STRAIGHTNESS - offset - slope * POSITION, atol=1e-3)


@pytest.mark.parametrize("line", ["end_point", "least_squares", "minimum_zone"])
@pytest.mark.parametrize("direction", [1, -1])
def test_reference_lines_leave_the_field_and_come_back(direction, line):
    scene = scene_of("after_motion", direction)
    spans = spans_of(scene)
    errors = convert_reference_line(scene.model, scene.errors, spans, dict.fromkeys("XYZ", line))
    assert_same_field(scene, scene.model, errors)
    for key in ("EYX", "EZX"):
        at = np.array(scene.errors.functions[key].kinks or np.linspace(-275.0, 275.0, 101))
        assert fit_line(at, errors.evaluate(key, at), line) == pytest.approx((0.0, 0.0), abs=1e-9)
    other = "end_point" if line != "end_point" else "least_squares"
    there = convert_reference_line(scene.model, errors, spans, {"X": other})
    assert_same_field(scene, scene.model, there)
    again = convert_reference_line(scene.model, errors, spans, {"X": line})
    assert_same_curves(errors, again, spans)


def test_before_the_motion_a_tilt_is_no_matter_of_straightness():
    scene = scene_of("before_motion", 1)
    with pytest.raises(OptionError, match="expected component_errors after_motion"):
        convert_reference_line(scene.model, scene.errors, spans_of(scene), {"X": "end_point"})


@pytest.mark.parametrize("key", squareness_keys(build_machine("wFXYZt")))
def test_the_sign_is_that_of_the_angle_between_the_axes(key):
    own, about = "XYZ".index(key[3]), "ABC".index(key[1])
    turn = np.zeros(3)
    turn[about] = 1e-3
    axis = transforms.vector_rotation(turn) @ np.eye(3)[own]
    larger = np.arccos(axis @ np.eye(3)[3 - own - about]) - np.pi / 2.0
    assert larger == pytest.approx(angle_sign(key) * 1e-3, abs=1e-9)


def test_signs_of_the_reference_machine_and_back():
    machine = build_machine("wCBFXYZt")
    keys = ("EC0Y", "EA0Z", "EB0Z", "EA0C", "EAX")
    errors = ErrorSet(dict.fromkeys(keys, Constant((0.0, 1.0), 7.0)))
    over = convert_squareness(machine, errors, "over_90")
    assert [over.amplitude(key) for key in errors] == [7.0, 7.0, -7.0, 7.0, 7.0]
    under = convert_squareness(machine, errors, "under_90")
    assert [under.amplitude(key) for key in errors] == [-7.0, -7.0, 7.0, 7.0, 7.0]
    for sign in ("over_90", "under_90", "right_hand"):
        there = convert_squareness(machine, errors, sign)
        assert convert_squareness(machine, there, sign) == errors


LINE = (0.0, 0.0, 100.0)
SURFACE = TwoArguments(
    (-275.0, 275.0), ("X", "Z"), ((-275.0, 275.0), (-480.0, -80.0)), ((0.0, 4.0), (3.0, 9.0))
)


def test_shifts_over_two_axes_stay_where_nothing_is_added_to_them():
    scene = parse_scene('machine = "dvf5000"\n[errors]\nEAX = 90\nEBZ = 3\nEXC = 12\n', "s")
    errors = ErrorSet({**scene.errors.functions, "EXX": SURFACE})
    model, found = convert_order(scene.model, errors, spans_of(scene), {"X": "before_motion"})
    assert found.functions["EXX"] == SURFACE
    assert_same_field(replace(scene, errors=errors), model, found)


@pytest.mark.parametrize("key", ["EXX", "EBX"])
def test_what_depends_on_a_second_axis_and_would_change_is_refused(key):
    scene = parse_scene('machine = "dvf5000"\n[errors]\nEBX = 5\n', "s")
    errors = ErrorSet({**scene.errors.functions, key: SURFACE})
    spans = spans_of(scene)
    for convert, value in ((zero_at, 0.0), (partial(move_measuring_line, to_origin=False), LINE)):
        with pytest.raises(OptionError, match=f"{key} depends on X and Z"):
            convert(scene.model, errors, spans, {"X": value})


def test_both_directions_are_converted_and_stay_two():
    span = (-100.0, 100.0)
    model = Model(build_machine("wFXt"))
    pitch = Directional(span, Constant(span, 10.0), Harmonics(span, ((1.0, 4.0, 0.0),)))
    errors = move_measuring_line(
        model, ErrorSet({"EBX": pitch}), {"X": span}, {"X": LINE}, to_origin=False
    )
    at = {"X": np.array([0.0, 60.0])}
    assert errors.functions["EBX"] == pitch
    np.testing.assert_allclose(errors.evaluate_at("EXX", at, "forward"), [1.0, 1.0], atol=1e-8)
    np.testing.assert_allclose(errors.evaluate_at("EXX", at, "backward"), [0.4, 0.2], atol=1e-8)
