"""Variance shares: exact, sampled, and Sobol's."""

import dataclasses

import pytest

import warpspace
from warpspace.exceptions import OptionError
from warpspace.machine.tolerances import Tolerance, ToleranceSet

SCENE = warpspace.load_scene("dvf5000_proposed")


@pytest.mark.parametrize("loop", ["tool", "workpiece", "relative"])
def test_exact_shares_add_up_and_sampling_repeats_them(loop: str) -> None:
    found = warpspace.contributions(SCENE, loop=loop)
    assert sum(row.share for row in found.rows) == pytest.approx(1.0)
    assert [row.share for row in found.rows] == sorted(
        (row.share for row in found.rows), reverse=True
    )
    for row in found.rows:
        assert row.sampled_share == pytest.approx(row.share, abs=0.012)


def test_translations_of_the_general_tolerance_have_equal_known_variances() -> None:
    found = warpspace.contributions(warpspace.load_scene("dvf5000_general"))
    straight = [row.variance_um2 for row in found.rows if row.unit == "µm"]
    assert straight == pytest.approx([100.0 / 3.0] * 9)


def test_sobol_ranks_the_largest_first_and_totals_exceed_first_order() -> None:
    found = warpspace.contributions(SCENE, sobol=256)
    totals = {row.key: row.sobol_total for row in found.rows}
    assert max(totals, key=lambda key: totals[key]) == found.rows[0].key == "EBZ"
    assert sum(totals.values()) > 1.0 > sum(row.sobol_first for row in found.rows)
    for row in found.rows:
        assert row.sobol_total >= row.sobol_first - 0.1


def test_a_single_parameter_has_all_of_it() -> None:
    only = ToleranceSet(
        {"translation": 0, "rotation": 0, "squareness": 0}, {"EXX": Tolerance(0, 3)}
    )
    found = warpspace.contributions(dataclasses.replace(SCENE, tolerances=only), sobol=64)
    assert found.rows[0].key == "EXX"
    assert found.rows[0].share == 1.0
    assert found.variance_um2 == pytest.approx(3.0)
    assert found.rows[0].sobol_total == pytest.approx(1.0, abs=0.3)
    assert found.rows[1].sobol_total is None


def test_no_width_and_bad_sobol() -> None:
    none = ToleranceSet({"translation": 0, "rotation": 0, "squareness": 0})
    with pytest.raises(OptionError, match="no parameter of this loop"):
        warpspace.contributions(dataclasses.replace(SCENE, tolerances=none))
    for base in (1, 3, 2**20):
        with pytest.raises(OptionError, match="power of two"):
            warpspace.contributions(SCENE, sobol=base)
