"""Numbers as figures spell them."""

import pytest

from warpspace.picture.words import spell, spell_factor, spell_short, spell_vector


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (51.724, "51.7"),
        (-43.7, "−43.7"),
        (1234.5, "1234"),
        (0.004123, "0.00412"),
        (9.996, "10.0"),
        (1e-9, "1.00e−09"),
        (123456789.0, "1.23e+08"),
    ],
)
def test_spell(value: float, text: str) -> None:
    assert spell(value) == text


def test_points_factors_and_short_numbers() -> None:
    assert spell_vector((275.0, -225.0, -51.0)) == "(275, −225, −51)"
    assert spell_vector((0.04, -0.04, 9.96)) == "(0, 0, 10)"
    assert spell_factor(1000.0) == "×1000"
    assert spell_factor(1.0) == "×1, true scale"
    assert spell_short(-2.5) == "−2.5"
