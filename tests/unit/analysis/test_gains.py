"""Ranking, key errors, levers and the search for the largest gain."""

import numpy as np
import pytest

import warpspace
from warpspace.analysis.gains import Gain, gains_at, gains_max, mark_key_errors
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.description import build_machine

SCENE = warpspace.load_scene("dvf5000_nominal")


def gain(key: str, norm: float) -> Gain:
    return Gain(key, norm, 0.0, 0.0, norm, (0.0, 0.0, 0.0), {})


def test_key_errors_are_the_fewest_that_reach_the_share() -> None:
    rows = [gain("EXX", 1.0), gain("EAX", 3.0), gain("EAY", 2.0)]
    marked = mark_key_errors(rows, 0.9)  # 9 of 14, then 13 of 14
    assert [row.key for row in marked] == ["EAX", "EAY", "EXX"]
    assert [row.is_key for row in marked] == [True, True, False]
    assert [row.is_key for row in mark_key_errors(rows, 1.0)] == [True, True, True]
    assert [row.is_key for row in mark_key_errors(rows, 0.5)] == [True, False, False]


def test_a_gain_of_zero_is_never_key() -> None:
    assert not any(row.is_key for row in mark_key_errors([gain("EXX", 0.0)], 1.0))


@pytest.mark.parametrize("share", [0.0, -1.0, 1.01, float("nan")])
def test_share_out_of_range(share: float) -> None:
    with pytest.raises(OptionError, match="share"):
        mark_key_errors([gain("EXX", 1.0)], share)


@pytest.mark.parametrize("loop", list(Loop))
def test_gains_at_a_point_are_the_errors_of_unit_parameters(loop: Loop) -> None:
    from warpspace.field.evaluate import View, evaluate_first_order
    from warpspace.kinematics.model import complete_coordinates
    from warpspace.machine.errors import Constant, ErrorSet

    at = {"X": 30.0, "Y": -100.0, "Z": -200.0, "B": -35.0, "C": 70.0}
    coordinates = complete_coordinates(SCENE.machine, at)
    for row in gains_at(SCENE.model, loop, SCENE.parameter_keys, at):
        errors = ErrorSet({row.key: Constant((0, 1), 1.0)})
        error = evaluate_first_order(SCENE.model, errors, coordinates, View(loop)).error_um
        np.testing.assert_allclose((row.x, row.y, row.z), error, atol=1e-8)
        assert row.norm == pytest.approx(np.linalg.norm(error), abs=1e-8)


@pytest.mark.parametrize("loop", [Loop.TOOL, Loop.WORKPIECE])
def test_lever_parts_add_up_to_the_lever(loop: Loop) -> None:
    at = {"X": 30.0, "Y": -100.0, "Z": -200.0, "B": -35.0, "C": 70.0}
    for row in gains_at(SCENE.model, loop, SCENE.parameter_keys, at):
        total = np.sum([vector for _, vector in row.lever_parts_mm] or [(0, 0, 0)], axis=0)
        np.testing.assert_allclose(total, row.lever_mm, atol=1e-6)


def test_workpiece_parameters_have_no_parts_in_the_relative_loop() -> None:
    found = gains_at(SCENE.model, Loop.RELATIVE, ["EAC", "EAX"], {})
    assert {row.key: bool(row.lever_parts_mm) for row in found} == {"EAC": False, "EAX": True}


def test_largest_gain_is_not_below_any_random_position() -> None:
    ranges = {name: axis.travel for name, axis in SCENE.machine.axes.items()}
    rng = np.random.default_rng(4)
    for loop in Loop:
        best = {row.key: row for row in gains_max(SCENE.model, loop, SCENE.parameter_keys, ranges)}
        for _ in range(25):
            at = {name: rng.uniform(*span) for name, span in ranges.items()}
            for row in gains_at(SCENE.model, loop, SCENE.parameter_keys, at):
                assert row.norm <= best[row.key].norm * (1 + 4e-5) + 1e-9
                for column in "xyz":
                    limit = getattr(best[row.key], column) + 1e-4 * best[row.key].norm + 1e-9
                    assert abs(getattr(row, column)) <= limit


def test_position_of_the_largest_gain_reproduces_it() -> None:
    ranges = {name: axis.travel for name, axis in SCENE.machine.axes.items()}
    for row in gains_max(SCENE.model, Loop.WORKPIECE, SCENE.parameter_keys, ranges, 10.0):
        (again,) = gains_at(SCENE.model, Loop.WORKPIECE, [row.key], row.at)
        assert again.norm == pytest.approx(row.norm)


def test_three_rotary_axes_in_one_loop() -> None:
    model = Model(build_machine("wABCFXt"), workpiece_point_mm=(0.0, 100.0, 50.0))
    ranges = {name: axis.travel for name, axis in model.machine.axes.items()}
    found = gains_max(model, Loop.WORKPIECE, model.machine.parameter_keys, ranges, 30.0)
    assert max(row.norm for row in found) >= 1.0


@pytest.mark.parametrize("step", [0.0, -1.0, 91.0, 1e-6, float("nan")])
def test_step_out_of_range(step: float) -> None:
    ranges = {name: axis.travel for name, axis in SCENE.machine.axes.items()}
    with pytest.raises(OptionError, match="step"):
        gains_max(SCENE.model, Loop.WORKPIECE, SCENE.parameter_keys, ranges, step)


def test_unknown_axis_and_empty_loop() -> None:
    with pytest.raises(UnknownNameError, match="axis 'A'"):
        gains_at(SCENE.model, Loop.TOOL, ["EAX"], {"A": 1.0})
    with pytest.raises(OptionError, match="has no axis in it"):
        gains_at(Model(build_machine("wFXYZt")), Loop.WORKPIECE, ["EAX"], {})
