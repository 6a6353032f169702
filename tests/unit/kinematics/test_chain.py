"""The exact chain on machines small enough to work out by hand."""

import numpy as np
import pytest

from warpspace.kinematics.chain import (
    branch_frames,
    branch_pose,
    error_transform,
    motion,
    nominal_point,
    point_in_branch,
    tool_axis,
)
from warpspace.kinematics.deviation import exact_error
from warpspace.kinematics.model import ComponentErrors, Loop, Model
from warpspace.machine.description import build_machine

OFFSETS = {
    "X": (1.0, 2.0, 3.0),
    "C": (0.0, 0.0, 50.0),
    "t": (0.0, 0.0, -100.0),
    "w": (0.0, 0.0, 10.0),
}
MACHINE = build_machine("wCFXt", offset_mm=OFFSETS)
AT = {"X": np.asarray(20.0), "C": np.asarray(90.0)}


def test_frames_stand_before_and_after_the_motion() -> None:
    (frames,) = branch_frames(Model(MACHINE), "tool", AT)
    assert frames.axis.name == "X"
    assert frames.before[:3, 3].tolist() == [1.0, 2.0, 3.0]
    assert frames.after[:3, 3].tolist() == [21.0, 2.0, 3.0]


def test_poses_end_at_the_tool_and_the_workpiece() -> None:
    assert branch_pose(Model(MACHINE), "tool", AT)[:3, 3].tolist() == [21.0, 2.0, -97.0]
    workpiece = branch_pose(Model(MACHINE), "workpiece", AT)
    assert workpiece[:3, 3].tolist() == [0.0, 0.0, 60.0]
    np.testing.assert_allclose(workpiece[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)


def test_functional_points_belong_to_their_loops() -> None:
    model = Model(MACHINE, tool_point_mm=(0.0, 0.0, -7.0), workpiece_point_mm=(5.0, 0.0, 0.0))
    assert nominal_point(model, Loop.TOOL, AT).tolist() == [21.0, 2.0, -104.0]
    assert nominal_point(model, Loop.RELATIVE, AT).tolist() == [21.0, 2.0, -104.0]
    found = nominal_point(model, Loop.WORKPIECE, AT)
    np.testing.assert_allclose(found, [0.0, 5.0, 60.0], atol=1e-14)
    np.testing.assert_array_equal(found, point_in_branch(model, "workpiece", AT, (5.0, 0.0, 0.0)))


@pytest.mark.parametrize("direction", [1, -1])
def test_direction_decides_which_way_an_axis_moves(direction: int) -> None:
    machine = build_machine("wCFXt", direction={"X": direction, "C": direction})
    assert motion(machine.axis("X"), np.asarray(20.0))[0, 3] == 20.0 * direction
    assert motion(machine.axis("C"), np.asarray(90.0))[1, 0] == pytest.approx(direction)


def test_tool_axis_turns_with_a_swivelling_head() -> None:
    model = Model(build_machine("wFXBt"))
    turned = tool_axis(model, {"X": np.asarray(0.0), "B": np.array([0.0, 90.0])})
    np.testing.assert_allclose(turned, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], atol=1e-15)


def test_error_transform_is_a_shift_and_then_a_full_turn() -> None:
    pose = error_transform("X", {"EYX": np.asarray(7.0), "ECX": np.asarray(1e5)}, constant=False)
    assert pose is not None
    assert pose[:3, 3] == pytest.approx([0.0, 0.007, 0.0])
    assert pose[1, 0] == pytest.approx(np.sin(0.1), abs=1e-15)
    assert error_transform("X", {"EC0X": np.asarray(1.0)}, constant=False) is None
    assert error_transform("X", {"EC0X": np.asarray(1.0)}, constant=True) is not None


def shift_of(model: Model, loop: Loop, values: dict[str, float]) -> np.ndarray:
    """Position error of the functional point, µm."""
    arrays = {key: np.asarray(value) for key, value in values.items()}
    return exact_error(model, loop, AT, arrays, nominal_point(model, loop, AT))[0]


def test_error_is_actual_minus_nominal_in_the_loop_of_its_axis() -> None:
    model = Model(MACHINE)
    for loop, expected in (("tool", 5.0), ("relative", 5.0), ("workpiece", 0.0)):
        np.testing.assert_allclose(
            shift_of(model, Loop(loop), {"EXX": 5.0}), [expected, 0.0, 0.0], atol=1e-9
        )
    for loop, expected in (("tool", 0.0), ("relative", -4.0), ("workpiece", 4.0)):
        np.testing.assert_allclose(
            shift_of(model, Loop(loop), {"EZC": 4.0}), [0.0, 0.0, expected], atol=1e-9
        )


def test_component_errors_ride_on_the_body_or_keep_their_direction() -> None:
    after = Model(MACHINE, ComponentErrors.AFTER_MOTION)
    before = Model(MACHINE, ComponentErrors.BEFORE_MOTION)
    found = shift_of(after, Loop.WORKPIECE, {"EXC": 4.0})
    np.testing.assert_allclose(found, [0.0, 4.0, 0.0], atol=1e-9)
    found = shift_of(before, Loop.WORKPIECE, {"EXC": 4.0})
    np.testing.assert_allclose(found, [4.0, 0.0, 0.0], atol=1e-9)
    for model in (after, before):
        found = shift_of(model, Loop.WORKPIECE, {"EX0C": 4.0})
        np.testing.assert_allclose(found, [4.0, 0.0, 0.0], atol=1e-9)


def test_squareness_does_not_ride_on_the_linear_motion_it_tilts() -> None:
    values = {"EC0X": 1000.0}
    moved = shift_of(Model(MACHINE), Loop.TOOL, values)
    assert moved[1] == pytest.approx(20.0 * np.sin(1e-3) * 1e3, rel=1e-9)
    assert shift_of(Model(MACHINE), Loop.TOOL, {"ECX": 1000.0})[1] == pytest.approx(0.0, abs=1e-9)


def test_tilt_of_the_tool_axis_has_no_part_about_the_axis() -> None:
    model = Model(MACHINE)
    values = {"EAX": np.asarray(30.0), "ECX": np.asarray(50.0)}
    tilt = exact_error(model, Loop.TOOL, AT, values, np.zeros(3))[1]
    np.testing.assert_allclose(tilt, [30.0, 0.0, 0.0], atol=2e-3)
    tilt = exact_error(model, Loop.RELATIVE, AT, {"EA0C": np.asarray(30.0)}, np.zeros(3))[1]
    np.testing.assert_allclose(tilt, [-30.0, 0.0, 0.0], atol=1e-6)
