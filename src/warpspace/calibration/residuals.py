"""Residuals of readings: outliers, prediction with intervals, vectors in the wrong frame."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from warpspace.calibration import solve
from warpspace.calibration.calibration_result import Residuals
from warpspace.calibration.fit import Fit, with_scatter
from warpspace.calibration.instruments import common_mode
from warpspace.calibration.kinds import in_other_frame
from warpspace.calibration.readings import Readings
from warpspace.units import UM_PER_MM, Array

OUTLIER = 4.0  # robust standard deviations beyond which a reading is an outlier


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
    from scipy.stats import t

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
    leverage = np.sum(set_up**2, axis=1)
    half_widths = t.ppf(0.975, fit.scatter_dof) * np.sqrt(variance + 1.0 - leverage)
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
        f" {UM_PER_MM * best_rms:.3g} µm: the result is likely wrong; expected --frame {other},"
        f" or columns ex_{letter}_um and so on"
    )
    return (note,)
