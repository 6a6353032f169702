"""Evidence of causes: Gaussian, in closed form.

The readings are r = A·c + U·s + noise: c are coefficients of the causes, each with a standard
deviation of `WITHIN` while its cause is within tolerance, s the unknowns of the set-up, with a flat
prior. A cause out of tolerance has a larger deviation, one of `FACTORS`. With the information
M = AᵀA + 1/WITHIN² of all causes within tolerance, V = M⁻¹ and x = V·Aᵀr, a hypothesis that enlarges
the block S of coefficients changes the logarithm of the evidence by
½·x_Sᵀ·K⁻¹·x_S − ½·log|K·δ| − ½·log|variance/WITHIN²|, where δ is the loss of prior information and
K = δ⁻¹ − V_SS.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from warpspace.calibration.solve import orthonormal_basis, project_out
from warpspace.diagnosis.causes import Cause
from warpspace.units import Array

WITHIN = 0.5  # standard deviation of an error within tolerance, in half-widths
FACTORS = (2.0, 5.0)  # standard deviations of an error out of tolerance, in half-widths
PRIOR_WITHIN = 0.2  # of the probability before the readings
PRIOR_ONE = 0.55  # one cause, each alike
PRIOR_TWO = 0.1  # two causes, each pair alike
PRIOR_NOT_GEOMETRIC = 0.15
NOISE_FACTORS = (0.3, 1.0, 3.0)  # disturbed readings, in half-widths of the smallest translation
OUTLIER = 5.0  # standard deviation of an outlier, likewise
MAX_OUTLIERS = 3  # of a file, by which an otherwise undisturbed one is recognised
SAMPLES = 200  # of a posterior, for its share out of tolerance
SEPARATE = 1.0  # logarithm of the evidence below which two causes are not separated
RARE = 1e-3  # probability of a cause below which it is not grouped
PROMISING = 15.0  # logarithm of the evidence below the best, from which samples are omitted

IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class Observations:
    """Readings divided by their standard uncertainty; nominal is the middle of the tolerances."""

    by_variable: Array  # [N, V] per µm or µrad
    by_unknown: Array  # [N, m]
    deviations: Array  # [N]; observed − nominal
    sets: tuple[str, ...]  # (N,); file or symptom of each
    limit: Array  # [N]; half-width of the smallest translation tolerance
    bends: Array  # [N, b]; low-order bends of artefacts, an amplitude of one half-width

    def joined(self, other: "Observations") -> "Observations":
        """Append readings with a set-up of their own."""
        return Observations(
            np.vstack([self.by_variable, other.by_variable]),
            _diagonal(self.by_unknown, other.by_unknown),
            np.append(self.deviations, other.deviations),
            (*self.sets, *other.sets),
            np.append(self.limit, other.limit),
            _diagonal(self.bends, other.bends),
        )


def _diagonal(first: Array, second: Array) -> Array:
    joined = np.zeros((len(first) + len(second), first.shape[1] + second.shape[1]))
    joined[: len(first), : first.shape[1]] = first
    joined[len(first) :, first.shape[1] :] = second
    return joined


@dataclass(frozen=True)
class Normal:
    """Normal distribution of the coefficients, all causes within tolerance."""

    columns: Array  # [N, P], set-up eliminated
    basis: Array  # [N, r], orthonormal, of the set-up
    information: Array  # [P, P]; of the readings
    covariance: Array  # [P, P]
    log_constant: float  # of the evidence, without the readings

    @classmethod
    def of(cls, columns: Array, by_unknown: Array) -> "Normal":
        basis = orthonormal_basis(by_unknown)
        columns = project_out(columns, basis)
        information, size = columns.T @ columns, columns.shape[1]
        total = information + np.eye(size) / WITHIN**2
        set_up = np.linalg.svd(by_unknown, compute_uv=False) if by_unknown.size else np.ones(1)
        set_up = set_up[set_up > 1e-12 * set_up[0]]
        constant = -0.5 * np.linalg.slogdet(total)[1] - size * np.log(WITHIN)
        constant -= float(np.sum(np.log(set_up)))
        return cls(columns, basis, information, np.linalg.inv(total), constant)

    def condition(self, deviations: Array) -> tuple[Array, float, Array]:
        """Return mean, [P], log evidence, and the readings weighted by Σ⁻¹, [N]."""
        readings = project_out(deviations, self.basis)
        mean = self.covariance @ (self.columns.T @ readings)
        weighted = readings - self.columns @ mean
        return mean, self.log_constant - 0.5 * float(readings @ weighted), weighted


@dataclass(frozen=True)
class Hypothesis:
    """Causes out of tolerance, each with a standard deviation in half-widths."""

    causes: tuple[int, ...]
    rows: IndexArray  # their coefficients
    variance: Array  # of each
    inverse: Array  # K⁻¹
    log_constant: float

    def log_ratio(self, means: Array) -> Array:
        """Compute the log evidence relative to all causes within tolerance, [...]."""
        part = means[..., self.rows]
        return self.log_constant + 0.5 * np.sum((part @ self.inverse) * part, axis=-1)


def build_hypotheses(
    blocks: Sequence[IndexArray], covariance: Array, sets: Iterable[tuple[int, ...]]
) -> tuple[Hypothesis, ...]:
    """Build the hypotheses of some sets of causes, for all of `FACTORS`; matrices in batches."""
    by_size: dict[int, list[tuple[tuple[int, ...], IndexArray, Array]]] = {}
    for causes in sets:
        rows = np.concatenate([blocks[cause] for cause in causes])
        for factors in product(FACTORS, repeat=len(causes)):
            variance = [np.full(len(blocks[c]), f**2) for c, f in zip(causes, factors, strict=True)]
            by_size.setdefault(len(rows), []).append((causes, rows, np.concatenate(variance)))
    hypotheses: list[Hypothesis] = []
    for batch in by_size.values():
        variance, rows = (np.stack([row[at] for row in batch]) for at in (2, 1))
        loss = 1.0 / WITHIN**2 - 1.0 / variance
        kernel = np.eye(rows.shape[1]) / loss[:, None] - covariance[rows[:, :, None], rows[:, None]]
        constant = np.linalg.slogdet(kernel)[1]
        constant += np.sum(np.log(loss * variance / WITHIN**2), axis=1)
        inverse = np.linalg.inv(kernel)
        for at, (causes, indices, widths) in enumerate(batch):
            hypotheses.append(
                Hypothesis(causes, indices, widths, inverse[at], -0.5 * float(constant[at]))
            )
    return tuple(hypotheses)


@dataclass(frozen=True)
class Posterior:
    """Probabilities of all explanations of some readings."""

    within: float
    not_geometric: dict[str, float]  # by file
    causes: dict[tuple[int, ...], float]  # one or two causes out of tolerance
    mean: Array  # [P]; all causes within tolerance
    weights: Array  # [H]; log posterior of each hypothesis, and of none, last


class CauseModel:
    """Hypotheses of the causes of readings of certain plans; the readings may change."""

    def __init__(self, causes: Sequence[Cause], observations: Observations) -> None:
        self.causes, self.observations = tuple(causes), observations
        columns = observations.by_variable @ np.hstack([cause.basis for cause in causes])
        self._columns = columns
        ends = np.cumsum([0, *(cause.basis.shape[1] for cause in causes)])
        self.blocks = [np.arange(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        self.normal = Normal.of(columns, observations.by_unknown)

    @staticmethod
    def eliminate(columns: Array, by_unknown: Array) -> Array:
        """Project the unknowns of a set-up out of columns, [N, P]."""
        return project_out(columns, orthonormal_basis(by_unknown))

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        count = range(len(self.causes))
        sets = [*((cause,) for cause in count), *combinations(count, 2)]
        return build_hypotheses(self.blocks, self.normal.covariance, sets)

    @cached_property
    def _log_priors(self) -> Array:
        """Prior of each hypothesis, and of none, last, [H + 1]."""
        sizes = [len(hypothesis.causes) for hypothesis in self.hypotheses]
        priors = {size: np.log(total / max(sizes.count(size), 1))
                  for size, total in ((1, PRIOR_ONE), (2, PRIOR_TWO))}  # fmt: skip
        return np.array([*(priors[size] for size in sizes), np.log(PRIOR_WITHIN)])

    # --- not geometric ----------------------------------------------------------------------------

    @cached_property
    def _disturbed(self) -> list[tuple[str, Normal, Array, float]]:
        """Models of disturbed files: name, model, divisor of the readings, log of its prior."""
        seen = self.observations
        names = list(dict.fromkeys(seen.sets))
        models: list[tuple[str, Normal, Array, float]] = []
        for name in names:
            inside = np.array([label == name for label in seen.sets])
            for factor in NOISE_FACTORS:
                divisor = np.where(inside, np.sqrt(1.0 + (factor * seen.limit) ** 2), 1.0)
                normal = Normal.of(self._columns / divisor[:, None],
                                   seen.by_unknown / divisor[:, None])  # fmt: skip
                share = PRIOR_NOT_GEOMETRIC / 2.0 / len(names) / len(NOISE_FACTORS)
                models.append((name, normal, divisor, float(np.log(share))))
        return models

    @cached_property
    def _bent(self) -> list[tuple[str, Normal, float]]:
        """Models of bent artefacts: their bends are coefficients like those of causes."""
        seen = self.observations
        models: list[tuple[str, Normal, float]] = []
        for name in dict.fromkeys(seen.sets):
            inside = np.array([label == name for label in seen.sets])
            bends = seen.bends[:, np.any(seen.bends[inside], axis=0)]
            for factor in FACTORS if bends.size else ():
                normal = Normal.of(np.hstack([self._columns, bends * factor / WITHIN]),
                                   seen.by_unknown)  # fmt: skip
                models.append(
                    (name, normal, float(np.log(PRIOR_NOT_GEOMETRIC / 4.0 / len(FACTORS))))
                )
        return models

    def _log_outliers(self, deviations: Array, weighted: Array) -> Array:
        """Compute the log evidence of one to three outliers, the likelier first, [3].

        By a reading of variance added to that of r: ½·s²·p²/(1 + s²q) − ½·log(1 + s²q), where
        p = Σ⁻¹r and q is the diagonal of Σ⁻¹; the mean over the readings, then the same with the
        likeliest one taken out.
        """
        normal, extra = self.normal, (OUTLIER * self.observations.limit) ** 2
        inner, basis = normal.columns @ normal.covariance, normal.basis
        q = 1.0 - np.sum(basis**2, axis=1) - np.sum(inner * normal.columns, axis=1)
        logs, total, weighted = np.zeros(MAX_OUTLIERS), 0.0, weighted.copy()
        removed: list[tuple[Array, float]] = []  # columns of Σ⁻¹ that were taken out
        for count in range(MAX_OUTLIERS):
            q = np.maximum(q, 0.0)
            gain = 0.5 * extra * weighted**2 / (1.0 + extra * q) - 0.5 * np.log1p(extra * q)
            total += log_sum(gain) - np.log(len(gain))
            logs[count] = total
            at = int(np.argmax(gain))
            column = -basis @ basis[at] - inner @ normal.columns[at]
            column[at] += 1.0
            for vector, factor in removed:
                column -= factor * vector[at] * vector
            share = float(extra[at] / (1.0 + extra[at] * q[at]))
            removed.append((column, share))
            weighted, q = weighted - share * weighted[at] * column, q - share * column**2
        return logs

    # --- posterior --------------------------------------------------------------------------------

    def infer(self, deviations: Array | None = None) -> Posterior:
        """Compute the probabilities for readings of these plans, [N]."""
        readings = self.observations.deviations if deviations is None else deviations
        mean, base, weighted = self.normal.condition(readings)
        weights = np.array([*(h.log_ratio(mean) for h in self.hypotheses), 0.0]) + self._log_priors
        best = weights.max()
        for at, hypothesis in enumerate(self.hypotheses):
            if weights[at] > best - PROMISING:
                weights[at] += self._log_outside(hypothesis, mean)
        disturbed: dict[str, list[float]] = {}
        for name, normal, divisor, log_prior in self._disturbed:
            _, log_evidence, _ = normal.condition(readings / divisor)
            log_evidence -= float(np.sum(np.log(divisor)))
            disturbed.setdefault(name, []).append(log_evidence - base + log_prior)
        names = list(disturbed)
        for name, normal, log_prior in self._bent:
            _, log_evidence, _ = normal.condition(readings)
            disturbed[name].append(log_evidence - base + log_prior - np.log(len(names)))
        outliers = self._log_outliers(readings, weighted) + np.log(
            PRIOR_NOT_GEOMETRIC / 4.0 / MAX_OUTLIERS
        )
        disturbed["outliers"] = outliers.tolist()
        totals = {name: log_sum(np.array(row)) for name, row in disturbed.items()}
        norm = log_sum(np.append(weights, [*totals.values()]))
        causes: dict[tuple[int, ...], float] = {}
        for hypothesis, weight in zip(self.hypotheses, weights, strict=False):
            share = float(np.exp(weight - norm))
            causes[hypothesis.causes] = causes.get(hypothesis.causes, 0.0) + share
        noise = {name: float(np.exp(total - norm)) for name, total in totals.items()}
        return Posterior(float(np.exp(weights[-1] - norm)), noise, causes, mean, weights - norm)

    def moments(self, hypothesis: Hypothesis, mean: Array) -> tuple[Array, Array]:
        """Return mean and covariance of the coefficients of a hypothesis under it."""
        block = self.normal.covariance[np.ix_(hypothesis.rows, hypothesis.rows)]
        gain = block @ hypothesis.inverse
        return mean[hypothesis.rows] + gain @ mean[hypothesis.rows], block + gain @ block

    def _log_outside(self, hypothesis: Hypothesis, mean: Array) -> float:
        """Compute log P(out of tolerance | readings) − log P(out of tolerance)."""
        centre, covariance = self.moments(hypothesis, mean)
        normals = self._normals[:, : len(centre)]
        eigenvalues, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
        after = self._share_outside(hypothesis, centre + normals @ root.T)
        before = self._share_outside(hypothesis, normals * np.sqrt(hypothesis.variance))
        return float(np.log(after) - np.log(before))

    def _share_outside(self, hypothesis: Hypothesis, coefficients: Array) -> float:
        is_outside = np.ones(len(coefficients), dtype=bool)
        start = 0
        for cause in hypothesis.causes:
            size = len(self.blocks[cause])
            values = coefficients[:, start : start + size] @ self._relative[cause].T
            is_outside &= np.abs(values).max(axis=1) > 1.0
            start += size
        return (float(is_outside.sum()) + 0.5) / (len(is_outside) + 1.0)

    @cached_property
    def _relative(self) -> list[Array]:
        """Values of each cause in half-widths per coefficient, [v, d]."""
        shapes: list[Array] = []
        for cause in self.causes:
            rows = np.isfinite(cause.limit)
            shapes.append(cause.basis[rows] / cause.limit[rows, None])
        return shapes

    @cached_property
    def _normals(self) -> Array:
        most = 2 * max(len(block) for block in self.blocks)
        return np.random.default_rng(0).standard_normal((SAMPLES, most))

    # --- groups -----------------------------------------------------------------------------------

    def group(
        self, posterior: Posterior
    ) -> tuple[list[tuple[tuple[int, ...], ...]], tuple[tuple[int, ...], ...]]:
        """Group causes that the readings do not separate, each with the likeliest one first.

        Readings as a cause would produce them, with its likeliest amplitude, are explained by
        another one: the two are not separated where the evidence differs by less than `SEPARATE`,
        in both directions. Causes below `RARE` are returned apart.
        """
        shares = posterior.causes
        ranked = sorted(shares, key=lambda causes: -shares[causes])
        likely = [causes for causes in ranked if shares[causes] >= RARE]
        best: dict[tuple[int, ...], tuple[float, Hypothesis]] = {}
        for weight, hypothesis in zip(posterior.weights, self.hypotheses, strict=False):
            if weight > best.get(hypothesis.causes, (-np.inf, None))[0]:
                best[hypothesis.causes] = weight, hypothesis
        typical = {causes: self._predict(best[causes][1], posterior.mean) for causes in likely}

        def is_explained(causes: tuple[int, ...], other: tuple[int, ...]) -> bool:
            mean = typical[causes]
            gain = best[causes][1].log_ratio(mean) - best[other][1].log_ratio(mean)
            return float(gain) < SEPARATE

        groups: list[list[tuple[int, ...]]] = []
        for causes in likely:
            for group in groups:
                if is_explained(group[0], causes) and is_explained(causes, group[0]):
                    group.append(causes)
                    break
            else:
                groups.append([causes])
        ordered = sorted(groups, key=lambda group: -sum(shares[causes] for causes in group))
        return [tuple(group) for group in ordered], tuple(ranked[len(likely) :])

    def gained_bits(self, posterior: Posterior) -> float:
        """Compute the information of the readings on the cause: posterior relative to prior."""
        logs = posterior.weights - self._log_priors
        bits = float(np.exp(posterior.weights) @ logs)
        disturbed = sum(posterior.not_geometric.values())
        bits += disturbed * np.log(max(disturbed, 1e-300) / PRIOR_NOT_GEOMETRIC)
        return float(bits / np.log(2.0))

    def fitted_values(self, causes: tuple[int, ...], posterior: Posterior) -> Array:
        """Compute the variables of causes out of tolerance, their likeliest values, [V]."""
        places = [at for at, h in enumerate(self.hypotheses) if h.causes == causes]
        hypothesis = self.hypotheses[max(places, key=lambda at: posterior.weights[at])]
        centre, _ = self.moments(hypothesis, posterior.mean)
        basis = np.hstack([self.causes[cause].basis for cause in causes])
        return basis @ centre

    def _predict(self, hypothesis: Hypothesis, mean: Array) -> Array:
        """Return the mean of all coefficients that readings of the fitted cause would produce."""
        centre, _ = self.moments(hypothesis, mean)
        return self.normal.covariance @ (self.normal.information[:, hypothesis.rows] @ centre)


def log_sum(logs: Array) -> float:
    largest = float(np.max(logs))
    return largest + float(np.log(np.sum(np.exp(logs - largest))))
