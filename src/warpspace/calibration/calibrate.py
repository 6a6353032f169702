"""Calibration: least-squares fit of the error parameters of a machine to measured data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np

from warpspace.analysis.description import Analysis, ProgressCallback
from warpspace.analysis.options import PLACE, Files, Grammar, option, typed_word
from warpspace.calibration.calibration_result import (
    TARGETS,
    Calibration,
    Combination,
    Estimability,
    FittedParameter,
    Residuals,
    Target,
    describe_target,
)
from warpspace.calibration.instruments import (
    NO_INSTRUMENT,
    Instrument,
    build_budget,
    common_mode,
    effective_dof,
    instrument_names,
    load_instrument,
)
from warpspace.calibration.kinds import in_other_frame
from warpspace.calibration.next_best import find_separating, next_best, observability, u95_at
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import read_readings
from warpspace.calibration.solve import (
    MAD,
    CheckCancelled,
    FitParameters,
    MeasurementModel,
    Rank,
    Solved,
    automatic_parameters,
    build_fit_parameters,
    by_name,
    covariance_of,
    find_rank,
    never_cancelled,
    orthonormal_basis,
    project_out,
    read_keys,
    rms_mm,
    robust_scale,
    solve,
)
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import build_basis
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Covariance
from warpspace.machine.limits import MAX_ERROR, MAX_TEXT
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

CALIBRATED = ", calibrated"  # suffix of the title of a calibrated scene
OUTLIER = 4.0  # robust standard deviations beyond which a reading is an outlier
MAX_NEXT = 10
POSES = 60  # random poses at which the effect of errors is evaluated
MIN_EFFECT = 0.01  # share of the effect of one error, below which a sum of errors has none
Budget: TypeAlias = Annotated[Instrument, Grammar("NAME|FILE.toml", load_instrument, is_file=True)]


def _target(text: str, scene: Scene) -> Target:
    if text in TARGETS:
        return text
    if "=" not in text:
        expected = f"expected {', '.join(TARGETS)}, or axis positions such as X=0,Y=-225"
        raise ValueError(expected)
    return PLACE.read(text, scene)


@dataclass(frozen=True, kw_only=True)
class Calibrate(Analysis):
    """Fit the errors of the machine of SCENE to measured data.

    Least squares with the exact model. Reports which parameters are estimable, which are
    confounded, standard uncertainties, 95 % intervals and residuals. Readings with a column u_um
    (standard uncertainty) are weighted by it. A column session, or run, names the set-up: each has
    its own position of the sphere or the station, or its own shift.
    """

    name = "calibrate"
    task = "measure"
    doing = "fitting"
    makes_scenes = True
    scene_help = "Write SCENE with the fitted errors"
    has_chart = True
    chart_help = "residuals before and after the fit, and the fitted errors"
    has_table = True
    data: Files = option(
        (),
        "CSV file of readings, or the name of a bundled one such as tcp_on.csv",
        required=True,
    )
    kinds: Annotated[tuple[str, ...], Grammar("KIND", typed_word, each=True)] = option(
        (),
        "points, tracker, sphere, sphere-tcp, lengths, or a test with its options such as"
        " circular:plane=XZ:radius=150 (`warpspace test --list`)."
        " Once for all files, or once for each, --data before --predict",
        flag="--kind",
        unset="recognised from the columns of each file",
    )
    frame: Literal["machine", "workpiece"] | None = option(
        None,
        "Frame of error vectors whose columns do not name it (ex_R_um: machine; ex_w_um:"
        " workpiece)",
        unset="workpiece",
    )
    fit: Annotated[tuple[str, ...] | None, Grammar("KEYS|auto", read_keys, many=True)] = option(
        None,
        "Parameters to fit, separated by commas; KEY:ramp and KEY:constant choose the curve of a"
        " component error",
        unset="auto: those that affect the readings",
    )
    predict: Files = option((), "Readings to predict with the fitted errors, not fitted themselves")
    robust: bool = option(False, "Reduce the weight of outliers (robust fit)")
    priors: bool = option(False, "Use the tolerances of SCENE as prior knowledge")
    next_count: int | None = option(
        None,
        "Recommend the N measurements that reduce the uncertainty most per minute of work",
        flag="--next",
        low=1,
        high=MAX_NEXT,
    )
    target: Annotated[Target, Grammar("map|corner|part|verdict|X=..,Y=..", _target)] = option(
        "map",
        "Quantity whose uncertainty is minimised: the error map (RMS), its most uncertain node, the"
        " part of SCENE, its tolerance verdicts, or a point",
        flag="--for",
    )
    instrument: Budget = option(
        NO_INSTRUMENT,
        f"Instrument whose uncertainty is included: {', '.join(instrument_names())}, or a file."
        " Readings without u_um have its scatter; common contributions widen the intervals",
        unset="none",
    )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> Calibration:
        names = (*self.data, *self.predict)
        kinds = self.kinds if len(self.kinds) > 1 else (self.kinds or (None,)) * len(names)
        if len(kinds) != len(names):
            raise OptionError(
                f"{len(kinds)} values of {{kinds}} for {len(names)} files; expected 1 or"
                f" {len(names)}"
            )
        sets = [
            read_readings(name, scene, kind, self.frame)
            for name, kind in zip(names, kinds, strict=True)
        ]
        if self.frame is not None and not any(readings.frame for readings in sets):
            raise OptionError(
                f"{{frame}} {self.frame}: no file holds error vectors ({{kinds}} points, tracker)"
            )
        count = len(self.data)
        return self.fit_readings(scene, sets[:count], sets[count:], lambda: watch(0.0))

    def fit_readings(
        self,
        scene: Scene,
        sets: Sequence[Readings],
        predict: Sequence[Readings] = (),
        check_cancelled: CheckCancelled = never_cancelled,
    ) -> Calibration:
        """Calibrate, and recommend the next measurements where they are requested or needed."""
        calibration = calibrate(scene, sets, self, predict, check_cancelled)
        count = self.next_count or int(self.target != "map")
        if not count and not calibration.rank.confounded:
            return calibration
        steps = next_best(
            scene,
            [residuals.readings for residuals in calibration.fitted],
            calibration,
            count,
            check_cancelled=check_cancelled,
            target=self.target,
            instrument=self.instrument,
        )
        notes = calibration.notes
        if len(steps) < count:
            measurement = "further measurement" if steps else "measurement"
            notes += (f"no {measurement} reduces U95 {describe_target(self.target)} by 1 %",)
        return replace(
            calibration,
            separated_by=find_separating(scene, sets, calibration, check_cancelled),
            next_measurements=steps,
            target=self.target,
            notes=notes,
        )


def calibrate(
    scene: Scene,
    sets: Sequence[Readings],
    request: Calibrate | None = None,
    predict: Sequence[Readings] = (),
    check_cancelled: CheckCancelled = never_cancelled,
) -> Calibration:
    """Fit the errors of a machine to readings.

    Parameters
    ----------
    scene : Scene
        The machine, and the errors to start from.
    sets : sequence of Readings
    request : Calibrate, optional
        Options of the fit: `fit`, `robust`, `priors`, `instrument`.
    predict : sequence of Readings, optional
        Readings that are not fitted but predicted.
    check_cancelled : callable, optional
        Called before each evaluation of the model; an exception that it raises ends the fit.

    Returns
    -------
    Calibration

    Raises
    ------
    OptionError, UnknownNameError
        If no fit is possible: too few readings, a parameter that the machine does not have, a fit
        that does not converge, errors too large for a rigid-body model.

    Notes
    -----
    Weighted least squares (``scipy.optimize.least_squares``) with the exact model; derivatives to
    first order. The parameters are taken in order; one that is confounded with those before it
    keeps the value of the scene, and only a combination of them has an interval. Standard
    uncertainties: from the covariance ``s²·(JᵀWJ)⁻¹``, s from the residuals where the readings
    state no uncertainty, intervals with Student's t (ISO/IEC Guide 98-3, H.3). In a robust fit s²
    is that of Huber (`warpspace.calibration.solve`).

    Examples
    --------
    >>> from warpspace import load_scene
    >>> from warpspace.calibration import read_readings
    >>> scene = load_scene("fork_head_bc")
    >>> calibration = calibrate(scene, [read_readings("tcp_on.csv", scene)])
    >>> round(calibration.rms_before_mm, 3), round(calibration.rms_after_mm, 3)
    (0.278, 0.061)
    """
    if not sets:
        raise OptionError("no readings; expected at least one file ({data} FILE)")
    fit = _assemble(scene, sets, request or Calibrate(), check_cancelled)
    return _report(fit, predict)


@dataclass(frozen=True)
class Fit:
    """One fit: the assembled readings, and by property the solution and its uncertainty."""

    scene: Scene
    request: Calibrate
    model: MeasurementModel
    has_assumed_scatter: bool  # of readings that state no uncertainty
    notes: tuple[str, ...]  # on that assumption

    @cached_property
    def parameters(self) -> FitParameters:
        """All parameters that may be fitted."""
        keys = self.request.fit
        if keys is None:
            keys = automatic_parameters(self.scene, self.model.sets)
        parameters = build_fit_parameters(self.scene, keys)
        if not parameters.keys:
            raise OptionError("no axis moves whose errors could be fitted; expected {fit} KEYS")
        return parameters

    @cached_property
    def initial(self) -> Solved:
        """Set-ups fitted alone, with the errors of the scene."""
        return solve(self.model, self.parameters.only(()), robust=self.request.robust)

    @cached_property
    def weights(self) -> Array:
        return np.concatenate(self.model.weights())

    @cached_property
    def rank(self) -> Rank:
        parameters = self.parameters
        jacobian = self.model.derivatives(parameters, parameters.start, self.initial.unknown)
        by_parameter, by_unknown = (self.weights[:, None] * columns for columns in jacobian)
        tolerance = self.model.rank_tolerance
        return find_rank(parameters.keys, by_parameter, by_unknown, tolerance)

    @cached_property
    def prior(self) -> tuple[Array, Array] | None:
        """Centres and standard uncertainties of the tolerances, [K] each, where they count."""
        return _prior(self.scene, self.parameters.keys) if self.request.priors else None

    @cached_property
    def fitted(self) -> FitParameters:
        """The parameters that are fitted; the others keep the values of the scene."""
        keys = self.rank.independent if self.prior is None else self.parameters.keys
        _check_count(self.model, self.rank, len(keys), self.prior is not None)
        return self.parameters.only(keys)

    @cached_property
    def solved(self) -> Solved:
        solved = solve(
            self.model, self.fitted, self.prior, self.initial.unknown, robust=self.request.robust
        )
        for row, amplitude in zip(self.fitted.parameters, solved.amplitudes, strict=True):
            if not abs(amplitude) <= MAX_ERROR:
                raise OptionError(
                    f"{row.key} is estimated as {amplitude:.4g} {row.unit}; expected at most"
                    f" ±{MAX_ERROR:g}. Are units, kind of readings and machine right?"
                )
        return solved

    @cached_property
    def before(self) -> list[Array]:
        """Residuals of each file with the errors of the scene, [n, d], mm."""
        return self.model.residuals(self.parameters, self.parameters.start, self.initial.unknown)

    @cached_property
    def after(self) -> list[Array]:
        """Residuals of each file with the fitted errors, [n, d], mm."""
        return self.model.residuals(self.fitted, self.solved.amplitudes, self.solved.unknown)

    @property
    def dof(self) -> int:
        """Degrees of freedom of the residuals; a prior counts as a reading."""
        count = len(self.fitted.keys)
        return self.model.size + count * (self.prior is not None) - count - len(self.model.unknowns)

    @cached_property
    def sigma_mm(self) -> float:
        """Standard deviation of a component; where uncertainties are stated, in units of these."""
        return self.solved.scale or self.standard_deviation(self.deviations(self.after))

    def deviations(self, residuals: Sequence[Array]) -> Array:
        """Weight and join residuals, [N]."""
        return np.concatenate([row.ravel() for row in residuals]) * self.weights

    def standard_deviation(self, deviations: Array) -> float:
        if self.request.robust:
            return robust_scale(deviations, self.dof)
        return float(np.sqrt(np.sum(deviations**2) / max(self.dof, 1)))

    @cached_property
    def scatter_covariance(self) -> Array:
        """Covariance of parameters and set-ups from the scatter of readings, [k + m, k + m]."""
        is_scaled = self.model.has_uncertainties or self.solved.scale is not None
        return covariance_of(self.solved) * (1.0 if is_scaled else self.sigma_mm**2)

    @property
    def scatter_dof(self) -> float:
        if not self.model.has_uncertainties:
            return float(max(self.dof, 1))
        return self.request.instrument.scatter[1] if self.has_assumed_scatter else np.inf

    @cached_property
    def shared_shifts(self) -> list[Array]:
        """Change of parameters and set-ups per u of each shared contribution, [k + m, c] each."""
        weights = np.sqrt(self.solved.trust) * self.weights[:, None]
        gain = covariance_of(self.solved) @ self.solved.weighted.T
        gain = gain[:, : len(weights)]
        shared = self.request.instrument.shared
        return [-gain @ (weights * common_mode(self.model, row)) for row in shared]

    @cached_property
    def covariance_parts(self) -> Array:
        """Covariance of the parameters by its source, [1 + shared, k, k]: scatter comes first."""
        count = len(self.fitted.keys)
        shared = [shift[:count] @ shift[:count].T for shift in self.shared_shifts]
        return np.stack([self.scatter_covariance[:count, :count], *shared])

    @cached_property
    def covariance(self) -> Array:
        return self.covariance_parts.sum(axis=0)

    @cached_property
    def effective_dof(self) -> Array:
        """Effective degrees of freedom of each fitted parameter, [k]."""
        variances = np.diagonal(self.covariance_parts, axis1=1, axis2=2)
        shared = [row.dof for row in self.request.instrument.shared]
        return effective_dof(variances, [self.scatter_dof, *shared])

    @cached_property
    def lack_of_fit(self) -> tuple[float | None, tuple[str, ...]]:
        return _lack_of_fit(self.model, self.after, self.sigma_mm, self.dof)


def _assemble(
    scene: Scene, sets: Sequence[Readings], request: Calibrate, check_cancelled: CheckCancelled
) -> Fit:
    has_assumed_scatter = any(readings.sigma_mm is None for readings in sets)
    sets, notes = _with_scatter(scene, sets, request, check_cancelled)
    model = MeasurementModel.of(scene, sets, check_cancelled)
    return Fit(scene, request, model, has_assumed_scatter, notes)


def _with_scatter(
    scene: Scene, sets: Sequence[Readings], request: Calibrate, check_cancelled: CheckCancelled
) -> tuple[Sequence[Readings], tuple[str, ...]]:
    """Weight readings without uncertainty by the instrument, or by a fit without priors."""
    if all(readings.sigma_mm is not None for readings in sets):
        return sets, ()
    scatter_mm, source = MM_PER_UM * request.instrument.scatter[0], "scatter of the instrument"
    if request.priors and not scatter_mm:
        fit = _assemble(scene, sets, replace(request, priors=False), check_cancelled)
        scatter_mm, source = fit.sigma_mm, "residuals of a fit without priors"
    if not scatter_mm:
        return sets, ()
    weighted = [
        readings
        if readings.sigma_mm is not None
        else replace(readings, sigma_mm=np.full(len(readings), scatter_mm))
        for readings in sets
    ]
    note = f"readings without u_um: u = {UM_PER_MM * scatter_mm:.3g} µm, from the {source}"
    return weighted, (note,)


def _report(fit: Fit, predict: Sequence[Readings]) -> Calibration:
    model, scene, instrument = fit.model, fit.scene, fit.request.instrument
    parameters, combinations = _estimates(fit)
    lack_of_fit, lack_notes = fit.lack_of_fit
    outliers = _outliers(model, fit.after)
    predicted, coverage, prediction_notes = _predict(fit, predict)
    budget = None
    if instrument.name:
        map_u95 = u95_at(scene, fit.fitted, "map")
        total = map_u95(fit.covariance) or 1.0  # where no error acts
        scatter, *shared = fit.covariance_parts
        parts = (scatter * fit.has_assumed_scatter, *shared)
        budget = build_budget(instrument, model, [(map_u95(part) / total) ** 2 for part in parts])
    return Calibration(
        scene=_fitted_scene(fit),
        title=scene.title,
        parameters=parameters,
        combinations=combinations,
        rank=fit.rank,
        slopes=fit.parameters.slopes,
        fit=fit.fitted.keys,
        covariance=fit.covariance,
        unknowns=by_name(model.unknowns, fit.solved.unknown),
        fitted=tuple(
            Residuals(*row) for row in zip(model.sets, fit.before, fit.after, outliers, strict=True)
        ),
        predicted=predicted,
        rms_before_mm=rms_mm(fit.before),
        rms_after_mm=rms_mm(fit.after),
        rms_predicted_before_mm=rms_mm([r.before_mm for r in predicted]) if predicted else None,
        rms_predicted_after_mm=rms_mm([r.after_mm for r in predicted]) if predicted else None,
        predicted_coverage_95=coverage,
        sigma_mm=fit.sigma_mm,
        dof=fit.dof,
        lack_of_fit=lack_of_fit,
        instrument=budget,
        notes=(
            *fit.notes,
            *(note for readings in (*model.sets, *predict) for note in readings.notes),
            *prediction_notes,
            *lack_notes,
            *_frame_notes(fit),
        ),
        observability=observability(scene, model.sets, model.check_cancelled),
    )


def _fitted_scene(fit: Fit) -> Scene:
    """Return the scene with the fitted errors and their covariance."""
    scene, keys = fit.scene, fit.fitted.keys
    lack_of_fit, notes = fit.lack_of_fit
    rows = tuple(map(tuple, ((fit.covariance + fit.covariance.T) / 2.0).tolist()))
    fitted = Covariance(
        keys,
        rows,
        float(fit.effective_dof.min(initial=np.inf)),
        lack_of_fit=(lack_of_fit or 0.0) if notes else 0.0,
    )
    null_space = () if fit.request.priors else fit.rank.null_space
    fitted = fitted.extended(fit.model.positions)
    return replace(
        scene,
        title=f"{scene.title.removesuffix(CALIBRATED)}{CALIBRATED}"[:MAX_TEXT],
        errors=fit.fitted.errors_with(fit.solved.amplitudes),
        uncertainty={key: curve for key, curve in scene.uncertainty.items() if key not in keys},
        covariance=_join_covariance(scene, fit.parameters, null_space, fitted),
    )


def _frame_notes(fit: Fit) -> tuple[str, ...]:
    """Warn where vectors fit much better in the other frame.

    The residuals of the readings in that frame, less what a change of the fitted parameters and
    set-ups can explain: the part of them outside the columns of the fitted Jacobian.
    """
    sets = fit.model.sets
    turned_sets = [in_other_frame(fit.scene, readings) for readings in sets]
    turned = [at for at, other in enumerate(turned_sets) if other is not None]
    if not turned:
        return ()
    from scipy.stats import f

    best_sigma, best_rms, changed = fit.sigma_mm, rms_mm(fit.after), turned[:0]
    for chosen in [turned, *([at] for at in turned if turned[1:])]:
        residuals = list(fit.after)
        for at in chosen:
            other = turned_sets[at] or sets[at]
            residuals[at] = residuals[at] + other.observed_mm - sets[at].observed_mm
        refitted = _refit(fit, residuals)
        if refitted is not None and refitted[0] < best_sigma:
            best_sigma, best_rms, changed = *refitted, chosen
    dof = max(fit.dof, 1)
    ratio = (fit.sigma_mm / max(best_sigma, 1e-12)) ** 2
    if ratio < max(4.0, float(f.ppf(0.999, dof, dof))):
        return ()
    files = ", ".join(Path(sets[at].source).name for at in changed)
    frame = sets[changed[0]].frame
    other, letter = ("workpiece", "w") if frame == "machine" else ("machine", "R")
    note = (
        f"{files}: in the {frame} frame these vectors leave residuals of"
        f" {UM_PER_MM * rms_mm(fit.after):.3g} µm (RMS), in the {other} frame"
        f" {UM_PER_MM * best_rms:.3g} µm: the result is likely wrong; expected --frame {other},"
        f" or columns ex_{letter}_um and so on"
    )
    return (note,)


def _refit(fit: Fit, residuals: Sequence[Array]) -> tuple[float, float] | None:
    """Fit residuals, [n, d] each, mm, to first order: their sigma and RMS; None without a fit."""
    trust = np.sqrt(fit.solved.trust)
    deviations = trust * fit.deviations(residuals)
    right = deviations
    if fit.prior is not None:
        right = np.append(right, (fit.solved.amplitudes - fit.prior[0]) / fit.prior[1])
    jacobian = fit.solved.weighted
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    step = np.linalg.lstsq(-jacobian / scale, right, rcond=None)[0] / scale
    amplitudes = fit.solved.amplitudes + step[: len(fit.fitted.keys)]
    if np.abs(amplitudes).max(initial=0.0) > MAX_ERROR:
        return None  # errors that no machine has
    deviations = (deviations + (jacobian @ step)[: len(deviations)]) / trust
    parts = np.split(deviations / fit.weights, np.cumsum([row.size for row in residuals])[:-1])
    vectors = [part.reshape(row.shape) for part, row in zip(parts, residuals, strict=True)]
    return fit.standard_deviation(deviations), rms_mm(vectors)


def _check_count(model: MeasurementModel, rank: Rank, fitted: int, has_prior: bool) -> None:
    if not rank.independent and not has_prior:
        raise OptionError(
            f"{model.size} components in {sum(map(len, model.sets))} readings determine none of the"
            " parameters; expected more poses, other axes, or another {fit}"
        )
    if not has_prior and model.size <= fitted + len(model.unknowns):
        required = fitted + len(model.unknowns) + 1
        raise OptionError(
            f"{model.size} components for {fitted} parameters and {len(model.unknowns)} unknown"
            f" coordinates of the set-up; expected at least {required}: more readings, or fewer"
            " parameters ({fit} KEYS)"
        )


def _prior(scene: Scene, keys: Sequence[str]) -> tuple[Array, Array]:
    tolerances = [scene.tolerances.get(key) for key in keys]
    rows = [tolerance for tolerance in tolerances if tolerance is not None]
    if len(rows) < len(keys):
        missing = ", ".join(scene.tolerances.missing(keys))
        raise OptionError(
            f"{{priors}}: {missing} have no tolerance; expected one each in [tolerances]"
        )
    widths = np.array([max(row.half_width, 1e-6) for row in rows])
    return np.array([row.centre for row in rows]), widths / np.sqrt(3.0)


def _join_covariance(
    scene: Scene,
    parameters: FitParameters,
    null_space: Sequence[Mapping[str, float]],
    fitted: Covariance,
) -> Covariance | None:
    """Join the fitted covariance with that of other errors in the scene; list undetermined errors.

    A vector of the null space is a sum of errors without effect on the readings. Where it moves no
    point either, in the working volume and at the poses of the readings, none of its errors needs
    to be undetermined.
    """
    present = (scene.covariance or Covariance((), ())).without(fitted.keys)
    stated = {*scene.uncertainty} - {*fitted.keys} | {*present.keys}
    ranges = fitted.extended(scene.workspace.ranges).measured_range
    rng = np.random.default_rng(0)
    poses = {axis: rng.uniform(*ranges[axis], POSES) for axis in ranges}
    candidates: dict[str, float] = {}
    for loop in (Loop.TOOL, Loop.RELATIVE) if null_space else ():
        basis = build_basis(
            scene.model, parameters.errors, parameters.keys, poses, scene.view(loop)
        )
        for vector in null_space:
            effects = [
                share * basis.position[parameters.keys.index(key)] for key, share in vector.items()
            ]
            largest = max(np.abs(effect).max() for effect in effects)
            if np.abs(sum(effects)).max() > MIN_EFFECT * largest:
                candidates |= vector
    undetermined = tuple(
        key for key in dict.fromkeys((*candidates, *present.undetermined)) if key not in stated
    )
    fitted = fitted.without(undetermined)
    keys = (*fitted.keys, *present.keys)
    if not keys and not undetermined:
        return None
    matrix, count = np.zeros((len(keys),) * 2), len(fitted.keys)
    matrix[:count, :count], matrix[count:, count:] = fitted.matrix, present.matrix
    joined = Covariance(
        keys,
        tuple(map(tuple, matrix.tolist())),
        min(fitted.dof, present.dof),
        present.measured_range,
        undetermined,
        max(fitted.lack_of_fit, present.lack_of_fit),
    )
    return joined.extended(fitted.measured_range)


def _estimates(fit: Fit) -> tuple[tuple[FittedParameter, ...], tuple[Combination, ...]]:
    from scipy.stats import t

    factors = t.ppf(0.975, fit.effective_dof)
    widths = np.sqrt(np.diag(fit.covariance))
    start = dict(zip(fit.parameters.keys, fit.parameters.start.tolist(), strict=True))
    parameters: list[FittedParameter] = []
    combinations: list[Combination] = []
    for key, before in start.items():
        if key not in fit.fitted.keys:
            status = Estimability.NOT_ESTIMABLE
            parameters.append(FittedParameter(key, before, before, None, None, status))
            continue
        at = fit.fitted.keys.index(key)
        amplitude, width = float(fit.solved.amplitudes[at]), float(widths[at])
        half = float(factors[at]) * width
        is_estimable = fit.rank.is_identifiable(key)
        status = Estimability.ESTIMABLE if is_estimable else Estimability.CONFOUNDED
        if is_estimable or fit.prior is not None:
            interval = (amplitude - half, amplitude + half)
            parameters.append(FittedParameter(key, before, amplitude, width, interval, status))
            continue
        parameters.append(FittedParameter(key, before, amplitude, None, None, status))
        shares = fit.rank.confounded_with(key)
        total = amplitude + sum(shares[other] * start[other] for other in shares if other != key)
        combinations.append(Combination(shares, total, width, (total - half, total + half)))
    return tuple(parameters), tuple(combinations)


def _outliers(model: MeasurementModel, residuals: Sequence[Array]) -> list[tuple[int, ...]]:
    lengths = [
        np.linalg.norm(row * weight.reshape(row.shape), axis=-1)
        for row, weight in zip(residuals, model.weights(), strict=True)
    ]
    pooled = np.concatenate(lengths)
    middle = float(np.median(pooled))
    width = MAD * float(np.median(np.abs(pooled - middle)))
    limit = middle + OUTLIER * max(width, 1e-9)
    return [tuple(int(at) for at in np.flatnonzero(row > limit)) for row in lengths]


def _predict(
    fit: Fit, predict: Sequence[Readings]
) -> tuple[tuple[Residuals, ...], float | None, tuple[str, ...]]:
    """Predict readings that are not fitted: residuals, coverage of 95 % intervals, notes.

    Set-ups that were not fitted are fitted to the predicted readings themselves.
    """
    if not predict:
        return (), None, ()
    if fit.request.instrument.scatter[0]:
        predict = _with_scatter(fit.scene, predict, fit.request, fit.model.check_cancelled)[0]
    model = MeasurementModel.of(fit.scene, predict, fit.model.check_cancelled)
    before = by_name(fit.model.unknowns, fit.initial.unknown)
    after = by_name(fit.model.unknowns, fit.solved.unknown)
    new = [name for name in model.unknowns if name not in after]
    notes: tuple[str, ...] = ()
    if new:
        errors = fit.fitted.errors_with(fit.solved.amplitudes)
        fixed = replace(fit.fitted.only(()), errors=errors)
        for values, parameters in ((before, fit.parameters.only(())), (after, fixed)):
            unknown = solve(model, parameters, robust=fit.request.robust).unknown
            set_up = by_name(model.unknowns, unknown)
            values |= {name: set_up[name] for name in new}
        notes = (f"set-ups fitted to the predicted readings themselves: {', '.join(new)}",)
    unknown = np.array([after[name] for name in model.unknowns])
    unknown_before = np.array([before[name] for name in model.unknowns])
    rows_before = model.residuals(fit.parameters, fit.parameters.start, unknown_before)
    rows_after = model.residuals(fit.fitted, fit.solved.amplitudes, unknown)
    rows = zip(model.sets, rows_before, rows_after, _outliers(model, rows_after), strict=True)
    residuals = tuple(Residuals(*row) for row in rows)
    if fit.model.has_uncertainties and not model.has_uncertainties:
        return residuals, None, notes  # the uncertainty of these readings is unknown
    return residuals, _coverage(fit, model, new, unknown, rows_after), notes


def _coverage(
    fit: Fit,
    model: MeasurementModel,
    new: Sequence[str],
    unknown: Array,
    residuals: Sequence[Array],
) -> float:
    """Compute the share of predicted components inside their 95 % intervals.

    Variances: of the readings, of all that was fitted, and of the contributions that predicted and
    fitted readings share, less the part of these that the fit has absorbed.
    """
    from scipy.stats import t

    weights = np.concatenate(model.weights(fit.sigma_mm))[:, None]
    by_parameter, by_unknown = model.derivatives(fit.fitted, fit.solved.amplitudes, unknown)
    is_new = np.isin(model.unknowns, new)
    count = len(fit.fitted.keys)
    shared_set_ups = [name for name in model.unknowns if name not in new]
    columns = [*range(count), *(count + fit.model.unknowns.index(n) for n in shared_set_ups)]
    set_up = orthonormal_basis(weights * by_unknown[:, is_new])
    jacobian = project_out(weights * np.hstack([by_parameter, by_unknown[:, ~is_new]]), set_up)
    covariance = fit.scatter_covariance[np.ix_(columns, columns)]
    variance = np.sum((jacobian @ covariance) * jacobian, axis=1)
    for contribution, shift in zip(fit.request.instrument.shared, fit.shared_shifts, strict=True):
        added = project_out(weights * common_mode(model, contribution), set_up)
        variance += np.sum((added - jacobian @ shift[columns]) ** 2, axis=1)
    leverage = np.sum(set_up**2, axis=1)
    half_widths = t.ppf(0.975, fit.scatter_dof) * np.sqrt(variance + 1.0 - leverage)
    deviations = weights[:, 0] * np.concatenate([row.ravel() for row in residuals])
    return float(np.mean(np.abs(deviations) <= half_widths))


CHANCE = 0.01  # probability of calling a complete model incomplete


def _lack_of_fit(
    model: MeasurementModel, residuals: Sequence[Array], sigma_mm: float, dof: int
) -> tuple[float | None, tuple[str, ...]]:
    """Compare the scatter of residuals with that of readings, stated or from repeated readings.

    The root of χ²/ν, or of F of lack of fit over pure error (Draper and Smith, Applied Regression
    Analysis, 2.1). None where readings state no uncertainty and no pose is repeated.
    """
    from scipy.stats import chi2, f

    dof = max(dof, 1)
    if model.has_uncertainties:
        ratio, reference = sigma_mm**2, "their stated uncertainty"
        limit = float(chi2.isf(CHANCE, dof)) / dof
    else:
        scatter, repeated = _pure_error(model, residuals)
        if repeated < 1 or dof <= repeated or scatter <= 0.0:
            return None, ()
        total, dof = sigma_mm**2 * dof, dof - repeated
        ratio = (total - scatter) / dof * repeated / scatter
        reference = "the scatter of repeated readings"
        limit = float(f.isf(CHANCE, dof, repeated))
    note = f"lack of fit: residuals are {np.sqrt(ratio):.1f} times {reference}"
    return float(np.sqrt(max(ratio, 0.0))), (note,) * (ratio > limit)


def _pure_error(model: MeasurementModel, residuals: Sequence[Array]) -> tuple[float, int]:
    """Sum the squared deviations of repeated readings from their mean; and degrees of freedom."""
    scatter, repeated = 0.0, 0
    for readings, row, weight in zip(model.sets, residuals, model.weights(), strict=True):
        weighted = row * weight.reshape(row.shape)
        labels = np.unique(readings.session, return_inverse=True)[1]
        poses = np.round(np.column_stack([labels, *readings.coordinates.values()]), 6)
        group = np.unique(poses, axis=0, return_inverse=True)[1].ravel()
        means = np.array([weighted[group == at].mean(axis=0) for at in range(group.max() + 1)])
        scatter += float(np.sum((weighted - means[group]) ** 2))
        repeated += (len(weighted) - len(means)) * weighted.shape[1]
    return scatter, repeated
