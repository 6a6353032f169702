"""Functions that an error follows along its axis."""

import numpy as np
import pytest

from warpspace.exceptions import UnknownNameError
from warpspace.machine.errors import (
    Constant,
    Directional,
    ErrorFunction,
    ErrorSet,
    Harmonics,
    Poly,
    Ramp,
    Table,
    TwoArguments,
)

SPAN = (-200.0, 200.0)
TURN = (0.0, 360.0)
AT = np.array([-200.0, -100.0, 0.0, 50.0, 200.0])
FUNCTIONS = [
    Constant(SPAN, 7.0),
    Ramp(SPAN, -8.0),
    Poly(SPAN, (1.0, 0.0, 0.0005)),
    Harmonics(TURN, ((1.0, 3.0, 0.0), (2.0, -4.0, 90.0))),
    Table(SPAN, ((-200.0, -20.0), (0.0, 4.0), (200.0, 12.0))),
    TwoArguments(
        SPAN, ("X", "Z"), ((-200.0, 0.0, 200.0), (0.0, 10.0)), ((1.0, 2.0), (3.0, -9.0), (4.0, 5.0))
    ),
    Directional(SPAN, Constant(SPAN, 3.0), Poly(SPAN, (1.0, 0.0, 0.0005))),
]


def test_constant_is_the_same_everywhere() -> None:
    assert Constant(SPAN, 7.0).evaluate(AT).tolist() == [7.0] * 5


def test_ramp_is_zero_at_the_lower_end_and_the_value_at_the_upper_one() -> None:
    assert Ramp(SPAN, 8.0).evaluate(AT).tolist() == [0.0, 2.0, 4.0, 5.0, 8.0]


def test_poly_is_the_sum_of_powers_of_the_position() -> None:
    assert Poly(SPAN, (1.0, 0.5, 0.01)).evaluate(np.array([0.0, 10.0])).tolist() == [1.0, 7.0]


def test_harmonics_are_cosines_with_their_phases_in_degrees() -> None:
    curve = Harmonics(TURN, ((1.0, 3.0, 0.0), (2.0, 4.0, 90.0)))
    found = curve.evaluate(np.array([0.0, 45.0, 90.0]))
    assert found == pytest.approx([3.0, 3.0 * np.sqrt(0.5) + 4.0, 0.0])


def test_table_is_linear_between_its_points_and_held_beyond_them() -> None:
    curve = Table(SPAN, ((-100.0, 1.0), (100.0, 3.0)))
    found = curve.evaluate(np.array([-500.0, -100.0, 0.0, 100.0, 500.0]))
    assert found.tolist() == [1.0, 1.0, 2.0, 3.0, 3.0]


def test_table_of_one_point_is_flat() -> None:
    assert Table(SPAN, ((5.0, 2.0),)).evaluate(AT).tolist() == [2.0] * 5


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_value_is_amplitude_times_shape(function: ErrorFunction) -> None:
    product = function.amplitude * function.shape(AT)
    np.testing.assert_allclose(product, function.evaluate(AT), rtol=1e-14)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_with_amplitude_keeps_the_curve_and_the_shape(function: ErrorFunction) -> None:
    changed = function.with_amplitude(-3.5)
    assert changed.amplitude == pytest.approx(-3.5)
    assert type(changed) is type(function)
    np.testing.assert_allclose(changed.shape(AT), function.shape(AT), rtol=1e-13)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_scaled_multiplies_every_value(function: ErrorFunction) -> None:
    scaled = function.scaled(-2.0)
    np.testing.assert_allclose(scaled.evaluate(AT), -2.0 * function.evaluate(AT), rtol=1e-14)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: type(f).__name__)
def test_values_keep_the_batch_shape(function: ErrorFunction) -> None:
    for shape in ((), (3,), (2, 1, 3), (0,)):
        assert function.evaluate(np.zeros(shape)).shape == shape
        assert function.shape(np.zeros(shape)).shape == shape


@pytest.mark.parametrize(
    ("function", "amplitude"),
    [
        (Poly(SPAN, (0.0, -0.5)), 100.0),
        (Poly((-100.0, 200.0), (0.0, -0.5)), -100.0),
        (Table(SPAN, ((0.0, -9.0), (1.0, 8.0))), -9.0),
        (Harmonics(TURN, ((3.0, 5.0, 0.0),)), 5.0),
    ],
)
def test_amplitude_is_the_largest_value_with_its_sign(
    function: ErrorFunction, amplitude: float
) -> None:
    assert function.amplitude == pytest.approx(amplitude)


@pytest.mark.parametrize("order", [180.0, 360.0, 720.0, 1000.0])
def test_amplitude_of_a_fast_harmonic_is_not_lost_between_samples(order: float) -> None:
    curve = Harmonics(TURN, ((order, 50.0, 90.0),))
    assert abs(curve.amplitude) == pytest.approx(50.0, rel=0.02)
    assert np.abs(curve.shape(np.linspace(0.0, 7.0, 999))).max() == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("value", [0.0, 5e-324, -1e-310])
def test_curve_of_nothing_keeps_finite_shapes(value: float) -> None:
    for function in (
        Constant(SPAN, value),
        Ramp(SPAN, value),
        Poly(SPAN, (value,)),
        Table(SPAN, ((0.0, value),)),
        Harmonics(TURN, ((1.0, value, 0.0),)),
    ):
        assert np.isfinite(function.shape(AT)).all()
        assert np.abs(function.amplitude * function.shape(AT)).max() <= 1e-300
        assert function.with_amplitude(4.0).amplitude == pytest.approx(4.0)


def test_ramp_of_zero_stays_a_ramp_when_its_slider_moves() -> None:
    assert Ramp(SPAN, 0.0).with_amplitude(4.0) == Ramp(SPAN, 4.0)


def test_poly_that_no_number_holds_is_infinite_and_warns_nobody() -> None:
    assert not np.isfinite(Poly(SPAN, (0.0, 1e308, 1e308)).amplitude)


@pytest.mark.parametrize(
    ("function", "spelling"),
    [
        (Constant(SPAN, 7.0), 7.0),
        (Ramp(SPAN, -8.0), {"ramp": -8.0}),
        (Poly(SPAN, (1.0, 2.0)), {"poly": [1.0, 2.0]}),
        (Harmonics(TURN, ((1.0, 3.0, 0.0),)), {"harmonics": [[1.0, 3.0, 0.0]]}),
        (Table(SPAN, ((0.0, 1.0), (2.0, 3.0))), {"table": [[0.0, 1.0], [2.0, 3.0]]}),
    ],
)
def test_function_spells_itself_as_a_scene_does(function: ErrorFunction, spelling: object) -> None:
    assert function.to_toml() == spelling


def test_set_gives_zero_for_what_is_absent() -> None:
    errors = ErrorSet({"EAX": Ramp(SPAN, 8.0)})
    assert list(errors) == ["EAX"]
    assert errors.evaluate("EBX", AT).tolist() == [0.0] * 5
    assert errors.amplitude("EBX") == 0.0
    assert errors.shape("EBX", AT).tolist() == [1.0] * 5
    assert errors.evaluate("EAX", AT)[-1] == errors.amplitude("EAX") == 8.0


def test_set_changes_one_amplitude_and_leaves_the_original_alone() -> None:
    errors = ErrorSet({"EAX": Ramp(SPAN, 8.0)})
    changed = errors.with_amplitude("EAX", 2.0, SPAN).with_amplitude("EXX", 5.0, SPAN)
    assert changed.functions == {"EAX": Ramp(SPAN, 2.0), "EXX": Constant(SPAN, 5.0)}
    assert errors.functions == {"EAX": Ramp(SPAN, 8.0)}


def test_set_refuses_what_is_no_parameter() -> None:
    with pytest.raises(UnknownNameError, match="'EAXX'"):
        ErrorSet({"EAXX": Constant(SPAN, 1.0)})
