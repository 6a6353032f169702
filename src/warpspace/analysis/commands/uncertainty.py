"""Uncertainty of the error map of a machine, its conformity with a limit, and its budget."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, ProgressCallback, Result
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, option, place_words
from warpspace.analysis.statistics import P95, Statistics, volume_statistics
from warpspace.analysis.uncertainty.propagation import (
    COVERAGE,
    NAMES,
    NOT_STATED,
    FieldUncertainty,
    plus_minus,
    volume_uncertainty,
)
from warpspace.field.grid import DEFAULT_NODES, build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Covariance
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene, choose_view, evaluate_grid
from warpspace.units import Array, Integers

MOSTLY = 50.0  # percent of the volume
SAMPLED_NODES = 11  # per axis at which machines are drawn, unless they verify statistics
MOST_SHARES = 10  # errors that the table of the largest shares has


@dataclass(frozen=True, kw_only=True)
class Uncertainty(Analysis):
    """Report the expanded uncertainty of the error map.

    U95 of mean, RMS, P95 and max of |E| from what the scene states of the uncertainty of its
    errors; the probability that the machine keeps a limit, at its worst point and everywhere, by
    machines drawn from that; how much of the map is significant, |E| above its own U95; which part
    lies beyond the positions that were measured; and which errors the uncertainty comes from.
    """

    name = "uncertainty"
    task = "understand"
    doing = "drawing machines"
    has_table = True
    limit_um: float | None = option(
        None, "Largest |E| accepted", unit="µm", low=0.001, high=MAX_ERROR, flag="--limit",
        unset="that of the scene",
    )  # fmt: skip
    verify: bool = option(False, "Monte Carlo beside the linear propagation")
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    nodes: int = option(
        DEFAULT_NODES, "Nodes per axis of the working volume", low=2, high=21, flag="--grid"
    )
    samples: int = option(10_000, "Number of machines drawn", low=100, high=1_000_000)
    seed: int = option(0, "Seed of the random numbers", low=0, high=2**63 - 1)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "UncertaintyResult":
        view = choose_view(scene, self.loop)
        grid = build_grid(scene.model, scene.workspace, self.nodes)
        uncertainty = volume_uncertainty(scene, view, self.nodes)
        limit = scene.limit_um if self.limit_um is None else self.limit_um
        statistics = volume_statistics(evaluate_grid(scene, grid, view), grid)
        beyond = (scene.covariance or Covariance((), ())).outside(grid.coordinates, grid.shape)
        result = UncertaintyResult(
            limit_um=limit,
            statistics=uncertainty.with_expanded_uncertainty(statistics)
            if uncertainty
            else statistics,
            never_measured_percent=100.0 * float(grid.weights[beyond].sum()),
            k=uncertainty and uncertainty.errors.factor,
            unknown=uncertainty.errors.unknown if uncertainty else [*scene.errors],
            remarks=tuple(uncertainty.errors.remarks()) if uncertainty else (NOT_STATED,),
            title=f"{scene.title} · {view.loop} loop",
        )
        if uncertainty is None or not uncertainty.errors.is_known:
            return result
        above = uncertainty.norm_um > uncertainty.u95_norm_um
        significant = 100.0 * float(grid.weights[above].sum())
        result = replace(result, significant_percent=significant, shares=_shares(uncertainty))
        if limit is None and not self.verify:
            return result
        worst, drawn = int(np.argmax(uncertainty.norm_um)), list[Array]()
        nodes = selected_nodes(grid.shape, max(grid.shape) if self.verify else SAMPLED_NODES)
        for norm in uncertainty.machines(self.samples, self.seed, np.append(nodes, worst)):
            summaries = _three(norm[:, :-1], grid.weights.reshape(-1)) if self.verify else ()
            drawn.append(np.stack([norm[:, -1], *summaries, norm.max(axis=1)]))
            watch(min(sum(part.shape[1] for part in drawn) / self.samples, 1.0))
        at_worst, *numbers = np.concatenate(drawn, axis=1)
        return replace(
            result,
            probability_worst=limit and float(np.mean(at_worst <= limit)),
            probability_everywhere=limit and float(np.mean(numbers[-1] <= limit)),
            montecarlo=dict(zip(NAMES, map(_spread, numbers), strict=True)) if self.verify else {},
        )


def selected_nodes(shape: Sequence[int], most: int) -> Integers:
    """Select nodes of a grid, evenly spaced, as flat indices: both ends and at most so many."""
    lines = [np.linspace(0, size - 1, min(size, most)).round().astype(int) for size in shape]
    return np.ravel_multi_index(np.ix_(*lines), shape).reshape(-1)


def _three(norm: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Compute mean, RMS and P95 of machines, [n] each, from their |E|, [n, N]."""
    order = np.argsort(norm, axis=1)
    place = np.argmax(np.cumsum(weights[order], axis=1) >= P95, axis=1)
    p95 = norm[range(len(norm)), order[range(len(norm)), place]]
    return norm @ weights, np.sqrt(norm**2 @ weights), p95


def _spread(drawn: Array) -> Mapping[str, float]:
    low, high = np.quantile(drawn, (0.5 - COVERAGE / 2.0, 0.5 + COVERAGE / 2.0))
    return {"mean_um": float(drawn.mean()), "u95_um": float(high - low) / 2.0}


def _shares(field: FieldUncertainty) -> list[Mapping[str, Any]]:
    mean, _, _, largest = field.gradients
    of_mean, errors = field.variance_shares(mean), field.errors
    u = dict(zip(errors.keys, np.diagonal(errors.covariance) ** 0.5, strict=True))
    return [
        {"key": key, "u": float(u[key]), "percent_of_max": 100.0 * part,
         "percent_of_mean": 100.0 * of_mean[key]}
        for key, part in field.variance_shares(largest).items()
    ]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class UncertaintyResult(Result):
    """Uncertainty of an error map; None where unknown or not requested."""

    json_keys = (
        "limit_um", "statistics", "k", "unknown", "probability_worst", "probability_everywhere",
        "significant_percent", "never_measured_percent", "shares", "montecarlo",
    )  # fmt: skip
    limit_um: float | None
    statistics: Statistics  # of |E| over the volume
    probability_worst: float | None = None  # that the limit is kept where |E| is largest
    probability_everywhere: float | None = None
    significant_percent: float | None = None  # of the volume, where |E| is above its U95
    never_measured_percent: float  # of the volume, beyond the positions of the data
    montecarlo: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    k: float | None  # U95 / u
    unknown: Sequence[str]  # errors of which nobody says how sure they are
    shares: Sequence[Mapping[str, Any]] = ()  # in the variances of largest and mean |E|
    remarks: tuple[str, ...]
    title: str

    def blocks(self) -> Iterator[Block]:
        yield self.title + (f" · U95 with k = {self.k:.3g}" if self.k else "")
        drawn = self.montecarlo
        columns = (
            Column("|E|", leads=True, key="of"),
            Column("value", ".2f", "µm", key="value_um"),
            Column("U95", unit="µm"),
            Column(key="u95_um", shows=False),
            *number_columns(("Monte Carlo: mean", "U95") if drawn else (), unit="µm"),
            *number_columns(("difference",) if drawn else (), "+.1f", "%"),
        )
        rows: list[tuple[Any, ...]] = []
        for name, label in NAMES.items():
            u95 = self.statistics.expanded_uncertainty.get(f"u95_{name}")
            row = (label, getattr(self.statistics, name), plus_minus(u95), u95)
            if drawn:
                mean, drawn_u95 = drawn[name].values()
                difference = 100.0 * (drawn_u95 / u95 - 1.0) if u95 else None
                row = (*row, mean, drawn_u95, difference)
            rows.append(row)
        yield Table(columns, rows)
        yield from (f"  {label}" for label in self.remarks)
        if self.probability_worst is not None and self.probability_everywhere is not None:
            yield (
                f"  |E| ≤ {self.limit_um:g} µm with {100.0 * self.probability_worst:.1f} % at the"
                f" worst point, {place_words(self.statistics.max_at_axes)};"
                f" with {100.0 * self.probability_everywhere:.1f} % everywhere"
            )
        if self.significant_percent is not None:
            yield f"  |E| is above its own U95 in {self.significant_percent:.1f} % of the volume"
            if self.significant_percent < MOSTLY:
                yield "  below it the first order does not suffice: verify by Monte Carlo"
        if self.never_measured_percent:
            yield f"  {self.never_measured_percent:.1f} % of the volume was never measured"
        numbers = Column("u", ".3g"), *number_columns(("of max", "of mean"), ".1f", "%")
        each = (share.values() for share in self.shares[:MOST_SHARES])
        rows = [(key, parameter(key).unit, *three) for key, *three in each]
        if rows:
            title = "Uncertainty budget, in shares of the variance:"
            yield Table((Column("error", leads=True), Column("unit"), *numbers), rows, title)
