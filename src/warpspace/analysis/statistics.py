"""Statistics of an error field, over its volume or over points; those of measured machines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as attribute
from typing import TypeAlias

import numpy as np

from warpspace.analysis.description import ExpandedUncertainty
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorField
from warpspace.field.grid import DEFAULT_NODES, Grid, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import PARAMETERS, parameter
from warpspace.machine.errors import ErrorSet, ToleranceSet
from warpspace.scene.model import Scene, choose_view, evaluate_grid
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


def statistics(
    field: ErrorField, axes: Mapping[str, Array] | None = None, shares: Array | None = None
) -> Statistics:
    """Summarise points, of equal weights or of given shares, [n], whose sum is 1."""
    norm = field.norm_um
    if norm.size == 0:
        raise OptionError("statistics of no points; expected at least one")
    flat = norm.reshape(-1)
    if shares is not None:
        rms = float(np.sqrt(shares @ (flat * flat)))
        p95 = _weighted_p95(flat, shares)
        return _summed_up(norm, float(shares @ flat), rms, p95, field.nominal_mm, axes or {})
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


def _weighted_p95(values: Array, shares: Array) -> float:
    """Interpolate between values, each of which lies amid its share."""
    top = np.flatnonzero(values >= np.quantile(values[::SAMPLED], 0.85))
    if shares[top].sum() < 2.0 * (1.0 - P95):
        top = np.arange(values.size)
    order = top[np.argsort(values[top])]
    place = 1.0 - np.cumsum(shares[order][::-1])[::-1] + shares[order] / 2.0
    return float(np.interp(P95, place, values[order]))


# Measured machines: errors against tolerances, and the predicted volumetric error.

THESIS_NODES = 11  # per axis; each node counts once
SHEARS = {"XY": (0, 1, -1.0), "XZ": (0, 2, 1.0), "YZ": (1, 2, -1.0)}


@dataclass(frozen=True, slots=True)
class Check:
    """One measured error against its tolerance."""

    key: str
    value: float  # µm or µrad
    centre: float | None  # µm or µrad; the tolerance; None where there is none
    half_width: float | None

    @property
    def unit(self) -> str:
        return parameter(self.key).unit

    @property
    def passes(self) -> bool | None:
        """Verdict: within the tolerance, limits included; None without one."""
        if self.centre is None or self.half_width is None:
            return None
        return bool(abs(self.value - self.centre) <= self.half_width * (1.0 + 1e-12))


@dataclass(frozen=True, slots=True)
class Measured:
    """A measured machine."""

    checks: tuple[Check, ...]  # one per error of the set
    predicted: Statistics  # |E| of the loop over the working volume
    # the same over 11³ nodes, each with the same weight, as in the thesis
    predicted_nodes: Statistics
    # angle by which the volume is out of square per plane, in the sign of the squareness parameter;
    # out of a least-squares affine fit to the whole map
    shear_urad: dict[str, float]


def check_errors(errors: ErrorSet, tolerances: ToleranceSet) -> tuple[Check, ...]:
    rows: list[Check] = []
    for key in (key for key in PARAMETERS if key in errors.functions):
        tolerance = tolerances.get(key)
        limits = (None, None) if tolerance is None else (tolerance.centre, tolerance.half_width)
        rows.append(Check(key, errors.amplitude(key), *limits))
    return tuple(rows)


def measured(
    scene: Scene,
    *,
    tolerances: ToleranceSet | None = None,
    loop: Loop | str | None = None,
    grid: int | Sequence[int] = DEFAULT_NODES,
) -> Measured:
    """Check the errors of a scene against tolerances and predict its volumetric error.

    Parameters
    ----------
    scene : Scene
    tolerances : ToleranceSet, optional
        The scene's own by default.
    loop : Loop or str, optional
    grid : int or sequence of int, (3,), optional
        Nodes per axis of the predicted map.

    Returns
    -------
    Measured
    """
    nodes, of_thesis = (
        build_grid(scene.model, scene.workspace, count) for count in (grid, THESIS_NODES)
    )
    view = choose_view(scene, loop)
    field = evaluate_grid(scene, nodes, view)
    return Measured(
        check_errors(scene.errors, scene.tolerances if tolerances is None else tolerances),
        volume_statistics(field, nodes),
        statistics(evaluate_grid(scene, of_thesis, view), of_thesis.coordinates),
        shear(field),
    )


def shear(field: ErrorField) -> dict[str, float]:
    point = field.nominal_mm.reshape(-1, 3)
    design = np.column_stack([np.ones(len(point)), point - point.mean(axis=0)])
    error = field.error_um.reshape(-1, 3)
    gradient = 1e3 * np.linalg.lstsq(design, error, rcond=None)[0][1:].T
    return {
        plane: float(sign * (gradient[first, second] + gradient[second, first]))
        for plane, (first, second, sign) in SHEARS.items()
    }
