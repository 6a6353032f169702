"""Kernels at the places where signs and shapes go wrong; identities are in tests/properties."""

import numpy as np
import pytest

from warpspace.kinematics import transforms


@pytest.mark.parametrize(
    ("index", "start", "end"),
    [(0, (0, 1, 0), (0, 0, 1)), (1, (0, 0, 1), (1, 0, 0)), (2, (1, 0, 0), (0, 1, 0))],
)
def test_quarter_turns_follow_the_right_hand_rule(index: int, start, end) -> None:
    turn = transforms.axis_rotation(index, np.pi / 2.0)
    np.testing.assert_allclose(transforms.rotate(turn, start), end, atol=1e-15)


def test_apply_takes_child_to_parent_coordinates() -> None:
    pose = transforms.rigid(transforms.axis_rotation(2, np.pi / 2.0), [10.0, 20.0, 30.0])
    np.testing.assert_allclose(transforms.apply(pose, [1.0, 0.0, 0.0]), [10.0, 21.0, 30.0])


def test_batches_broadcast_against_each_other() -> None:
    turns = transforms.axis_rotation(0, np.zeros((4, 1)))
    shifts = np.ones((5, 3))
    assert transforms.rigid(turns, shifts).shape == (4, 5, 4, 4)
    assert transforms.translation(shifts).shape == (5, 4, 4)
    assert transforms.apply(transforms.rigid(turns, shifts), np.ones(3)).shape == (4, 5, 3)
    assert transforms.vector_rotation(np.zeros((0, 3))).shape == (0, 3, 3)


def test_rotation_vector_of_nothing_is_the_identity() -> None:
    np.testing.assert_array_equal(transforms.vector_rotation(np.zeros(3)), np.eye(3))


def test_tiny_rotations_are_not_rounded_away() -> None:
    turned = transforms.vector_rotation([0.0, 0.0, 1e-12])
    assert turned[1, 0] == pytest.approx(1e-12, rel=1e-12)
    assert turned[0, 1] == pytest.approx(-1e-12, rel=1e-12)
