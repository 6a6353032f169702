"""ISO 230-2 by hand: five targets, five runs, two directions, every number computed on paper."""

import numpy as np
import pytest

from bench_scenes import scene_with
from warpspace.bench.base import BenchRun
from warpspace.bench.data import parse_table
from warpspace.bench.kinds.positioning import Positioning

# Deviations in µm. Runs differ by −2, −1, 0, +1, +2 times a step from the mean of their target:
# s = step · sqrt(10/4) = step · 1.5811388.
TARGETS = (0.0, 50.0, 100.0, 150.0, 200.0)
FORWARD = (0.0, 1.0, 3.0, 2.0, 4.0)
BACKWARD = (-2.0, -2.0, -1.0, -1.0, 1.0)
STEP_FORWARD = (0.2, 0.4, 0.2, 0.2, 0.6)
STEP_BACKWARD = (0.4, 0.2, 0.2, 0.8, 0.2)
S = 1.5811388300841898


def csv_text(directions="+-"):
    rows = ["run,direction,target_mm,deviation_um"]
    for run in range(5):
        for sign in directions:
            mean, step = (FORWARD, STEP_FORWARD) if sign == "+" else (BACKWARD, STEP_BACKWARD)
            rows += [
                f"{run + 1},{sign},{target},{mean[i] + (run - 2) * step[i]:.10g}"
                for i, target in enumerate(TARGETS)
            ]
    return "\n".join(rows) + "\n"


TEST = Positioning(axis="X")


def evaluated(text):
    scene = scene_with()
    table = parse_table(text, TEST.data_columns(scene), "data.csv")
    plan, readings = TEST.plan_data(scene, table)
    return BenchRun("measured", plan, readings, TEST.evaluate(plan, readings))


def test_every_number_of_the_standard():
    found = evaluated(csv_text())
    assert found.values == pytest.approx({
        # B_i = x̄↑ − x̄↓ = 2, 3, 4, 3, 3
        "B_um": 4.0, "B_mean_um": 3.0,
        # M: x̄_i = −1, −0.5, 1, 0.5, 2.5
        "M_um": 3.5,
        # E↑ = 4 − 0, E↓ = 1 − (−2), E = 4 − (−2)
        "E_forward_um": 4.0, "E_backward_um": 3.0, "E_um": 6.0,
        # R↑ = 4 s at the target with the largest step
        "R_forward_um": 4.0 * 0.6 * S, "R_backward_um": 4.0 * 0.8 * S,
        # R_i = 2s↑ + 2s↓ + |B_i| : 2 + 1.2S, 3 + 1.2S, 4 + 0.8S, 3 + 2S, 3 + 1.6S → 3 + 2S = 6.162
        "R_um": 3.0 + 2.0 * S,
        # A↑: largest x̄ + 2s = 4 + 1.2S, least x̄ − 2s = −0.4S (target 0; 1 − 0.8S = −0.26)
        "A_forward_um": 4.0 + 1.2 * S + 0.4 * S,
        # A↓: 1 + 0.4S; −2 − 0.8S at the first target (−1 − 1.6S = −3.53 at the fourth is lower)
        "A_backward_um": 1.0 + 0.4 * S + 1.0 + 1.6 * S, "A_um": 4.0 + 1.2 * S + 1.0 + 1.6 * S,
    })  # fmt: skip
    row = found.outcome.details["targets"][2]
    assert row["target_mm"] == 100.0
    assert row["reversal_um"] == pytest.approx(4.0)
    assert row["s_forward_um"] == pytest.approx(0.2 * S)


def test_one_direction_gives_the_one_directional_numbers_only():
    assert {*evaluated(csv_text("+")).values} == {"A_forward_um", "E_forward_um", "R_forward_um"}


def test_bands_of_the_figure_are_two_standard_deviations_wide():
    (chart,) = TEST.charts([evaluated(csv_text())])
    forward = chart.bands[0]
    np.testing.assert_allclose(forward.high - forward.low, 4.0 * S * np.array(STEP_FORWARD))
