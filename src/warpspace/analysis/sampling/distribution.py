"""Distribution of a sampled quantity, collected as a stream in bounded memory."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError, SceneError
from warpspace.machine.errors import ToleranceSet
from warpspace.units import Array

EXACT_SAMPLES = 1_000_000  # up to so many samples every value is kept and quantiles are exact
LOWEST_UM, HIGHEST_UM = 1e-3, 1e6
RELATIVE_STEP = 2e-5  # width of a bin of the fine histogram beyond that, relative to the value
_BINS = math.ceil(math.log(HIGHEST_UM / LOWEST_UM) / math.log1p(RELATIVE_STEP))
_SMOOTH_BINS = 2048
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class BinCounts:
    """Counts in bins of equal width."""

    edges_um: Array  # [n + 1]
    counts: NDArray[np.int64]  # [n]


@dataclass(frozen=True, slots=True)
class Probability:
    """Share of machines that stay within a specification."""

    spec_um: float
    probability: float  # share of the samples
    low: float  # wilson score interval at `CONFIDENCE`
    high: float


@dataclass(frozen=True, slots=True)
class PartialSums:
    """Sums, and samples or bins, of some blocks of samples."""

    count: int  # how many samples
    # of each block in order; added up one by one, so that grouping blocks does not change a bit
    sums: tuple[float, ...]
    square_sums: tuple[float, ...]
    largest: float  # µm
    within: int  # samples not above the specification
    values: Array | None  # [count], or None, µm; the samples themselves
    # [n], or None; bins of the fine histogram that are not empty, ascending, and their counts
    bins: NDArray[np.uint32] | None
    counts: NDArray[np.int64] | None


def summarise(
    blocks: Iterable[Array], spec_um: float | None = None, *, keep: bool, count: bool
) -> PartialSums:
    """Summarise one block of samples or more, [n] each, µm."""
    sums: list[float] = []
    squares: list[float] = []
    samples: list[Array] = []
    fine = np.zeros(_BINS + 2, dtype=np.int64) if count else None
    number, within, largest = 0, 0, 0.0
    for values in blocks:
        sums.append(float(values.sum()))
        squares.append(float(values @ values))
        number += len(values)
        largest = max(largest, float(values.max()))
        within += 0 if spec_um is None else int(np.count_nonzero(values <= spec_um))
        if fine is not None:
            bins, counts = np.unique(_fine_bins(values), return_counts=True)
            fine[bins] += counts
        if keep:
            samples.append(values)
    filled = None if fine is None else np.flatnonzero(fine)
    return PartialSums(
        number,
        tuple(sums),
        tuple(squares),
        largest,
        within,
        np.concatenate(samples) if keep else None,
        None if filled is None else filled.astype(np.uint32),
        None if fine is None or filled is None else fine[filled],
    )


class Stream:
    """Accumulator of non-negative samples."""

    def __init__(self, expected: int, spec_um: float | None = None) -> None:
        self.count = 0
        self.spec_um = spec_um
        self._within = 0
        self._sum = self._sum_squares = self.max_um = 0.0
        self._values = np.empty(expected) if expected <= EXACT_SAMPLES else None
        self._fine = np.zeros(_BINS + 2, dtype=np.int64) if self._values is None else None

    def add(self, values: Array) -> None:
        exact = self.exact_quantiles
        self.merge(summarise([values], self.spec_um, keep=exact, count=not exact))

    def merge(self, part: PartialSums) -> None:
        """Merge summarised blocks of samples, in their order."""
        if self._values is not None and part.values is not None:
            self._values[self.count : self.count + part.count] = part.values
        if self._fine is not None and part.bins is not None and part.counts is not None:
            self._fine[part.bins] += part.counts
        self.count += part.count
        for block, squares in zip(part.sums, part.square_sums, strict=True):
            self._sum += block
            self._sum_squares += squares
        self.max_um = max(self.max_um, part.largest)
        self._within += part.within

    @property
    def mean_um(self) -> float:
        return self._sum / self.count

    @property
    def rms_um(self) -> float:
        return math.sqrt(self._sum_squares / self.count)

    @property
    def exact_quantiles(self) -> bool:
        """True if quantiles are those of the samples and not of the fine histogram."""
        return self._values is not None

    def quantile(self, share: float) -> float:
        """Compute a quantile, µm: exact up to a million samples, beyond to 0.002 % of its value."""
        if self._values is not None:
            return float(np.quantile(self._values[: self.count], share))
        assert self._fine is not None  # noqa: S101 - one of both is kept
        index = int(np.searchsorted(np.cumsum(self._fine), share * self.count))
        return min(float(_fine_centres()[index]), self.max_um)

    def histogram(self, edges_um: Array) -> BinCounts:
        """Count the samples in bins with ascending edges, [n + 1], µm."""
        if self._values is not None:
            counts = np.histogram(self._values[: self.count], edges_um)[0]
        else:
            assert self._fine is not None  # noqa: S101
            centres = np.minimum(_fine_centres(), self.max_um)
            counts = np.histogram(centres, edges_um, weights=self._fine)[0]
        return BinCounts(edges_um, counts.astype(np.int64))

    def display_histogram(self) -> BinCounts:
        """Count the samples in 32 to 81 bins of a round width that start at zero."""
        width = round_width(self.max_um / 80.0)
        bins = max(1, math.floor(self.max_um / width) + 1)
        return self.histogram(np.arange(bins + 1, dtype=np.float64) * width)

    def mode_um(self) -> float:
        """Estimate the mode, µm: the peak of a Gaussian kernel estimate.

        Notes
        -----
        Bandwidth: standard deviation times n^(−1/7), the rate that suits a peak; counts in 2048
        bins. With 100,000 samples the mode scatters by about 2.5 % of the standard deviation.
        """
        spread = math.sqrt(max(self.rms_um**2 - self.mean_um**2, 0.0))
        if spread < 1e-9 * max(self.max_um, LOWEST_UM):
            return self.mean_um
        from scipy import ndimage

        edges = np.linspace(0.0, self.max_um * (1.0 + 1e-12), _SMOOTH_BINS + 1, dtype=np.float64)
        bandwidth = spread * self.count ** (-1.0 / 7.0) / edges[1]
        smooth = ndimage.gaussian_filter1d(
            self.histogram(edges).counts.astype(float), bandwidth, mode="constant"
        )
        peak = int(np.argmax(smooth))
        return float((edges[peak] + edges[peak + 1]) / 2.0)

    def probability(self) -> Probability | None:
        """Compute the share within the limit; None without one."""
        if self.spec_um is None:
            return None
        from scipy import stats

        interval = stats.binomtest(self._within, self.count).proportion_ci(
            CONFIDENCE, method="wilson"
        )
        share = self._within / self.count
        return Probability(self.spec_um, share, float(interval.low), float(interval.high))


def machines_needed(samples: int, probability: float) -> int:
    """Compute the number of machines within a limit that proves a share of the population."""
    from scipy import special

    deviation = special.ndtri(0.5 + CONFIDENCE / 2.0)
    spread = math.sqrt(samples * probability * (1.0 - probability))
    return math.ceil(samples * probability + deviation * spread)


def round_width(least: float) -> float:
    """Round up to 1, 2 or 5 × 10ⁿ; 1 for zero."""
    if not least > 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(least))
    return decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= least)


def _fine_bins(values: Array) -> NDArray[np.int64]:
    with np.errstate(divide="ignore"):
        position = np.log(values / LOWEST_UM) / math.log1p(RELATIVE_STEP)
    return np.clip(np.floor(position) + 1.0, 0, _BINS + 1).astype(np.int64)


def _fine_centres() -> Array:
    inner = LOWEST_UM * np.exp((np.arange(_BINS) + 0.5) * math.log1p(RELATIVE_STEP))
    return np.concatenate([[0.0], inner, [HIGHEST_UM]])


SIGMAS = 3.0
"""Standard deviations of a normal distribution between centre and limit (thesis, section 4.3)."""


class Distribution(StrEnum):
    """Distribution of a parameter within its tolerance."""

    UNIFORM = "uniform"
    NORMAL = "normal"


@dataclass(frozen=True, slots=True)
class Draws:
    """Independent random values of a machine's parameters."""

    keys: tuple[str, ...]  # (K,); parameter keys
    centre: Array  # [K], µm or µrad
    half_width: Array
    # uniform over centre ± half width, or normal with 3σ = half width
    distribution: Distribution = Distribution.UNIFORM
    # whether the normal distribution ends at the limits (values outside are drawn again); without
    # it 0.27 % lie outside. Without effect on the uniform one.
    clip: bool = False

    @property
    def variance(self) -> Array:
        """Variance of each parameter, [K], µm² or µrad²."""
        if self.distribution is Distribution.UNIFORM:
            return self.half_width**2 / 3.0
        sigma = self.half_width / SIGMAS
        if not self.clip:
            return sigma**2
        from scipy import special

        inside = 1.0 - 2.0 * float(special.ndtr(-SIGMAS))
        density = math.exp(-(SIGMAS**2) / 2.0) / math.sqrt(2.0 * math.pi)
        return sigma**2 * (1.0 - 2.0 * SIGMAS * density / inside)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draw machines, [count, K], µm or µrad."""
        shape = (count, len(self.keys))
        if self.distribution is Distribution.UNIFORM:
            return self.centre + self.half_width * rng.uniform(-1.0, 1.0, shape)
        unit = rng.standard_normal(shape)
        while self.clip and (outside := np.abs(unit) > SIGMAS).any():
            unit[outside] = rng.standard_normal(int(outside.sum()))
        return self.centre + self.half_width / SIGMAS * unit

    def from_unit(self, unit: Array) -> Array:
        """Map numbers between 0 and 1, [..., K], to values through the inverse distribution."""
        if self.distribution is Distribution.UNIFORM:
            return self.centre + self.half_width * (2.0 * unit - 1.0)
        from scipy import special

        tail = float(special.ndtr(-SIGMAS)) if self.clip else 1e-12
        return self.centre + self.half_width / SIGMAS * special.ndtri(
            tail + unit * (1.0 - 2.0 * tail)
        )


def choose_distribution(word: Distribution | str) -> Distribution:
    if word not in [*Distribution]:
        raise OptionError(f"distribution {word!r}; expected one of {', '.join(Distribution)}")
    return Distribution(word)


def build_draws(
    tolerances: ToleranceSet,
    keys: Sequence[str],
    distribution: Distribution | str = Distribution.UNIFORM,
    *,
    clip: bool = False,
    source: str = "tolerances",
) -> Draws:
    kind = choose_distribution(distribution)
    if not tolerances:
        problem = (
            "has no tolerances to sample machines from; expected a [tolerances] section, for"
            " instance default = { translation = 10, rotation = 20, squareness = 25 }"
        )
        raise SceneError(source, [problem])
    missing = tolerances.missing(keys)
    if missing:
        problem = (
            f"tolerances: no half width for {', '.join(missing)}; expected one for each parameter"
            " of the loop, or a default for its class (0 holds it at its centre)"
        )
        raise SceneError(source, [problem])
    ranges = [tolerance for tolerance in map(tolerances.get, keys) if tolerance is not None]
    for key, tolerance in zip(keys, ranges, strict=True):
        if not tolerance.half_width >= 0.0:
            raise SceneError(
                source, [f"tolerances.{key}: half width {tolerance.half_width:g}; expected ≥ 0"]
            )
    return Draws(
        tuple(keys),
        np.array([tolerance.centre for tolerance in ranges], dtype=float),
        np.array([tolerance.half_width for tolerance in ranges], dtype=float),
        kind,
        clip,
    )
