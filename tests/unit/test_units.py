"""Factors between the units of the product."""

import pytest

from warpspace import units


def test_factors_to_and_fro_cancel() -> None:
    there_and_back = (units.UM_PER_MM * units.MM_PER_UM, units.URAD_PER_RAD * units.RAD_PER_URAD)
    assert there_and_back == pytest.approx((1.0, 1.0))


def test_a_millimetre_times_a_microradian_is_a_nanometre() -> None:
    product = units.UM_PER_MM * units.RAD_PER_URAD
    assert product == pytest.approx(1e-3)
    assert product == pytest.approx(units.UM_PER_MM_URAD)


def test_micro_is_the_one_sign_of_the_house_style() -> None:
    assert (units.MICROMETRE, units.MICRORADIAN) == ("\u00b5m", "\u00b5rad")
