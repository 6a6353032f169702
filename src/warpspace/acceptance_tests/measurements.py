"""Constraints on the errors of one machine: readings, and the uncertainty that its scene states."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.polytope import MAX_ROWS, Constraint
from warpspace.analysis.description import ProgressCallback
from warpspace.analysis.uncertainty.propagation import NOT_STATED, t_quantile
from warpspace.bench.linear_form import LinearForm
from warpspace.calibration.fit import FitOptions, with_scatter
from warpspace.calibration.instruments import Instrument, common_mode, effective_dof
from warpspace.calibration.kinds import Prediction
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import find_kind
from warpspace.calibration.solve import MeasurementModel
from warpspace.exceptions import OptionError
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Covariance, ErrorSet
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

COVERAGE = 0.95  # probability with which all estimates hold together
MIN_UNCERTAINTY = 1e-6  # µm or µrad; smaller ones are below the numerical resolution


@dataclass(frozen=True)
class Estimates:
    """Estimates of linear functionals of the errors, up to unknowns of a set-up."""

    name: str
    rows: Array  # [n, V]
    values: Array  # [n], µm or µrad
    uncertainty: Array  # [n], standard, µm or µrad
    dof: Array  # [n]
    free: Array  # [n, f]; change per unit of each unknown
    unknowns: tuple[str, ...] = ()  # (f,)


def limit_estimates(estimates: Sequence[Estimates]) -> tuple[Constraint, ...]:
    """Build the constraints |row · v − value| ≤ k·u, which all hold together with 95 % or more.

    k is the quantile of Student's t at (1 + 0.95^(1/n))/2 for n estimates in total. For independent
    normal ones the probability is 95 % exactly, for correlated ones at least that (Šidák, Journal
    of the American Statistical Association 62 (1967), 626).
    """
    count = sum(len(each.values) for each in estimates)
    constraints: list[Constraint] = []
    for each in estimates:
        factor = t_quantile((1.0 + COVERAGE ** (1.0 / count)) / 2.0, each.dof)
        width = factor * each.uncertainty
        form = LinearForm(each.rows / width[:, None], each.free / width[:, None])
        target, unknowns = each.values / width, each.unknowns
        constraints.append(Constraint(each.name, form, 1.0, target=target, unknowns=unknowns))
    return tuple(constraints)


def estimate_from_readings(
    curves: ErrorCurves, sets: Sequence[Readings], instrument: Instrument, watch: ProgressCallback
) -> Iterator[Estimates]:
    """Linearise readings about the exact chain without errors.

    The uncertainty of a component includes the common contributions of the instrument.
    """
    check_cancelled = partial(watch, 0.0)
    stated = [readings.sigma_mm is not None for readings in sets]
    sets, _ = with_scatter(curves.scene, sets, FitOptions(instrument=instrument), check_cancelled)
    model = MeasurementModel.of(curves.scene, sets, check_cancelled)
    if model.size > MAX_ROWS:
        raise OptionError(f"{model.size:,} components of readings; expected at most {MAX_ROWS:,}")
    common = [np.sum(common_mode(model, row) ** 2, axis=1) for row in instrument.shared]
    dofs = [row.dof for row in instrument.shared]
    start, first = model.start(), 0
    for readings, is_stated in zip(sets, stated, strict=True):
        kind, size = find_kind(readings.kind), readings.observed_mm.size
        name = Path(readings.source).name
        if readings.sigma_mm is None:
            raise OptionError(
                f"{name}: the uncertainty of its readings is unknown; expected a column u_um, or"
                " {instrument}"
            )
        prediction = Prediction(ErrorSet(), model.unknowns, start)
        _, by_unknown = kind.slopes(curves.scene, readings, prediction, ())
        nominal_mm = kind.observe(curves.scene, readings, prediction)
        gains = curves.respond(partial(_respond, readings=readings, prediction=prediction))
        scatter = np.repeat(readings.sigma_mm**2, readings.observed_mm.shape[1])
        rows = slice(first, first + size)
        variances = np.array([scatter, *(variance[rows] for variance in common)])
        scatter_dof = np.inf if is_stated else instrument.scatter[1]
        free = by_unknown.reshape(size, len(start))
        acts = np.any(free != 0.0, axis=0)
        yield Estimates(
            f"the readings of {name}",
            gains.reshape(size, gains.shape[-1]),
            (readings.observed_mm - nominal_mm).ravel() * UM_PER_MM,
            np.sqrt(variances.sum(axis=0)) * UM_PER_MM,
            effective_dof(variances, [scatter_dof, *dofs]),
            free[:, acts],
            tuple(np.array(model.unknowns, dtype=str)[acts].tolist()),
        )
        first += size


def _respond(scene: Scene, readings: Readings, prediction: Prediction) -> Array:
    prediction = Prediction(scene.errors, prediction.unknowns, prediction.values)
    kind, keys = find_kind(readings.kind), scene.parameter_keys
    return kind.slopes(scene, readings, prediction, keys)[0] * UM_PER_MM


def estimate_from_scene(curves: ErrorCurves) -> Iterator[Estimates]:
    """Return the estimates of a scene that states the uncertainty of its errors.

    Covariance: the amplitude of an error is that of the least-squares projection of its values at
    the knots on the curve of the scene; the estimates are the sums of amplitudes along the
    principal axes of the covariance. Standard uncertainty along an axis: the value at each knot.
    """
    scene = curves.scene
    covariance = scene.covariance or Covariance((), ())
    if not covariance.keys and not scene.uncertainty:
        raise OptionError(f"{{measured}}: {NOT_STATED}")
    rows = np.zeros((len(covariance.keys), len(curves.upper)))
    for row, key in zip(rows, covariance.keys, strict=True):
        positions = _positions(curves, key)
        shape = scene.errors.shape_at(key, {parameter(key).axis: positions})
        if not shape.any():
            raise OptionError(
                f"{{knots}} {curves.knots}: {key} is zero at all knots; expected more"
            )
        row[curves.columns(key)] = shape / (shape @ shape)
    if len(rows):
        amplitudes = np.array([scene.errors.amplitude(key) for key in covariance.keys])
        variances, axes = np.linalg.eigh(covariance.matrix)
        uncertainty = np.sqrt(np.maximum(variances, MIN_UNCERTAINTY**2))
        dof, free = np.full(len(rows), covariance.dof), np.zeros((len(rows), 0))
        name = "the covariance of the scene"
        yield Estimates(name, axes.T @ rows, axes.T @ amplitudes, uncertainty, dof, free)
    for key, curve in scene.uncertainty.items():
        positions = _positions(curves, key)
        count = len(positions)
        yield Estimates(
            f"the uncertainty of {key}",
            np.eye(len(curves.upper))[curves.columns(key)],
            scene.errors.evaluate(key, positions),
            curve.evaluate(positions),
            np.full(count, np.inf),
            np.zeros((count, 0)),
        )


def _positions(curves: ErrorCurves, key: str) -> Array:
    """Return the positions of the knots of an error, [knots], mm or degrees."""
    axis, errors = parameter(key).axis, curves.scene.errors
    if key not in curves.keys:
        raise OptionError(f"{{measured}}: {key} has an uncertainty, but is no error of the scene")
    if not {axis} >= {*errors.arguments(key)}:
        expected = f"expected a curve along {axis}"
        raise OptionError(f"{{measured}}: {key} depends on several axes; {expected}")
    return np.linspace(*curves.scene.axis_span(axis), len(curves.columns(key)))
