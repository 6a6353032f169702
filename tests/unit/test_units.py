"""Formatting of numbers."""

import pytest

from warpspace.units import spell_change, spell_fixed


@pytest.mark.parametrize(
    ("value", "text", "change"),
    [
        (51.72, "51.7", "+51.7"),
        (9.96, "10.0", "+10.0"),
        (-3.25e3, "−3250.0", "−3250.0"),
        (0.04, "0.0", "0.0"),
        (-0.04, "0.0", "0.0"),
    ],
)
def test_results_have_one_decimal_and_zero_has_no_sign(value, text, change):
    assert (spell_fixed(value), spell_change(value)) == (text, change)
