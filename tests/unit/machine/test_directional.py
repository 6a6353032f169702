"""Errors by direction of travel."""

from dataclasses import replace

import numpy as np
import pytest

from warpspace.exceptions import SceneError
from warpspace.machine.errors import Constant, Directional, ErrorSet, Poly, Ramp, TwoArguments
from warpspace.machine.travel import TravelDirection
from warpspace.scene.library import parse_scene
from warpspace.scene.pipeline import evaluate
from warpspace.scene.save import scene_to_toml

SPAN = (-200.0, 200.0)
CURVE = Directional(SPAN, Ramp(SPAN, 8.0), Constant(SPAN, -2.0))
AT = {"X": np.array([-200.0, 0.0, 200.0])}
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
def test_each_direction_has_its_values(direction: str, values: list[float]) -> None:
    assert CURVE.evaluate_at("X", AT, direction).tolist() == values


def test_without_a_direction_it_is_the_mean() -> None:
    assert CURVE.evaluate(AT["X"]).tolist() == CURVE.evaluate_at("X", AT).tolist()


@pytest.mark.parametrize("curve", [Constant(SPAN, 3.0), Ramp(SPAN, 3.0)])
def test_other_errors_have_no_difference(curve: Constant | Ramp) -> None:
    assert curve.evaluate_at("X", AT, TravelDirection.DIFFERENCE).tolist() == [0.0] * 3
    assert curve.evaluate_at("X", AT, "forward").tolist() == curve.evaluate(AT["X"]).tolist()


def test_the_amplitude_is_the_larger_one_and_scales_both() -> None:
    assert CURVE.amplitude == 8.0
    assert replace(CURVE, backward=Constant(SPAN, -9.0)).amplitude == -9.0
    half = CURVE.with_amplitude(4.0)
    assert half == Directional(SPAN, Ramp(SPAN, 4.0), Constant(SPAN, -1.0))
    for direction in TravelDirection:
        shape = CURVE.shape_at("X", AT, direction)
        np.testing.assert_allclose(8.0 * shape, CURVE.evaluate_at("X", AT, direction))


def test_an_amplitude_that_no_number_holds_is_not_hidden_by_the_other_direction() -> None:
    huge = Poly(SPAN, (0.0, 1e308, -1e308))
    assert not abs(Directional(SPAN, Constant(SPAN, 1.0), huge).amplitude) < 1e9
    assert not abs(Directional(SPAN, huge, Constant(SPAN, 1.0)).amplitude) < 1e9


@pytest.mark.parametrize("exact", [False, True])
def test_the_field_is_that_of_the_direction_of_the_scene(exact: bool) -> None:
    fields = {
        way: evaluate(
            parse_scene(SCENE.replace('"mean"', f'"{way}"'), "s"),
            at={"X": [-200.0, 200.0], "Y": 50.0, "Z": -100.0},
            exact=exact,
        ).error_um
        for way in TravelDirection
    }
    there, back = fields[TravelDirection.FORWARD], fields[TravelDirection.BACKWARD]
    assert there[1, 0] - back[1, 0] == pytest.approx(10.0)
    np.testing.assert_allclose(fields[TravelDirection.MEAN], (there + back) / 2.0, atol=1e-9)
    np.testing.assert_allclose(fields[TravelDirection.DIFFERENCE], there - back, atol=1e-9)
    np.testing.assert_allclose(fields[TravelDirection.DIFFERENCE][:, 1:], 0.0, atol=1e-9)


def test_scenes_reload_equal_with_both_curves_and_the_direction() -> None:
    for way in TravelDirection:
        scene = parse_scene(SCENE.replace('"mean"', f'"{way}"'), "s")
        assert scene.model.direction == way
        assert parse_scene(scene_to_toml(scene), "s") == scene


def test_over_another_range_both_curves_keep_their_values() -> None:
    scene = parse_scene(SCENE, "s")
    wider = replace(
        scene, workspace=replace(scene.workspace, ranges={**scene.workspace.ranges, "X": (-1.0, 1)})
    )
    saved = parse_scene(scene_to_toml(wider), "s")
    at = {"X": np.linspace(-1.0, 1.0, 5)}
    for way in TravelDirection:
        found = [errors.evaluate_at("EXX", at, way) for errors in (saved.errors, scene.errors)]
        np.testing.assert_allclose(found[0], found[1], atol=1e-12)


def test_a_direction_may_depend_on_a_second_axis() -> None:
    surface = TwoArguments(SPAN, ("X", "Z"), ((0.0,), (0.0, 10.0)), ((0.0, 4.0),))
    curve = Directional(SPAN, surface, Constant(SPAN, 1.0))
    at = {"X": np.zeros((3, 1)), "Z": np.array([0.0, 5.0])}
    assert curve.evaluate_at("X", at, "difference").tolist() == [[-1.0, 1.0]] * 3
    assert [words for words, _ in curve.lines] == [
        "forward Z 0",
        "forward Z 5",
        "forward Z 10",
        "backward",
    ]
    assert ErrorSet({"EXX": curve}).evaluate_at("EXX", at).tolist() == [[0.5, 1.5]] * 3


@pytest.mark.parametrize(
    ("spelled", "message"),
    [
        ("{ forward = 3 }", r"errors\.EYY\.backward: is missing"),
        ("{ forward = 3, backward = { ramq = 3 } }", r"errors\.EYY\.backward = .*expected a numb"),
        ("{ forward = { poly = [0, 'a'] }, backward = 3 }", r'EYY\.forward\.poly\[1\] = "a": exp'),
        ("{ forward = 3, backward = 4, x = 5 }", r"errors\.EYY\.x: unknown key"),
        ("{ forward = 3, backward = { ramp = 3, raw = 1 } }", r"EYY\.backward\.raw: unknown key"),
        (
            "{ forward = 3, backward = { forward = 3, backward = 4 } }",
            r"EYY\.backward: expected a curve that has no directions of its own",
        ),
        ("{ forward = 3, backward = { poly = [0, 1e9] } }", "expected at most ±100000"),
    ],
)
def test_what_is_no_pair_of_curves_is_refused_in_words(spelled: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        parse_scene(f'machine = "dvf5000"\n[errors]\nEYY = {spelled}\n', "mine")


def test_a_direction_that_does_not_exist_is_refused() -> None:
    with pytest.raises(SceneError, match=r'convention\.direction = "up": expected one of "mean"'):
        parse_scene(SCENE.replace('"mean"', '"up"'), "s")


def test_constants_have_no_direction() -> None:
    with pytest.raises(SceneError, match=r"EC0Y = .*is constant along its axis; expected a number"):
        parse_scene(SCENE.replace("EC0Y = 20", "EC0Y = { forward = 1, backward = 2 }"), "s")
