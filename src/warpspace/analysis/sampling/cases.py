"""Cases of a Monte Carlo run: a machine, its tolerances and a plan, small enough to be pickled.

Samples come in blocks of fixed size, each with a random stream that follows from the seed and the
number of the block. Whoever evaluates a block, and when, does not change its numbers.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from warpspace.analysis.sampling.distribution import EXACT_SAMPLES, Draws, PartialSums, summarise
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, build_basis, reference_point
from warpspace.field.grid import Workspace, build_grid, node_counts
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, loop_error, nominal_point
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine.axes import TravelDirection, is_linear, is_rotary
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import SAMPLES, WORKERS
from warpspace.units import Array

MAX_CYLINDER_MM = 1e5
FULL_TURN = 360.0
AVERAGE_POWER = 14
ROTARY_PARTS = 16


@dataclass(frozen=True, slots=True)
class Cylinder:
    """The largest workpiece: a cylinder standing on the origin of the workpiece frame."""

    diameter_mm: float
    height_mm: float

    def __str__(self) -> str:
        return f"Ø{self.diameter_mm:g} × {self.height_mm:g} mm"


@dataclass(frozen=True, slots=True)
class Places:
    """Positions of a machine and the points evaluated there."""

    coordinates: dict[str, Array]  # [...], mm or degrees
    point_mm: Array  # [..., 3]; nominal points in R
    # [N], or None; what each point counts for in a mean over the volume, in the order of the
    # points; None where all count alike
    weights: Array | None = None


def choose_cylinder(model: Model, cylinder: Cylinder | None = None) -> Cylinder:
    if cylinder is None:
        x, y, z = model.workpiece_point_mm
        cylinder = Cylinder(2.0 * math.hypot(x, y), z)
        if not (cylinder.diameter_mm > 0.0 and cylinder.height_mm > 0.0):
            raise OptionError(
                f"the workpiece point {model.workpiece_point_mm} mm of the scene is no point on the"
                " top rim of a workpiece; expected the size of the largest workpiece, {cylinder}"
                " DIAMETERxHEIGHT in mm"
            )
    for name, value in (("diameter", cylinder.diameter_mm), ("height", cylinder.height_mm)):
        if not 0.0 < value <= MAX_CYLINDER_MM:
            raise OptionError(f"cylinder: {name} {value:g} mm; expected above 0, at most 100000")
    return cylinder


def _rotary_nodes(low: float, high: float, nodes: int) -> Array:
    full = high - low >= FULL_TURN
    return np.linspace(low, low + FULL_TURN if full else high, nodes, endpoint=not full)


DEFAULT_SAMPLES, DEFAULT_NODES = 100_000, 11
BLOCK = 8192  # machines per random stream; part of what a seed means, so not to be changed lightly
LEAST_BLOCKS, MOST_BLOCKS = 16, 4096
"""Blocks in one task of an executor: 131,072 machines at least, 33,554,432 at most."""
EXACT_MACHINES, EXACT_POINTS = 256, 100_000
"""Machines that the exact chain is evaluated of, and how many points of all of them at most."""
TASKS_ASKED = 4096  # tasks that a large run is cut into before they grow
BLOCK_MULTIPLICATIONS = 900_000
"""Size of one matrix product: its result stays in the cache, and BLAS leaves it to one core."""

Job = Callable[[np.random.Generator, int], Array]
"""Takes a random generator and a number of machines, gives their |E|, [n], µm."""


class Reduction(StrEnum):
    """Reduction of |E| to one number per machine."""

    SAMPLED = "sampled"
    MAX = "max"
    MEAN = "mean"


LIMIT_REDUCTION = Reduction.MAX
"""Where a machine has to keep a limit, unless somebody says otherwise: everywhere in the volume."""


@dataclass(frozen=True, slots=True)
class SamplingPlan:
    """Number of samples, seed and reduction of a Monte Carlo run."""

    samples: int = DEFAULT_SAMPLES
    seed: int = 0
    # |E| at one random point per machine, or its largest or mean over the points of a machine
    reduction: Reduction | str = Reduction.SAMPLED
    nodes: int = DEFAULT_NODES  # nodes per axis for `max` and `mean`
    spec_um: float | None = None  # specification whose probability is asked for, µm
    # largest workpiece; None takes it from the model's workpiece point
    cylinder: Cylinder | None = None
    # threads; None for one per core, at most 8. With an executor, tasks that run at a time.
    workers: int | None = None

    def check(self) -> None:
        if not SAMPLES[0] <= self.samples <= SAMPLES[1]:
            raise OptionError(f"samples: {self.samples}; expected 1 to {SAMPLES[1]:,}")
        if self.seed < 0:
            raise OptionError(f"seed: {self.seed}; expected a whole number, 0 or above")
        if self.reduction not in [*Reduction]:
            raise OptionError(f"over {self.reduction!r}; expected one of {', '.join(Reduction)}")
        if self.spec_um is not None and not 0.0 <= self.spec_um < np.inf:
            raise OptionError(f"specification: {self.spec_um:g} µm; expected 0 or above")
        if self.workers is not None and not WORKERS[0] <= self.workers <= WORKERS[1]:
            raise OptionError(f"workers: {self.workers}; expected 1 to {WORKERS[1]:,}")

    @property
    def blocks(self) -> int:
        """Number of blocks of samples; the last one may be shorter."""
        return -(-self.samples // BLOCK)

    def block(self, index: int) -> tuple[np.random.Generator, int]:
        """Return the random stream of a block and its number of machines."""
        # the same stream as SeedSequence(seed).spawn(index + 1)[index], without the list
        stream = np.random.SeedSequence(self.seed, spawn_key=(index,))
        return np.random.default_rng(stream), min(BLOCK, self.samples - index * BLOCK)


def reduce_nodes(
    amplitudes: Array, gains: Array, reduction: Reduction | str, weights: Array | None = None
) -> Array:
    """Evaluate |E| of machines at all nodes and return its largest or mean, [n], µm.

    Amplitudes are [n, K], gains [3, K, N]; weights, [N], say what each node counts for in the mean
    and add up to 1, all alike by default.

    Notes
    -----
    Three matrix products per block, each squared and added in place while it is in the cache; the
    [n, N] errors are never held as a whole.
    """
    machines, nodes = len(amplitudes), gains.shape[2]
    rows = int(np.clip(BLOCK_MULTIPLICATIONS // gains[0].size, 8, 256))
    total, part = np.empty((rows, nodes)), np.empty((rows, nodes))
    result = np.empty(machines)
    for start in range(0, machines, rows):
        block = amplitudes[start : start + rows]
        square, term = total[: len(block)], part[: len(block)]
        np.matmul(block, gains[0], out=square)
        np.multiply(square, square, out=square)
        for gain in gains[1:]:
            np.matmul(block, gain, out=term)
            np.multiply(term, term, out=term)
            np.add(square, term, out=square)
        if reduction == Reduction.MAX:
            result[start : start + rows] = np.sqrt(square.max(axis=1))
        elif weights is None:
            result[start : start + rows] = np.sqrt(square, out=square).mean(axis=1)
        else:
            result[start : start + rows] = np.sqrt(square, out=square) @ weights
    return result


@dataclass(frozen=True, slots=True)
class Case:
    """One Monte Carlo run: a machine, and the volume it is evaluated in.

    Tool and relative loop: over the working volume, other axes at their place in the workspace.
    Workpiece loop: over the volume of the largest workpiece, its rotary axes over their travel.
    """

    model: Model
    draws: Draws  # the parameters and their distributions, see `build_draws`
    workspace: Workspace
    view: View = field(default_factory=View)  # loop and reference
    plan: SamplingPlan = field(default_factory=SamplingPlan)

    def check(self) -> None:
        self.plan.check()
        if self.view.loop is Loop.WORKPIECE:
            choose_cylinder(self.model, self.plan.cylinder)

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Ranges of the axes that vary."""
        spans, axes = self.workspace.ranges, self.model.machine.axes
        if self.view.loop is not Loop.WORKPIECE:
            return {
                name: span for name, span in spans.items() if name in axes and span[0] < span[1]
            }
        return {
            axis.name: spans[axis.name] if axis.is_linear else axis.travel
            for axis in self.model.machine.branch("workpiece")
        }

    @property
    def dimensions(self) -> int:
        """Number of coordinates of a place."""
        return len(self.ranges) + (3 if self.view.loop is Loop.WORKPIECE else 0)

    def random(self, rng: np.random.Generator, count: int) -> Places:
        return self.places(rng.random((count, self.dimensions)))

    def spread(self, nodes: int) -> Places:
        """Return the nodes for the mean over the points of one machine.

        The grid of the working volume, each node with its share of the volume. For the workpiece
        loop nodes³ low-discrepancy points (Sobol sequence) over cylinder and rotary travel, since a
        five-dimensional grid would be either coarse or huge.
        """
        if self.view.loop is not Loop.WORKPIECE:
            grid = build_grid(self.model, self.workspace, nodes)
            return Places(grid.coordinates, grid.nominal_mm, grid.weights.reshape(-1))
        count = node_counts(nodes)[0] ** 3
        # Whole powers of two keep the balance of the sequence; the surplus is cut off.
        return self._sobol(math.ceil(math.log2(count)), count)

    def extreme(self, nodes: int) -> Places:
        """Return the nodes for the largest error of one machine.

        For constant parameters E is affine in the linear axes and in the point of the workpiece, so
        that |E| is convex in them and largest at a corner of the volume or on a rim of the
        cylinder: those give exactly the maximum over any grid. Rotary axes, and the angle round the
        rim, are covered with `nodes` positions.
        """
        node_counts(nodes)
        along = {
            name: _rotary_nodes(low, high, nodes) if is_rotary(name) else np.array([low, high])
            for name, (low, high) in self.ranges.items()
        }
        if self.view.loop is not Loop.WORKPIECE:
            axes = dict(zip(along, np.meshgrid(*along.values()), strict=True))
            coordinates = self._complete(axes)
            flat = {name: np.ravel(values) for name, values in coordinates.items()}
            return Places(flat, nominal_point(self.model, Loop.TOOL, flat))
        size = choose_cylinder(self.model, self.plan.cylinder)
        turn = _rotary_nodes(0.0, FULL_TURN, nodes)
        mesh = np.meshgrid(*along.values(), np.array([0.0, size.height_mm]), turn)
        *moving, height, angle = (values.ravel() for values in mesh)
        axes = dict(zip(along, moving, strict=True))
        return self._on_workpiece(axes, (size.diameter_mm / 2.0, angle, height))

    def average(self) -> Places:
        """Return places whose unweighted mean is exact for functions quadratic in the points.

        Two Gauss points per linear axis, which is exact for the square of an error, and the middles
        of 16 parts of the range of a rotary one; for the workpiece loop 2¹⁴ points of a Sobol
        sequence, which is good to about 0.01 %.
        """
        if self.view.loop is Loop.WORKPIECE:
            return self._sobol(AVERAGE_POWER)
        gauss = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)
        middles = (np.arange(ROTARY_PARTS) + 0.5) / ROTARY_PARTS
        mesh = np.meshgrid(*(gauss if is_linear(name) else middles for name in self.ranges))
        return self.places(
            np.stack([values.ravel() for values in mesh], -1) if mesh else np.zeros((1, 0))
        )

    def places(self, unit: Array) -> Places:
        """Map numbers between 0 and 1, [n, dimensions], to places."""
        axes = {
            name: low + (high - low) * unit[:, index]
            for index, (name, (low, high)) in enumerate(self.ranges.items())
        }
        if self.view.loop is not Loop.WORKPIECE:
            coordinates = self._complete(axes)
            return Places(coordinates, nominal_point(self.model, Loop.TOOL, coordinates))
        size = choose_cylinder(self.model, self.plan.cylinder)
        radius = size.diameter_mm / 2.0 * np.sqrt(unit[:, -3])
        return self._on_workpiece(
            axes, (radius, FULL_TURN * unit[:, -2], size.height_mm * unit[:, -1])
        )

    def _sobol(self, power: int, count: int | None = None) -> Places:
        from scipy.stats import qmc

        sequence = qmc.Sobol(self.dimensions, scramble=True, rng=0)
        return self.places(sequence.random_base2(power)[:count])

    def _complete(self, axes: dict[str, Array]) -> dict[str, Array]:
        return complete_coordinates(self.model.machine, axes, self.workspace.positions)

    def _on_workpiece(
        self, axes: dict[str, Array], point: tuple[Array | float, Array, Array]
    ) -> Places:
        """Place points of the workpiece, given as radius [mm], angle [degrees] and height [mm]."""
        coordinates = self._complete(axes)
        radius, degrees, height = point
        angle = np.deg2rad(degrees)
        local = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)
        pose = branch_pose(self.model, "workpiece", coordinates)
        return Places(coordinates, transforms.apply(pose, local))

    @property
    def is_exact(self) -> bool:
        """True if all samples are stored for exact quantiles."""
        return self.plan.samples <= EXACT_SAMPLES

    @property
    def task_blocks(self) -> int:
        """Blocks in one task of an executor; follows from the plan alone."""
        if self.is_exact:
            return LEAST_BLOCKS
        return max(LEAST_BLOCKS, min(self.plan.blocks // TASKS_ASKED, MOST_BLOCKS))

    def responses(self, places: Places) -> Array:
        """Compute the responses of constant parameters at places, [3, K, N], µm per unit."""
        model = replace(self.model, direction=TravelDirection.MEAN)  # gains have none
        keys, at = self.draws.keys, places.coordinates
        basis = build_basis(model, ErrorSet(), keys, at, self.view, places.point_mm)
        flat = basis.position.reshape(len(keys), -1, 3)
        return np.ascontiguousarray(np.moveaxis(flat, -1, 0))

    def common_places(self) -> Places:
        """Return the points for the largest or the mean of each machine."""
        nodes = self.plan.nodes
        return self.spread(nodes) if self.plan.reduction == "mean" else self.extreme(nodes)

    def build_job(self) -> Job:
        quantity = Reduction(self.plan.reduction)
        if quantity is Reduction.SAMPLED:

            def one_point_each(rng: np.random.Generator, count: int) -> Array:
                amplitudes = self.draws.draw(rng, count)
                gains = self.responses(self.random(rng, count))
                return np.sqrt(
                    sum((np.einsum("nk,kn->n", amplitudes, gain) ** 2) for gain in gains)
                )

            return one_point_each
        places = self.common_places()
        gains = self.responses(places)

        def all_points_each(rng: np.random.Generator, count: int) -> Array:
            return reduce_nodes(self.draws.draw(rng, count), gains, quantity, places.weights)

        return all_points_each


def both_orders(case: Case, count: int = EXACT_MACHINES) -> tuple[Array, Array]:
    """Evaluate the first machines of a case to first order and exactly, [n, N, 3] each, µm."""
    model = replace(case.model, direction=TravelDirection.MEAN)
    view, loop = case.view, case.view.loop
    rng, n_machines = case.plan.block(0)
    amplitudes = case.draws.draw(rng, n_machines)[:count]
    if case.plan.reduction == Reduction.SAMPLED:
        places = case.random(rng, n_machines)
        axes = {
            key: np.broadcast_to(q, n_machines)[:count, None]
            for key, q in places.coordinates.items()
        }
        point = np.broadcast_to(places.point_mm, (n_machines, 3))[:count, None]
    else:
        places = case.extreme(case.plan.nodes)
        axes, point = places.coordinates, places.point_mm
        amplitudes = amplitudes[: max(1, EXACT_POINTS // len(point))]
    values = dict(zip(case.draws.keys, amplitudes.T[..., None], strict=True))

    def error(at: Coordinates, point_mm: Array, exact: bool) -> Array:
        return loop_error(model, loop, at, values, point_mm, exact=exact)[0]

    first, exact = (error(axes, point, exactly) for exactly in (False, True))
    reference = reference_point(model, view, axes)
    if reference is not None:
        first, exact = first - error(*reference, False), exact - error(*reference, True)
    return first, exact


def sample_blocks(
    case: Case, first: int, end: int, *, keep: bool, job: Job | None = None
) -> PartialSums:
    do = case.build_job() if job is None else job

    def blocks() -> Iterator[Array]:
        for index in range(first, end):
            yield do(*case.plan.block(index))

    exact = case.is_exact
    return summarise(blocks(), case.plan.spec_um, keep=keep or exact, count=not exact)
