"""Search for the best values of errors over the volume, for one set and for the best sets."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from itertools import combinations
from math import comb
from typing import Any, cast

import numpy as np

from warpspace.analysis.integer_program import solve_integer_program
from warpspace.analysis.statistics import Statistics, volume_statistics
from warpspace.field.evaluate import ErrorBasis
from warpspace.field.grid import Grid
from warpspace.units import Array

NODES_REDUCED = 1000  # nodes whose rows are reduced at a time, so that memory stays small
SILENT = 1e-12  # µm per µm or µrad: a response below it everywhere is none
CLOSE_UM = 1e-4  # the largest error is found to within this of the least there can be, µm
NODES_AT_ONCE = 40  # worst nodes for which planes are added in one step
MOST_STEPS = 300


@dataclass(frozen=True)
class Volume:
    """Response of all nodes of a volume, and the present errors."""

    basis: ErrorBasis  # First-order response of the nodes of `grid`
    grid: Grid
    amplitudes: Array  # [K], µm or µrad; present values in the order of `basis.keys`

    @cached_property
    def response(self) -> Array:
        """Response of every node, [K, N, 3], µm per µm or µrad."""
        return self.basis.position.reshape(len(self.basis.keys), self.grid.weights.size, 3)

    @cached_property
    def error_um(self) -> Array:
        """Present error of every node, [N, 3], µm."""
        return np.tensordot(self.amplitudes, self.response, 1)

    @cached_property
    def square_um2(self) -> Array:
        """Present squared length of every node's error, [N], µm²."""
        return np.einsum("nc,nc->n", self.error_um, self.error_um)

    @cached_property
    def active_indices(self) -> tuple[int, ...]:
        """Indices of the errors that move any node at all in this loop."""
        largest = np.abs(self.response).max(axis=(1, 2), initial=0.0)
        return tuple(int(index) for index in np.flatnonzero(largest > SILENT))

    @cached_property
    def triangle(self) -> tuple[Array, Array]:
        """Reduced rows that determine the RMS: a matrix, [M, K], and the present error, [M]."""
        nodes = self.error_um.shape[0]
        root = np.sqrt(self.grid.weights.reshape(-1))
        triangle = np.empty((0, len(self.basis.keys) + 1))
        for first in range(0, nodes, NODES_REDUCED):
            part = slice(first, first + NODES_REDUCED)
            columns = [*self.response[:, part], self.error_um[part]]
            rows = [(column * root[part, None]).reshape(-1) for column in columns]
            stacked = np.concatenate([triangle, np.array(rows).T])
            triangle = cast("Array", np.linalg.qr(stacked, mode="r"))
        return triangle[:, :-1], triangle[:, -1]

    def changed(self, indices: tuple[int, ...], values: Array) -> Array:
        """Return all amplitudes with some of them replaced, [K], µm or µrad."""
        amplitudes = self.amplitudes.copy()
        amplitudes[list(indices)] = values
        return amplitudes

    def statistics(self, amplitudes: Array) -> Statistics:
        return volume_statistics(self.basis.evaluate(amplitudes, orientation=False), self.grid)

    def mean(self, indices: tuple[int, ...], change: Array) -> tuple[float, Array]:
        """Return the mean |E| after a change, µm, and its slope along each changed error, [k]."""
        chosen = self.response[list(indices)]
        error = self.error_um + np.tensordot(change, chosen, 1)
        norm = np.sqrt(np.einsum("nc,nc->n", error, error))
        weights = self.grid.weights.reshape(-1) / self.grid.weights.sum()
        direction = error * (weights / np.maximum(norm, np.finfo(float).tiny))[:, None]
        return float(weights @ norm), np.einsum("knc,nc->k", chosen, direction)


class Objective(StrEnum):
    """Quantity that is minimised over the volume."""

    RMS = "rms"
    MAX = "max"


MOST_SETS = {Objective.RMS: 4000, Objective.MAX: 300}
"""Sets of one size that are all tried; of more, a path through them is followed."""


@dataclass(frozen=True, slots=True)
class Solution:
    """The best change of a set of errors."""

    indices: tuple[int, ...]  # which errors, by their place in the basis
    change: Array  # [k], µm or µrad; new minus present value
    value_um: float  # the objective then


@dataclass(frozen=True, slots=True)
class Search:
    """Objective of a search, and the bounds of each error."""

    volume: Volume
    objective: Objective
    bounds: Array  # [K, 2], µm or µrad; least and largest change of every error of the basis
    mean_um: float = np.inf  # largest mean |E| after the change

    def least(self, indices: tuple[int, ...], give_up_um: float = np.inf) -> Solution | None:
        """Find the best change of some errors.

        None where it cannot beat `give_up_um`, or where no change keeps the mean.
        """
        if self.objective is Objective.RMS:
            return least_rms(self.volume, indices, self.bounds, self.mean_um)
        return least_max(self.volume, indices, self.bounds, give_up_um, self.mean_um)

    def best(
        self, sets: Iterator[tuple[int, ...]], start: Solution | None = None
    ) -> Solution | None:
        """Return the best of some sets; None where none is better than the start."""
        best = start
        for indices in sets:
            limit = np.inf if best is None else best.value_um
            solution = self.least(indices, limit)
            if solution is not None and (best is None or solution.value_um < best.value_um - 1e-9):
                best = solution
        return None if best is start else best

    def best_sets(self, candidates: Sequence[int], count: int) -> Iterator[tuple[Solution, bool]]:
        """Find the best sets of one, two, … up to `count` adjustments."""
        before: Solution | None = None
        for size in range(1, min(count, len(candidates)) + 1):
            proven = comb(len(candidates), size) <= MOST_SETS[self.objective]
            if proven or before is None:
                best = self.best(combinations(sorted(candidates), size))
            else:
                best = self._extended(before, candidates)
            if best is None:
                return
            yield best, proven
            before = best

    def _extended(self, before: Solution, candidates: Sequence[int]) -> Solution | None:
        additions = [index for index in candidates if index not in before.indices]
        best = self.best(tuple(sorted((*before.indices, index))) for index in additions)
        while best is not None:
            members = best.indices
            swaps = (
                tuple(sorted({*members, new} - {old}))
                for old in members
                for new in candidates
                if new not in members
            )
            better = self.best(swaps, best)
            if better is None:
                return best
            best = better
        return best


def least_rms(
    volume: Volume, indices: tuple[int, ...], bounds: Array, mean_um: float = np.inf
) -> Solution | None:
    """Minimise the root mean square over the volume: weighted least squares within bounds.

    Where that raises the mean above `mean_um`, the same as a convex program with this constraint.
    """
    matrix, error = volume.triangle
    chosen, ranges = matrix[:, indices], bounds[list(indices)]
    change = _least_squares(chosen, -error, *ranges.T)
    if mean_um < np.inf and volume.mean(indices, change)[0] > mean_um + CLOSE_UM:
        from scipy.optimize import minimize

        def square(change: Array) -> tuple[float, Array]:
            remaining = chosen @ change + error
            return float(remaining @ remaining), 2.0 * remaining @ chosen

        constraint = {
            "type": "ineq",
            "fun": lambda change: mean_um - volume.mean(indices, change)[0],
            "jac": lambda change: -volume.mean(indices, change)[1],
        }
        change = minimize(
            square, change, jac=True, method="SLSQP", bounds=ranges, constraints=[constraint]
        ).x
        if volume.mean(indices, change)[0] > mean_um + CLOSE_UM:
            return None
    return Solution(indices, change, float(np.linalg.norm(chosen @ change + error)))


def _least_squares(matrix: Array, goal: Array, low: Array, high: Array) -> Array:
    """Solve within bounds by active sets (Stark and Parker, 1995)."""
    change: Array = np.asarray(np.linalg.lstsq(matrix, goal)[0], dtype=float)
    if np.all((change >= low) & (change <= high)):
        return change
    from scipy.optimize import lsq_linear

    return lsq_linear(matrix, goal, (low, high), "bvls", tol=1e-14, max_iter=MOST_STEPS).x


def least_max(
    volume: Volume,
    indices: tuple[int, ...],
    bounds: Array,
    give_up_um: float = np.inf,
    mean_um: float = np.inf,
) -> Solution | None:
    """Minimise the largest error of all nodes; see `Search.least`.

    Notes
    -----
    min over x of max over nodes of |e + A x| is a convex (second-order cone) problem. The length of
    a vector is at least its part along any unit vector u, so that each node and each u give a plane
    u · (e + A x) ≤ t below the objective. A linear program with the planes found so far gives a
    lower bound and the next x; there the worst nodes give new planes, u being the direction of
    their error. It ends when the best x met is within `CLOSE_UM` of the lower bound, which is
    proof for all nodes at once. The mean is convex as well: where it exceeds `mean_um`, its tangent
    plane is added.
    """
    if len(indices) == 1:
        solution = _least_max_of_one(volume, indices[0], bounds[indices[0]], give_up_um)
        if (
            solution is None
            or mean_um == np.inf
            or volume.mean(indices, solution.change)[0] <= mean_um + CLOSE_UM
        ):
            return solution
    from scipy.optimize import linprog

    chosen = volume.response[list(indices)]
    size = len(indices)
    matrix, present = volume.triangle
    change = _least_squares(matrix[:, indices], -present, *bounds[list(indices)].T)
    ranges = [*map(tuple, bounds[list(indices)]), (0.0, None)]
    goal = np.zeros(size + 1)
    goal[-1] = 1.0
    planes: list[Array] = []
    offsets: list[Array] = []
    best, best_um = change, np.inf
    for _ in range(MOST_STEPS):
        largest, slopes, heights = _tangent_planes(volume, chosen, change)
        mean, slope = volume.mean(indices, change) if mean_um < np.inf else (0.0, goal[:-1])
        if mean > mean_um:
            planes.append(np.append(slope, 0.0)[None])
            offsets.append(np.array([mean_um - mean + slope @ change]))
        if mean <= mean_um + CLOSE_UM and largest < best_um:
            best, best_um = change, largest
        planes.append(slopes)
        offsets.append(heights)
        solution = linprog(goal, np.concatenate(planes), np.concatenate(offsets), bounds=ranges)
        if solution.status != 0:
            break
        if solution.fun > give_up_um - CLOSE_UM:
            return None
        if best_um - solution.fun < CLOSE_UM:
            break
        change = np.clip(solution.x[:size], *bounds[list(indices)].T)
    return Solution(indices, best, best_um) if best_um < np.inf else None


def _tangent_planes(volume: Volume, chosen: Array, change: Array) -> tuple[float, Array, Array]:
    """Return the largest error after a change, and planes below it at its worst nodes.

    Slopes, [P, k + 1], by the change and by the largest error, and offsets, [P].
    """
    error = volume.error_um + np.tensordot(change, chosen, 1)
    norm = np.sqrt(np.einsum("nc,nc->n", error, error))
    count = min(NODES_AT_ONCE, norm.size)
    worst = np.argpartition(norm, -count)[-count:]
    unit = error[worst] / np.maximum(norm[worst], np.finfo(float).tiny)[:, None]
    slopes = np.column_stack([np.einsum("knc,nc->nk", chosen[:, worst], unit), -np.ones(count)])
    return float(norm.max()), slopes, -np.einsum("nc,nc->n", volume.error_um[worst], unit)


def _least_max_of_one(
    volume: Volume, index: int, bounds: Array, give_up_um: float
) -> Solution | None:
    """Minimise along one error: the planes are lines, and two of them give the next value."""
    response = volume.response[index]
    low, high = map(float, bounds)
    along = (np.einsum("nc,nc->n", other, response) for other in (volume.error_um, response))
    products = np.stack([volume.square_um2, *along])
    ends: dict[bool, tuple[float, float, float]] = {}  # place, value, slope where it falls, rises
    at = best = float(np.clip(0.0, low, high))
    best_um = np.inf
    for _ in range(MOST_STEPS):
        squares = np.array([1.0, 2.0 * at, at * at]) @ products
        worst = int(np.argmax(squares))
        value = float(np.sqrt(max(squares[worst], 0.0)))
        slope = float(products[1, worst] + at * products[2, worst]) / value if value else 0.0
        if value < best_um:
            best, best_um = at, value
        ends[slope > 0.0] = at, value, slope
        if slope == 0.0 or at == (low if slope > 0.0 else high):
            floor_um = value
        elif len(ends) < 2:
            at, floor_um = (low if slope > 0.0 else high), -np.inf
        else:
            (x, falls, down), (y, rises, up) = ends[False], ends[True]
            at = (rises - falls + down * x - up * y) / (down - up)
            floor_um = falls + down * (at - x)
        if floor_um > give_up_um - CLOSE_UM:
            return None
        if best_um - floor_um < CLOSE_UM:
            break
    return Solution((index,), np.array([best]), best_um)


MOST_CUTS = 400  # steps of the search for one number of acts
RANK = 1e-3  # preference of an act over the next one, among equal plans
TIE_UM = 1e-5  # objectives that differ by less are equal
MOST_SECONDS = 60.0  # for one number of acts


@dataclass(frozen=True)
class StepSearch:
    """Search for the best whole steps of a few acts.

    Notes
    -----
    Both objectives and the mean are convex, so that a tangent plane at any change is below them. A
    mixed-integer program with the planes so far gives a lower bound and the next change, where new
    planes are added. It ends when the best change met is within `CLOSE_UM` of the lower bound,
    which is proof for all changes at once.
    """

    volume: Volume  # of the present error, with amplitude 1, and of one step of each act
    objective: Objective
    steps: Array  # [A, 2]; least and largest number of steps of each act
    rows: Array  # [R, A]; of linear conditions on the steps
    limits: Array  # [R, 2]; least and largest value of each condition
    mean_um: float = np.inf  # largest mean |E| after the change

    def best_sets(
        self, count: int, advance: Callable[[float], None]
    ) -> Iterator[tuple[Array, bool]]:
        """Find the best steps, [A], of at most one, two, … acts, and whether that is proven."""
        planes, offsets = [np.zeros((0, 2 * len(self.steps) + 1))], [np.zeros(0)]
        best, best_um = np.zeros(len(self.steps)), self.evaluate(np.zeros(len(self.steps)))[0]
        for size in range(1, min(count, len(self.steps)) + 1):
            before_um, ceiling_um, proven = best_um, np.inf, False
            end_s = time.monotonic() + MOST_SECONDS
            for number in range(MOST_CUTS):
                advance((size - 1 + number / MOST_CUTS) / count)
                below = np.concatenate(planes), np.concatenate(offsets)
                change, bound_um = self._relaxed(size, *below, ceiling_um, end_s - time.monotonic())
                if change is None:
                    break
                if not proven and best_um - bound_um < CLOSE_UM:
                    proven, ceiling_um = True, best_um + TIE_UM
                    continue
                value_um, slopes, heights = self.evaluate(change)
                mean, slope = self.volume.mean(tuple(range(1, len(change) + 1)), change)
                is_allowed = mean <= self.mean_um + CLOSE_UM
                if is_allowed and value_um < (2.0 * TIE_UM + best_um if proven else best_um):
                    best, best_um = change, value_um
                    if proven:
                        break
                elif not is_allowed:
                    slopes = np.concatenate([slopes, np.append(slope, 0.0)[None]])
                    heights = np.append(heights, self.mean_um - mean + slope @ change)
                planes.append(np.insert(slopes, [len(change)] * len(change), 0.0, axis=1))
                offsets.append(heights)
            if best_um > before_um - CLOSE_UM:
                return
            yield best, proven

    def evaluate(self, change: Array) -> tuple[float, Array, Array]:
        """Return the objective, and planes below it: slopes, [P, A + 1], and offsets, [P]."""
        if self.objective is Objective.MAX:
            return _tangent_planes(self.volume, self.volume.response[1:], change)
        matrix, error = self.volume.triangle
        chosen = matrix[:, 1:]
        remaining = chosen @ change + error
        value_um = float(np.linalg.norm(remaining))
        unit = remaining[None] / max(value_um, np.finfo(float).tiny)
        return value_um, np.append(unit @ chosen, [[-1.0]], axis=1), -unit @ error

    def _relaxed(
        self, size: int, planes: Array, offsets: Any, ceiling_um: float, seconds: float
    ) -> tuple[Array | None, float]:
        """Return the best whole steps for the planes, [A], and the lower bound of the objective.

        With a ceiling of the objective, the smallest steps below it, so that equal plans are
        always told apart. None where there are none, or the solver ran out of time. Variables:
        steps, whether an act is used, objective, magnitudes of the steps.
        """
        if seconds <= 0.0:
            return None, -np.inf
        (low, high), count = self.steps.T, len(self.steps)
        acts, none, still = np.eye(count), np.zeros((count, count)), np.zeros((count, 1))
        goal = np.zeros(3 * count + 1)
        goal[2 * count] = 1.0
        if ceiling_um < np.inf:
            goal[2 * count :] = [0.0, *(1.0 + RANK * np.arange(count))]
        used = np.repeat([0.0, 1.0, 0.0], [count, count, count + 1])
        rows = [
            np.hstack([acts, -np.diag(high), still, none]),
            np.hstack([-acts, np.diag(low), still, none]),
            np.hstack([-acts, none, -still, -acts]),
            np.hstack([acts, none, -still, -acts]),
            used[None],
            np.pad(self.rows, ((0, 0), (0, 2 * count + 1))),
            np.pad(planes, ((0, 0), (0, count))),
        ]
        least = np.full(sum(map(len, rows)), -np.inf)
        first = 4 * count + 1
        least[first : first + len(self.rows)] = self.limits[:, 0]
        largest = np.concatenate([np.zeros(4 * count), [size], self.limits[:, 1], offsets])
        bounds = (
            np.append(low, np.zeros(2 * count + 1)),
            np.concatenate([high, np.ones(count), [ceiling_um], np.maximum(-low, high)]),
        )
        is_integer = np.arange(3 * count + 1) < 2 * count
        best, bound = solve_integer_program(
            goal, np.vstack(rows), (least, largest), bounds, is_integer, seconds
        )
        return None if best is None else np.round(best[:count]), bound
