"""The distribution of a sampled quantity, collected as a stream in bounded memory."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

from warpspace.units import Array

EXACT_SAMPLES = 1_000_000
"""Up to so many samples every value is kept and quantiles are exact."""
LOWEST_UM, HIGHEST_UM = 1e-3, 1e6
RELATIVE_STEP = 2e-5
"""Width of a bin of the fine histogram beyond that, relative to the value."""
_BINS = math.ceil(math.log(HIGHEST_UM / LOWEST_UM) / math.log1p(RELATIVE_STEP))
_SMOOTH_BINS = 2048
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Histogram:
    """Counts in bins of equal width.

    Attributes
    ----------
    edges_um : ndarray, [n + 1], µm
    counts : ndarray of int, [n]
    """

    edges_um: Array
    counts: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Probability:
    """Share of machines that stay within a specification.

    Attributes
    ----------
    spec_um : float, µm
    probability : float
        Share of the samples.
    low, high : float
        Wilson score interval at `CONFIDENCE`.
    """

    spec_um: float
    probability: float
    low: float
    high: float


class Stream:
    """Collects samples that are not negative.

    Parameters
    ----------
    expected : int
        How many samples will come; decides between exact quantiles and the fine histogram.
    spec_um : float, optional
        A specification; samples not above it are counted.
    """

    def __init__(self, expected: int, spec_um: float | None = None) -> None:
        self.count = 0
        self.spec_um = spec_um
        self._within = 0
        self._sum = self._sum_squares = self._largest = 0.0
        self._values = np.empty(expected) if expected <= EXACT_SAMPLES else None
        self._fine = np.zeros(_BINS + 2, dtype=np.int64) if self._values is None else None

    def add(self, values: Array) -> None:
        """Take in samples, [n], µm."""
        if self._values is not None:
            self._values[self.count : self.count + len(values)] = values
        if self._fine is not None:
            with np.errstate(divide="ignore"):
                position = np.log(values / LOWEST_UM) / math.log1p(RELATIVE_STEP)
            index = np.clip(np.floor(position) + 1.0, 0, _BINS + 1).astype(np.int64)
            self._fine += np.bincount(index, minlength=_BINS + 2)
        self.count += len(values)
        self._sum += float(values.sum())
        self._sum_squares += float(values @ values)
        self._largest = max(self._largest, float(values.max()))
        if self.spec_um is not None:
            self._within += int(np.count_nonzero(values <= self.spec_um))

    @property
    def mean_um(self) -> float:
        """Mean, µm."""
        return self._sum / self.count

    @property
    def rms_um(self) -> float:
        """Root mean square, µm."""
        return math.sqrt(self._sum_squares / self.count)

    @property
    def max_um(self) -> float:
        """Largest sample, µm."""
        return self._largest

    @property
    def exact_quantiles(self) -> bool:
        """Whether quantiles are those of the samples and not of the fine histogram."""
        return self._values is not None

    def quantile(self, share: float) -> float:
        """Give a quantile, µm: exact up to a million samples, beyond to 0.002 % of its value."""
        if self._values is not None:
            return float(np.quantile(self._values[: self.count], share))
        assert self._fine is not None  # noqa: S101 - one of both is kept
        index = int(np.searchsorted(np.cumsum(self._fine), share * self.count))
        return min(float(_fine_centres()[index]), self._largest)

    def histogram(self, edges_um: Array) -> Histogram:
        """Count the samples in bins; beyond a million samples as exact as the fine histogram.

        Parameters
        ----------
        edges_um : ndarray, [n + 1], µm
            Ascending.
        """
        if self._values is not None:
            counts = np.histogram(self._values[: self.count], edges_um)[0]
        else:
            assert self._fine is not None  # noqa: S101
            centres = np.minimum(_fine_centres(), self._largest)
            counts = np.histogram(centres, edges_um, weights=self._fine)[0]
        return Histogram(edges_um, counts.astype(np.int64))

    def display_histogram(self) -> Histogram:
        """Count the samples in 32 to 81 bins of a round width that start at zero."""
        width = round_width(self._largest / 80.0)
        bins = max(1, math.floor(self._largest / width) + 1)
        return self.histogram(np.arange(bins + 1, dtype=np.float64) * width)

    def mode_um(self) -> float:
        """Give the most frequent value, µm: the peak of a Gaussian kernel estimate.

        Notes
        -----
        Bandwidth: standard deviation times n^(−1/7), the rate that suits a peak; counts in 2048
        bins. With 100,000 samples the mode scatters by about 2.5 % of the standard deviation.
        """
        spread = math.sqrt(max(self.rms_um**2 - self.mean_um**2, 0.0))
        if spread < 1e-9 * max(self._largest, LOWEST_UM):
            return self.mean_um
        edges = np.linspace(0.0, self._largest * (1.0 + 1e-12), _SMOOTH_BINS + 1, dtype=np.float64)
        bandwidth = spread * self.count ** (-1.0 / 7.0) / edges[1]
        smooth = ndimage.gaussian_filter1d(
            self.histogram(edges).counts.astype(float), bandwidth, mode="constant"
        )
        peak = int(np.argmax(smooth))
        return float((edges[peak] + edges[peak + 1]) / 2.0)

    def probability(self) -> Probability | None:
        """Give the share within the specification; None without one."""
        if self.spec_um is None:
            return None
        interval = stats.binomtest(self._within, self.count).proportion_ci(
            CONFIDENCE, method="wilson"
        )
        share = self._within / self.count
        return Probability(self.spec_um, share, float(interval.low), float(interval.high))


def round_width(least: float) -> float:
    """Give the smallest of 1, 2, 5 × 10ⁿ that is not below a number; 1 for zero."""
    if not least > 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(least))
    return decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= least)


def _fine_centres() -> Array:
    """Middle of every bin of the fine histogram, the first and last being what lies beyond, µm."""
    inner = LOWEST_UM * np.exp((np.arange(_BINS) + 0.5) * math.log1p(RELATIVE_STEP))
    return np.concatenate([[0.0], inner, [HIGHEST_UM]])
