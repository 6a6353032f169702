"""Curves from edited rows: read, checked, converted, sampled."""

import numpy as np
import pytest

from warpspace.app.state.curve_text import (
    convert_shape,
    kind_titles,
    parse_shape,
    sample_curve,
    shape_kind,
    spell_rows,
)
from warpspace.exceptions import OptionError
from warpspace.machine.errors import Constant, Harmonics, Poly, Ramp, Table

SPAN = (-275.0, 275.0)
EXAMPLES = [
    Constant(SPAN, 23.1),
    Ramp(SPAN, -43.7),
    Poly(SPAN, (0.5, 0.02, -1e-5)),
    Harmonics(SPAN, ((1.0, 3.0, 0.0), (2.0, 0.5, 90.0))),
    Table(SPAN, ((-275.0, 0.0), (0.0, 4.1), (275.0, -1.0))),
]


@pytest.mark.parametrize("function", EXAMPLES, ids=shape_kind)
def test_rows_read_back_to_the_function(function):
    assert parse_shape(shape_kind(function), spell_rows(function), SPAN) == function


@pytest.mark.parametrize(
    ("kind", "text", "function"),
    [
        ("constant", " 5,5 ", Constant(SPAN, 5.5)),
        ("ramp", "−3  # at the upper end", Ramp(SPAN, -3.0)),
        ("polynomial", "0; 0.02", Poly(SPAN, (0.0, 0.02))),
        ("polynomial", "0\n0.02\n", Poly(SPAN, (0.0, 0.02))),
        ("harmonics", "1 3", Harmonics(SPAN, ((1.0, 3.0, 0.0),))),
        ("table", "-275, 0\n275, 4.1", Table(SPAN, ((-275.0, 0.0), (275.0, 4.1)))),
        ("table", "-275\t0\n\n275\t4,1", Table(SPAN, ((-275.0, 0.0), (275.0, 4.1)))),
    ],
)
def test_spellings(kind, text, function):
    assert parse_shape(kind, text, SPAN) == function


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        ("constant", "", "no numbers"),
        ("constant", "1 2", "one number"),
        ("constant", "nan", "finite"),
        ("constant", "1e9", "at most"),
        ("ramp", "<script>alert(1)</script>", "no number"),
        ("polynomial", "0 1e9", "the curve reaches"),
        ("polynomial", "1 " * 17, "at most 16"),
        ("harmonics", "1", "row 1"),
        ("harmonics", "-1 3", "order"),
        ("harmonics", "1 3 0\n" * 65, "at most 64"),
        ("table", "0 1 2", "row 1"),
        ("table", "\n".join(f"{i} 0" for i in range(2001)), "at most 2000"),
        ("table", "0 inf", "finite"),
        ("spline", "0 1", "expected one of"),
        ("constant", "1" * 80_001, "at most 80,000"),
    ],
)
def test_refused_with_a_message(kind, text, message):
    with pytest.raises(OptionError, match=message):
        parse_shape(kind, text, SPAN)


@pytest.mark.parametrize("kind", kind_titles())
@pytest.mark.parametrize("function", [*EXAMPLES, None], ids=shape_kind)
def test_another_kind_starts_from_the_present_curve(function, kind):
    converted = convert_shape(function, kind, SPAN)
    assert shape_kind(converted) == kind
    if function is not None and kind in {"constant", "ramp", "harmonics"}:
        assert converted.amplitude == pytest.approx(function.amplitude, rel=1e-6)
    # what the editor would show is what it would read
    assert parse_shape(kind, spell_rows(converted), SPAN) is not None


def test_a_curve_is_sampled_along_the_travel_with_its_kinks():
    at, value = sample_curve(EXAMPLES[4], SPAN)
    assert at[0] == SPAN[0]
    assert at[-1] == SPAN[1]
    assert value[at == 0.0] == 4.1
    assert np.all(sample_curve(None, SPAN)[1] == 0.0)


def test_long_tables_are_thinned_out_for_editing():
    points = tuple((float(q), 0.1 * q) for q in np.linspace(-275, 275, 5501))
    rows = spell_rows(Table(SPAN, points)).splitlines()
    assert len(rows) == 2000
    assert rows[0].split() == ["-275", "-27.5"]
    assert rows[-1].split() == ["275", "27.5"]
