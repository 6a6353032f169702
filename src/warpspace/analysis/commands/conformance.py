"""Conformance share: the part of the volume within a limit, and the largest box within it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, ExpandedUncertainty, ProgressCallback, Result
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, option
from warpspace.analysis.statistics import share_below, share_within
from warpspace.analysis.uncertainty.propagation import field_uncertainty, plus_minus
from warpspace.exceptions import OptionError
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.model import Scene, choose_view, evaluate_grid
from warpspace.units import Array

SHARES = (0.25, 0.5, 0.75, 1.0)  # of the volume, whose limits are reported


@dataclass(frozen=True, kw_only=True)
class Conformance(Analysis):
    """Compute the share of the volume of SCENE within a limit.

    A box between nodes of the grid is within the limit if all its corners are. The result contains
    the share of the volume, the largest box of axis ranges within the limit, and the limits for
    given shares of the volume.
    """

    name = "conformance"
    task = "understand"
    has_table = True
    limit_um: float | None = option(
        None, "Largest |E| accepted", unit="µm", low=0.001, high=MAX_ERROR, flag="--limit",
        unset="that of the scene",
    )  # fmt: skip
    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    nodes: int = option(21, "Nodes per axis of the working volume", low=2, high=61, flag="--grid")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ConformanceResult":
        grid = build_grid(scene.model, scene.workspace, self.nodes)
        view = choose_view(scene, self.loop)
        field = evaluate_grid(scene, grid, view)
        watch(0.3)
        axes = scene.workspace.volume_axes
        limit = scene.limit_um if self.limit_um is None else self.limit_um
        if limit is None:
            raise OptionError("{limit_um}: the scene sets no limit; set one")
        if not any(axes):
            raise OptionError("{limit_um}: the working volume of the scene is a point")
        keeps = field.norm_um <= limit
        ranges = scene.workspace.ranges
        lengths = [float(np.ptp(ranges[axis])) if axis else 0.0 for axis in axes]
        box_nodes = largest_box(keeps, lengths)
        watch(0.9)
        box = None
        if box_nodes is not None:
            box = {
                axis: _span(ranges[axis], ends, count)
                for axis, ends, count in zip(axes, box_nodes, keeps.shape, strict=True)
                if axis
            }
        uncertainty = field_uncertainty(
            scene, field.error_um, grid.coordinates, view, grid.point_mm
        )

        def shares(error_um: Array) -> Array:
            moved = replace(field, error_um=error_um)
            keeps = (share_within(moved, part) for part in SHARES)
            return np.array([100.0 * share_below(moved, limit), *keeps])

        percent, *keeps_um = shares(field.error_um).tolist()
        u95, *u95_um = uncertainty.propagate(shares) if uncertainty else [None] * (1 + len(SHARES))
        names = [f"{part:.0%}" for part in SHARES]
        expanded = ExpandedUncertainty[Any]()
        if uncertainty:
            expanded["u95_percent"] = u95
            expanded["u95_keeps_um"] = dict(zip(names, u95_um, strict=True))
        return ConformanceResult(
            limit_um=limit,
            percent=percent,
            box=box,
            keeps_um=dict(zip(names, keeps_um, strict=True)),
            expanded_uncertainty=expanded,
            uncertainty=uncertainty and uncertainty.errors,
            title=scene.title,
            loop=view.loop,
            ranges={axis: ranges[axis] for axis in axes if axis},
        )


@dataclass(frozen=True, kw_only=True)
class ConformanceResult(Result):
    """Part of a volume within a limit."""

    json_keys = ("limit_um", "percent", "box", "keeps_um", "expanded_uncertainty")
    limit_um: float
    percent: float  # of the volume
    box: Mapping[str, tuple[float, float]] | None  # axis ranges, mm or degrees
    keeps_um: Mapping[str, float]  # limit by part of the volume
    expanded_uncertainty: ExpandedUncertainty[Any]  # of percent and of these
    title: str
    loop: Loop
    ranges: Mapping[str, tuple[float, float]]

    def blocks(self) -> Iterator[Block]:
        about = (
            f" {plus_minus(self.expanded_uncertainty['u95_percent'], '.1f')}"
            if self.expanded_uncertainty
            else ""
        )
        share = f"{self.percent:.1f}{about} %"
        yield f"{self.title} · {self.loop} loop · {share} of the volume within {self.limit_um:g} µm"
        if self.box is None:
            yield "  no box between nodes of the grid is within the limit"
        else:
            columns = (
                Column("axis", leads=True, key="axis"),
                *number_columns(("from", "to"), ".1f", keys=("from", "to")),
                Column("of", ".0f", "%", key="percent_of_range"),
                Column("unit", key="unit"),
            )
            rows = [
                (axis, low, high, 100.0 * (high - low) / float(np.ptp(self.ranges[axis])),
                 "mm" if is_linear(axis) else "°")
                for axis, (low, high) in self.box.items()
            ]  # fmt: skip
            yield Table(columns, rows, title="Largest box within the limit:")
        columns = (Column("share", leads=True), Column("limit", ".2f", "µm"))
        rows = [*self.keeps_um.items()]
        if self.expanded_uncertainty:
            columns += (Column("U95", unit="µm"),)
            rows = [
                (*row, plus_minus(self.expanded_uncertainty["u95_keeps_um"][row[0]]))
                for row in rows
            ]
        yield Table(columns, rows, title="Limit for a share of the volume:")


def largest_box(
    keeps: NDArray[np.bool_], lengths: list[float]
) -> tuple[tuple[int, int], ...] | None:
    """Find the largest box whose nodes are all within a limit: first and last node of each axis."""
    largest, box = 0.0, None
    steps = [length / max(count - 1, 1) for length, count in zip(lengths, keeps.shape, strict=True)]
    pairs = [[(i, j) for i in range(n) for j in range(i + (n > 1), n)] for n in keeps.shape]
    for x in pairs[0]:
        slab = np.all(keeps[x[0] : x[1] + 1], axis=0)
        for y in pairs[1]:
            size = _extent(x, steps[0]) * _extent(y, steps[1])
            if size * max(lengths[2], 1.0) <= largest:
                continue
            z = _longest_run(np.all(slab[y[0] : y[1] + 1], axis=0))
            if z is not None and size * _extent(z, steps[2]) > largest:
                largest, box = size * _extent(z, steps[2]), (x, y, z)
    return box


def _longest_run(row: NDArray[np.bool_]) -> tuple[int, int] | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2] - 1
    if not len(starts):
        return None
    longest = int(np.argmax(ends - starts))
    run = int(starts[longest]), int(ends[longest])
    return run if run[1] > run[0] or len(row) == 1 else None


def _extent(ends: tuple[int, int], step: float) -> float:
    return (ends[1] - ends[0]) * step or 1.0


def _span(ends: tuple[float, float], nodes: tuple[int, int], count: int) -> tuple[float, float]:
    low, high = ends
    first, last = (low + (high - low) * node / max(count - 1, 1) for node in nodes)
    return first, last
