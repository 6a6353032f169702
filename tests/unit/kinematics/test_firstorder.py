"""Jacobian columns of single parameters; the whole Jacobian is tested in tests/properties."""

import numpy as np
import pytest

from warpspace.kinematics.firstorder import columns, jacobian, rotation_gain
from warpspace.kinematics.model import ComponentErrors, Loop, Model
from warpspace.machine.description import build_machine

MODEL = Model(build_machine("wCFXt", offset_mm={"X": (1.0, 2.0, 3.0), "t": (0.0, 0.0, -100.0)}))
AT = {"X": np.asarray(20.0), "C": np.asarray(90.0)}
POINT = np.array([21.0, 2.0, -97.0])


def test_rotation_gain_is_direction_times_lever() -> None:
    assert rotation_gain([0.0, 0.0, -500.0], [1.0, 0.0, 0.0]).tolist() == [0.0, 0.5, 0.0]
    batch = rotation_gain(np.ones((4, 3)), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(batch, np.tile([-1e-3, 1e-3, 0.0], (4, 1)))


def test_columns_hold_direction_lever_and_gain() -> None:
    found = columns(MODEL, Loop.TOOL, ["EBX", "EYX", "EAC"], AT, POINT)
    assert set(found) == {"EBX", "EYX"}
    assert found["EBX"].lever_mm.tolist() == [0.0, 0.0, -100.0]
    assert found["EBX"].position == pytest.approx([-0.1, 0.0, 0.0])
    assert found["EYX"].position.tolist() == [0.0, 1.0, 0.0]


def test_constants_act_before_the_motion() -> None:
    lever = columns(MODEL, Loop.TOOL, ["EC0X"], AT, POINT)["EC0X"].lever_mm
    assert lever.tolist() == [20.0, 0.0, -100.0]


@pytest.mark.parametrize(
    ("convention", "direction"),
    [(ComponentErrors.AFTER_MOTION, (0.0, 1.0, 0.0)), (ComponentErrors.BEFORE_MOTION, (1, 0, 0))],
)
def test_convention_decides_where_component_errors_point(convention, direction) -> None:
    model = Model(MODEL.machine, convention)
    column = columns(model, Loop.WORKPIECE, ["EXC"], AT, POINT)["EXC"]
    np.testing.assert_allclose(column.direction, direction, atol=1e-15)


def test_workpiece_branch_counts_negative_in_the_relative_loop() -> None:
    column = columns(MODEL, Loop.RELATIVE, ["EZC"], AT, POINT)["EZC"]
    assert (column.sign, column.position.tolist()) == (-1.0, [0.0, 0.0, -1.0])
    assert columns(MODEL, Loop.RELATIVE, ["EZX"], AT, POINT)["EZX"].sign == 1.0


def test_parameter_outside_the_loop_or_the_machine_gives_zeros_in_its_place() -> None:
    position, orientation = jacobian(MODEL, Loop.TOOL, ["EZC", "EZX", "EZB"], AT, POINT)
    assert position.tolist() == [[0, 0, 0], [0, 0, 1], [0, 0, 0]]
    assert not orientation.any()


def test_rotation_about_the_tool_axis_has_no_orientation_error() -> None:
    _, orientation = jacobian(MODEL, Loop.TOOL, ["EAX", "ECX"], AT, POINT)
    assert orientation.tolist() == [[1, 0, 0], [0, 0, 0]]


def test_shape_follows_all_coordinates_and_the_points() -> None:
    batch = {"X": np.zeros((4, 1)), "C": np.zeros(5)}
    position, orientation = jacobian(MODEL, Loop.TOOL, ["EXX"], batch, np.zeros(3))
    assert position.shape == orientation.shape == (1, 4, 5, 3)
    position, _ = jacobian(MODEL, Loop.TOOL, [], AT, np.zeros((7, 3)))
    assert position.shape == (0, 7, 3)
