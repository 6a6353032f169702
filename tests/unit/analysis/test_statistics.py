"""Statistics of a field."""

import numpy as np
import pytest

from warpspace.analysis.statistics import statistics, volume_statistics
from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import build_grid
from warpspace.scene.library import load_scene
from warpspace.scene.pipeline import evaluate


def field_of(norms: np.ndarray) -> ErrorField:
    """A field along x whose errors point along y."""
    nominal = np.stack([np.arange(norms.size), *np.zeros((2, norms.size))], -1)
    error = norms.reshape(-1, 1) * np.array([0.0, -1.0, 0.0])
    shape = (*norms.shape, 3)
    return ErrorField(nominal.reshape(shape), error.reshape(shape), np.zeros(shape))


def test_numbers_are_those_of_the_lengths() -> None:
    found = statistics(field_of(np.array([[3.0, 4.0], [0.0, 5.0]])))
    assert found.mean_um == 3.0
    assert found.rms_um == pytest.approx(np.sqrt(12.5))
    assert found.max_um == 5.0
    assert found.max_at_mm == (3.0, 0.0, 0.0)


def test_95th_percentile_leaves_a_twentieth_above() -> None:
    assert statistics(field_of(np.arange(101.0))).p95_um == pytest.approx(95.0)


@pytest.mark.parametrize("count", [1, 2, 3, 19, 20, 21, 9261])
def test_95th_percentile_is_that_of_numpy(count: int) -> None:
    norms = np.random.default_rng(count).gamma(2.0, 10.0, count)
    assert statistics(field_of(norms)).p95_um == pytest.approx(np.quantile(norms, 0.95), rel=1e-14)


def test_one_point_is_enough_and_none_is_not() -> None:
    assert statistics(field_of(np.array(7.0))).max_um == 7.0
    with pytest.raises(OptionError, match="expected at least one"):
        statistics(field_of(np.zeros(0)))


@pytest.mark.parametrize("name", ["dvf5000_first", "dvf5000_second"])
def test_statistics_of_the_volume_hardly_depend_on_the_number_of_nodes(name: str) -> None:
    scene = load_scene(name)
    found = {}
    for nodes in (11, 31, 61):
        grid = build_grid(scene.model, scene.workspace, nodes)
        found[nodes] = volume_statistics(evaluate(scene, grid=nodes), grid)
    for nodes in (11, 31):
        assert found[nodes].mean_um == pytest.approx(found[61].mean_um, rel=0.005)
        assert found[nodes].rms_um == pytest.approx(found[61].rms_um, rel=0.005)
        assert found[nodes].p95_um == pytest.approx(found[61].p95_um, rel=0.005)


def test_statistics_of_the_volume_of_a_linear_error_are_those_of_its_integral() -> None:
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


def test_the_worst_node_is_named_in_both_coordinate_systems() -> None:
    """The corner of the first machine: axes X 275 Y −225 Z −480, in R z −51."""
    scene = load_scene("dvf5000_first")
    grid = build_grid(scene.model, scene.workspace, 5)
    field = evaluate(scene, grid=5)
    found = volume_statistics(field, grid)
    assert {axis: found.max_at_axes[axis] for axis in "XYZ"} == {"X": 275, "Y": -225, "Z": -480}
    assert found.max_at_mm[2] == pytest.approx(-51.0, abs=0.5)
    assert statistics(field, grid.coordinates).max_at_axes == found.max_at_axes
