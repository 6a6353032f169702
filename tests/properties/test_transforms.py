"""Kernels on homogeneous transformations: identities that hold for every input."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from warpspace.kinematics import transforms

ANGLES = st.floats(-10.0, 10.0)
SHAPES = hnp.array_shapes(min_dims=0, max_dims=2, max_side=3)


@st.composite
def vector_batches(draw: st.DrawFn, limit: float = 5.0) -> np.ndarray:
    """Batches of vectors, [..., 3]."""
    shape = (*draw(SHAPES), 3)
    return draw(hnp.arrays(float, shape, elements=st.floats(-limit, limit)))


@given(turn=vector_batches(), shift=st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_inverse_undoes_a_rigid_motion(turn: np.ndarray, shift: tuple[float, ...]) -> None:
    pose = transforms.rigid(transforms.vector_rotation(turn), np.array(shift))
    product = pose @ transforms.inverse(pose)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(4), pose.shape), atol=1e-10)


@given(turn=vector_batches())
def test_rotations_are_orthonormal_and_right_handed(turn: np.ndarray) -> None:
    rotation = transforms.vector_rotation(turn)
    product = rotation @ np.swapaxes(rotation, -1, -2)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), rotation.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0, atol=1e-13)


@given(turn=vector_batches())
def test_turning_forth_and_back_is_the_identity(turn: np.ndarray) -> None:
    product = transforms.vector_rotation(turn) @ transforms.vector_rotation(-turn)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-13)


@given(index=st.integers(0, 2), angle=hnp.arrays(float, SHAPES, elements=ANGLES))
def test_axis_rotation_is_the_rotation_about_that_unit_vector(
    index: int, angle: np.ndarray
) -> None:
    about = angle[..., None] * np.eye(3)[index]
    np.testing.assert_allclose(
        transforms.axis_rotation(index, angle), transforms.vector_rotation(about), atol=1e-13
    )


@given(exponent=st.integers(-14, -2), direction=vector_batches(1.0))
def test_small_rotations_are_one_plus_skew_to_second_order(
    exponent: int, direction: np.ndarray
) -> None:
    turn = 10.0**exponent * direction
    cross = transforms.skew(turn)
    second_order = np.eye(3) + cross + cross @ cross / 2.0
    angle = np.linalg.norm(turn, axis=-1).max(initial=0.0)
    difference = np.abs(transforms.vector_rotation(turn) - second_order).max()
    assert difference <= angle**3 + 1e-15


@given(left=vector_batches(), right=st.tuples(*[st.floats(-5, 5)] * 3))
def test_skew_is_the_cross_product(left: np.ndarray, right: tuple[float, ...]) -> None:
    product = transforms.rotate(transforms.skew(left), np.array(right))
    np.testing.assert_allclose(product, np.cross(left, np.array(right)), atol=1e-12)


@given(first=vector_batches(1e3), second=st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_translations_add_up(first: np.ndarray, second: tuple[float, ...]) -> None:
    moved = transforms.apply(transforms.translation(first), np.array(second))
    np.testing.assert_allclose(moved, first + np.array(second), atol=1e-9)
    np.testing.assert_array_equal(
        transforms.translation(np.zeros_like(first)),
        np.broadcast_to(np.eye(4), (*first.shape[:-1], 4, 4)),
    )


@given(turn=vector_batches(), shift=st.tuples(*[st.floats(-10, 10)] * 3))
def test_batch_gives_what_a_loop_gives(turn: np.ndarray, shift: tuple[float, ...]) -> None:
    point = np.array(shift)
    pose = transforms.rigid(transforms.vector_rotation(turn), point)
    moved, inverse = transforms.apply(pose, point), transforms.inverse(pose)
    for index in np.ndindex(turn.shape[:-1]):
        single = transforms.rigid(transforms.vector_rotation(turn[index]), point)
        np.testing.assert_allclose(pose[index], single, atol=1e-14)
        np.testing.assert_allclose(moved[index], transforms.apply(single, point), atol=1e-13)
        np.testing.assert_allclose(inverse[index], transforms.inverse(single), atol=1e-13)
