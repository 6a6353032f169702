"""Any kind of curve can be entered for an error that is zero, and grows in its kind."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.documents.scene_file import open_text, state_to_toml
from warpspace.app.state.app_state import start_state
from warpspace.app.state.curve_text import convert_shape, parse_shape, shape_kind, spell_rows
from warpspace.app.state.edits import axis_span, curve_of, with_curve, with_typed_amplitude
from warpspace.machine.curves.registry import curve_kinds
from warpspace.machine.errors import (
    Constant,
    Directional,
    ErrorFunction,
    Harmonics,
    Poly,
    Ramp,
    Table,
    TwoArguments,
)
from warpspace.machine.parameters import parameter

ZERO = start_state(load_scene("dvf5000_nominal"), nodes=3)
SPAN = (-275.0, 275.0)
ENTERED = {
    "constant": "3.5",
    "ramp": "-4",
    "polynomial": "0.5 0.02 -1e-5",
    "harmonics": "1 3 0\n2 0.5 90",
    "table": "-100 0\n0 4.1\n100 -1",
}
"""Numbers of each kind that are not zero."""


def every_parameter():
    """All 41 parameters of the machine."""
    assert len(ZERO.amplitudes) == 41
    return list(ZERO.amplitudes)


@pytest.mark.parametrize("kind", list(ENTERED))
@pytest.mark.parametrize("key", every_parameter())
def test_every_kind_can_be_entered_for_every_error_that_is_zero(key: str, kind: str) -> None:
    assert ZERO.amplitudes[key] == 0.0
    span = axis_span(ZERO, key)
    # the user chooses the kind, and then edits the numbers that it starts with
    chosen = with_curve(ZERO, key, convert_shape(curve_of(ZERO, key), kind, span))
    if parameter(key).is_constant and kind != "constant":
        assert chosen.notes == (f"{key} is constant along its axis; expected one number",)
        return
    assert shape_kind(curve_of(chosen, key)) == kind
    assert chosen.amplitudes[key] == 0.0
    assert parse_shape(kind, spell_rows(curve_of(chosen, key)), span) == curve_of(chosen, key)
    wanted = parse_shape(kind, ENTERED[kind], span)
    entered = with_curve(chosen, key, wanted)
    assert entered.notes == ()
    at = np.linspace(*span, 101)
    np.testing.assert_allclose(curve_of(entered, key).evaluate(at), wanted.evaluate(at), rtol=1e-12)
    assert entered.amplitudes[key] == pytest.approx(wanted.amplitude)
    # in place of editing them, the user moves the slider
    moved = with_typed_amplitude(chosen, key, 12.5)
    assert shape_kind(curve_of(moved, key)) == kind
    assert curve_of(moved, key).amplitude == pytest.approx(12.5)
    back, _ = open_text(state_to_toml(moved), "x", "x.toml")
    np.testing.assert_allclose(
        curve_of(back, key).evaluate(at), curve_of(moved, key).evaluate(at), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize(
    ("zero", "grown"),
    [
        (Constant(SPAN, 0.0), Constant(SPAN, 11.0)),
        (Ramp(SPAN, 0.0), Ramp(SPAN, 11.0)),
        (Poly(SPAN, (0.0,)), Poly(SPAN, (11.0,))),
        (Poly(SPAN, (0.0, 0.0, 0.0)), Poly(SPAN, (5.5, 0.02, 0.0))),
        (Table(SPAN, ((7.0, 0.0),)), Table(SPAN, ((7.0, 11.0),))),
        (
            Table(SPAN, ((-100.0, 0.0), (0.0, 0.0), (100.0, 0.0))),
            Table(SPAN, ((-100.0, 0.0), (0.0, 5.5), (100.0, 11.0))),
        ),
        (
            Harmonics((0.0, 360.0), ((2.0, 0.0, 0.0), (3.0, 0.0, 45.0))),
            Harmonics((0.0, 360.0), ((2.0, 11.0, 0.0), (3.0, 0.0, 45.0))),
        ),
        (
            TwoArguments(SPAN, ("X", "Z"), ((-1.0, 0.0, 3.0), (0.0, 5.0)), ((0.0, 0.0),) * 3),
            TwoArguments(
                SPAN,
                ("X", "Z"),
                ((-1.0, 0.0, 3.0), (0.0, 5.0)),
                ((0.0, 0.0), (2.75, 2.75), (11.0, 11.0)),
            ),
        ),
        (
            Directional(SPAN, Constant(SPAN, 0.0), Ramp(SPAN, 0.0)),
            Directional(SPAN, Constant(SPAN, 11.0), Ramp(SPAN, 11.0)),
        ),
        # a term that is zero by itself cannot carry the amplitude
        (
            Harmonics((0.0, 360.0), ((0.0, 0.0, 90.0),)),
            Harmonics((0.0, 360.0), ((1.0, 11.0, 0.0),)),
        ),
    ],
)
def test_a_zero_curve_grows_in_its_kind(zero: ErrorFunction, grown: ErrorFunction) -> None:
    moved = zero.with_amplitude(11.0)
    assert type(moved) is type(grown)
    at = np.linspace(*zero.span, 77)
    np.testing.assert_allclose(moved.evaluate(at), grown.evaluate(at), rtol=1e-12, atol=1e-12)
    assert moved.amplitude == pytest.approx(11.0)
    np.testing.assert_allclose(11.0 * zero.shape(at), grown.evaluate(at), rtol=1e-12, atol=1e-12)
    assert zero.with_amplitude(0.0) == zero


@pytest.mark.parametrize("text", list(ENTERED.values()))
def test_a_curve_that_is_taken_to_zero_keeps_its_shape_while_it_is_open(text: str) -> None:
    kind = next(kind for kind in ENTERED if ENTERED[kind] == text)
    span = axis_span(ZERO, "EXX")
    entered = with_curve(ZERO, "EXX", parse_shape(kind, text, span))
    amplitude = entered.amplitudes["EXX"]
    zeroed = entered.with_amplitude("EXX", 0.0)
    assert shape_kind(curve_of(zeroed, "EXX")) == kind
    assert "-0" not in spell_rows(curve_of(zeroed, "EXX")).split()
    assert curve_of(zeroed.with_amplitude("EXX", amplitude), "EXX") == curve_of(entered, "EXX")


def test_all_kinds_are_tried() -> None:
    assert {kind.title for kind in curve_kinds() if kind.edited_as_rows} == {*ENTERED}
