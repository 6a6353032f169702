"""Statistics of an error field: over the volume it fills, or over points as they are."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import TypeAlias

import numpy as np

from warpspace.analysis.description import ExpandedUncertainty
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import Grid
from warpspace.units import Array

Numbers: TypeAlias = Mapping[str, float | None]
P95 = 0.95
SAMPLED = 61


@dataclass(frozen=True, slots=True)
class Summary:
    """The length of position errors: over a volume, over points, over machines."""

    mean_um: float  # mean, root mean square, 95th percentile and largest
    rms_um: float
    p95_um: float
    max_um: float
    # of these, u95_mean_um and so on, µm
    expanded_uncertainty: ExpandedUncertainty[float | None] = attribute(
        default_factory=ExpandedUncertainty[float | None], kw_only=True
    )

    @property
    def three(self) -> tuple[float, float, float]:
        return self.mean_um, self.rms_um, self.max_um

    @property
    def four(self) -> tuple[float, float, float, float]:
        return self.mean_um, self.rms_um, self.p95_um, self.max_um


@dataclass(frozen=True, slots=True)
class Statistics(Summary):
    """Summary of a field."""

    max_at_mm: tuple[float, float, float]  # nominal point in R of the largest
    # mm or degrees; axis positions there; empty where the field came without any
    max_at_axes: Mapping[str, float] = attribute(default_factory=dict)


def volume_statistics(field: ErrorField, grid: Grid) -> Statistics:
    """Summarise the volume that a grid fills, whatever the number of its nodes."""
    norm, cells = field.norm_um.reshape(grid.shape), field.cells_um.reshape(-1)
    return _summed_up(
        norm,
        volume_mean(norm, grid),
        float(np.sqrt(np.sum(grid.weights * norm * norm))),
        _percentile(cells, P95 * cells.size - 0.5),
        grid.nominal_mm,
        grid.coordinates,
    )


def volume_mean(values: Array, grid: Grid) -> float:
    """Compute the mean over the volume of a grid, of values at its nodes."""
    return float(np.sum(grid.weights * values.reshape(grid.shape)))


def statistics(field: ErrorField, axes: Mapping[str, Array] | None = None) -> Statistics:
    norm = field.norm_um
    if norm.size == 0:
        raise OptionError("statistics of no points; expected at least one")
    flat = norm.reshape(-1)
    rms = float(np.sqrt(flat @ flat / flat.size))
    p95 = _percentile(flat, P95 * (flat.size - 1))
    return _summed_up(norm, float(flat.mean()), rms, p95, field.nominal_mm, axes or {})


def _summed_up(
    norm: Array, mean: float, rms: float, p95: float, nominal: Array, axes: Mapping[str, Array]
) -> Statistics:
    worst = np.unravel_index(int(np.argmax(norm)), norm.shape)
    x, y, z = (float(value) for value in nominal[worst])
    at = {name: float(np.broadcast_to(q, norm.shape)[worst]) for name, q in axes.items()}
    return Statistics(mean, rms, p95, float(norm[worst]), (x, y, z), at)


def share_within(field: ErrorField, share: float) -> float:
    """Compute the limit of a share of the volume, µm; |E| is interpolated between nodes."""
    cells = field.cells_um.reshape(-1)
    within = _percentile(cells, share * cells.size - 0.5)
    return float(field.norm_um.max()) if share >= 1.0 else within


def share_below(field: ErrorField, limit_um: float) -> float:
    """Compute the share of the volume within a limit; |E| is interpolated between nodes."""
    if field.norm_um.max() <= limit_um:
        return 1.0
    return np.count_nonzero(field.cells_um <= limit_um) / field.cells_um.size


def _percentile(values: Array, place: float) -> float:
    """Interpolate between the two values next to a rank, counted from 0."""
    place = min(max(place, 0.0), values.size - 1.0)
    below = int(place)
    above = min(below + 1, values.size - 1)
    # those far below that place, as a sample tells, are only counted: five times as fast
    sample = np.sort(values[::SAMPLED])
    top = values[values > sample[int(sample.size * max(place / values.size - 0.05, 0.0))]]
    counted = values.size - top.size
    if counted > below:
        top, counted = values, 0
    low, high = np.partition(top, (below - counted, above - counted))[
        [below - counted, above - counted]
    ]
    return float(low + (place - below) * (high - low))
