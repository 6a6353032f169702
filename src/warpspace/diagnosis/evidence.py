"""Evidence of causes: Gaussian, in closed form.

Readings are r = A·c + U·s + noise. The coefficients c of a cause have a standard deviation of
`WITHIN` half-widths within tolerance and one of `FACTORS` out of it; the unknowns s of the set-up
have a flat prior. With M = AᵀA + 1/WITHIN², V = M⁻¹ and x = V·Aᵀr, U eliminated, a hypothesis that
enlarges the variance of the block S changes the log evidence by
½·x_Sᵀ·K⁻¹·x_S − ½·log|δ·K| − ½·log|variance/WITHIN²|; δ is the precision it takes from the prior,
K = δ⁻¹ − V_SS. Draws of the posterior correct for a cause being outside its tolerance somewhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from warpspace.calibration.solve import (
    CheckCancelled,
    never_cancelled,
    orthonormal_basis,
    project_out,
)
from warpspace.diagnosis.causes import Cause
from warpspace.units import Array

WITHIN, FACTORS = 0.5, (3.0, 8.0)  # standard deviations, in half-widths
PRIOR_WITHIN, PRIOR_ONE, PRIOR_TWO, PRIOR_NOT_GEOMETRIC = 0.2, 0.58, 0.1, 0.12
PRIOR_SYMPTOM_WRONG = 0.01  # instead of the last one, where there are no readings
NOISE_FACTORS = (0.3, 1.0, 3.0)  # of disturbed files, in smallest half-widths of a translation
OUTLIER = 5.0  # standard deviation of outliers, likewise
MAX_OUTLIERS = 3
DRAWS = 200  # of a posterior
PROMISING = 15.0  # log evidence below the best one from which it is not corrected by draws
SEPARATE = 1.0  # log evidence below which two causes are not separated
RARE = 1e-3  # probability below which a cause is not grouped

Causes = tuple[int, ...]


@dataclass(frozen=True)
class Observations:
    """Readings, divided by their standard uncertainty."""

    columns: Array  # [N, P], per coefficient of the causes
    by_unknown: Array  # [N, m]
    deviations: Array  # [N], from the middle of the tolerances
    sets: tuple[str, ...]  # (N,); file or symptom of each
    tolerance: Array  # [N]; smallest half-width of a translation

    def joined(self, other: "Observations") -> "Observations":
        """Append readings with a set-up of their own."""
        counts = self.by_unknown.shape, other.by_unknown.shape
        by_unknown = np.zeros(np.add(*counts))
        by_unknown[: counts[0][0], : counts[0][1]] = self.by_unknown
        by_unknown[counts[0][0] :, counts[0][1] :] = other.by_unknown
        return Observations(
            np.vstack([self.columns, other.columns]),
            by_unknown,
            np.append(self.deviations, other.deviations),
            (*self.sets, *other.sets),
            np.append(self.tolerance, other.tolerance),
        )


@dataclass(frozen=True)
class Normal:
    """Distribution of readings with all causes within tolerance."""

    columns: Array  # [N, P], set-up eliminated
    set_up: Array  # [N, r], orthonormal basis
    information: Array  # [P, P]; of readings and prior
    covariance: Array  # [P, P]
    log_constant: float  # of the evidence

    @classmethod
    def of(cls, columns: Array, by_unknown: Array) -> "Normal":
        set_up = orthonormal_basis(by_unknown)
        columns = project_out(columns, set_up)
        size = columns.shape[1]
        information = columns.T @ columns + np.eye(size) / WITHIN**2
        volume = np.linalg.slogdet(information)[1] + 2.0 * size * np.log(WITHIN)
        if set_up.size:  # flat prior
            volume += np.linalg.slogdet(set_up.T @ by_unknown @ by_unknown.T @ set_up)[1]
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        return cls(columns, set_up, information, covariance, -0.5 * float(volume))

    def condition(self, deviations: Array) -> tuple[Array, float, Array]:
        """Return mean, [P], log evidence, and readings weighted by their covariance, [N]."""
        readings = project_out(deviations, self.set_up)
        mean = self.covariance @ (self.columns.T @ readings)
        weighted = readings - self.columns @ mean
        return mean, self.log_constant - 0.5 * float(readings @ weighted), weighted


@dataclass(frozen=True)
class Hypothesis:
    """Causes out of tolerance, with a standard deviation in half-widths."""

    causes: Causes
    factor: float
    rows: NDArray[np.intp]  # of their coefficients
    inverse: Array  # K⁻¹
    log_constant: float

    def log_ratio(self, means: Array) -> Array:
        """Compute the log evidence relative to all causes within tolerance, [...]."""
        part = means[..., self.rows]
        return self.log_constant + 0.5 * np.sum((part @ self.inverse) * part, axis=-1)

    def moments(self, normal: Normal, mean: Array) -> tuple[Array, Array]:
        """Compute mean and covariance of its coefficients, given the readings."""
        block = normal.covariance[np.ix_(self.rows, self.rows)]
        gain = block @ self.inverse
        return mean[self.rows] + gain @ mean[self.rows], block + gain @ block


@dataclass(frozen=True)
class Posterior:
    """Probabilities of all explanations."""

    causes: dict[Causes, float]  # one or two out of tolerance
    within: float
    disturbed: dict[str, float]  # by file, and outliers
    mean: Array  # [P]; of the coefficients with all causes within tolerance
    logs: Array  # [H + 1]; of each hypothesis, and of none


class Diagnostics:
    """Hypotheses on the causes of readings; the readings of its tests may be replaced."""

    def __init__(
        self,
        causes: Sequence[Cause],
        observations: Observations,
        prior_not_geometric: float = PRIOR_NOT_GEOMETRIC,
        check_cancelled: CheckCancelled = never_cancelled,
    ) -> None:
        self.causes, self.observations = tuple(causes), observations
        self.prior_not_geometric, self.check_cancelled = prior_not_geometric, check_cancelled
        ends = np.cumsum([0, *(cause.shape.shape[1] for cause in causes)])
        self.blocks = [
            np.arange(end - c.shape.shape[1], end) for end, c in zip(ends[1:], causes, strict=True)
        ]
        self.normal = Normal.of(observations.columns, observations.by_unknown)
        count = range(len(causes))
        self.hypotheses = [
            self.suppose(members, factor, self.normal.covariance)
            for members in (*((cause,) for cause in count), *combinations(count, 2))
            for factor in FACTORS
        ]
        priors = {1: PRIOR_ONE / len(causes), 2: PRIOR_TWO / max(comb(len(causes), 2), 1)}
        logs = [np.log(priors[len(h.causes)] / len(FACTORS)) for h in self.hypotheses]
        self.log_priors = np.array([*logs, np.log(PRIOR_WITHIN)])

    def suppose(self, causes: Causes, factor: float, covariance: Array) -> Hypothesis:
        rows = np.concatenate([self.blocks[cause] for cause in causes])
        loss = 1.0 / WITHIN**2 - 1.0 / factor**2
        kernel = np.eye(len(rows)) / loss - covariance[np.ix_(rows, rows)]
        volume = np.linalg.slogdet(kernel)[1] + len(rows) * np.log(loss * (factor / WITHIN) ** 2)
        inverse = np.asarray(np.linalg.inv(kernel), dtype=np.float64)
        return Hypothesis(causes, factor, rows, inverse, -0.5 * float(volume))

    def infer(self, deviations: Array | None = None) -> Posterior:
        """Compute the probabilities of all explanations of readings, [N]."""
        readings = self.observations.deviations if deviations is None else deviations
        mean, base, weighted = self.normal.condition(readings)
        logs = np.array([*(h.log_ratio(mean) for h in self.hypotheses), 0.0]) + self.log_priors
        for at in np.flatnonzero(logs[:-1] > logs.max() - PROMISING):
            logs[at] += self._log_outside(self.hypotheses[at], mean)
        noise = {
            name: self._log_noise(models, readings) - base
            for name, models in self._disturbed.items()
        }
        noise["outliers"] = self._log_outliers(weighted) + np.log(self.prior_not_geometric / 2.0)
        norm = log_sum(np.append(logs, [*noise.values()]))
        probabilities: dict[Causes, float] = {}
        for hypothesis, share in zip(self.hypotheses, np.exp(logs - norm), strict=False):
            present = probabilities.get(hypothesis.causes, 0.0)
            probabilities[hypothesis.causes] = present + float(share)
        disturbed = {name: float(np.exp(value - norm)) for name, value in noise.items()}
        return Posterior(
            probabilities, float(np.exp(logs[-1] - norm)), disturbed, mean, logs - norm
        )

    def _log_outside(self, hypothesis: Hypothesis, mean: Array) -> float:
        """Compute log P(out of tolerance, given the readings) − log P(out of tolerance)."""
        centre, covariance = hypothesis.moments(self.normal, mean)
        draws = self._draws[:, : len(centre)]
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        shares: list[float] = []
        for coefficients in (centre + draws @ root.T, hypothesis.factor * draws):
            is_outside, start = np.ones(DRAWS, dtype=bool), 0
            for shape in (self.causes[cause].shape for cause in hypothesis.causes):
                stop = start + shape.shape[1]
                is_outside &= np.abs(coefficients[:, start:stop] @ shape.T).max(axis=1) > 1.0
                start = stop
            shares.append(float(is_outside.mean()) + 0.5 / DRAWS)
        return float(np.log(shares[0] / shares[1]))

    @cached_property
    def _draws(self) -> Array:
        width = 2 * max(len(block) for block in self.blocks)
        return np.random.default_rng(0).standard_normal((DRAWS, width))

    # --- not geometric ----------------------------------------------------------------------------

    @cached_property
    def _disturbed(self) -> dict[str, list[tuple[Normal, Array]]]:
        """Models of more noise in one file, and the factor of its standard uncertainties, [N]."""
        observations = self.observations
        models: dict[str, list[tuple[Normal, Array]]] = {}
        for name in dict.fromkeys(observations.sets):
            inside = np.array([label == name for label in observations.sets])
            for factor in NOISE_FACTORS:
                divisor = np.where(inside, np.hypot(1.0, factor * observations.tolerance), 1.0)
                columns = observations.columns / divisor[:, None]
                by_unknown = observations.by_unknown / divisor[:, None]
                models.setdefault(name, []).append((Normal.of(columns, by_unknown), divisor))
                self.check_cancelled()
        return models

    def _log_noise(self, models: Sequence[tuple[Normal, Array]], readings: Array) -> float:
        """Compute the log evidence and prior of more noise in one file."""
        logs = [normal.condition(readings / d)[1] - np.sum(np.log(d)) for normal, d in models]
        prior = self.prior_not_geometric / 2.0 / len(self._disturbed) / len(models)
        return log_sum(np.array(logs)) + float(np.log(prior))

    def _log_outliers(self, weighted: Array) -> float:
        """Compute the log evidence of one to three outliers.

        A reading of a variance enlarged by s²: ½·s²·p²/(1 + s²q) − ½·log(1 + s²q), p = Σ⁻¹r and q
        the diagonal of Σ⁻¹; the mean over all readings, and again without the likeliest one.
        """
        normal, variance = self.normal, (OUTLIER * self.observations.tolerance) ** 2
        inner, p = normal.columns @ normal.covariance, weighted
        q = 1.0 - np.sum(normal.set_up**2, axis=1) - np.sum(inner * normal.columns, axis=1)
        removed: list[Array] = []  # scaled columns of Σ⁻¹
        logs = [0.0]
        for _ in range(MAX_OUTLIERS):
            q = np.maximum(q, 0.0)
            gain = 0.5 * variance * p**2 / (1.0 + variance * q) - 0.5 * np.log1p(variance * q)
            logs.append(logs[-1] + log_sum(gain) - np.log(len(gain)))
            at = int(np.argmax(gain))
            column = -normal.set_up @ normal.set_up[at] - inner @ normal.columns[at]
            column[at] += 1.0
            column -= sum(vector[at] * vector for vector in removed)
            share = variance[at] / (1.0 + variance[at] * q[at])
            p, q = p - share * p[at] * column, q - share * column**2
            removed.append(np.sqrt(share) * column)
        return log_sum(np.array(logs[1:])) - float(np.log(MAX_OUTLIERS))

    # --- groups -----------------------------------------------------------------------------------

    def gained_bits(self, posterior: Posterior) -> float:
        """Compute the information of the readings on the cause, relative to the prior."""
        shares = np.append(np.exp(posterior.logs), sum(posterior.disturbed.values()))
        priors = np.append(np.exp(self.log_priors), self.prior_not_geometric)
        return float(shares @ np.log2(np.maximum(shares, 1e-300) * priors.sum() / priors))

    def likeliest(self, causes: Causes, posterior: Posterior) -> Hypothesis:
        places = [at for at, h in enumerate(self.hypotheses) if h.causes == causes]
        return self.hypotheses[max(places, key=lambda at: posterior.logs[at])]

    def group(self, posterior: Posterior) -> tuple[list[list[Causes]], list[Causes]]:
        """Group causes that the readings do not separate, the likeliest first; and rare ones.

        Readings as one cause would produce them are explained by another one where its log evidence
        is less than `SEPARATE` below; the two are not separated if this holds both ways.
        """
        shares = posterior.causes
        ranked = sorted(shares, key=lambda causes: -shares[causes])
        likely = [causes for causes in ranked if shares[causes] >= RARE]
        best = {causes: self.likeliest(causes, posterior) for causes in likely}
        means: dict[Causes, Array] = {}
        readings = self.normal.information - np.eye(len(posterior.mean)) / WITHIN**2
        for causes, hypothesis in best.items():
            centre, _ = hypothesis.moments(self.normal, posterior.mean)
            means[causes] = self.normal.covariance @ (readings[:, hypothesis.rows] @ centre)
        groups: list[list[Causes]] = []
        for causes in likely:
            for group in groups:
                directions = (group[0], causes), (causes, group[0])
                gains = [
                    best[a].log_ratio(means[a]) - best[b].log_ratio(means[a]) for a, b in directions
                ]
                if max(gains) < SEPARATE:
                    group.append(causes)
                    break
            else:
                groups.append([causes])
        groups.sort(key=lambda group: -sum(shares[causes] for causes in group))
        return groups, ranked[len(likely) :]


def log_sum(logs: Array) -> float:
    largest = float(np.max(logs))
    return largest + float(np.log(np.sum(np.exp(logs - largest))))
