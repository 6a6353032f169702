"""Next checks: expected information on the cause, per minute of work."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpspace.analysis.description import NO_JSON, ProgressCallback
from warpspace.calibration.calibration_result import Candidate
from warpspace.calibration.next_best import minutes
from warpspace.calibration.readings import Readings
from warpspace.diagnosis.evidence import Causes, Diagnostics, Normal, Observations, Posterior
from warpspace.units import Array

DRAWS = 96  # readings of each test
MAX_HYPOTHESES, PROMISING = 60, 8.0  # the likeliest ones, and log probability below the first
ENOUGH, MIN_BITS = 0.5, 0.02  # share of the largest information, and bits, of a test


@dataclass(frozen=True)
class ProposedTest:
    """A test and the expected reduction of the entropy of the cause."""

    test: str
    options: Mapping[str, Any]
    information_bits: float
    minutes: float
    candidate: Candidate = field(metadata=NO_JSON)
    # on the question whether it is this one
    bits_by_causes: Mapping[Causes, float] = field(metadata=NO_JSON)


def rank_tests(
    diagnostics: Diagnostics,
    posterior: Posterior,
    planned: Sequence[tuple[Candidate, Observations]],
    watch: ProgressCallback,
) -> list[ProposedTest]:
    """Rank tests by the expected information per minute, the best first.

    Readings are drawn from the posterior of the likeliest hypotheses: the mean reduction of the
    entropy is the mutual information of cause and readings. Disturbed readings are no hypotheses.
    """
    rng = np.random.default_rng(0)
    order = np.argsort(-posterior.logs[:-1])[:MAX_HYPOTHESES]
    order = order[posterior.logs[order] > posterior.logs.max() - PROMISING]
    chosen = [diagnostics.hypotheses[at] for at in order]
    logs = np.append(posterior.logs[order], posterior.logs[-1])
    shares = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    normal = diagnostics.normal
    root = np.linalg.cholesky(normal.covariance)
    coefficients = posterior.mean + rng.standard_normal((DRAWS, len(root))) @ root.T
    for row, at in enumerate(rng.choice(len(shares), DRAWS, p=shares)):
        if at < len(chosen):
            rows, inverse = chosen[at].rows, chosen[at].inverse
            noise = np.linalg.cholesky(inverse) @ rng.standard_normal(len(rows))
            coefficients[row] += normal.covariance[:, rows] @ (
                inverse @ posterior.mean[rows] + noise
            )
    names = [*(hypothesis.causes for hypothesis in chosen), ()]
    sets = list(dict.fromkeys(names))
    member = np.array([[name == other for other in sets] for name in names], dtype=float)
    present = np.array([*(h.log_ratio(posterior.mean) for h in chosen), 0.0])
    before = shares @ member
    tests: list[ProposedTest] = []
    for number, (candidate, added) in enumerate(planned):
        watch(number / len(planned))
        columns = Normal.of(added.columns, added.by_unknown).columns
        gram = columns.T @ columns
        covariance = np.asarray(np.linalg.inv(normal.information + gram), dtype=np.float64)
        noise = rng.standard_normal((DRAWS, len(columns))) @ columns
        means = (normal.information @ posterior.mean + coefficients @ gram + noise) @ covariance
        later = [
            diagnostics.suppose(h.causes, h.factor, covariance).log_ratio(means) for h in chosen
        ]
        weights = logs - present + np.stack([*later, np.zeros(DRAWS)], -1)
        after = np.exp(weights - weights.max(axis=1, keepdims=True))
        after = after @ member / after.sum(axis=1, keepdims=True)
        bits = _entropy(before) - _entropy(after).mean()
        each = [_entropy(np.stack([p, 1.0 - p], -1)) for p in (before, after)]
        by_causes = dict(
            zip(sets, np.maximum(each[0] - each[1].mean(axis=0), 0.0).tolist(), strict=True)
        )
        tests.append(
            ProposedTest(
                re.sub(r"(: \d+ readings of one component)?; .*", "", candidate.name),
                test_options(candidate.readings),
                max(float(bits), 0.0),
                minutes(candidate.readings),
                candidate,
                by_causes,
            )
        )
    enough = max(MIN_BITS, ENOUGH * max((test.information_bits for test in tests), default=0.0))
    useful = [test for test in tests if test.information_bits >= enough]
    return sorted(useful, key=lambda test: -test.information_bits / test.minutes)


def test_options(readings: Readings) -> dict[str, Any]:
    """Return the options of a test, or the positions of the axes that move, mm or degrees."""
    name, *parts = readings.kind.split(":")
    if readings.plan is None:
        positions = {axis: np.unique(at).tolist() for axis, at in readings.coordinates.items()}
        return {"kind": name} | {axis: at for axis, at in positions.items() if len(at) > 1}
    pairs = (part.partition("=") for part in parts)
    return {"kind": name, **{option: value for option, _, value in pairs}}


def _entropy(shares: Array) -> Array:
    return -np.sum(shares * np.log2(np.maximum(shares, 1e-300)), axis=-1)
