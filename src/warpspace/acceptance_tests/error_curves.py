"""Machines within tolerance: each error an arbitrary piecewise linear curve along its axis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpspace.acceptance_tests.polytope import (
    Constraint,
    LargestError,
    Polytope,
    bound_nodes,
    find_largest_error,
)
from warpspace.analysis.description import ProgressCallback
from warpspace.bench.linear_form import LinearForm, absolute
from warpspace.bench.plan import BenchPlan, IndexArray, respond
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import build_basis
from warpspace.field.grid import Grid, build_grid
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, TableCurve
from warpspace.scene.model import Scene
from warpspace.units import Array

MM_PER_M = 1e3
AT_TOLERANCE = 1e-7  # of the width of a tolerance: a value that reaches it


@dataclass(frozen=True)
class ErrorCurves:
    """Errors of the machines within the tolerances of a scene.

    Along the range of its axis a component error is linear between knots; constants have one value.

    Notes
    -----
    Over a volume of linear axes that carry the tool, the largest |E| is at a node whose positions
    are knots. The response to a rotation is its lever arm, from the carriage of its axis to the
    tool, which is linear in the positions of the axes beyond and independent of that of its own.
    Between two knots of an axis, the others at rest, E is therefore linear in its position and |E|
    convex, so that one of the knots has the larger |E|; axis after axis, this leads to a node. The
    lever arm of an axis that carries the workpiece changes with its own position, and a rotary axis
    turns lever arms: along these (`curved_axes`) nodes are the knots and the positions midway.
    """

    scene: Scene
    knots: int = 5
    slope: float | None = None  # µm/m or µrad/m; the largest along linear axes
    second_difference: float | None = None  # µm/m² or µrad/m²; likewise
    measured: tuple[Constraint, ...] = ()  # what is known of this machine

    def __post_init__(self) -> None:
        """Refuse scenes without tolerances."""
        missing = self.scene.tolerances.missing(self.keys)
        if missing:
            verb = "has no tolerance" if len(missing) == 1 else "have no tolerance"
            raise OptionError(f"unbounded: {', '.join(missing)} {verb}")
        if not (self.upper > self.lower).any():
            raise OptionError("all tolerances are zero: there is one machine only")

    @property
    def keys(self) -> tuple[str, ...]:
        return self.scene.parameter_keys

    @cached_property
    def variables(self) -> tuple[tuple[str, int], ...]:
        """Key and number of the knot of each value, (V,)."""
        return tuple(
            (key, knot)
            for key in self.keys
            for knot in range(1 if parameter(key).is_constant else self.knots)
        )

    @cached_property
    def lower(self) -> Array:
        return self._ends(-1.0)

    @cached_property
    def upper(self) -> Array:
        return self._ends(1.0)

    def _ends(self, sign: float) -> Array:
        tolerances = {key: self.scene.tolerances.get(key) for key in self.keys}
        ends = {key: t.centre + sign * t.half_width for key, t in tolerances.items() if t}
        return np.array([ends[key] for key, _ in self.variables])

    @cached_property
    def grid(self) -> Grid:
        """Nodes of the volume: the knots along each axis, and positions midway."""
        nodes = [
            2 * self.knots - 1 if axis in self.curved_axes else self.knots
            for axis in self.scene.workspace.volume_axes
        ]
        return build_grid(self.scene.model, self.scene.workspace, nodes)

    def positions_of(self, node: int) -> dict[str, float]:
        """Return the positions of the axes at a node, mm or degrees."""
        pairs = self.grid.coordinates.items()
        return {axis: float(np.broadcast_to(q, self.grid.shape).flat[node]) for axis, q in pairs}

    @property
    def curved_axes(self) -> tuple[str, ...]:
        """Axes of the volume between whose knots |E| may be larger than at both."""
        carrying = self.scene.machine.chain.workpiece
        axes = filter(None, self.scene.workspace.volume_axes)
        return tuple(axis for axis in axes if axis in carrying or not is_linear(axis))

    @cached_property
    def gains(self) -> Array:
        """Response of each node to each value, [N, 3, V]; the reference of the scene applies."""

        def respond_nodes(scene: Scene) -> Array:
            at, points = self.grid.coordinates, self.grid.point_mm
            basis = build_basis(scene.model, scene.errors, self.keys, at, scene.view(), points)
            return np.moveaxis(basis.position.reshape(len(self.keys), -1, 3), 0, -1)

        return self.respond(respond_nodes)

    def readings(self, plan: BenchPlan) -> Array:
        """Compute the response of the readings of a test to each value, [m, V]."""
        return self.respond(lambda scene: respond(scene, plan, self.keys))

    def respond(self, evaluate: Callable[[Scene], Array]) -> Array:
        """Compute the response to each value, [..., V], from those to each curve, [..., K]."""
        columns = {variable: index for index, variable in enumerate(self.variables)}
        responses = np.zeros(0)
        for knot, unit in enumerate(np.eye(self.knots)):
            curves = {key: self._curve(key, unit) for key in self.keys}
            response = evaluate(replace(self.scene, errors=ErrorSet(curves)))
            if not knot:
                responses = np.zeros((*response.shape[:-1], len(columns)))
            for row, key in enumerate(self.keys):
                if (key, knot) in columns:
                    responses[..., columns[key, knot]] = response[..., row]
        return responses

    def _curve(self, key: str, at_knots: Array) -> ErrorFunction:
        span = self.scene.axis_span(parameter(key).axis)
        if parameter(key).is_constant:
            return Constant(span, float(at_knots[0]))
        positions = np.linspace(*span, self.knots).tolist()
        return TableCurve(span, tuple(zip(positions, at_knots.tolist(), strict=True)))

    def columns(self, key: str) -> IndexArray:
        """Return the columns of the values of an error, one per knot."""
        return np.flatnonzero([name == key for name, _ in self.variables])

    def by_key(self, machine: Array) -> dict[str, Array]:
        """Split a machine, [V], into its errors."""
        return {key: machine[self.columns(key)] for key in self.keys}

    def build_scene(self, machine: Array) -> Scene:
        """Return the scene of one machine, [V]."""
        curves = {key: self._curve(key, part) for key, part in self.by_key(machine).items()}
        return replace(self.scene, errors=ErrorSet(curves))

    def polytope(self, constraints: Sequence[Constraint]) -> Polytope:
        """Build the polytope of the machines that pass tests and agree with measurements."""
        curves = [
            Constraint(name, self._differences(np.array(weights)), limit)
            for name, limit, weights in (
                ("slope", self.slope, [-1.0, 1.0]),
                ("second difference", self.second_difference, [1.0, -2.0, 1.0]),
            )
            if limit is not None
        ]
        return Polytope(self.lower, self.upper, [*curves, *self.measured, *constraints])

    def find_largest(
        self,
        constraints: Sequence[Constraint],
        watch: ProgressCallback,
        limit_um: float = np.inf,
        stop_um: float = np.inf,
    ) -> LargestError:
        polytope = self.polytope(constraints)
        bounds = self._node_bounds
        return find_largest_error(polytope, self.gains, watch, limit_um, stop_um, bounds)

    @cached_property
    def _node_bounds(self) -> Array:
        return bound_nodes(self.lower, self.upper, self.gains)

    def find_ranges(
        self, constraints: Sequence[Constraint], watch: ProgressCallback
    ) -> dict[str, tuple[float, float]]:
        """Find the lowest and the highest value of each error at its knots, µm or µrad.

        A vertex found for one value is a machine for all others: a value that already reaches its
        tolerance needs no linear program.
        """
        polytope = self.polytope(constraints)
        first = polytope.maximise(np.zeros(len(self.upper))).point
        lowest, highest = first.copy(), first.copy()
        widths = self.upper - self.lower
        ranges: dict[str, tuple[float, float]] = {}
        for number, key in enumerate(self.keys):
            at = self.columns(key)
            for sign in (1.0, -1.0):
                for column in at:
                    watch(number / len(self.keys))
                    room = (
                        np.maximum(self.upper - highest, 0.0) if sign > 0 else lowest - self.lower
                    )
                    if room[at].min() <= AT_TOLERANCE * widths[column]:
                        break
                    cost = sign * np.eye(1, len(widths), column)[0]
                    point = polytope.maximise(cost).point
                    lowest, highest = np.minimum(lowest, point), np.maximum(highest, point)
            ranges[key] = float(lowest[at].min()), float(highest[at].max())
        return ranges

    def _differences(self, weights: Array) -> LinearForm:
        """Build the form of the largest divided difference of neighbouring knots, per m or m²."""
        order = len(weights) - 1
        rows = [np.zeros((0, len(self.variables)))]
        for index, (key, knot) in enumerate(self.variables):
            axis = parameter(key).axis
            if knot >= order and is_linear(axis):
                low, high = self.scene.axis_span(axis)
                row = np.zeros((1, len(self.variables)))
                row[0, index - order : index + 1] = weights
                rows.append(row * (MM_PER_M * (self.knots - 1) / (high - low)) ** order)
        return absolute(*rows)
