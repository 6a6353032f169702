"""Statistics of a field."""

import numpy as np
import pytest

from warpspace.analysis.statistics import statistics
from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField


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
