"""Machines that pass tests as a polytope, and the largest error vector over it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from heapq import heapify, heappop, heappush
from itertools import combinations, count
from typing import NamedTuple

import highspy
import numpy as np
from numpy.typing import NDArray

from warpspace.bench.linear_form import LinearForm
from warpspace.exceptions import OptionError
from warpspace.units import Array

FEASIBLE = 1e-7  # share of a limit by which rows may exceed it
ADDED = 8  # rows of one test that are added to the program at a time
GAP = 0.02  # of upper and lower bound
SIDE = np.array([1.0, 1e-3, 1e-6])  # of two opposite directions, the one on it is solved
MAX_ROWS = 60_000  # functionals of all tests


class InfeasibleError(OptionError):
    """A plan that no machine passes."""


@dataclass(frozen=True)
class Constraint:
    """A test and its limit: the size of its form is at most the limit."""

    name: str
    form: LinearForm  # of the values of errors: rows [n, V]
    limit: float  # µm or µrad
    quantity: str = ""


class Vertex(NamedTuple):
    """Largest value of a linear functional over a polytope, with the proof that it is largest.

    For any cost vector c, ``offset + max over the box of (c − gradient) · v`` is an upper bound of
    c · v over the polytope (weak duality).
    """

    values: Array  # [V], µm or µrad; of the errors
    maximum: float
    gradient: Array  # [V]
    offset: float


class Polytope:
    """Values of errors within a box, [V], that pass tests.

    The linear program keeps its basis from one cost vector to the next. Rows of tests are added
    where the solution violates them, so that it stays small.
    """

    def __init__(self, lower: Array, upper: Array, constraints: Sequence[Constraint]) -> None:
        self.lower, self.upper = lower, upper
        width, blocks = len(lower), list[Array]()
        unknowns = sum(constraint.form.free.shape[1] for constraint in constraints)
        at, sizes = width, list[Array]()
        for constraint in constraints:
            form = constraint.form
            block = np.zeros((len(form.rows), width + unknowns))
            block[:, :width] = form.rows
            block[:, at : at + form.free.shape[1]] = -form.free
            at += form.free.shape[1]
            block = block[np.unique(np.round(block, 9), axis=0, return_index=True)[1]]
            blocks.append(block)
            sizes.append(np.full(len(block), constraint.limit / form.factor))
        self._rows = np.concatenate([np.zeros((0, width + unknowns)), *blocks])
        if len(self._rows) > MAX_ROWS:
            raise OptionError(f"tests with {len(self._rows):,} readings; expected {MAX_ROWS:,}")
        self._sizes = np.concatenate([np.zeros(0), *sizes])
        self._test = np.repeat(np.arange(len(blocks)), [len(block) for block in blocks])
        self._added = np.zeros(0, dtype=np.intp)
        self._solver = highspy.Highs()
        self._solver.silent()
        self._solver.setOptionValue("threads", 1)
        free = np.full(unknowns, np.inf)
        empty = np.zeros(0)
        self._solver.addCols(
            width + unknowns, np.zeros(width + unknowns), np.append(lower, -free),
            np.append(upper, free), 0, empty.astype(np.int32), empty.astype(np.int32), empty,
        )  # fmt: skip
        self._solver.changeObjectiveSense(highspy.ObjSense.kMaximize)
        starts = [len(block) // ADDED or 1 for block in blocks]
        self._add(
            np.concatenate(
                [np.flatnonzero(self._test == number)[::step] for number, step in enumerate(starts)]
            )
            if blocks
            else self._added
        )

    @property
    def is_symmetric(self) -> bool:
        return bool(np.allclose(self.lower, -self.upper))

    def maximise(self, cost: Array) -> Vertex:
        count, width = len(cost), self._rows.shape[1]
        padded = np.append(cost, np.zeros(width - count))
        self._solver.changeColsCost(width, np.arange(width, dtype=np.int32), padded)
        while True:
            self._solver.run()
            status = self._solver.getModelStatus()
            if status == highspy.HighsModelStatus.kInfeasible:
                raise InfeasibleError("no machine within the tolerances passes all tests")
            solution = self._solver.getSolution()
            values = np.array(solution.col_value)
            excess = np.abs(self._rows @ values) / self._sizes - 1.0
            if excess.max(initial=0.0) <= FEASIBLE:
                break
            self._add(self._violated(excess))
        dual = np.array(solution.row_dual)
        gradient = dual @ self._rows[self._added, :count]
        offset = float(np.abs(dual) @ self._sizes[self._added])
        return Vertex(values[:count], float(cost @ values[:count]), gradient, offset)

    def bound(self, cost: Array, proofs: Sequence[Vertex]) -> float:
        """Return an upper bound of a functional, [V], from the proofs of others."""
        rest = cost - np.array([proof.gradient for proof in proofs])
        middle, half = (self.upper + self.lower) / 2.0, (self.upper - self.lower) / 2.0
        bounds = [proof.offset for proof in proofs] + rest @ middle + np.abs(rest) @ half
        return float(bounds.min())

    def box_bounds(self, costs: Array) -> Array:
        """Return the largest values of functionals, [..., V], over the box."""
        middle, half = (self.upper + self.lower) / 2.0, (self.upper - self.lower) / 2.0
        return costs @ middle + np.abs(costs) @ half

    def _violated(self, excess: Array) -> NDArray[np.intp]:
        rows: list[NDArray[np.intp]] = []
        for number in np.unique(self._test[excess > FEASIBLE]):
            candidates = np.flatnonzero((self._test == number) & (excess > FEASIBLE))
            order = np.argsort(-excess[candidates])
            rows.append(candidates[order[:ADDED]])
        return np.concatenate(rows)

    def _add(self, rows: NDArray[np.intp]) -> None:
        sizes = self._sizes[rows]
        block = self._rows[rows]
        index, column = np.nonzero(block)
        starts = np.searchsorted(index, np.arange(len(rows))).astype(np.int32)
        self._solver.addRows(
            len(rows),
            -sizes,
            sizes,
            len(index),
            starts,
            column.astype(np.int32),
            block[index, column],
        )
        self._added = np.append(self._added, rows)


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
    values: Array  # [V], µm or µrad; errors of the machine
    error_um: Array  # [3]; its error vector at the node


class _Search:
    def __init__(self, polytope: Polytope, gains: Array, gap: float, limit_um: float) -> None:
        self.polytope, self.gains, self.gap = polytope, gains, gap
        self.limit_um = 0.0 if np.isinf(limit_um) else limit_um
        self.best = LargestError(0.0, 0.0, 0, np.zeros(gains.shape[2]), np.zeros(3))

    @property
    def threshold_um(self) -> float:
        return max((1.0 + self.gap) * self.best.low_um, self.limit_um)

    def maximise(self, node: int, direction: Array) -> Vertex:
        """Maximise one direction at a node; improve the best machine, its direction iterated."""
        first, cost = None, direction @ self.gains[node]
        while True:
            vertex = self.polytope.maximise(cost)
            first = first or vertex
            errors = self.gains @ vertex.values
            norm = np.linalg.norm(errors, axis=1)
            at = int(np.argmax(norm))
            if norm[at] <= self.best.low_um * (1.0 + 1e-4):
                return first
            self.best = LargestError(float(norm[at]), 0.0, at, vertex.values, errors[at])
            cost = errors[at] @ self.gains[at] / norm[at]

    def close(self, node: int, check_cancelled: Callable[[], None]) -> float:
        """Return an upper bound of |E| at a node, at most the threshold."""
        triangles, is_symmetric = icosahedron(), self.polytope.is_symmetric
        if is_symmetric:
            triangles = triangles[triangles.sum(axis=1) @ SIDE > 0.0]
        proofs = [Vertex(np.zeros(0), 0.0, np.zeros(self.gains.shape[2]), 0.0)]
        upper, solved = dict[bytes, float](), set[bytes]()  # by direction

        def key_of(corner: Array) -> bytes:
            sign = np.sign(corner @ SIDE) if is_symmetric else 1.0
            return (np.round(sign * corner, 9) + 0.0).tobytes()

        def entry(triangle: Array) -> tuple[float, int, Array]:
            for corner in triangle:
                key = key_of(corner)
                if key not in solved:
                    cost = np.frombuffer(key) @ self.gains[node]
                    bound = self.polytope.bound(cost, proofs)
                    upper[key] = min(upper.get(key, np.inf), bound)
            heights = np.array([upper[key_of(corner)] for corner in triangle])
            return -cone_bound(triangle, heights), next(number), triangle

        number = count()
        queue = [entry(triangle) for triangle in triangles]
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
                heappush(queue, entry(triangle))
                continue
            sums = triangle + np.roll(triangle, -1, axis=0)
            lengths = np.linalg.norm(sums, axis=1)
            (a, b, c), (ab, bc, ca) = triangle, sums / lengths[:, None]
            for side, corner in enumerate((ab, bc, ca)):
                height = (upper[keys[side]] + upper[keys[side - 2]]) / lengths[side]
                key = key_of(corner)
                upper[key] = min(upper.get(key, np.inf), height)
            for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)):
                heappush(queue, entry(np.array(part)))
        return -queue[0][0]


def find_largest_error(
    polytope: Polytope,
    gains: Array,
    watch: Callable[[float], None],
    gap: float = GAP,
    limit_um: float = np.inf,
) -> LargestError:
    """Find the largest |E| over nodes and machines, with bounds that differ by at most `gap`.

    Parameters
    ----------
    gains : ndarray, [N, 3, V], µm per µm or µrad
        Response of each node to each value.
    watch : callable
        Called with the completed share of the work.
    gap : float, optional
    limit_um : float, optional
        Limit to be decided upon: the bounds are as close as it takes to be on one side of it.

    Notes
    -----
    |E| at a node is the largest of u · E over unit vectors u. Where u lies in a triangle of
    directions, u · E is bounded by the largest d · E of its corners d over the machines
    (`cone_bound`), which are linear programs. From an icosahedron, triangles with a bound above the
    best machine are divided in four. Each solution that improves the best machine is iterated: the
    direction becomes that of its error vector. Nodes, and corners of triangles, whose bound by
    tolerances alone is small enough are not solved.
    """
    search, high = _Search(polytope, gains, gap, limit_um), 0.0
    triangles = icosahedron()
    heights = np.stack([polytope.box_bounds(triangles @ each) for each in gains])
    bounds = np.array(
        [max(cone_bound(t, h) for t, h in zip(triangles, each, strict=True)) for each in heights]
    )
    for done, node in enumerate(np.argsort(-bounds)):
        if bounds[node] <= max(search.threshold_um, high):
            high = max(high, bounds[node])
            break
        high = max(high, search.close(int(node), partial(watch, done / len(bounds))))
        if search.best.low_um > limit_um:
            break
    return replace(search.best, high_um=max(high, search.best.low_um))
