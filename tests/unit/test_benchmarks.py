"""What the benchmarks judge by: the growth of memory, and medians of complete runs."""

import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.parametrize("slope", [-20.0, 0.0, 20.0])
def test_the_interval_of_a_growth_holds_it_and_is_not_moved_by_single_readings(slope, monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import soak_app

    times_s = np.arange(720.0, 3600.0, 5.0)
    held = 0
    for seed in range(40):
        chance = np.random.default_rng(seed)
        sizes = 400.0 + slope * times_s / 3600.0 + chance.normal(0.0, 10.0, times_s.size)
        sizes[chance.random(times_s.size) < 0.05] += 300.0  # a tab that is being built
        _, found, error = soak_app.growth(list(zip(times_s, sizes, strict=True)))
        assert error < 10.0
        held += abs(found - slope) <= error
    assert held >= 34  # of 40; 2σ is 38
    # an hour must tell its growth, and a minute only what is plain
    assert soak_app.is_flat(9.0, 9.0, 1.0)
    assert not soak_app.is_flat(11.0, 3.0, 1.0)
    assert not soak_app.is_flat(0.0, 11.0, 1.0)  # cannot tell
    assert soak_app.is_flat(300.0, 200.0, 1.0 / 60.0)
    assert not soak_app.is_flat(900.0, 200.0, 1.0 / 60.0)
    sys.modules.pop("soak_app")


def test_each_figure_is_the_median_of_its_runs_and_the_ratio_that_of_the_medians(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    from table import Growth, Row, Section, median_section

    runs = [
        Section(
            "Start",
            "",
            [Row("command", value, "numpy", baseline, max_ratio=2.0)],
            [Growth("search", "knots", [2.0, 4.0], [value, 2.0 * value])],
        )
        for value, baseline in ((3.0, 1.0), (1.0, 2.0), (2.0, 9.0))
    ]
    section = median_section(runs)
    assert (section.rows[0].value, section.rows[0].baseline_value) == (2.0, 2.0)
    assert section.rows[0].is_met
    assert section.growth[0].costs == [2.0, 4.0]
    sys.modules.pop("table")
