"""Next checks: expected information on the cause, per minute of work."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpspace.calibration.next_best import candidates, minutes
from warpspace.calibration.solve import MeasurementModel
from warpspace.diagnosis.causes import ErrorVariables
from warpspace.diagnosis.evidence import (
    WITHIN,
    CauseModel,
    Hypothesis,
    Observations,
    Posterior,
    build_hypotheses,
)
from warpspace.diagnosis.observations import observe
from warpspace.calibration.calibration_result import Candidate
from warpspace.units import Array

DRAWS = 96  # readings of each candidate that are drawn from the posterior
MAX_HYPOTHESES = 60  # the likeliest ones, among which a test decides
LEAST_WEIGHT = 8.0  # logarithm below the best one from which a hypothesis is left out
ENOUGH = 0.5  # share of the largest information that a proposed test has
MIN_BITS = 0.02  # of a test that is proposed


@dataclass(frozen=True)
class InformativeTest:
    """A test and the expected reduction of the entropy of the cause."""

    candidate: Candidate
    bits: float
    bits_by_cause: dict[tuple[int, ...], float]  # on the question whether it is this one

    @property
    def minutes(self) -> float:
        return minutes(self.candidate.readings)

    @property
    def name(self) -> str:
        return self.candidate.name.partition(";")[0].partition(": ")[0]

    def options(self) -> dict[str, Any]:
        """Return the kind of the readings and the options of its test."""
        _, *parts = self.candidate.readings.kind.split(":")
        pairs = (part.partition("=") for part in parts)
        return {"kind": self.candidate.readings.kind, **{name: value for name, _, value in pairs}}


def plan_candidates(
    variables: ErrorVariables, noise_mm: float, watch: Callable[[float], None]
) -> list[tuple[Candidate, Observations]]:
    """Build the readings of all candidates on the machine."""
    planned: list[tuple[Candidate, Observations]] = []
    choice = candidates(variables.scene)
    for number, candidate in enumerate(choice):
        watch(number / len(choice))
        model = MeasurementModel.of(variables.scene, [candidate.readings])
        planned.append((candidate, observe(variables, model, noise_mm)))
    return planned


def rank_tests(
    model: CauseModel,
    posterior: Posterior,
    planned: Sequence[tuple[Candidate, Observations]],
    watch: Callable[[float], None],
) -> list[InformativeTest]:
    """Rank candidates by the expected information per minute, the best first.

    Readings are drawn from the posterior: a hypothesis, its coefficients, and noise. The mean
    reduction of the entropy over the causes is the mutual information of cause and readings.
    Disturbed readings are not among the hypotheses.
    """
    rng = np.random.default_rng(0)
    order = np.argsort(-posterior.weights[:-1])[:MAX_HYPOTHESES]
    best = float(posterior.weights.max())
    order = order[posterior.weights[order] > best - LEAST_WEIGHT]
    listed = list(dict.fromkeys(model.hypotheses[at].causes for at in order))
    place = {(h.causes, tuple(h.variance)): at for at, h in enumerate(model.hypotheses)}
    chosen = build_hypotheses(model.blocks, model.normal.covariance, listed)
    order = [place[h.causes, tuple(h.variance)] for h in chosen]
    weights = np.append(posterior.weights[order], posterior.weights[-1])
    shares = np.exp(weights - weights.max())
    shares /= shares.sum()
    drawn = rng.choice(len(shares), DRAWS, p=shares)
    coefficients = _draw(model, posterior, [*chosen, None], drawn, rng)
    names = [*(h.causes for h in chosen), ()]
    sets = list(dict.fromkeys(names))
    member = np.array([[name == other for other in sets] for name in names], dtype=float)
    present = np.array([h.log_ratio(posterior.mean) for h in chosen] + [0.0])
    before = shares @ member
    information = model.normal.information + np.eye(len(posterior.mean)) / WITHIN**2
    weighted_sum = information @ posterior.mean
    bases = np.hstack([cause.basis for cause in model.causes])
    tests: list[InformativeTest] = []
    for number, (candidate, added) in enumerate(planned):
        watch(number / len(planned))
        columns = added.by_variable @ bases
        columns = model.eliminate(columns, added.by_unknown)
        gram = columns.T @ columns
        covariance = np.linalg.inv(information + gram)
        noise = rng.standard_normal((DRAWS, len(columns))) @ columns
        means = (weighted_sum + coefficients @ gram + noise) @ covariance
        later = [h.log_ratio(means) for h in build_hypotheses(model.blocks, covariance, listed)]
        logs = weights - present + np.stack([*later, np.zeros(DRAWS)], -1)
        after = np.exp(logs - logs.max(axis=1, keepdims=True))
        after = after @ member / after.sum(axis=1, keepdims=True)
        bits = _entropy(before) - _entropy(after).mean()
        by_cause = _binary(before) - _binary(after).mean(axis=0)
        tests.append(
            InformativeTest(
                candidate,
                max(float(bits), 0.0),
                {name: max(float(gain), 0.0) for name, gain in zip(sets, by_cause, strict=True)},
            )
        )
    enough = ENOUGH * max((test.bits for test in tests), default=0.0)
    useful = [test for test in tests if test.bits >= max(enough, MIN_BITS)]
    return sorted(useful, key=lambda test: -test.bits / test.minutes)


def _draw(
    model: CauseModel,
    posterior: Posterior,
    hypotheses: Sequence[Hypothesis | None],
    drawn: Array,
    rng: np.random.Generator,
) -> Array:
    """Draw coefficients of all causes from the posterior of hypotheses, [n, P]."""
    covariance = model.normal.covariance
    root = np.linalg.cholesky(covariance)
    coefficients = posterior.mean + rng.standard_normal((len(drawn), len(root))) @ root.T
    for row, at in enumerate(drawn):
        hypothesis = hypotheses[at]
        if hypothesis is not None:
            block = covariance[:, hypothesis.rows]
            kernel = np.linalg.cholesky(hypothesis.inverse)
            shift = hypothesis.inverse @ posterior.mean[hypothesis.rows]
            shift = shift + kernel @ rng.standard_normal(len(kernel))
            coefficients[row] += block @ shift
    return coefficients


def _entropy(shares: Array) -> Array:
    return -np.sum(shares * np.log2(np.maximum(shares, 1e-300)), axis=-1)


def _binary(shares: Array) -> Array:
    return _entropy(np.stack([shares, 1.0 - shares], -1))
