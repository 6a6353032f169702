"""Transforms, chains, bodies and the first order, against numbers by hand."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.evaluate import error_values
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import body_motions, columns, loop_error, nominal_point
from warpspace.kinematics.model import (
    ComponentErrors,
    Loop,
    Model,
    batch_shape,
    complete_coordinates,
)
from warpspace.machine.definition import build_machine


def test_tiny_rotations_are_not_rounded_away():
    turned = transforms.vector_rotation([0.0, 0.0, 1e-12])
    assert turned[1, 0] == pytest.approx(1e-12, rel=1e-12)
    assert turned[0, 1] == pytest.approx(-1e-12, rel=1e-12)


MACHINE = build_machine("wCFXYt")


def test_axes_not_given_take_their_default_or_zero():
    found = complete_coordinates(MACHINE, {"X": [1.0, 2.0]}, {"Y": 5.0, "X": 9.0})
    assert {axis: at.tolist() for axis, at in found.items()} == {"X": [1, 2], "Y": 5, "C": 0}
    assert batch_shape(found) == (2,)
    fitting = complete_coordinates(MACHINE, {"X": np.zeros((2, 1)), "Y": np.zeros(3)})
    assert batch_shape(fitting) == (2, 3)
    with pytest.raises(OptionError, match=r"X \(2,\), Y \(3,\).*one batch shape"):
        complete_coordinates(MACHINE, {"X": np.zeros(2), "Y": np.zeros(3)})
    with pytest.raises(UnknownNameError, match="'Z'; expected one of X, Y, C"):
        complete_coordinates(MACHINE, {"Z": 1.0})


@pytest.mark.parametrize("value", [np.nan, [0.0, np.inf], "far", None, [[1.0], [1.0, 2.0]]])
def test_positions_that_are_no_finite_numbers_are_refused(value):
    with pytest.raises(OptionError, match=r"axis Y at .*; expected finite numbers"):
        complete_coordinates(MACHINE, {"Y": value})


OFFSETS = {"X": (1.0, 2.0, 3.0), "C": (0.0, 0.0, 50.0), "w": (0.0, 0.0, 10.0)}
CHAIN_MACHINE = build_machine("wCFXt", offset_mm={**OFFSETS, "t": (0.0, 0.0, -100.0)})
AT = {"X": np.asarray(20.0), "C": np.asarray(90.0)}


def test_functional_points_belong_to_their_loops():
    model = Model(CHAIN_MACHINE, tool_point_mm=(0.0, 0.0, -7.0), workpiece_point_mm=(5.0, 0.0, 0.0))
    assert nominal_point(model, Loop.TOOL, AT).tolist() == [21.0, 2.0, -104.0]
    assert nominal_point(model, Loop.RELATIVE, AT).tolist() == [21.0, 2.0, -104.0]
    on_workpiece = nominal_point(model, Loop.WORKPIECE, AT)
    np.testing.assert_allclose(on_workpiece, [0.0, 5.0, 60.0], atol=1e-14)


TILTED = 20e3 * np.array([np.cos(1e-3) - 1.0, np.sin(1e-3), 0.0])
"""20 mm along X, turned by 1000 µrad about z, µm."""


@pytest.mark.parametrize(
    ("loop", "errors", "after", "before"),
    [
        # actual minus nominal in the loop of its axis
        ("tool", {"EXX": 5.0}, (5, 0, 0), (5, 0, 0)),
        ("relative", {"EXX": 5.0}, (5, 0, 0), (5, 0, 0)),
        ("workpiece", {"EXX": 5.0}, (0, 0, 0), (0, 0, 0)),
        ("tool", {"EZC": 4.0}, (0, 0, 0), (0, 0, 0)),
        ("relative", {"EZC": 4.0}, (0, 0, -4), (0, 0, -4)),
        ("workpiece", {"EZC": 4.0}, (0, 0, 4), (0, 0, 4)),
        # component errors ride on the body or keep their direction, constants always keep it
        ("workpiece", {"EXC": 4.0}, (0, 4, 0), (4, 0, 0)),
        ("workpiece", {"EX0C": 4.0}, (4, 0, 0), (4, 0, 0)),
        # squareness does not ride on the linear motion it tilts
        ("tool", {"EC0X": 1000.0}, TILTED, TILTED),
        ("tool", {"ECX": 1000.0}, (0, 0, 0), TILTED),
    ],
)
def test_errors_of_the_exact_chain_by_hand(loop, errors, after, before):
    values = {key: np.asarray(value) for key, value in errors.items()}
    for order, expected in zip(ComponentErrors, (after, before), strict=True):
        model = Model(CHAIN_MACHINE, order)
        point = nominal_point(model, Loop(loop), AT)
        found, _ = loop_error(model, Loop(loop), AT, values, point)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_only_bodies_behind_an_error_move():
    scene = load_scene("teach_squareness")
    at = complete_coordinates(scene.machine, {"X": 10.0})
    bodies = body_motions(scene.model, error_values(scene.model, scene.errors, at), at)
    moved = {name for name, body in bodies.items() if np.any(body.rotation_rad != 0.0)}
    assert moved == {"Y", "Z", "S", "t"}


MODEL = Model(build_machine("wCFXt", offset_mm={"X": (1.0, 2.0, 3.0), "t": (0.0, 0.0, -100.0)}))
POINT = np.array([21.0, 2.0, -97.0])


def test_columns_hold_direction_lever_sign_and_gain():
    found = columns(MODEL, Loop.TOOL, ["EBX", "EYX", "EAC", "EC0X"], AT, POINT)
    assert set(found) == {"EBX", "EYX", "EC0X"}
    assert found["EBX"].lever_mm.tolist() == [0.0, 0.0, -100.0]
    assert found["EBX"].position == pytest.approx([-0.1, 0.0, 0.0])
    assert found["EYX"].position.tolist() == [0.0, 1.0, 0.0]
    assert found["EC0X"].lever_mm.tolist() == [20.0, 0.0, -100.0]  # before the motion
    relative = columns(MODEL, Loop.RELATIVE, ["EZC", "EZX"], AT, POINT)
    assert (relative["EZC"].sign, relative["EZX"].sign) == (-1.0, 1.0)
    assert relative["EZC"].position.tolist() == [0.0, 0.0, -1.0]
    for convention, direction in zip(ComponentErrors, ((0, 1, 0), (1, 0, 0)), strict=True):
        model = Model(MODEL.machine, convention)
        column = columns(model, Loop.WORKPIECE, ["EXC"], AT, POINT)["EXC"]
        np.testing.assert_allclose(column.direction, direction, atol=1e-15)
