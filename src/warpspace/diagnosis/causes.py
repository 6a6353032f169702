"""Causes of errors: their shapes along the axes, machine element, and effect on readings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import combinations

import numpy as np

from warpspace.bench.plan import respond_sites, sense
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings, find_kind
from warpspace.calibration.solve import FitParameters, MeasurementModel, is_straightness
from warpspace.exceptions import OptionError
from warpspace.machine.axes import ErrorKind, Parameter, direction_index, parameter
from warpspace.machine.errors import Constant, Directional, ErrorFunction, ErrorSet, TableCurve
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, Array

KNOTS = 5  # of a component error along its axis; linear between them
CORRELATION = 0.5  # length over which a curve varies, as a share of the range of its axis
MIN_SHARE = 1e-6  # eigenvalue of a shape, relative to the largest, that is kept


class CauseKind(StrEnum):
    """Class of causes with a common remedy."""

    POSITIONING = "positioning"
    STRAIGHTNESS = "straightness"
    ROLL = "roll"
    PITCH = "pitch"
    YAW = "yaw"
    BEARING = "bearing"
    SQUARENESS = "squareness"
    LOCATION = "location"
    ORIENTATION = "orientation"
    REVERSAL = "reversal"
    SERVO = "servo_mismatch"
    TEMPERATURE = "scale_temperature"


@dataclass(frozen=True)
class Cause:
    """An error that may be out of tolerance.

    Its variables are `basis` times coefficients. Where the error is within tolerance these have a
    standard deviation of half a tolerance; a coefficient of one is the half-width.
    """

    name: str  # key of an error, or a name such as "reversal of X"
    kind: CauseKind
    element: str  # of the machine
    basis: Array  # [V, d]; µm or µrad
    limit: Array  # [V]; half-width of each variable; infinite for those of other causes

    @property
    def title(self) -> str:
        return f"{parameter(self.name).name} ({self.name})" if is_key(self.name) else self.name


def is_key(name: str) -> bool:
    return " " not in name


@dataclass(frozen=True)
class ErrorVariables:
    """Values that readings depend on: errors at knots, reversals, lags of the drives."""

    scene: Scene

    @cached_property
    def keys(self) -> tuple[str, ...]:
        return self.scene.parameter_keys

    @cached_property
    def names(self) -> tuple[tuple[str, int], ...]:
        """Key and knot, name of a reversal, name of a lag, (V,)."""
        errors = [
            (key, knot)
            for key in self.keys
            for knot in range(1 if parameter(key).is_constant else KNOTS)
        ]
        reversals = [(f"reversal of {axis}", 0) for axis in self.axes]
        return (*errors, *reversals, *((f"lag of {axis}", 0) for axis in self.linear_axes))

    @cached_property
    def axes(self) -> tuple[str, ...]:
        return tuple(self.scene.machine.axes)

    @cached_property
    def linear_axes(self) -> tuple[str, ...]:
        return tuple(axis for axis in self.axes if self.scene.machine.axes[axis].is_linear)

    def columns(self, name: str) -> list[int]:
        return [at for at, (variable, _) in enumerate(self.names) if variable == name]

    @cached_property
    def centre(self) -> Array:
        """Middle of the tolerances, [V], µm or µrad."""
        tolerances = {key: self.scene.tolerances.get(key) for key in self.keys}
        centres = {key: t.centre for key, t in tolerances.items() if t is not None}
        return np.array([centres.get(name, 0.0) for name, _ in self.names])

    def curve(self, key: str, at_knots: Array) -> ErrorFunction:
        span = self.scene.axis_span(parameter(key).axis)
        if parameter(key).is_constant:
            return Constant(span, float(at_knots[0]))
        rows = zip(np.linspace(*span, KNOTS).tolist(), at_knots.tolist(), strict=True)
        return TableCurve(span, tuple(rows))

    def errors(self, values: Array) -> ErrorSet:
        """Build the errors of variables, [V]; reversals and lags are omitted."""
        columns = {key: self.columns(key) for key in self.keys}
        acting = [key for key in self.keys if np.any(values[columns[key]])]
        return ErrorSet({key: self.curve(key, values[columns[key]]) for key in acting})

    def respond(self, model: MeasurementModel) -> tuple[Array, Array]:
        """Differentiate readings, [N, V] per µm or µrad and [N, m] per unit of the set-up, mm."""
        start, by_unknown = model.start(), np.zeros((model.size, 0))
        matrix = np.zeros((model.size, len(self.names)))
        for knot, unit in enumerate(np.eye(KNOTS)):
            curves = {key: self.curve(key, unit) for key in self.keys}
            by_key, by_unknown = model.derivatives(_unit_parameters(curves), _ones(curves), start)
            for column, key in enumerate(self.keys):
                rows = self.columns(key)
                if knot < len(rows):
                    matrix[:, rows[knot]] = by_key[:, column]
        reversals: dict[str, ErrorFunction] = {}
        for axis in self.axes:  # forward minus backward is one
            span = self.scene.axis_span(axis)
            both = Directional(span, Constant(span, 0.5), Constant(span, -0.5))
            reversals[positioning_key(axis)] = both
        by_axis, _ = model.derivatives(_unit_parameters(reversals), 0.5 * _ones(reversals), start)
        for column, axis in enumerate(self.axes):
            matrix[:, self.columns(f"reversal of {axis}")] = 0.5 * by_axis[:, [column]]
        lags = np.concatenate([self._respond_lags(readings) for readings in model.sets])
        matrix[:, len(self.names) - len(self.linear_axes) :] = lags
        return matrix, by_unknown

    def _respond_lags(self, readings: Readings) -> Array:
        """Differentiate readings by the lag of each linear axis at the feed of the circle, [n, L].

        Of circles only: in the other tests the axes stand still while they are read.
        """
        kind, plan = find_kind(readings.kind), readings.plan
        matrix = np.zeros((readings.observed_mm.size, len(self.linear_axes)))
        if plan is None or not isinstance(kind, TestReadings) or kind.test.name != "circular":
            return matrix
        scene = replace(self.scene, model=kind.test.model(self.scene), errors=ErrorSet())
        keys = [positioning_key(axis) for axis in self.linear_axes]
        sites_um = respond_sites(scene, plan, keys)
        for column, axis in enumerate(self.linear_axes):
            if axis in plan.travel:
                feed = self.scene.machine.axes[axis].direction * plan.travel[axis]
                lag_um = sites_um[column] * feed[:, None]
                matrix[:, column] = sense(plan, lag_um) * MM_PER_UM
        return matrix


def positioning_key(axis: str) -> str:
    letters = "XYZ" if parameter(f"EX{axis}").axis[0] in "XYZUVW" else "ABC"
    return f"E{letters[direction_index(axis)]}{axis}"


def _unit_parameters(curves: dict[str, ErrorFunction]) -> FitParameters:
    return FitParameters(tuple(curves), ErrorSet(curves), _ones(curves))


def _ones(curves: dict[str, ErrorFunction]) -> Array:
    return np.ones(len(curves))


# --- The causes -----------------------------------------------------------------------------------


def build_causes(variables: ErrorVariables) -> tuple[Cause, ...]:
    """Build the causes that are considered; errors with a tolerance of zero are none.

    Raises
    ------
    OptionError
        If an error has no tolerance.
    """
    scene = variables.scene
    missing = scene.tolerances.missing(variables.keys)
    if missing:
        raise OptionError(
            f"{scene.name}: {', '.join(missing)} without tolerance; expected [tolerances] for all"
            " errors, since a cause is an error out of tolerance"
        )
    causes: list[Cause] = []
    for key in variables.keys:
        row, half_width = parameter(key), half_width_of(scene, key)
        shapes = np.eye(1) if row.is_constant else _curve_shapes(row)
        if half_width:
            causes.append(
                _cause(variables, {key: half_width * shapes}, key, _kind(row), _element(scene, row))
            )
    for axis in variables.axes:
        half_width, name = half_width_of(scene, positioning_key(axis)), f"reversal of {axis}"
        if half_width:
            causes.append(
                _cause(variables, {name: half_width * np.eye(1)}, name, CauseKind.REVERSAL,
                       f"drive of {axis}: play, friction, preload")
            )  # fmt: skip
    for first, second in combinations(variables.linear_axes, 2):
        half_width = min(half_width_of(scene, positioning_key(axis)) for axis in (first, second))
        if half_width and direction_index(first) != direction_index(second):
            lags = {f"lag of {axis}": np.array([[sign * half_width / 2.0]])
                    for axis, sign in ((first, 1.0), (second, -1.0))}  # fmt: skip
            causes.append(
                _cause(variables, lags, f"servo mismatch {first}{second}", CauseKind.SERVO,
                       f"drives of {first} and {second}: lag at feed")
            )  # fmt: skip
    expansion = _expansion(variables)
    if expansion:
        name = "scale temperature"
        element = f"scales of {', '.join(variables.linear_axes)}"
        causes.append(_cause(variables, expansion, name, CauseKind.TEMPERATURE, element))
    return tuple(causes)


def half_width_of(scene: Scene, key: str) -> float:
    tolerance = scene.tolerances.get(key)
    return 0.0 if tolerance is None else tolerance.half_width


def _cause(
    variables: ErrorVariables,
    shapes: dict[str, Array],
    name: str,
    kind: CauseKind,
    element: str,
) -> Cause:
    count = len(variables.names)
    basis = np.zeros((count, next(iter(shapes.values())).shape[1]))
    limit = np.full(count, np.inf)
    for variable, values in shapes.items():
        rows = variables.columns(variable)
        basis[rows] = values
        is_lag = variable.startswith("lag")
        scene = variables.scene
        single = float(np.abs(values).max())
        limit[rows] = single if is_lag or not is_key(variable) else half_width_of(scene, variable)
    return Cause(name, kind, element, basis, limit)


def _curve_shapes(row: Parameter) -> Array:
    """Build the shapes of curves with a pointwise standard deviation of one on average, [K, d].

    A Gaussian process without its mean, which is a constant of the machine or of the set-up; of a
    straightness without its slope as well, which is a squareness.
    """
    share = np.linspace(0.0, 1.0, KNOTS)
    covariance = np.exp(-0.5 * ((share[:, None] - share) / CORRELATION) ** 2)
    trends = [np.ones(KNOTS), share] if is_straightness(row.key) else [np.ones(KNOTS)]
    basis, _ = np.linalg.qr(np.stack(trends, -1))
    without = np.eye(KNOTS) - basis @ basis.T
    eigenvalues, vectors = np.linalg.eigh(without @ covariance @ without)
    kept = eigenvalues > MIN_SHARE * eigenvalues[-1]
    shapes = vectors[:, kept] * np.sqrt(eigenvalues[kept])
    return shapes / np.sqrt(np.mean(np.sum(shapes**2, axis=1)))


def _expansion(variables: ErrorVariables) -> dict[str, Array]:
    """Build the common expansion of all scales; one is the smallest positioning tolerance."""
    scene, spans = variables.scene, dict[str, Array]()
    for axis in variables.linear_axes:
        low, high = scene.axis_span(axis)
        sense_of_motion = scene.machine.axes[axis].direction
        spans[axis] = sense_of_motion * np.linspace(low - high, high - low, KNOTS)[:, None] / 2.0
    half_widths = [half_width_of(scene, positioning_key(axis)) for axis in spans]
    if not spans or not min(half_widths):
        return {}
    longest = max(float(np.abs(values).max()) for values in spans.values())
    return {positioning_key(a): min(half_widths) / longest * v for a, v in spans.items()}


def _kind(row: Parameter) -> CauseKind:
    kinds = {
        ErrorKind.SQUARENESS: CauseKind.SQUARENESS,
        ErrorKind.LOCATION: CauseKind.LOCATION,
        ErrorKind.ORIENTATION: CauseKind.ORIENTATION,
    }
    if row.kind in kinds:
        return kinds[row.kind]
    word = row.name.partition(" of ")[0]
    if "positioning" in word:
        return CauseKind.POSITIONING
    return CauseKind(word) if word in [*CauseKind] else CauseKind.BEARING


def _element(scene: Scene, row: Parameter) -> str:
    """Describe the element of the machine that has an error: a guide, a scale, a joint."""
    what, kind = row.name.partition(" of ")[0], _kind(row)
    if row.is_constant:
        chain = scene.machine.chain
        branch = chain.tool if row.axis in chain.tool else chain.workpiece
        at = branch.index(row.axis)
        carrier = f"{branch[at - 1]}" if at else "the frame"
        return f"joint of {row.axis} and {carrier}: {row.name}"
    if kind is CauseKind.POSITIONING:
        return f"scale or drive of {row.axis}: {what}"
    place = "guide" if scene.machine.axes[row.axis].is_linear else "bearing"
    return f"{place} of {row.axis}: {row.name.replace(f' of {row.axis}', '')}"


def titles(causes: Sequence[Cause]) -> str:
    return " and ".join(cause.title for cause in causes)
