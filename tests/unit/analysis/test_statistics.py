"""Statistics of a field, and verdicts on measured errors."""

import numpy as np
import pytest

import warpspace
from warpspace.analysis.statistics import Check, check_errors, shear, statistics, volume_statistics
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import build_grid
from warpspace.machine.errors import Constant, ErrorSet, ToleranceSet
from warpspace.scene.library import load_scene


def field_of(norms):
    nominal = np.stack([np.arange(norms.size), *np.zeros((2, norms.size))], -1)
    error = norms.reshape(-1, 1) * np.array([0.0, -1.0, 0.0])
    shape = (*norms.shape, 3)
    return ErrorField(nominal.reshape(shape), error.reshape(shape), np.zeros(shape))


def test_numbers_are_those_of_the_lengths():
    found = statistics(field_of(np.array([[3.0, 4.0], [0.0, 5.0]])))
    assert found.mean_um == 3.0
    assert found.rms_um == pytest.approx(np.sqrt(12.5))
    assert found.max_um == 5.0
    assert found.max_at_mm == (3.0, 0.0, 0.0)


@pytest.mark.parametrize("count", [1, 2, 3, 19, 20, 21, 9261])
def test_95th_percentile_is_that_of_numpy(count):
    norms = np.random.default_rng(count).gamma(2.0, 10.0, count)
    assert statistics(field_of(norms)).p95_um == pytest.approx(np.quantile(norms, 0.95), rel=1e-14)


def test_one_point_is_enough_and_none_is_not():
    assert statistics(field_of(np.array(7.0))).max_um == 7.0
    with pytest.raises(OptionError, match="expected at least one"):
        statistics(field_of(np.zeros(0)))


def test_statistics_of_the_volume_of_a_linear_error_are_those_of_its_integral():
    """|E| = 100·u over a bar 0 ≤ u ≤ 1: mean 50, RMS 100/√3 (at many nodes), P95 95."""
    scene = load_scene("dvf5000_nominal")
    grid = build_grid(scene.model, scene.workspace, (101, 2, 2))
    error = np.zeros((*grid.shape, 3))
    error[..., 1] = np.linspace(0.0, 100.0, 101)[:, None, None]
    found = volume_statistics(ErrorField(grid.nominal_mm, error, np.zeros_like(error)), grid)
    assert found.mean_um == pytest.approx(50.0)
    assert found.rms_um == pytest.approx(100.0 / np.sqrt(3.0), rel=1e-4)
    assert found.p95_um == pytest.approx(95.0, abs=0.02)
    assert found.max_at_axes["X"] == 275.0


@pytest.mark.parametrize(
    ("value", "passes"),
    [(-14.0, True), (-2.0, True), (-14.01, False), (-1.99, False), (-8.0, True)],
)
def test_limits_belong_to_the_tolerance_and_none_gives_no_verdict(value, passes):
    assert Check("EAX", value, -8.0, 6.0).passes is passes
    (check,) = check_errors(ErrorSet({"EAX": Constant((0, 1), 3.0)}), ToleranceSet())
    assert check.passes is None


def test_shear_of_pure_squareness_is_the_squareness():
    field = warpspace.evaluate(load_scene("teach_squareness"), grid=3)
    assert shear(field) == pytest.approx({"XY": 30.0, "XZ": 0.0, "YZ": 0.0}, abs=1e-9)
