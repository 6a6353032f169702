"""Fit of errors and set-ups to readings: solution, covariance, residuals, predictions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from warpspace.analysis.uncertainty.propagation import t_quantile
from warpspace.calibration import solve
from warpspace.calibration.calibration_result import Residuals
from warpspace.calibration.instruments import NO_INSTRUMENT, Instrument, common_mode, effective_dof
from warpspace.calibration.kinds import in_other_frame
from warpspace.calibration.part_reports import check_dimensions, couple_parts
from warpspace.calibration.readings import Readings
from warpspace.calibration.session_terms import SessionTerms
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import build_basis
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Covariance
from warpspace.machine.limits import MAX_ERROR, MAX_TEXT
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

CALIBRATED = ", calibrated"  # suffix of the title of a calibrated scene
POSES = 60  # random poses at which the effect of errors is evaluated
MIN_EFFECT = 0.01  # share of the effect of one error, below which a sum of errors has none
OUTLIER = 4.0  # robust standard deviations beyond which a reading is an outlier
CHANCE = 0.01  # probability of calling a complete model incomplete


@dataclass(frozen=True)
class FitOptions:
    """Options of a fit, those of `Calibrate`."""

    keys: tuple[str, ...] | None = None
    robust: bool = False
    priors: bool = False
    instrument: Instrument = NO_INSTRUMENT
    session_u: float | None = None  # between parts, µm/m and µrad; None where not stated


@dataclass(frozen=True)
class Fit:
    """One fit: the assembled readings, and by property the solution and its uncertainty."""

    scene: Scene
    model: solve.MeasurementModel
    options: FitOptions
    has_assumed_scatter: bool  # of readings that state no uncertainty
    notes: tuple[str, ...]  # on that assumption

    @classmethod
    def of(
        cls,
        scene: Scene,
        sets: Sequence[Readings],
        options: FitOptions,
        check_cancelled: solve.CheckCancelled = solve.never_cancelled,
    ) -> "Fit":
        sets = couple_parts(sets)
        has_assumed_scatter = any(readings.sigma_mm is None for readings in sets)
        sets, notes = with_scatter(scene, sets, options, check_cancelled)
        model = solve.MeasurementModel.of(scene, sets, check_cancelled)
        return cls(scene, model, options, has_assumed_scatter, notes)

    @cached_property
    def parameters(self) -> solve.FitParameters:
        """All parameters that may be fitted."""
        keys = self.options.keys
        if keys is None:
            keys = solve.automatic_parameters(self.scene, self.model.sets)
        parameters = solve.build_fit_parameters(self.scene, keys)
        if not parameters.keys:
            raise OptionError("no axis moves whose errors could be fitted; expected {fit} KEYS")
        return parameters

    @cached_property
    def initial(self) -> solve.Solved:
        """Set-ups fitted alone, with the errors of the scene."""
        return solve.solve(self.model, self.parameters.only(()), robust=self.options.robust)

    @cached_property
    def weights(self) -> Array:
        return self.model.weights()

    @cached_property
    def rank(self) -> solve.Rank:
        parameters = self.parameters
        jacobian = self.model.derivatives(parameters, parameters.start, self.initial.unknown)
        by_parameter, by_unknown = (self.weights[:, None] * columns for columns in jacobian)
        tolerance = self.model.rank_tolerance
        return solve.find_rank(parameters.keys, by_parameter, by_unknown, tolerance)

    @cached_property
    def prior(self) -> tuple[Array, Array] | None:
        """Centres and standard uncertainties of the tolerances, [K] each, where they count."""
        if not self.options.priors:
            return None
        keys, tolerances = self.parameters.keys, self.scene.tolerances
        rows = [row for row in map(tolerances.get, keys) if row is not None]
        if len(rows) < len(keys):
            raise OptionError(
                f"{{priors}}: {', '.join(tolerances.missing(keys))} have no tolerance; expected one"
                " each in [tolerances]"
            )
        widths = np.array([max(row.half_width, 1e-6) for row in rows])
        return np.array([row.centre for row in rows]), widths / np.sqrt(3.0)

    @cached_property
    def fitted(self) -> solve.FitParameters:
        """The parameters that are fitted; the others keep the values of the scene."""
        keys = self.rank.independent if self.prior is None else self.parameters.keys
        model, count, unknowns = self.model, len(keys), len(self.model.unknowns)
        if not self.rank.independent and self.prior is None:
            raise OptionError(
                f"{model.size} components in {sum(map(len, model.sets))} readings determine none of"
                " the parameters; expected more poses, other axes, or another {fit}"
            )
        if self.prior is None and model.size <= count + unknowns:
            raise OptionError(
                f"{model.size} components for {count} parameters and {unknowns} unknown coordinates"
                f" of the set-up; expected at least {count + unknowns + 1}: more readings, or fewer"
                " parameters ({fit} KEYS)"
            )
        return self.parameters.only(keys)

    @cached_property
    def solved(self) -> solve.Solved:
        solved = solve.solve(
            self.model, self.fitted, self.prior, self.initial.unknown, robust=self.options.robust
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
        if self.options.robust:
            return solve.robust_scale(deviations, self.dof)
        return float(np.sqrt(np.sum(deviations**2) / max(self.dof, 1)))

    @cached_property
    def scatter_covariance(self) -> Array:
        """Covariance of parameters and set-ups from the scatter of readings, [k + m, k + m]."""
        is_scaled = self.model.has_uncertainties or self.solved.scale is not None
        return solve.covariance_of(self.solved) * (1.0 if is_scaled else self.sigma_mm**2)

    @property
    def scatter_dof(self) -> float:
        if not self.model.has_uncertainties:
            return float(max(self.dof, 1))
        return self.options.instrument.scatter[1] if self.has_assumed_scatter else np.inf

    @cached_property
    def gain(self) -> Array:
        """Change of parameters and set-ups per change of each component of readings, [k + m, N]."""
        weights = np.sqrt(self.solved.trust) * self.weights
        gain = solve.covariance_of(self.solved) @ self.solved.weighted[: len(weights)].T
        return -gain * weights

    @cached_property
    def shared_shifts(self) -> list[Array]:
        """Change of parameters and set-ups per u of each shared contribution, [k + m, c] each."""
        shared = self.options.instrument.shared
        return [self.gain @ common_mode(self.model, row) for row in shared]

    @cached_property
    def session_terms(self) -> SessionTerms | None:
        """The variation between the parts of inspection reports."""
        unknown = dict(zip(self.model.unknowns, self.solved.unknown.tolist(), strict=True))
        covariance = self.scatter_covariance[len(self.fitted.keys) :, len(self.fitted.keys) :]
        scatter = self.sigma_mm, self.scatter_dof
        return SessionTerms.of(
            self.model.sets, unknown, covariance, scatter, self.options.session_u
        )

    @cached_property
    def session_shift(self) -> Array:
        """Change of parameters and set-ups per u of the shape of the mean part, [k + m, s]."""
        if self.session_terms is None:
            return np.zeros((len(self.scatter_covariance), 0))
        shift = self.gain @ self.session_terms.columns(self.model.sets)
        return shift / np.sqrt(len(self.session_terms.parts))

    @cached_property
    def covariance_parts(self) -> Array:
        """Covariance of the parameters by its source, [2 + shared, k, k].

        The scatter comes first, the variation between parts last.
        """
        count = len(self.fitted.keys)
        shifts = [shift[:count] for shift in (*self.shared_shifts, self.session_shift)]
        return np.stack(
            [self.scatter_covariance[:count, :count], *(shift @ shift.T for shift in shifts)]
        )

    @cached_property
    def covariance(self) -> Array:
        return self.covariance_parts.sum(axis=0)

    @cached_property
    def effective_dof(self) -> Array:
        """Effective degrees of freedom of each fitted parameter, [k]."""
        variances = np.diagonal(self.covariance_parts, axis1=1, axis2=2)
        shared = [row.dof for row in self.options.instrument.shared]
        terms_dof = self.session_terms.dof if self.session_terms else np.inf
        return effective_dof(variances, [self.scatter_dof, *shared, terms_dof])

    @cached_property
    def lack_of_fit(self) -> tuple[float | None, tuple[str, ...]]:
        """Scatter of residuals over that of readings, stated or from repeated ones; and a note.

        The root of χ²/ν, or of F of lack of fit over pure error (Draper and Smith, Applied
        Regression Analysis, 2.1). None where readings state no uncertainty and no pose is repeated.
        """
        from scipy.stats import chi2, f

        dof = max(self.dof, 1)
        if self.model.has_uncertainties:
            ratio, reference = self.sigma_mm**2, "their stated uncertainty"
            limit = float(chi2.isf(CHANCE, dof)) / dof
        else:
            scatter, repeated = _pure_error(self.model, self.after)
            if repeated < 1 or dof <= repeated or scatter <= 0.0:
                return None, ()
            total, dof = self.sigma_mm**2 * dof, dof - repeated
            ratio = (total - scatter) / dof * repeated / scatter
            reference = "the scatter of repeated readings"
            limit = float(f.isf(CHANCE, dof, repeated))
        note = f"lack of fit: residuals are {np.sqrt(ratio):.1f} times {reference}"
        return float(np.sqrt(max(ratio, 0.0))), (note,) * (ratio > limit)

    @cached_property
    def fitted_scene(self) -> Scene:
        """The scene with the fitted errors and their covariance."""
        scene, keys = self.scene, self.fitted.keys
        lack_of_fit, notes = self.lack_of_fit
        covariance = Covariance(
            keys,
            tuple(map(tuple, ((self.covariance + self.covariance.T) / 2.0).tolist())),
            float(self.effective_dof.min(initial=np.inf)),
            lack_of_fit=(lack_of_fit or 0.0) if notes else 0.0,
        ).extended(self.model.positions)
        null_space = () if self.options.priors else self.rank.null_space
        return replace(
            scene,
            title=f"{scene.title.removesuffix(CALIBRATED)}{CALIBRATED}"[:MAX_TEXT],
            errors=self.fitted.errors_with(self.solved.amplitudes),
            uncertainty={k: curve for k, curve in scene.uncertainty.items() if k not in keys},
            covariance=_join_covariance(scene, self.parameters, null_space, covariance),
        )

    def refit(self, residuals: Sequence[Array]) -> tuple[float, float] | None:
        """Fit residuals, [n, d] each, mm, to first order: sigma and RMS; None without a fit."""
        trust = np.sqrt(self.solved.trust)
        deviations = trust * self.deviations(residuals)
        right = deviations
        if self.prior is not None:
            right = np.append(right, (self.solved.amplitudes - self.prior[0]) / self.prior[1])
        jacobian = self.solved.weighted
        scale = np.linalg.norm(jacobian, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        step = np.linalg.lstsq(-jacobian / scale, right, rcond=None)[0] / scale
        amplitudes = self.solved.amplitudes + step[: len(self.fitted.keys)]
        if np.abs(amplitudes).max(initial=0.0) > MAX_ERROR:
            return None  # errors that no machine has
        deviations = (deviations + (jacobian @ step)[: len(deviations)]) / trust
        parts = np.split(deviations / self.weights, np.cumsum([row.size for row in residuals])[:-1])
        vectors = [part.reshape(row.shape) for part, row in zip(parts, residuals, strict=True)]
        return self.standard_deviation(deviations), solve.rms_mm(vectors)


def with_scatter(
    scene: Scene,
    sets: Sequence[Readings],
    options: FitOptions,
    check_cancelled: solve.CheckCancelled,
) -> tuple[Sequence[Readings], tuple[str, ...]]:
    """Weight readings without uncertainty by the instrument, or by a fit without priors."""
    if all(readings.sigma_mm is not None for readings in sets):
        return sets, ()
    scatter_mm, source = MM_PER_UM * options.instrument.scatter[0], "scatter of the instrument"
    if options.priors and not scatter_mm:
        fit = Fit.of(scene, sets, replace(options, priors=False), check_cancelled)
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


def _join_covariance(
    scene: Scene,
    parameters: solve.FitParameters,
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


def _pure_error(model: solve.MeasurementModel, residuals: Sequence[Array]) -> tuple[float, int]:
    """Sum the squared deviations of repeated readings from their mean; and degrees of freedom."""
    scatter, repeated = 0.0, 0
    for readings, weighted in zip(model.sets, model.weighted(residuals), strict=True):
        labels = np.unique(readings.session, return_inverse=True)[1]
        poses = np.round(np.column_stack([labels, *readings.coordinates.values()]), 6)
        group = np.unique(poses, axis=0, return_inverse=True)[1].ravel()
        means = np.array([weighted[group == at].mean(axis=0) for at in range(group.max() + 1)])
        scatter += float(np.sum((weighted - means[group]) ** 2))
        repeated += (len(weighted) - len(means)) * weighted.shape[1]
    return scatter, repeated


def join_residuals(
    model: solve.MeasurementModel, before: Sequence[Array], after: Sequence[Array]
) -> tuple[Residuals, ...]:
    """Join the residuals of each file, [n, d], mm, before and after the fit; find outliers."""
    lengths = [np.linalg.norm(row, axis=-1) for row in model.weighted(after)]
    pooled = np.concatenate(lengths)
    middle = float(np.median(pooled))
    width = solve.MAD * float(np.median(np.abs(pooled - middle)))
    limit = middle + OUTLIER * max(width, 1e-9)
    outliers = [tuple(map(int, np.flatnonzero(row > limit))) for row in lengths]
    return tuple(Residuals(*row) for row in zip(model.sets, before, after, outliers, strict=True))


def predict_readings(
    fit: Fit, sets: Sequence[Readings]
) -> tuple[tuple[Residuals, ...], float | None, tuple[str, ...]]:
    """Predict readings that are not fitted: residuals, coverage of 95 % intervals, notes.

    Set-ups that were not fitted are fitted to the predicted readings themselves.
    """
    if not sets:
        return (), None, ()
    if fit.options.instrument.scatter[0]:
        sets, _ = with_scatter(fit.scene, sets, fit.options, fit.model.check_cancelled)
    check_dimensions([*fit.model.sets, *sets])
    model = solve.MeasurementModel.of(fit.scene, sets, fit.model.check_cancelled)
    before = dict(zip(fit.model.unknowns, fit.initial.unknown, strict=True))
    after = dict(zip(fit.model.unknowns, fit.solved.unknown, strict=True))
    new = [name for name in model.unknowns if name not in after]
    notes: tuple[str, ...] = ()
    if new:
        errors = fit.fitted.errors_with(fit.solved.amplitudes)
        fixed = replace(fit.fitted.only(()), errors=errors)
        for values, parameters in ((before, fit.parameters.only(())), (after, fixed)):
            unknown = solve.solve(model, parameters, robust=fit.options.robust).unknown
            set_up = dict(zip(model.unknowns, unknown, strict=True))
            values |= {name: set_up[name] for name in new}
        notes = (f"set-ups fitted to the predicted readings themselves: {', '.join(new)}",)
    unknown = np.array([after[name] for name in model.unknowns])
    unknown_before = np.array([before[name] for name in model.unknowns])
    rows_before = model.residuals(fit.parameters, fit.parameters.start, unknown_before)
    rows_after = model.residuals(fit.fitted, fit.solved.amplitudes, unknown)
    residuals = join_residuals(model, rows_before, rows_after)
    if fit.model.has_uncertainties and not model.has_uncertainties:
        return residuals, None, notes  # the uncertainty of these readings is unknown
    return residuals, _coverage(fit, model, new, unknown, rows_after), notes


def _coverage(
    fit: Fit,
    model: solve.MeasurementModel,
    new: Sequence[str],
    unknown: Array,
    residuals: Sequence[Array],
) -> float:
    """Compute the share of predicted components inside their 95 % intervals.

    Variances: of the readings, of all that was fitted, and of the contributions that predicted and
    fitted readings share, less the part of these that the fit has absorbed.
    """
    weights = model.weights(fit.sigma_mm)[:, None]
    by_parameter, by_unknown = model.derivatives(fit.fitted, fit.solved.amplitudes, unknown)
    is_new = np.isin(model.unknowns, new)
    count = len(fit.fitted.keys)
    shared_set_ups = [name for name in model.unknowns if name not in new]
    columns = [*range(count), *(count + fit.model.unknowns.index(n) for n in shared_set_ups)]
    set_up = solve.orthonormal_basis(weights * by_unknown[:, is_new])
    jacobian = solve.project_out(
        weights * np.hstack([by_parameter, by_unknown[:, ~is_new]]), set_up
    )
    covariance = fit.scatter_covariance[np.ix_(columns, columns)]
    variance = np.sum((jacobian @ covariance) * jacobian, axis=1)
    for contribution, shift in zip(fit.options.instrument.shared, fit.shared_shifts, strict=True):
        added = solve.project_out(weights * common_mode(model, contribution), set_up)
        variance += np.sum((added - jacobian @ shift[columns]) ** 2, axis=1)
    if fit.session_terms is not None:  # another part varies by itself
        added = solve.project_out(weights * fit.session_terms.columns(model.sets), set_up)
        variance += np.sum(added**2, axis=1)
        variance += np.sum((jacobian @ fit.session_shift[columns]) ** 2, axis=1)
    leverage = np.sum(set_up**2, axis=1)
    half_widths = t_quantile(0.975, fit.scatter_dof) * np.sqrt(variance + 1.0 - leverage)
    deviations = weights[:, 0] * np.concatenate([row.ravel() for row in residuals])
    return float(np.mean(np.abs(deviations) <= half_widths))


def frame_notes(fit: Fit) -> tuple[str, ...]:
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

    best_sigma, best_rms, changed = fit.sigma_mm, solve.rms_mm(fit.after), turned[:0]
    for chosen in [turned, *([at] for at in turned if turned[1:])]:
        residuals = list(fit.after)
        for at in chosen:
            other = turned_sets[at] or sets[at]
            residuals[at] = residuals[at] + other.observed_mm - sets[at].observed_mm
        refitted = fit.refit(residuals)
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
        f" {UM_PER_MM * solve.rms_mm(fit.after):.3g} µm (RMS), in the {other} frame"
        f" {UM_PER_MM * best_rms:.3g} µm: the result is likely wrong; expected the {other}"
        f" frame, or columns ex_{letter}_um and so on"
    )
    return (note,)
