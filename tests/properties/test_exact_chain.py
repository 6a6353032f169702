"""The exact chain: zero errors give zero, and the first order leaves out squares and no more."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chains import MAX_LINEAR_MM, MAX_OFFSET_MM, models, positions
from warpspace.field.evaluate import View, evaluate_exact, evaluate_first_order
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.deviation import exact_error
from warpspace.kinematics.firstorder import jacobian
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Constant, ErrorSet

REACH_MM = 8.0 * (MAX_OFFSET_MM + MAX_LINEAR_MM)
SPAN = (-1.0, 1.0)


@settings(max_examples=60)
@given(data=st.data())
def test_zero_errors_give_exactly_zero(data: st.DataObject) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model, (3,)))
    for value in (None, 0.0):
        given_keys = model.machine.allowed_keys if value is not None else ()
        errors = ErrorSet({key: Constant(SPAN, 0.0) for key in given_keys})
        view = View(loop)
        for solve in (evaluate_exact, evaluate_first_order):
            field = solve(model, errors, coordinates, view)
            np.testing.assert_allclose(field.error_um, 0.0, rtol=0, atol=1e-8)
            np.testing.assert_allclose(field.orientation_urad, 0.0, rtol=0, atol=1e-8)


@settings(max_examples=60)
@given(data=st.data())
def test_exact_minus_first_order_shrinks_with_the_square_of_the_errors(
    data: st.DataObject,
) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model))
    keys = model.machine.allowed_keys
    amplitudes = np.array(
        data.draw(st.lists(st.integers(-1000, 1000), min_size=len(keys), max_size=len(keys))),
        dtype=float,
    )
    point = nominal_point(model, loop, coordinates)
    gain, tilt = jacobian(model, loop, keys, coordinates, point)

    def left_out(factor: float) -> tuple[np.ndarray, np.ndarray]:
        values = {key: np.asarray(factor * amplitudes[i]) for i, key in enumerate(keys)}
        error, orientation = exact_error(model, loop, coordinates, values, point)
        first = factor * amplitudes
        return error - first @ gain, orientation - first @ tilt

    turned = float(np.abs(amplitudes).sum()) * 1e-6
    (whole, whole_tilt), (half, half_tilt) = left_out(1.0), left_out(0.5)
    # |second order| ≤ ε²·L, and what is neither first nor second order ≤ ε³·L.
    assert np.linalg.norm(whole) <= turned**2 * REACH_MM * 1e3 + 1e-6
    assert np.linalg.norm(whole - 4.0 * half) <= turned**3 * REACH_MM * 1e3 + 1e-6
    assert np.linalg.norm(whole_tilt) <= turned**2 * 1e6 + 1e-6
    assert np.linalg.norm(whole_tilt - 4.0 * half_tilt) <= turned**3 * 1e6 + 1e-6


@settings(max_examples=40)
@given(data=st.data())
def test_exact_batch_gives_what_a_loop_over_its_points_gives(data: st.DataObject) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model, (2, 2)))
    errors = ErrorSet({key: Constant(SPAN, 37.0) for key in model.machine.allowed_keys})
    frame = data.draw(st.sampled_from(("machine", "workpiece")))
    view = View(loop, frame)
    field = evaluate_exact(model, errors, coordinates, view)
    assert field.error_um.shape == (2, 2, 3)
    for index in np.ndindex(2, 2):
        one = {axis: values[index] for axis, values in coordinates.items()}
        single = evaluate_exact(model, errors, one, view)
        np.testing.assert_allclose(field.error_um[index], single.error_um, atol=1e-8)
        np.testing.assert_allclose(
            field.orientation_urad[index], single.orientation_urad, atol=1e-8
        )


@settings(max_examples=40)
@given(data=st.data())
def test_frame_of_the_result_turns_vectors_and_keeps_their_lengths(data: st.DataObject) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates = data.draw(positions(model, (2,)))
    errors = ErrorSet({key: Constant(SPAN, 20.0) for key in model.machine.allowed_keys})
    rotation = branch_pose(model, "workpiece", coordinates)[..., :3, :3]
    for solve in (evaluate_exact, evaluate_first_order):
        in_machine = solve(model, errors, coordinates, View(loop, "machine"))
        on_table = solve(model, errors, coordinates, View(loop, "workpiece"))
        back = transforms.rotate(rotation, on_table.error_um)
        np.testing.assert_allclose(back, in_machine.error_um, atol=1e-8)
        np.testing.assert_allclose(on_table.norm_um, in_machine.norm_um, atol=1e-8)
