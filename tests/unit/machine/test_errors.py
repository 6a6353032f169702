"""Functions that errors follow along one axis or two and by direction; tolerances."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.machine.axes import TravelDirection
from warpspace.machine.errors import (
    Constant,
    Directional,
    ErrorSet,
    Harmonics,
    Poly,
    Ramp,
    TableCurve,
    Tolerance,
    ToleranceSet,
    TwoArguments,
)
from warpspace.scene.library import parse_scene
from warpspace.scene.scene_writer import scene_to_toml

SPAN = (-200.0, 200.0)
TURN = (0.0, 360.0)
AT = np.array([-200.0, -100.0, 0.0, 50.0, 200.0])
FUNCTIONS = [
    Constant(SPAN, 7.0),
    Ramp(SPAN, -8.0),
    Poly(SPAN, (1.0, 0.0, 0.0005)),
    Harmonics(TURN, ((1.0, 3.0, 0.0), (2.0, -4.0, 90.0))),
    TableCurve(SPAN, ((-200.0, -20.0), (0.0, 4.0), (200.0, 12.0))),
    TwoArguments(
        SPAN, ("X", "Z"), ((-200.0, 0.0, 200.0), (0.0, 10.0)), ((1.0, 2.0), (3.0, -9.0), (4.0, 5.0))
    ),
    Directional(SPAN, Constant(SPAN, 3.0), Poly(SPAN, (1.0, 0.0, 0.0005))),
]


@pytest.mark.parametrize(
    ("function", "at", "values"),
    [
        (Constant(SPAN, 7.0), AT, [7.0] * 5),
        (Ramp(SPAN, 8.0), AT, [0.0, 2.0, 4.0, 5.0, 8.0]),
        (Poly(SPAN, (1.0, 0.5, 0.01)), [0.0, 10.0], [1.0, 7.0]),
        # cosines with their phases in degrees
        (
            Harmonics(TURN, ((1.0, 3.0, 0.0), (2.0, 4.0, 90.0))),
            [0.0, 45.0, 90.0],
            [3.0, 3.0 * np.sqrt(0.5) + 4.0, 0.0],
        ),
        # linear between its points and held beyond them
        (
            TableCurve(SPAN, ((-100.0, 1.0), (100.0, 3.0))),
            [-500.0, -100.0, 0.0, 100.0, 500.0],
            [1.0, 1.0, 2.0, 3.0, 3.0],
        ),
        (TableCurve(SPAN, ((5.0, 2.0),)), AT, [2.0] * 5),
    ],
)
def test_a_curve_has_its_values(function, at, values):
    np.testing.assert_allclose(function.evaluate(np.array(at)), values, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_a_curve_is_its_amplitude_times_its_shape(function):
    values = function.evaluate(AT)
    np.testing.assert_allclose(function.scaled(-2.0).evaluate(AT), -2.0 * values, rtol=1e-14)
    changed = function.with_amplitude(-3.5)
    assert changed.amplitude == pytest.approx(-3.5)
    assert type(changed) is type(function)
    shapes = [curve.with_amplitude(1.0).evaluate(AT) for curve in (changed, function)]
    np.testing.assert_allclose(*shapes, rtol=1e-13)
    np.testing.assert_allclose(function.amplitude * shapes[1], values, rtol=1e-14)
    for shape in ((), (3,), (2, 1, 3), (0,)):
        assert function.evaluate(np.zeros(shape)).shape == shape


@pytest.mark.parametrize(
    ("function", "amplitude"),
    [
        (Poly(SPAN, (0.0, -0.5)), 100.0),
        (Poly((-100.0, 200.0), (0.0, -0.5)), -100.0),
        (TableCurve(SPAN, ((0.0, -9.0), (1.0, 8.0))), -9.0),
        (Harmonics(TURN, ((3.0, 5.0, 0.0),)), 5.0),
    ],
)
def test_amplitude_is_the_largest_value_with_its_sign(function, amplitude):
    assert function.amplitude == pytest.approx(amplitude)


@pytest.mark.parametrize("order", [180.0, 360.0, 720.0, 1000.0])
def test_amplitude_of_a_fast_harmonic_is_not_lost_between_samples(order):
    curve = Harmonics(TURN, ((order, 50.0, 90.0),))
    assert abs(curve.amplitude) == pytest.approx(50.0, rel=0.02)
    values = curve.with_amplitude(1.0).evaluate(np.linspace(0.0, 7.0, 999))
    assert np.abs(values).max() == pytest.approx(1.0, rel=0.02)


def test_a_set_gives_zero_for_what_is_absent_and_leaves_the_original_alone():
    errors = ErrorSet({"EAX": Ramp(SPAN, 8.0)})
    assert errors.evaluate("EBX", AT).tolist() == [0.0] * 5
    assert (errors.amplitude("EBX"), errors.shape_at("EBX", {"X": AT}).tolist()) == (0.0, [1.0] * 5)
    changed = errors.with_amplitude("EAX", 2.0, SPAN).with_amplitude("EXX", 5.0, SPAN)
    assert changed.functions == {"EAX": Ramp(SPAN, 2.0), "EXX": Constant(SPAN, 5.0)}
    assert errors.functions == {"EAX": Ramp(SPAN, 8.0)}
    with pytest.raises(UnknownNameError, match="'EAXX'"):
        ErrorSet({"EAXX": Constant(SPAN, 1.0)})


CURVE = Directional(SPAN, Ramp(SPAN, 8.0), Constant(SPAN, -2.0))
DIRECTIONAL_AT = {"X": np.array([-200.0, 0.0, 200.0])}
SCENE = """machine = "dvf5000"
[convention]
direction = "mean"
[workspace]
X = [-200, 200]
[errors]
EXX = { forward = { ramp = 8 }, backward = -2 }
EYX = 5
EC0Y = 20
"""


@pytest.mark.parametrize(
    ("direction", "values"),
    [
        ("mean", [-1.0, 1.0, 3.0]),
        ("forward", [0.0, 4.0, 8.0]),
        ("backward", [-2.0, -2.0, -2.0]),
        ("difference", [2.0, 6.0, 10.0]),
    ],
)
def test_each_direction_has_its_values(direction, values):
    assert CURVE.evaluate_at("X", DIRECTIONAL_AT, direction).tolist() == values
    shape = CURVE.with_amplitude(1.0).evaluate_at("X", DIRECTIONAL_AT, direction)
    np.testing.assert_allclose(8.0 * shape, values)


def test_the_amplitude_is_the_larger_one_and_scales_both():
    assert CURVE.amplitude == 8.0
    assert replace(CURVE, backward=Constant(SPAN, -9.0)).amplitude == -9.0
    half = CURVE.with_amplitude(4.0)
    assert half == Directional(SPAN, Ramp(SPAN, 4.0), Constant(SPAN, -1.0))
    assert CURVE.evaluate(DIRECTIONAL_AT["X"]).tolist() == [-1.0, 1.0, 3.0]
    # one that no number holds is not hidden by the other direction, and warns nobody
    huge = Poly(SPAN, (0.0, 1e308, -1e308))
    assert not abs(Directional(SPAN, Constant(SPAN, 1.0), huge).amplitude) < 1e9
    assert not abs(Directional(SPAN, huge, Constant(SPAN, 1.0)).amplitude) < 1e9


def test_scenes_reload_equal_with_both_curves_and_the_direction():
    for way in TravelDirection:
        scene = parse_scene(SCENE.replace('"mean"', f'"{way}"'), "s")
        assert scene.model.direction == way
        assert parse_scene(scene_to_toml(scene), "s") == scene


def test_over_another_range_both_curves_keep_their_values():
    scene = parse_scene(SCENE, "s")
    ranges = {**scene.workspace.ranges, "X": (-1.0, 1)}
    other = replace(scene, workspace=replace(scene.workspace, ranges=ranges))
    saved = parse_scene(scene_to_toml(other), "s")
    at = {"X": np.linspace(-1.0, 1.0, 5)}
    for way in TravelDirection:
        values = [errors.evaluate_at("EXX", at, way) for errors in (saved.errors, scene.errors)]
        np.testing.assert_allclose(*values, atol=1e-12)


def test_a_direction_may_depend_on_a_second_axis():
    surface = TwoArguments(SPAN, ("X", "Z"), ((0.0,), (0.0, 10.0)), ((0.0, 4.0),))
    curve = Directional(SPAN, surface, Constant(SPAN, 1.0))
    at = {"X": np.zeros((3, 1)), "Z": np.array([0.0, 5.0])}
    assert curve.evaluate_at("X", at, "difference").tolist() == [[-1.0, 1.0]] * 3
    labels = ["forward Z 0", "forward Z 5", "forward Z 10", "backward"]
    assert [label for label, _ in curve.lines] == labels
    assert ErrorSet({"EXX": curve}).evaluate_at("EXX", at).tolist() == [[0.5, 1.5]] * 3


TWO_SPAN = (-275.0, 275.0)
X, Z = (-100.0, 0.0, 300.0), (-480.0, -80.0)
VALUES = ((1.0, 5.0), (2.0, -8.0), (6.0, 4.0))
TWO = TwoArguments(TWO_SPAN, ("X", "Z"), (X, Z), VALUES)
SURFACE = (
    "EXX = { table2 = { axes = ['Z', 'X'], X = [-100, 0, 300], Z = [-480, -80],"
    " values = [[1, 2, 6], [5, -8, 4]] } }"
)


def at(x, z):
    return TWO.evaluate_at("X", {"X": np.array(x), "Z": np.array(z)})


def test_a_surface_is_the_mean_of_four_points_weighted_by_opposite_areas():
    assert at(np.array(X)[:, None], np.array(Z)).tolist() == [list(row) for row in VALUES]
    # a quarter of the way along X from 0 to 300, and of the way along Z from -480 to -80
    by_hand = 0.75 * (0.75 * 2.0 + 0.25 * -8.0) + 0.25 * (0.75 * 6.0 + 0.25 * 4.0)
    assert float(at(75.0, -380.0)) == pytest.approx(by_hand, rel=1e-15)
    # its ends are held along both axes
    assert at([-900.0, 900.0, 900.0], [-900.0, -900.0, 900.0]).tolist() == [1.0, 6.0, 4.0]
    assert float(at(-900.0, -280.0)) == 3.0
    flat = TwoArguments(TWO_SPAN, ("X", "Z"), ((3.0,), Z), ((1.0, 5.0),))
    found = flat.evaluate_at("X", {"X": np.array([-9.0, 3.0, 9.0]), "Z": np.array(-280.0)})
    assert found.tolist() == [3.0, 3.0, 3.0]


def test_along_its_axis_a_surface_is_shown_by_sections():
    assert [line[0] for line in TWO.lines] == ["Z -480", "Z -280", "Z -80"]
    assert TWO.lines[1][1] == TableCurve(TWO_SPAN, ((-100.0, 3.0), (0.0, -3.0), (300.0, 5.0)))
    np.testing.assert_array_equal(TWO.evaluate(np.array(X)), [3.0, -3.0, 5.0])


def test_scene_files_may_name_the_axes_in_either_order_and_reload_equal():
    scene = parse_scene(f'machine = "dvf5000"\n[errors]\n{SURFACE}\n', "mine")
    assert scene.errors.functions["EXX"] == TWO
    assert parse_scene(scene_to_toml(scene), "mine") == scene


def test_a_table_larger_than_the_limit_is_refused_before_its_values_are_read():
    many = list(range(400))
    text = f"EXX = {{ table2 = {{ axes = ['X', 'Z'], X = {many}, Z = {many}, values = [] }} }}"
    with pytest.raises(SceneError, match="has 160,000 values; expected at most 100,000"):
        parse_scene(f'machine = "dvf5000"\n[errors]\n{text}\n', "mine")


def test_rows_that_people_write_do_not_make_a_surface():
    with pytest.raises(OptionError, match="comes from a scene file or an import"):
        TwoArguments.from_rows(TWO_SPAN, [[1.0]])
    with pytest.raises(OptionError):
        TwoArguments.from_curve(Constant(TWO_SPAN, 1.0), TWO_SPAN)


def test_own_tolerance_comes_before_that_of_the_class():
    own = Tolerance(-8.0, 6.0)
    tolerances = ToleranceSet({"translation": 10.0, "squareness": 25.0}, {"EAX": own})
    expected = [own, Tolerance(0.0, 10.0), Tolerance(0.0, 25.0), None]
    assert [tolerances.get(key) for key in ("EAX", "EXX", "EA0B", "EAY")] == expected
    assert tolerances.missing(["EXX", "EAX", "EAY", "EBY", "EC0Y"]) == ("EAY", "EBY")
    assert tolerances
    assert not ToleranceSet()
    assert ToleranceSet(individual={"EAX": Tolerance(0.0, 0.0)})


AXES = ("X", "Z"), ((-1.0, 0.0, 3.0), (0.0, 5.0))
FLAT, RISING = ((0.0, 0.0),) * 3, ((0.0, 0.0), (2.75, 2.75), (11.0, 11.0))
ZERO, ALL = Constant(TWO_SPAN, 0.0), Constant(TWO_SPAN, 11.0)
NOTHING = TWO_SPAN, ZERO, Ramp(TWO_SPAN, 0.0)


@pytest.mark.parametrize(
    ("kind", "zero", "grown"),
    [
        (Constant, (TWO_SPAN, 0.0), (TWO_SPAN, 11.0)),
        (Ramp, (TWO_SPAN, 0.0), (TWO_SPAN, 11.0)),
        (Poly, (TWO_SPAN, (0.0,)), (TWO_SPAN, (11.0,))),
        (Poly, (TWO_SPAN, (0.0, 0.0, 0.0)), (TWO_SPAN, (5.5, 0.02, 0.0))),
        (TableCurve, (TWO_SPAN, ((7.0, 0.0),)), (TWO_SPAN, ((7.0, 11.0),))),
        (
            TableCurve,
            (TWO_SPAN, ((-100.0, 0.0), (0.0, 0.0), (100.0, 0.0))),
            (TWO_SPAN, ((-100.0, 0.0), (0.0, 5.5), (100.0, 11.0))),
        ),
        (
            Harmonics,
            (TURN, ((2.0, 0.0, 0.0), (3.0, 0.0, 45.0))),
            (TURN, ((2.0, 11.0, 0.0), (3.0, 0.0, 45.0))),
        ),
        # a term that is zero by itself cannot carry the amplitude
        (Harmonics, (TURN, ((0.0, 0.0, 90.0),)), (TURN, ((1.0, 11.0, 0.0),))),
        (TwoArguments, (TWO_SPAN, *AXES, FLAT), (TWO_SPAN, *AXES, RISING)),
        (Directional, NOTHING, (TWO_SPAN, ALL, Ramp(TWO_SPAN, 11.0))),
    ],
)
def test_a_zero_curve_grows_in_its_kind(kind, zero, grown):
    zero, expected = kind(*zero), kind(*grown)
    at = np.linspace(*zero.span, 77)
    for amplitude in (11.0, 1.0):
        moved = zero.with_amplitude(amplitude)
        assert type(moved) is kind
        assert moved.amplitude == pytest.approx(amplitude)
        values = 11.0 / amplitude * moved.evaluate(at)
        np.testing.assert_allclose(values, expected.evaluate(at), rtol=1e-12, atol=1e-12)
    assert zero.with_amplitude(0.0) == zero
