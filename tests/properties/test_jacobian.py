"""The one Jacobian is the derivative of the exact chain, for any chain and any parameter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chains import central_differences, models, positions, vectors
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.conventions.registry import convention_names
from warpspace.kinematics.firstorder import columns, jacobian
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.parameters import parameter

TOLERANCE = 1e-6
"""Gains reach about 10 µm/µrad; the cubic term of a 50 µrad step is 1e-9 of that."""


@pytest.mark.parametrize("convention", convention_names())
@pytest.mark.parametrize("loop", Loop)
@settings(max_examples=40)
@given(data=st.data())
def test_jacobian_is_the_central_difference_of_the_exact_chain(
    loop: Loop, convention: str, data: st.DataObject
) -> None:
    model = data.draw(models(convention))
    coordinates = data.draw(positions(model))
    point = nominal_point(model, loop, coordinates)
    keys = model.machine.allowed_keys
    position, orientation = jacobian(model, loop, keys, coordinates, point)
    expected_position, expected_orientation = central_differences(
        model, loop, keys, coordinates, point
    )
    np.testing.assert_allclose(position, expected_position, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(orientation, expected_orientation, rtol=0, atol=TOLERANCE)


@settings(max_examples=40)
@given(data=st.data())
def test_jacobian_holds_at_any_point_and_not_just_at_the_functional_one(
    data: st.DataObject,
) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates, point = data.draw(positions(model)), np.array(data.draw(vectors()))
    keys = model.machine.allowed_keys
    found = jacobian(model, loop, keys, coordinates, point)
    expected = central_differences(model, loop, keys, coordinates, point)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=TOLERANCE)


@settings(max_examples=40)
@given(data=st.data())
def test_batch_gives_what_a_loop_over_its_points_gives(data: st.DataObject) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    batch = data.draw(positions(model, (2, 3)))
    keys = model.machine.allowed_keys
    point = nominal_point(model, loop, batch)
    position, orientation = jacobian(model, loop, keys, batch, point)
    assert position.shape == orientation.shape == (len(keys), 2, 3, 3)
    for index in np.ndindex(2, 3):
        one = {axis: values[index] for axis, values in batch.items()}
        single = jacobian(model, loop, keys, one, nominal_point(model, loop, one))
        np.testing.assert_allclose(position[(slice(None), *index)], single[0], atol=1e-12)
        np.testing.assert_allclose(orientation[(slice(None), *index)], single[1], atol=1e-12)


@settings(max_examples=60)
@given(data=st.data())
def test_every_parameter_of_every_axis_moves_some_point_of_its_loop_and_of_no_other(
    data: st.DataObject,
) -> None:
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


@settings(max_examples=40)
@given(data=st.data())
def test_relative_loop_is_tool_minus_workpiece(data: st.DataObject) -> None:
    model: Model = data.draw(models())
    coordinates = data.draw(positions(model))
    point, keys = np.array(data.draw(vectors())), model.machine.allowed_keys
    by_loop = {loop: jacobian(model, loop, keys, coordinates, point) for loop in Loop}
    for part in (0, 1):
        np.testing.assert_array_equal(
            by_loop[Loop.RELATIVE][part], by_loop[Loop.TOOL][part] - by_loop[Loop.WORKPIECE][part]
        )


@settings(max_examples=40)
@given(data=st.data())
def test_lever_explains_the_gain_of_every_rotation(data: st.DataObject) -> None:
    model, loop = data.draw(models()), data.draw(st.sampled_from(Loop))
    coordinates, point = data.draw(positions(model)), np.array(data.draw(vectors()))
    found = columns(model, loop, model.machine.allowed_keys, coordinates, point)
    for key, column in found.items():
        rotation = parameter(key).is_rotation
        gain = np.cross(column.direction, column.lever_mm) / 1e3 if rotation else column.direction
        np.testing.assert_allclose(column.position, column.sign * gain, rtol=0, atol=1e-12)
