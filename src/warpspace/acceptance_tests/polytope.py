"""Machines that pass tests as a polytope, and the largest error vector over it."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from heapq import heapify, heappop, heappush
from itertools import combinations, count
from typing import NamedTuple

import highspy
import numpy as np

from warpspace.bench.linear_form import LinearForm
from warpspace.exceptions import OptionError
from warpspace.units import Array

FEASIBLE = 1e-7  # share of a limit by which rows may exceed it
ADDED = 8  # rows of one test that are added to the program at a time
GAP = 0.02  # of upper and lower bound
CLOSE = 0.999  # share of a limit that counts as reached
SIDE = np.array([1.0, 1e-3, 1e-6])  # of two opposite directions, the one on it is solved
MAX_ROWS = 60_000  # functionals of all tests


class InfeasibleError(OptionError):
    """A plan that no machine passes."""


@dataclass(frozen=True)
class Constraint:
    """A test and its limit: the size of its form, about the target, is at most the limit."""

    name: str
    form: LinearForm  # of the values of errors: rows [n, V]
    limit: float  # µm or µrad
    quantity: str = ""
    target: Array | float = 0.0  # [n]; subtracted from the rows: estimates
    # (f,); names of the unknowns of the form; equal names of several constraints are one unknown
    unknowns: tuple[str, ...] = ()


class Vertex(NamedTuple):
    """Largest value of a linear functional over a polytope, with the proof that it is largest.

    For any cost vector c, ``offset + max over the box of (c − gradient) · v`` is an upper bound of
    c · v over the polytope (weak duality): rows R and duals y give the gradient y·R, rows within
    target ± 1 the offset Σ (y·target + |y|).
    """

    point: Array  # [V], µm or µrad
    maximum: float
    gradient: Array  # [V]
    offset: float


class Polytope:
    """Machines within a box, [V], that pass tests.

    The linear program keeps its basis from one cost vector to the next. Rows of tests are added
    where the solution violates them, so that it stays small.
    """

    def __init__(self, lower: Array, upper: Array, constraints: Sequence[Constraint]) -> None:
        self.lower, self.upper = lower, upper
        columns: dict[Hashable, int] = {}
        for number, each in enumerate(constraints):
            for name in _unknowns(number, each):
                columns.setdefault(name, len(lower) + len(columns))
        width = len(lower) + len(columns)
        blocks = [np.zeros((0, width + 1))]
        for number, each in enumerate(constraints):
            block = np.zeros((len(each.form.rows), width + 1))
            block[:, : len(lower)] = each.form.rows
            block[:, [columns[name] for name in _unknowns(number, each)]] = -each.form.free
            block[:, -1] = each.target
            block *= each.form.factor / each.limit  # within the target ± 1
            blocks.append(block[np.unique(np.round(block, 9), axis=0, return_index=True)[1]])
        self._rows, self._target = np.split(np.concatenate(blocks), [width], axis=1)
        self._target = self._target[:, 0]
        if len(self._rows) > MAX_ROWS:
            raise OptionError(f"the tests have {len(self._rows):,} rows; expected {MAX_ROWS:,}")
        self._test = np.repeat(np.arange(len(blocks)), [len(block) for block in blocks])
        self._added = np.zeros(0, dtype=np.intp)
        free, none = np.full(width - len(lower), np.inf), np.zeros(0, dtype=np.int32)
        self._solver = highspy.Highs()
        self._solver.silent()
        self._solver.setOptionValue("threads", 1)
        self._solver.addCols(
            width, np.zeros(width), np.append(lower, -free), np.append(upper, free),
            0, none, none, np.zeros(0),
        )  # fmt: skip
        self._solver.changeObjectiveSense(highspy.ObjSense.kMaximize)

    @property
    def is_symmetric(self) -> bool:
        return not self._target.any() and bool(np.allclose(self.lower, -self.upper))

    def maximise(self, cost: Array) -> Vertex:
        """Find the vertex with the largest cost · machine; raise InfeasibleError without any."""
        count, width = len(cost), self._rows.shape[1]
        padded = np.append(cost, np.zeros(width - count))
        self._solver.changeColsCost(width, np.arange(width, dtype=np.int32), padded)
        while True:
            if not self._solve() and not self._solve(is_restart=True):
                raise InfeasibleError("no machine within the tolerances passes all tests")
            solution = self._solver.getSolution()
            point = np.array(solution.col_value)
            excess = np.abs(self._rows @ point - self._target) - 1.0
            excess[self._added] = 0.0
            if excess.max(initial=0.0) <= FEASIBLE:
                break
            self._add_violated(excess)
        dual = np.array(solution.row_dual)
        gradient = dual @ self._rows[self._added, :count]
        offset = float(np.abs(dual).sum() + dual @ self._target[self._added])
        return Vertex(point[:count], float(cost @ point[:count]), gradient, offset)

    def _solve(self, is_restart: bool = False) -> bool:
        """Run the solver; restart it where the basis of the solution before leads nowhere."""
        if is_restart:
            self._solver.clearSolver()
        self._solver.run()
        return self._solver.getModelStatus() == highspy.HighsModelStatus.kOptimal

    def bounds(self, costs: Array, proofs: Sequence[Vertex] = ()) -> Array:
        """Compute upper bounds of functionals, [..., V], from the box and proofs of others."""
        middle, half = (self.upper + self.lower) / 2.0, (self.upper - self.lower) / 2.0
        bounds = costs @ middle + np.abs(costs) @ half
        for proof in proofs:
            changed = costs - proof.gradient
            bounds = np.minimum(bounds, proof.offset + changed @ middle + np.abs(changed) @ half)
        return bounds

    def _add_violated(self, excess: Array) -> None:
        """Add the rows of each test that exceed its limit most."""
        order = np.argsort(-excess)
        order = order[excess[order] > FEASIBLE]
        tests = self._test[order]
        chosen = np.concatenate([order[tests == test][:ADDED] for test in np.unique(tests)])
        block = self._rows[chosen]
        row, column = np.nonzero(block)
        starts = np.searchsorted(row, np.arange(len(chosen))).astype(np.int32)
        target, columns = self._target[chosen], column.astype(np.int32)
        self._solver.addRows(
            len(chosen), target - 1.0, target + 1.0, len(row), starts, columns, block[row, column]
        )
        self._added = np.append(self._added, chosen)


def _unknowns(number: int, constraint: Constraint) -> Sequence[Hashable]:
    return constraint.unknowns or [(number, k) for k in range(constraint.form.free.shape[1])]


@cache
def icosahedron() -> Array:
    """Return the triangles of an icosahedron, [20, 3, 3]: corners on the unit sphere."""
    golden = (1.0 + 5.0**0.5) / 2.0
    ring = np.array([[0.0, a, b * golden] for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([np.roll(ring, shift, axis=1) for shift in range(3)])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    near = corners @ corners.T > 0.4
    return np.array([
        corners[[a, b, c]]
        for a, b, c in combinations(range(12), 3)
        if near[a, b] and near[b, c] and near[a, c]
    ])  # fmt: skip


def cone_bound(corners: Array, heights: Array) -> float:
    """Return the largest |e| of vectors e in a cone with corners · e ≤ heights.

    A unit vector u of the cone is a sum of its corners, λ @ corners with λ ≥ 0, so that
    u · e ≤ λ · heights = u · v, where corners @ v = heights. That is |v| where v lies in the cone;
    else the largest is at its boundary.
    """
    gram = corners @ corners.T
    share = np.linalg.solve(gram, heights)
    if (share >= 0.0).all():
        return float(np.sqrt(share @ heights))
    if len(corners) == 1:
        return float(max(heights[0], 0.0))
    faces = ([k for k in range(len(corners)) if k != out] for out in range(len(corners)))
    return max(cone_bound(corners[face], heights[face]) for face in faces)


@dataclass(frozen=True)
class LargestError:
    """The largest error vector over nodes and machines, between two bounds."""

    low_um: float  # that of the machine
    high_um: float
    node: int
    machine: Array  # [V], µm or µrad; errors at their knots
    error_um: Array  # [3]; its error vector at the node


class _LargestErrorSearch:
    def __init__(self, polytope: Polytope, gains: Array, limit_um: float, stop_um: float) -> None:
        self.polytope, self.gains, self.limit_um, self.stop_um = polytope, gains, limit_um, stop_um
        self.best = LargestError(0.0, 0.0, 0, np.zeros(gains.shape[2]), np.zeros(3))

    @property
    def threshold_um(self) -> float:
        if self.best.low_um > self.stop_um:
            return np.inf
        if np.isinf(self.limit_um):
            return (1.0 + GAP) * self.best.low_um
        return np.inf if self.best.low_um > CLOSE * self.limit_um else self.limit_um

    def maximise(self, node: int, direction: Array) -> Vertex:
        """Maximise one direction at a node; improve the best machine, its direction iterated."""
        first, cost = None, direction @ self.gains[node]
        while True:
            vertex = self.polytope.maximise(cost)
            first = first or vertex
            errors = self.gains @ vertex.point
            norm = np.linalg.norm(errors, axis=1)
            at = int(np.argmax(norm))
            if norm[at] <= self.best.low_um * (1.0 + 1e-4):
                return first
            self.best = LargestError(float(norm[at]), 0.0, at, vertex.point, errors[at])
            cost = errors[at] @ self.gains[at] / norm[at]

    def close(self, node: int, check_cancelled: Callable[[], None]) -> float:
        """Return an upper bound of |E| at a node, at most the threshold."""
        triangles, is_symmetric = icosahedron(), self.polytope.is_symmetric
        if is_symmetric:
            triangles = triangles[triangles.sum(axis=1) @ SIDE > 0.0]
        proofs: list[Vertex] = []
        upper, solved = dict[bytes, float](), set[bytes]()  # by direction

        def key_of(corner: Array) -> bytes:
            sign = np.sign(corner @ SIDE) if is_symmetric else 1.0
            return (np.round(sign * corner, 9) + 0.0).tobytes()

        def ranked(triangle: Array) -> tuple[float, int, Array]:
            for corner in triangle:
                key = key_of(corner)
                if key not in solved:
                    cost = np.frombuffer(key) @ self.gains[node]
                    bound = float(self.polytope.bounds(cost, proofs))
                    upper[key] = min(upper.get(key, np.inf), bound)
            heights = np.array([upper[key_of(corner)] for corner in triangle])
            return -cone_bound(triangle, heights), next(number), triangle

        number = count()
        queue = [ranked(triangle) for triangle in triangles]
        heapify(queue)
        while -queue[0][0] > self.threshold_um:
            triangle = heappop(queue)[2]
            keys = [key_of(corner) for corner in triangle]
            unsolved = [key for key in keys if key not in solved]
            if unsolved:
                key = max(unsolved, key=upper.__getitem__)
                proofs.append(self.maximise(node, np.frombuffer(key)))
                upper[key] = proofs[-1].maximum
                solved.add(key)
                check_cancelled()
                heappush(queue, ranked(triangle))
                continue
            sums = triangle + np.roll(triangle, -1, axis=0)
            lengths = np.linalg.norm(sums, axis=1)
            (a, b, c), (ab, bc, ca) = triangle, sums / lengths[:, None]
            for side, corner in enumerate((ab, bc, ca)):
                height = (upper[keys[side]] + upper[keys[side - 2]]) / lengths[side]
                key = key_of(corner)
                upper[key] = min(upper.get(key, np.inf), height)
            for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)):
                heappush(queue, ranked(np.array(part)))
        return -queue[0][0]


def bound_nodes(lower: Array, upper: Array, gains: Array) -> Array:
    """Compute upper bounds of |E| at nodes, [N], by the tolerances alone."""
    triangles, box = icosahedron(), Polytope(lower, upper, ())
    heights = np.stack([box.bounds(triangles @ each) for each in gains])
    return np.array(
        [max(cone_bound(t, h) for t, h in zip(triangles, each, strict=True)) for each in heights]
    )


def find_largest_error(
    polytope: Polytope,
    gains: Array,
    watch: Callable[[float], None],
    limit_um: float = np.inf,
    stop_um: float = np.inf,
    bounds: Array | None = None,
) -> LargestError:
    """Find the largest |E| over nodes and machines, with bounds that differ by at most `GAP`.

    Parameters
    ----------
    gains : ndarray, [N, 3, V], µm per µm or µrad
        Response of each node to each value.
    watch : callable
        Called with the completed share of the work.
    limit_um : float, optional
        Limit to be decided upon: the upper bound is at most the limit, or infinite where a machine
        exceeds `CLOSE` of it.
    stop_um : float, optional
        Size of an error at which the search ends: the upper bound is infinite then.
    bounds : ndarray, [N], µm, optional
        `bound_nodes` of the box and the gains, where they are known.

    Notes
    -----
    |E| at a node is the largest of u · E over unit vectors u. Where u lies in a triangle of
    directions, u · E is bounded by the largest d · E of its corners d over the machines
    (`cone_bound`), which are linear programs. From an icosahedron, triangles with a bound above the
    best machine are divided in four. Each solution that improves the best machine is iterated: the
    direction becomes that of its error vector. Nodes, and corners of triangles, whose bound by
    tolerances alone is small enough are not solved.
    """
    search, high = _LargestErrorSearch(polytope, gains, limit_um, stop_um), 0.0
    bounds = bound_nodes(polytope.lower, polytope.upper, gains) if bounds is None else bounds
    for done, node in enumerate(np.argsort(-bounds)):
        if bounds[node] <= max(search.threshold_um, high):
            break
        high = max(high, search.close(int(node), partial(watch, done / len(bounds))))
    if np.isinf(search.threshold_um):
        return replace(search.best, high_um=np.inf)
    remaining = bounds[bounds <= max(search.threshold_um, high)].max(initial=0.0)
    return replace(search.best, high_um=float(max(high, remaining, search.best.low_um)))
