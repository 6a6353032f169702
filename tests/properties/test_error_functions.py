"""Errors of two arguments and by direction of travel, in any chain: linear, exact, batched."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chains import models, positions, vectors
from warpspace.field.evaluate import View, build_basis, evaluate_exact, evaluate_first_order
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection, axis_parameters
from warpspace.machine.errors import Constant, Directional, ErrorSet, Ramp, TableCurve, TwoArguments

SPAN = (-500.0, 500.0)
STEP = 10.0
"""µm or µrad of a central difference."""
VALUES = st.integers(1, 40).map(float)


@st.composite
def functions(draw, model, axis):
    others = [name for name in model.machine.axes if name != axis]

    def one():
        if not others or draw(st.booleans()):
            return TableCurve(SPAN, ((-400.0, draw(VALUES)), (10.0, draw(VALUES)), (300.0, 3.0)))
        rows = tuple(tuple(draw(VALUES) for _ in range(3)) for _ in range(2))
        axes = (axis, draw(st.sampled_from(others)))
        return TwoArguments(SPAN, axes, ((-300.0, 200.0), (-150.0, 0.0, 100.0)), rows)

    if draw(st.booleans()):
        return Directional(SPAN, one(), draw(st.sampled_from((one(), Constant(SPAN, 5.0)))))
    return one()


@st.composite
def cases(draw):
    model = draw(models())
    axis = draw(st.sampled_from([*model.machine.axes]))
    keys = [row.key for row in axis_parameters(axis) if not row.is_constant]
    chosen = draw(st.lists(st.sampled_from(keys), min_size=1, max_size=3, unique=True))
    errors = {key: draw(functions(model, axis)) for key in chosen}
    return replace(model, direction=draw(st.sampled_from(TravelDirection))), ErrorSet(errors)


@given(data=st.data())
def test_the_response_is_the_derivative_of_the_exact_field_by_the_amplitude(data):
    model, errors = data.draw(cases())
    view = View(data.draw(st.sampled_from(Loop)))
    at = data.draw(positions(model, (4,)))
    point = np.array([data.draw(vectors()) for _ in range(4)])
    for key in errors:
        basis = build_basis(model, errors, (key,), at, view, point)
        moved = [
            evaluate_exact(
                model, ErrorSet({key: errors.functions[key].with_amplitude(a)}), at, view, point
            )
            for a in (STEP, -STEP)
        ]
        slope = (moved[0].error_um - moved[1].error_um) / (2.0 * STEP)
        np.testing.assert_allclose(basis.position[0], slope, rtol=0, atol=1e-6)


@pytest.mark.parametrize("curve", [Constant(SPAN, 3.0), Ramp(SPAN, 3.0)])
@settings(max_examples=10)
@given(data=st.data())
def test_errors_without_a_direction_have_no_reversal(curve, data):
    model = replace(data.draw(models()), direction=TravelDirection.DIFFERENCE)
    errors = ErrorSet(dict.fromkeys(model.machine.allowed_keys, curve))
    at = data.draw(positions(model))
    assert not evaluate_first_order(model, errors, at).error_um.any()
    np.testing.assert_allclose(evaluate_exact(model, errors, at).error_um, 0.0, atol=1e-9)
