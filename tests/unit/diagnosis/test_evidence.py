"""Evidence of causes against dense multivariate normal densities of scipy."""

from itertools import combinations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpspace.diagnosis import evidence
from warpspace.diagnosis.causes import Cause
from warpspace.diagnosis.evidence import FACTORS, WITHIN, Diagnostics, Normal, Observations

READINGS, FLAT = 12, 1e4


@pytest.fixture
def seen():
    rng = np.random.default_rng(5)
    sets = ("first.csv",) * 7 + ("second.csv",) * 5
    columns, set_up = rng.standard_normal((READINGS, 4)), rng.standard_normal((READINGS, 2))
    deviations = columns @ [0.3, -0.2, 4.0, 3.0] + set_up @ [5.0, -7.0] + rng.normal(size=READINGS)
    return Observations(columns, set_up, deviations, sets, np.full(READINGS, 8.0))


@pytest.fixture
def causes():
    """Two constants and a curve of two coefficients."""
    shapes = np.eye(1), np.eye(1), np.array([[1.0, 0.5], [-0.4, 0.8]])
    return [Cause(f"cause {n}", [n], np.ones(len(s)), s) for n, s in enumerate(shapes)]


def dense(seen, widths, noise=1.0):
    covariance = seen.columns @ np.diag(np.square(widths)) @ seen.columns.T
    covariance += FLAT**2 * seen.by_unknown @ seen.by_unknown.T
    covariance += np.diag(np.broadcast_to(noise, READINGS) ** 2)
    return multivariate_normal(np.zeros(READINGS), covariance).logpdf(seen.deviations)


def widths_of(diagnostics, members, factor):
    widths = np.full(4, WITHIN)
    for cause in members:
        widths[diagnostics.blocks[cause]] = factor
    return widths


def test_evidence_of_causes_is_that_of_the_dense_density(seen, causes):
    diagnostics = Diagnostics(causes, seen)
    mean, _, _ = diagnostics.normal.condition(seen.deviations)
    none = dense(seen, np.full(4, WITHIN))
    expected = {
        (members, factor): dense(seen, widths_of(diagnostics, members, factor)) - none
        for members in [(0,), (1,), (2,), *combinations(range(3), 2)]
        for factor in FACTORS
    }
    found = {(h.causes, h.factor): h.log_ratio(mean) for h in diagnostics.hypotheses}
    assert found.keys() == expected.keys()
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, abs=1e-4)


def test_coefficients_are_those_of_the_dense_posterior(seen, causes):
    diagnostics = Diagnostics(causes, seen)
    mean, _, _ = diagnostics.normal.condition(seen.deviations)
    hypothesis = next(h for h in diagnostics.hypotheses if h.causes == (2,) and h.factor == 8.0)
    prior = np.diag(np.square(widths_of(diagnostics, (2,), 8.0)))
    inside = np.linalg.inv(
        seen.columns @ prior @ seen.columns.T
        + FLAT**2 * seen.by_unknown @ seen.by_unknown.T
        + np.eye(READINGS)
    )
    gain = prior @ seen.columns.T @ inside
    expected, spread = gain @ seen.deviations, prior - gain @ seen.columns @ prior
    centre, covariance = hypothesis.moments(diagnostics.normal, mean)
    assert centre == pytest.approx(expected[2:], abs=1e-4)
    assert covariance == pytest.approx(spread[2:, 2:], abs=1e-4)


@pytest.mark.parametrize("name", ["first.csv", "second.csv"])
def test_a_disturbed_file_has_more_noise(seen, causes, name):
    """Relative to the undisturbed model, the flat prior of the set-up being the same."""
    noise = np.where([label == name for label in seen.sets], np.hypot(1.0, 0.3 * 8.0), 1.0)
    expected = dense(seen, np.full(4, WITHIN), noise) - dense(seen, np.full(4, WITHIN))
    diagnostics = Diagnostics(causes, seen)
    normal, divisor = diagnostics._disturbed[name][0]
    assert divisor == pytest.approx(noise)
    base = diagnostics.normal.condition(seen.deviations)[1]
    found = normal.condition(seen.deviations / divisor)[1] - np.log(divisor).sum() - base
    assert found == pytest.approx(expected, abs=1e-4)


def test_one_outlier_is_the_mean_over_the_readings(seen, causes, monkeypatch):
    monkeypatch.setattr(evidence, "MAX_OUTLIERS", 1)
    diagnostics = Diagnostics(causes, seen)
    _, _, weighted = diagnostics.normal.condition(seen.deviations)
    none = dense(seen, np.full(4, WITHIN))
    each = []
    for at in range(READINGS):
        noise = np.ones(READINGS)
        noise[at] = np.hypot(1.0, evidence.OUTLIER * 8.0)
        each.append(dense(seen, np.full(4, WITHIN), noise) - none)
    expected = np.log(np.mean(np.exp(each)))
    assert diagnostics._log_outliers(weighted) == pytest.approx(expected, abs=1e-4)


def test_the_second_outlier_is_sought_without_the_first(causes, monkeypatch):
    """Two gross outliers: evidence of both at once, by the dense density."""
    rng = np.random.default_rng(8)
    columns, deviations = rng.standard_normal((READINGS, 4)), rng.normal(size=READINGS)
    deviations[[2, 9]] += 60.0, -45.0
    none = np.zeros((READINGS, 0))
    seen = Observations(columns, none, deviations, ("a",) * READINGS, np.full(READINGS, 8.0))
    monkeypatch.setattr(evidence, "MAX_OUTLIERS", 2)
    diagnostics = Diagnostics(causes, seen)
    noise = np.ones(READINGS)
    noise[[2, 9]] = np.hypot(1.0, evidence.OUTLIER * 8.0)
    expected = dense(seen, np.full(4, WITHIN), noise) - dense(seen, np.full(4, WITHIN))
    _, _, weighted = diagnostics.normal.condition(deviations)
    # of two outliers half of the prior, and one in N readings each
    expected += np.log(0.5) - 2.0 * np.log(READINGS)
    assert diagnostics._log_outliers(weighted) == pytest.approx(expected, abs=1e-3)


def test_all_probabilities_sum_to_one_and_causes_are_named(seen, causes):
    posterior = Diagnostics(causes, seen).infer()
    total = sum(posterior.causes.values()) + sum(posterior.disturbed.values()) + posterior.within
    assert total == pytest.approx(1.0, abs=1e-12)
    assert max(posterior.causes, key=posterior.causes.get) == (2,)


def test_equal_columns_form_one_group_and_others_do_not(causes):
    rng = np.random.default_rng(3)
    columns = 5.0 * rng.standard_normal((READINGS, 4))
    columns[:, 1] = columns[:, 0]
    none, sets = np.zeros((READINGS, 0)), ("a",) * READINGS
    deviations = 6.0 * columns[:, 0] + rng.normal(size=READINGS)
    diagnostics = Diagnostics(causes, Observations(columns, none, deviations, sets, np.ones(12)))
    posterior = diagnostics.infer()
    groups, _ = diagnostics.group(posterior)
    assert {(0,), (1,)} <= {*groups[0]}
    assert (2,) not in groups[0]
    assert posterior.causes[(0,)] == pytest.approx(posterior.causes[(1,)])
    assert sum(posterior.causes[causes] for causes in groups[0]) > 0.9


def test_the_flat_prior_of_a_set_up_has_no_scale():
    """A set-up in other units shifts the evidence by the logarithm of the units only."""
    rng = np.random.default_rng(1)
    columns, set_up = rng.standard_normal((9, 3)), rng.standard_normal((9, 2))
    deviations = rng.normal(size=9)
    first, second = (Normal.of(columns, scale * set_up) for scale in (1.0, 1e3))
    gap = first.condition(deviations)[1] - second.condition(deviations)[1]
    assert gap == pytest.approx(2.0 * np.log(1e3), abs=1e-9)
    assert first.condition(deviations)[0] == pytest.approx(second.condition(deviations)[0])
