"""Numbers as they are typed and pasted, and the errors that a panel lists."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.app.documents.view_settings import settings_line, with_settings
from warpspace.app.evaluation.effects import effects_alone
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.state import edits
from warpspace.app.state.app_state import start_state
from warpspace.app.state.curve_text import read_curve
from warpspace.app.state.listing import Listing, is_mostly_zero, listed_keys, used_keys
from warpspace.app.state.typed_numbers import read_typed, spell_typed
from warpspace.exceptions import OptionError
from warpspace.machine.errors import Harmonics, Table
from warpspace.machine.limits import MAX_ERROR

START = start_state(load_scene("dvf5000_first"), nodes=7)
SPAN = (-275.0, 275.0)
LIVE = LiveModel()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("87.3", 87.3),
        ("1e-3", 1e-3),
        ("1,5e2", 150.0),
        ("1.23456789", 1.23456789),
        ("−3,25", -3.25),
        (" +.5 ", 0.5),
        ("12 µrad", 12.0),
        ("12\u202fμrad", 12.0),
        ("5.", 5.0),
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


@pytest.mark.parametrize("value", [1.23456789, 87.3, -0.0, 1e-3, 1e5, 0.1 + 0.2])
def test_a_box_spells_what_it_reads_back(value):
    assert read_typed(spell_typed(value)) == pytest.approx(value, rel=1e-12, abs=0.0)
    assert spell_typed(-0.0) == "0"
    assert spell_typed(0.1 + 0.2) == "0.3"


def test_a_typed_number_widens_the_range_of_its_slider():
    assert START.spans["EAX"].high < 87.3
    typed = edits.with_typed_amplitude(START, "EAX", 87.3)
    assert typed.amplitudes["EAX"] == 87.3
    assert typed.spans["EAX"].low == -200.0
    assert typed.spans["EAX"].high == 200.0
    assert typed.notes == ()
    # within its range nothing but the number changes
    assert edits.with_typed_amplitude(START, "EAX", 1.23456789).spans == START.spans


def test_a_link_keeps_what_was_typed():
    typed = edits.with_typed_amplitude(START, "EAX", 87.3)
    assert with_settings(START, settings_line(typed)).amplitudes["EAX"] == 87.3


@pytest.mark.parametrize(("value", "kept"), [(1e9, MAX_ERROR), (-1e300, -MAX_ERROR)])
def test_what_no_model_holds_for_is_clamped_and_said(value, kept):
    typed = edits.with_typed_amplitude(START, "EAX", value)
    assert typed.amplitudes["EAX"] == kept
    assert len(typed.notes) == 1
    assert edits.with_typed_amplitude(START, "QQQ", 1.0).notes == (
        "QQQ: no parameter of this machine",
    )


@pytest.mark.parametrize("old", ["muted=EXX&soloed=EAX,EBX", "excluded=EXX&only=EAX,EBX"])
def test_links_with_the_old_words_are_read(old):
    found = with_settings(START, old).exclusions
    assert found.excluded == {"EXX"}
    assert found.only == {"EAX", "EBX"}


# --- pasted tables -------------------------------------------------------------------------------

WANTED = Table(SPAN, ((-275.0, -1.5), (0.0, 2.0), (275.0, 0.25)))


@pytest.mark.parametrize(
    "text",
    [
        "X [mm]\tEXX [µm]\n-275\t-1,5\n0\t2\n275\t0,25",
        "Position;Wert 1\r\n−275;−1,5\r\n0;2,0\r\n275;2,5e-1\r\n",
        '"X","EXX"\n-275.0,-1.5\n0.0,2.0\n275.0,0.25',
        "-275  -1.5\n\n0 2 # middle\n275 .25",
        "275\t0.25\n-275\t-1.5\n0\t2",
        "-275 -1.5\n0 1\n275 0.25\n0 3",
    ],
)
def test_a_table_is_pasted_from_a_spreadsheet(text):
    assert read_curve("table", text, SPAN).function == WANTED


def test_commas_alone_divide_where_nothing_else_can_be_meant():
    found = read_curve("table", "X,EXX\n-275,-1\n275,4", SPAN).function
    assert found == Table(SPAN, ((-275.0, -1.0), (275.0, 4.0)))


def test_what_was_put_in_order_is_said():
    entered = read_curve("table", "pos\tvalue\n5\t1\n-5\t2\n5\t4", SPAN)
    assert entered.function == Table(SPAN, ((-5.0, 2.0), (5.0, 2.5)))
    heading, ordered, averaged = entered.remarks
    assert "pos" in heading
    assert ordered == "Rows sorted by position."
    assert averaged == "Values of the same position averaged, at 5."
    assert read_curve("table", "-5 2\n5 4", SPAN).remarks == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1\n1 x", "row 2: '1 x' holds what is no number"),
        ("O.5 3\n1 2", "row 1"),
        ("a b\nc d", "row 2"),
        ("0\t1.234,5\n1\t2", "row 1"),
        ("0 1 2\n1 2 3", "row 1: 3 numbers"),
    ],
)
def test_a_bad_table_is_refused(text, message):
    with pytest.raises(OptionError, match=message):
        read_curve("table", text, SPAN)


# --- a table keeps the shape of what it is made of -----------------------------------------------


@pytest.mark.parametrize("order", [0.65, 2.0, 8.0, 30.0])
def test_harmonics_become_a_table_of_the_same_shape(order):
    span = (0.0, 360.0)
    wave = Harmonics(span, ((order, 4.0, 30.0), (1.0, 1.0, 0.0)))
    table = Table.from_curve(wave, span)
    at = np.linspace(*span, 5000)
    apart = np.abs(table.evaluate(at) - wave.evaluate(at)).max()
    assert apart <= 0.0025 * abs(wave.amplitude)


# --- what is listed ------------------------------------------------------------------------------


def test_most_errors_are_zero_and_can_be_hidden():
    assert len(START.amplitudes) == 41
    assert len(used_keys(START)) == 7
    assert is_mostly_zero(START)
    assert listed_keys(START, Listing(not_zero=True)) == used_keys(START)
    assert listed_keys(START, Listing()) == tuple(START.amplitudes)
    # one that was zeroed by hand stays, one that got a value comes
    tried = START.with_amplitude("EAX", 0.0).with_amplitude("EXX", 1.0)
    assert {*used_keys(tried)} == {*used_keys(START), "EXX"}
    assert not is_mostly_zero(start_state(load_scene("dvf5000_nominal"), nodes=3))


def test_a_search_finds_what_is_hidden():
    assert START.amplitudes["EXX"] == 0.0
    assert listed_keys(START, Listing("EXX", not_zero=True)) == ("EXX",)


def test_the_effect_of_an_error_is_the_rms_that_only_shows():
    picture = LIVE.evaluate(START)
    effects = effects_alone(picture, START)
    assert effects.keys() == START.amplitudes.keys()
    for key in (*used_keys(START), "EXX"):
        alone = LIVE.evaluate(edits.with_only(START, key, True))
        assert effects[key] == pytest.approx(alone.statistics.rms_um, rel=1e-9, abs=1e-12)
    ordered = listed_keys(START, Listing(not_zero=True, by_effect=True), effects)
    assert [effects[key] for key in ordered] == sorted(map(effects.get, ordered), reverse=True)
