"""Numbers, curves and clicks as people enter them."""

from functools import partial

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.browser.actions import EditCurve
from warpspace.app.panels.error_list import edit_curve, kind_titles, read_curve, spell_rows
from warpspace.app.state import edits
from warpspace.app.state.app_state import Exclusions, start_state
from warpspace.app.state.store import StateStore
from warpspace.app.state.tree import toggled
from warpspace.app.state.typed_numbers import read_typed, spell_typed
from warpspace.exceptions import OptionError
from warpspace.machine.curves.registry import curve_kind
from warpspace.machine.errors import Constant, Harmonics, Poly, Ramp, TableCurve

START = start_state(load_scene("dvf5000_first"), nodes=7)
SPAN = (-275.0, 275.0)


def read(kind, text):
    return read_curve(curve_kind(kind), text, SPAN)[0]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("87.3", 87.3),
        ("1e-3", 1e-3),
        ("1.23456789", 1.23456789),
        ("−3,25", -3.25),
        (" +.5 ", 0.5),
        ("12 µrad", 12.0),
        ("12\u202fμrad", 12.0),
    ],
)
def test_numbers_are_read_as_people_type_them(text, value):
    assert read_typed(text, "µrad") == value


@pytest.mark.parametrize(
    "text",
    [
        *("", "-", "1e", "abc", "1.234,5", "1,234.5", "1_000", "nan", "inf", "1e999", "٣"),
        *("12 mm", "0x10", "1 2", "<b>", "1" * 41),
    ],
)
def test_what_is_no_number_is_none(text):
    assert read_typed(text, "µrad") is None


def test_a_box_spells_what_it_reads_back():
    for value in (1.23456789, 87.3, -0.0, 1e-3, 1e5, 0.1 + 0.2):
        assert read_typed(spell_typed(value)) == pytest.approx(value, rel=1e-12, abs=0.0)
    assert [*map(spell_typed, (-0.0, 0.1 + 0.2))] == ["0", "0.3"]


@pytest.mark.parametrize("order", [0.65, 2.0, 8.0, 30.0])
def test_harmonics_become_a_table_of_the_same_shape(order):
    span = (0.0, 360.0)
    wave = Harmonics(span, ((order, 4.0, 30.0), (1.0, 1.0, 0.0)))
    table = TableCurve.from_curve(wave, span)
    at = np.linspace(*span, 5000)
    apart = np.abs(table.evaluate(at) - wave.evaluate(at)).max()
    assert apart <= 0.0025 * abs(wave.amplitude)


PASTED = TableCurve(SPAN, ((-275.0, -1.5), (0.0, 2.0), (275.0, 0.25)))
EXAMPLES = [
    Constant(SPAN, 23.1),
    Ramp(SPAN, -43.7),
    Poly(SPAN, (0.5, 0.02, -1e-5)),
    Harmonics(SPAN, ((1.0, 3.0, 0.0), (2.0, 0.5, 90.0))),
    TableCurve(SPAN, ((-275.0, 0.0), (0.0, 4.1), (275.0, -1.0))),
]


@pytest.mark.parametrize("function", EXAMPLES, ids=lambda function: function.title)
def test_rows_read_back_to_the_function_and_an_error_taken_to_zero_keeps_it(function):
    assert read(function.title, spell_rows(function)) == function
    entered = edits.with_curve(START, "EXX", function)
    zeroed = entered.with_amplitude("EXX", 0.0)
    assert "-0" not in spell_rows(zeroed.curve("EXX")).split()
    again = zeroed.with_amplitude("EXX", entered.amplitudes["EXX"])
    assert again.curve("EXX") == entered.curve("EXX")


@pytest.mark.parametrize(
    ("kind", "text", "function"),
    [
        ("constant", " 5,5 ", Constant(SPAN, 5.5)),
        ("ramp", "−3  # at the upper end", Ramp(SPAN, -3.0)),
        ("polynomial", "0; 0.02", Poly(SPAN, (0.0, 0.02))),
        ("harmonics", "1 3", Harmonics(SPAN, ((1.0, 3.0, 0.0),))),
        ("table", "-275, 0\n275, 4.1", TableCurve(SPAN, ((-275.0, 0.0), (275.0, 4.1)))),
        ("table", "-275\t0\n\n275\t4,1", TableCurve(SPAN, ((-275.0, 0.0), (275.0, 4.1)))),
        ("table", "X [mm]\tEXX [µm]\n-275\t-1,5\n0\t2\n275\t0,25", PASTED),
        ("table", "Position;Wert 1\r\n−275;−1,5\r\n0;2,0\r\n275;2,5e-1\r\n", PASTED),
        ("table", '"X","EXX"\n-275.0,-1.5\n0.0,2.0\n275.0,0.25', PASTED),
        ("table", "-275  -1.5\n\n0 2 # middle\n275 .25", PASTED),
        ("table", "275\t0.25\n-275\t-1.5\n0\t2", PASTED),
        ("table", "-275 -1.5\n0 1\n275 0.25\n0 3", PASTED),
    ],
)
def test_curves_are_read_as_typed_and_as_pasted_from_a_spreadsheet(kind, text, function):
    assert read(kind, text) == function


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        ("constant", "", "no numbers"),
        ("constant", "1 2", "one number"),
        ("constant", "1e9", "at most"),
        ("ramp", "<script>alert(1)</script>", "invalid number"),
        ("polynomial", "0 1e9", "the curve reaches"),
        ("polynomial", "1 " * 17, "at most 16"),
        ("harmonics", "1", "row 1"),
        ("harmonics", "-1 3", "order"),
        ("harmonics", "1 3 0\n" * 65, "at most 64"),
        ("table", "0 1 2\n1 2 3", "row 1: 3 numbers"),
        ("table", "0 1\n1 x", "row 2: '1 x' contains an invalid number"),
        ("table", "a b\nc d", "row 2"),
        ("table", "0\t1.234,5\n1\t2", "row 1"),
        ("table", "\n".join(f"{i} 0" for i in range(2001)), "at most 2000"),
        ("table", "0 inf", "finite"),
        ("constant", "1" * 80_001, "at most 80,000"),
    ],
)
def test_refused_with_a_message(kind, text, message):
    with pytest.raises(OptionError, match=message):
        read(kind, text)


@pytest.mark.parametrize("kind", kind_titles())
@pytest.mark.parametrize("function", EXAMPLES, ids=lambda function: function.title)
def test_another_kind_starts_from_the_present_curve(function, kind):
    state, said = edit_curve(
        edits.with_curve(START, "EXX", function), EditCurve("EXX", "kind", kind)
    )
    converted = state.curve("EXX")
    assert (converted.title, said) == (kind, None)
    if kind in {"constant", "ramp", "harmonics"}:
        assert converted.amplitude == pytest.approx(function.amplitude, rel=1e-6)
    # what the editor would show is what it would read
    assert read(kind, spell_rows(converted)) is not None
    assert "expected one of" in edit_curve(state, EditCurve("EXX", "kind", "none such"))[1].message


def test_long_tables_are_thinned_out_for_editing():
    points = tuple((float(q), 0.1 * q) for q in np.linspace(-275, 275, 5501))
    rows = spell_rows(TableCurve(SPAN, points)).splitlines()
    ends = [rows[at].split() for at in (0, -1)]
    assert (len(rows), ends) == (2000, [["-275", "-27.5"], ["275", "27.5"]])


def test_each_switch_is_a_step_however_fast_they_follow_each_other():
    store, seen = StateStore(START), list[Exclusions]()
    for number, word in enumerate(("excluded EAX", "excluded EBX", "excluded EBX", "only EBX")):
        name, key = word.split()
        seen.append(store.state.exclusions)
        store.apply(partial(toggled, path=f"exclusions.{name}", word=key), at=0.01 * number)
    assert store.undoes == "only pitch of X"
    for exclusions in reversed(seen):
        store.undo()
        assert store.state.exclusions == exclusions
    assert store.state == START
