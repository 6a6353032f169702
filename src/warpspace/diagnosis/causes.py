"""Causes: errors along their axes, reversals, servo mismatches, warm scales, bent plates."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.bench.kinds.ball_plate import BallPlate
from warpspace.bench.kinds.circular import Circular
from warpspace.bench.plan import respond_sites, sense
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings, find_kind
from warpspace.calibration.solve import FitParameters, MeasurementModel, is_straightness
from warpspace.machine.axes import direction_index, is_linear, parameter
from warpspace.machine.errors import Constant, Directional, ErrorFunction, ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

KNOTS = 5  # of a component error along its axis
CORRELATION = 0.5  # length over which a curve varies, as a share of the range of its axis
TEMPERATURE, BENT = "scale temperature", "bent plate"
PLATE_BENDS = 3  # bow along both sides, and twist


@dataclass(frozen=True)
class Cause:
    """A cause, whose variables are `shape` × its coefficients × half-width."""

    name: str  # key of an error, or a name such as "reversal of X"
    rows: Sequence[int]  # (v,); its variables among all
    half_width: Array  # [v], µm or µrad; tolerance of each
    shape: Array  # [v, d]

    @property
    def title(self) -> str:
        return self.name if " " in self.name else f"{parameter(self.name).name} ({self.name})"


@dataclass(frozen=True)
class CauseSet:
    """The causes that are considered on a machine, and the readings that they produce.

    A curve is a Gaussian process without its mean, which is a constant of the machine or of the
    set-up; a straightness also without its slope, which is a squareness.
    """

    scene: Scene

    @cached_property
    def curves(self) -> ErrorCurves:
        return ErrorCurves(self.scene, KNOTS)

    @cached_property
    def linear_axes(self) -> tuple[str, ...]:
        return tuple(filter(is_linear, self.scene.machine.axes))

    @property
    def drive_causes(self) -> list[str]:
        reversals = [f"reversal of {axis}" for axis in self.scene.machine.axes]
        return [*reversals, *(f"servo mismatch of {axis}" for axis in self.linear_axes)]

    @cached_property
    def variables(self) -> list[str]:
        """Error of each knot, reversals, mismatches, bends, (V,)."""
        return [
            *(key for key, _ in self.curves.variables),
            *self.drive_causes,
            *[BENT] * PLATE_BENDS,
        ]

    def half_width(self, key: str) -> float:
        tolerance = self.scene.tolerances.get(key)
        return tolerance.half_width if tolerance else 0.0

    @cached_property
    def smallest_um(self) -> float:
        """Smallest half-width of a translation, µm."""
        keys = [key for key in self.curves.keys if not parameter(key).is_rotation]
        return min(filter(None, map(self.half_width, keys)), default=1.0)

    @cached_property
    def causes(self) -> tuple[Cause, ...]:
        """Causes; none is an error whose tolerance is zero."""
        return tuple(cause for cause in self._build_causes() if cause.half_width.all())

    def _build_causes(self) -> Iterator[Cause]:
        axes = self.scene.machine.axes
        position = {axis: self.half_width(positioning_key(axis)) for axis in axes}
        for key in self.curves.keys:
            shape = np.eye(1) if parameter(key).is_constant else _curve_shape(key)
            yield self._cause(key, [key], self.half_width(key), shape)
        for name in self.drive_causes:
            yield self._cause(name, [name], position[name.rpartition(" ")[2]], np.eye(1))
        yield self._cause(BENT, [BENT], self.smallest_um, np.eye(PLATE_BENDS))
        if self.linear_axes:
            spans = [self.scene.axis_span(axis) for axis in self.linear_axes]
            longest = max(high - low for low, high in spans)
            ramps = [
                axes[axis].direction * (high - low) / longest * np.linspace(-1.0, 1.0, KNOTS)
                for axis, (low, high) in zip(self.linear_axes, spans, strict=True)
            ]
            smallest = min(position[axis] for axis in self.linear_axes)
            keys = [positioning_key(axis) for axis in self.linear_axes]
            yield self._cause(TEMPERATURE, keys, smallest, np.concatenate(ramps)[:, None])

    def _cause(self, name: str, variables: list[str], half_width: float, shape: Array) -> Cause:
        rows = [at for key in variables for at, each in enumerate(self.variables) if each == key]
        return Cause(name, rows, np.full(len(rows), half_width), shape)

    @cached_property
    def basis(self) -> Array:
        """Variables per coefficient of all causes, [V, P], µm or µrad."""
        columns: list[Array] = []
        for cause in self.causes:
            basis = np.zeros((len(self.variables), cause.shape.shape[1]))
            basis[cause.rows] = cause.half_width[:, None] * cause.shape
            columns.append(basis)
        return np.hstack(columns)

    @cached_property
    def centre(self) -> Array:
        """Middle of the tolerances, [V], µm or µrad."""
        errors = (self.curves.lower + self.curves.upper) / 2.0
        return np.append(errors, np.zeros(len(self.variables) - len(errors)))

    @cached_property
    def none(self) -> FitParameters:
        return FitParameters((), ErrorSet(), np.zeros(0))

    # --- readings -------------------------------------------------------------------------------

    def respond(self, model: MeasurementModel) -> tuple[Array, Array]:
        """Differentiate readings, [N, V] mm per µm or µrad, and by unknowns of the set-up."""
        unit: dict[str, ErrorFunction] = {}
        for axis in self.scene.machine.axes:
            span = self.scene.axis_span(axis)
            reversal = Directional(span, Constant(span, 0.5), Constant(span, -0.5))
            unit[positioning_key(axis)] = reversal
        by_error = self.curves.respond(lambda scene: differentiate(model, scene.errors, 1.0)[0])
        by_reversal, by_unknown = differentiate(model, ErrorSet(unit), 0.5)
        by_test = np.concatenate([self._respond_test(readings) for readings in model.sets])
        return np.hstack([by_error, 0.5 * by_reversal, by_test]), by_unknown

    def _respond_test(self, readings: Readings) -> Array:
        """Differentiate circles by mismatches, and plates by bends, [n, axes + 3].

        A mismatch is the lag of one axis, more than that of the by_test, at the feed of a circle.
        """
        kind, plan = find_kind(readings.kind), readings.plan
        matrix = np.zeros((readings.observed_mm.size, len(self.linear_axes) + PLATE_BENDS))
        test = kind.test if isinstance(kind, TestReadings) else None
        if plan is not None and isinstance(test, Circular):
            scene = replace(self.scene, errors=ErrorSet(), model=test.model(self.scene))
            keys = [positioning_key(axis) for axis in self.linear_axes]
            sites = respond_sites(scene, plan, keys)
            for column, axis in enumerate(self.linear_axes):
                if axis in plan.travel:
                    feed = self.scene.machine.axes[axis].direction * plan.travel[axis]
                    matrix[:, column] = sense(plan, feed[:, None] * sites[column]) * MM_PER_UM
        elif plan is not None and isinstance(test, BallPlate):
            row, column = (
                2.0 * plan.marks[name] / (test.balls - 1) - 1.0 for name in ("row", "column")
            )
            across = 3 - sum("XYZ".index(axis) for axis in test.plane)
            sensed = np.repeat(np.arange(3), len(row) // 3) == across
            bends = np.stack([row**2, row * column, column**2], -1)
            matrix[:, len(self.linear_axes) :] = sensed[:, None] * bends * MM_PER_UM
        return matrix


def differentiate(
    model: MeasurementModel, errors: ErrorSet, amplitude: float
) -> tuple[Array, Array]:
    """Differentiate readings by errors of an amplitude, [N, K], and by the set-up, [N, m], mm."""
    functions: dict[str, ErrorFunction] = dict(errors.functions)
    amplitudes = np.full(len(functions), amplitude)
    parameters = FitParameters(tuple(functions), errors, amplitudes)
    return model.derivatives(parameters, amplitudes, model.start())


def positioning_key(axis: str) -> str:
    return f"E{('XYZ' if is_linear(axis) else 'ABC')[direction_index(axis)]}{axis}"


def _curve_shape(key: str) -> Array:
    """Build shapes whose sum has a standard deviation of one on average, [KNOTS, d]."""
    share = np.linspace(0.0, 1.0, KNOTS)
    covariance = np.exp(-0.5 * ((share[:, None] - share) / CORRELATION) ** 2)
    trend = np.vander(share, 2 if is_straightness(key) else 1)
    without = np.eye(KNOTS) - trend @ np.linalg.pinv(trend)
    eigenvalues, vectors = np.linalg.eigh(without @ covariance @ without)
    shape = vectors[:, trend.shape[1] :] * np.sqrt(eigenvalues[trend.shape[1] :])
    return shape / np.sqrt(np.mean(np.sum(shape**2, axis=1)))
