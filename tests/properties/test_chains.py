"""Any chain: transforms, exact model, Jacobian, spelling."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from chains import (
    MAX_LINEAR_MM,
    MAX_OFFSET_MM,
    central_differences,
    chains,
    models,
    positions,
    vectors,
)
from warpspace.exceptions import ChainError
from warpspace.field.evaluate import View, evaluate_exact, evaluate_first_order
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, columns, jacobian, loop_error, nominal_point
from warpspace.kinematics.model import Loop, convention_names
from warpspace.machine.axes import parameter
from warpspace.machine.definition import parse_chain
from warpspace.machine.errors import Constant, ErrorSet

SHAPES = hnp.array_shapes(min_dims=0, max_dims=2, max_side=3)


def vector_batches(limit=5.0):
    """Return batches of vectors, [..., 3]."""
    shapes = SHAPES.map(lambda shape: (*shape, 3))
    return hnp.arrays(float, shapes, elements=st.floats(-limit, limit))


@given(turn=vector_batches(), shift=st.tuples(*[st.floats(-1e4, 1e4)] * 3))
def test_inverse_undoes_a_rigid_motion(turn, shift):
    pose = transforms.rigid(transforms.vector_rotation(turn), np.array(shift))
    product = pose @ transforms.inverse(pose)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(4), pose.shape), atol=1e-10)


@given(turn=vector_batches())
def test_a_rotation_vector_turns_as_that_of_scipy(turn):
    expected = Rotation.from_rotvec(turn.reshape(-1, 3)).as_matrix().reshape(*turn.shape, 3)
    np.testing.assert_allclose(transforms.vector_rotation(turn), expected, atol=1e-13)


@given(exponent=st.integers(-14, -2), direction=vector_batches(1.0))
def test_small_rotations_are_one_plus_skew_to_second_order(exponent, direction):
    turn = 10.0**exponent * direction
    cross = transforms.skew(turn)
    second_order = np.eye(3) + cross + cross @ cross / 2.0
    angle = np.linalg.norm(turn, axis=-1).max(initial=0.0)
    difference = np.abs(transforms.vector_rotation(turn) - second_order).max()
    assert difference <= angle**3 + 1e-15


REACH_MM = 8.0 * (MAX_OFFSET_MM + MAX_LINEAR_MM)
SPAN = (-1.0, 1.0)


@given(data=st.data())
def test_zero_errors_give_exactly_zero(data):
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model, (3,)))
    for keys in ((), model.machine.allowed_keys):
        errors = ErrorSet(dict.fromkeys(keys, Constant(SPAN, 0.0)))
        for solve in (evaluate_exact, evaluate_first_order):
            field = solve(model, errors, coordinates, View(loop))
            np.testing.assert_allclose(field.error_um, 0.0, rtol=0, atol=1e-8)
            np.testing.assert_allclose(field.orientation_urad, 0.0, rtol=0, atol=1e-8)


@given(data=st.data())
def test_exact_minus_first_order_shrinks_with_the_square_of_the_errors(data):
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model))
    keys = model.machine.allowed_keys
    numbers = st.integers(-1000, 1000).map(float)
    amplitudes = data.draw(hnp.arrays(float, len(keys), elements=numbers))
    point = nominal_point(model, loop, coordinates)
    gain, tilt = jacobian(model, loop, keys, coordinates, point)

    def left_out(factor):
        first = factor * amplitudes
        values = dict(zip(keys, first, strict=True))
        error, orientation = loop_error(model, loop, coordinates, values, point)
        return error - first @ gain, orientation - first @ tilt

    turned = float(np.abs(amplitudes).sum()) * 1e-6
    (whole, whole_tilt), (half, half_tilt) = left_out(1.0), left_out(0.5)
    # |second order| ≤ ε²·L, and what is neither first nor second order ≤ ε³·L.
    assert np.linalg.norm(whole) <= turned**2 * REACH_MM * 1e3 + 1e-6
    assert np.linalg.norm(whole - 4.0 * half) <= turned**3 * REACH_MM * 1e3 + 1e-6
    assert np.linalg.norm(whole_tilt) <= turned**2 * 1e6 + 1e-6
    assert np.linalg.norm(whole_tilt - 4.0 * half_tilt) <= turned**3 * 1e6 + 1e-6


@given(data=st.data())
def test_frame_of_the_result_turns_vectors_and_keeps_their_lengths(data):
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model, (2,)))
    errors = ErrorSet(dict.fromkeys(model.machine.allowed_keys, Constant(SPAN, 20.0)))
    rotation = branch_pose(model, "workpiece", coordinates)[..., :3, :3]
    for solve in (evaluate_exact, evaluate_first_order):
        in_machine = solve(model, errors, coordinates, View(loop, "machine"))
        on_table = solve(model, errors, coordinates, View(loop, "workpiece"))
        back = transforms.rotate(rotation, on_table.error_um)
        np.testing.assert_allclose(back, in_machine.error_um, atol=1e-8)
        np.testing.assert_allclose(on_table.norm_um, in_machine.norm_um, atol=1e-8)


TOLERANCE = 1e-6
"""Gains reach about 10 µm/µrad; the cubic term of a 50 µrad step is 1e-9 of that."""


@pytest.mark.parametrize("convention", convention_names())
@pytest.mark.parametrize("loop", Loop)
@given(data=st.data())
def test_jacobian_is_the_central_difference_of_the_exact_chain(loop, convention, data):
    model = data.draw(models(convention))
    coordinates = data.draw(positions(model))
    anywhere = data.draw(st.none() | vectors())
    point = nominal_point(model, loop, coordinates) if anywhere is None else np.array(anywhere)
    keys = model.machine.allowed_keys
    gains = jacobian(model, loop, keys, coordinates, point)
    expected = central_differences(model, loop, keys, coordinates, point)
    np.testing.assert_allclose(gains, expected, rtol=0, atol=TOLERANCE)


@given(data=st.data())
def test_every_parameter_of_every_axis_moves_some_point_of_its_loop_and_of_no_other(data):
    model = data.draw(models())
    coordinates = data.draw(positions(model))
    corners = 2000.0 * np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [1.0, 1.0, 1.0]])
    keys = model.machine.allowed_keys
    assert len(keys) == 12 * len(model.machine.axes)
    moved = {
        loop: np.abs(jacobian(model, loop, keys, coordinates, corners)[0]).max(axis=(1, 2))
        for loop in Loop
    }
    for index, key in enumerate(keys):
        on_tool = parameter(key).axis in model.machine.chain.tool
        own, other = (Loop.TOOL, Loop.WORKPIECE) if on_tool else (Loop.WORKPIECE, Loop.TOOL)
        assert moved[own][index] > 0.1, key
        assert moved[Loop.RELATIVE][index] > 0.1, key
        assert moved[other][index] == 0.0, key


@given(data=st.data())
def test_lever_explains_the_gain_of_every_rotation(data):
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates, point = data.draw(positions(model)), np.array(data.draw(vectors()))
    keys = model.machine.allowed_keys
    for key, column in columns(model, loop, keys, coordinates, point).items():
        rotation = parameter(key).is_rotation
        gain = np.cross(column.direction, column.lever_mm) / 1e3 if rotation else column.direction
        np.testing.assert_allclose(column.position, column.sign * gain, rtol=0, atol=1e-12)


FILLERS = st.text(alphabet=" ()[]{}'’′-_\t", max_size=3)


@given(chain=chains(), frame=st.sampled_from("Fb"), data=st.data())
def test_brackets_primes_blanks_and_hyphens_change_nothing(chain, frame, data):
    letters = str(chain).replace("F", frame)
    spelling = "".join(data.draw(FILLERS) + letter for letter in letters) + data.draw(FILLERS)
    assert parse_chain(spelling) == chain


@given(text=st.text(alphabet="wtFbXYZABCxyzDW T-'()", max_size=14))
def test_any_text_is_a_chain_that_reads_back_or_a_chain_error(text):
    with suppress(ChainError):
        chain = parse_chain(text)
        assert parse_chain(str(chain)) == chain
        assert 1 <= len(chain.axes) <= 6
        return
    with pytest.raises(ChainError, match="expected") as caught:
        parse_chain(text)
    assert repr(text) in str(caught.value)
