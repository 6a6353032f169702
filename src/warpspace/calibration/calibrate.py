"""Calibration: least-squares fit of the error parameters of a machine to measured data."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np

from warpspace.analysis.description import Analysis, ProgressCallback
from warpspace.analysis.options import PLACE, Files, Grammar, Kinds, option
from warpspace.analysis.uncertainty.propagation import t_quantile
from warpspace.calibration.calibration_result import (
    TARGETS,
    Calibration,
    Combination,
    Estimability,
    FittedParameter,
    Target,
    describe_target,
)
from warpspace.calibration.fit import Fit, FitOptions, frame_notes, join_residuals, predict_readings
from warpspace.calibration.instruments import (
    NO_INSTRUMENT,
    Instrument,
    build_budget,
    instrument_names,
    load_instrument,
)
from warpspace.calibration.next_best import find_separating, next_best, observability, u95_at
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import pair_kinds, read_readings
from warpspace.calibration.solve import CheckCancelled, never_cancelled, read_keys, rms_mm
from warpspace.exceptions import OptionError, SceneError
from warpspace.parts.inspection_report import MAX_SESSION_U
from warpspace.parts.workpiece import REPORT_PLACE_HELP, Place, place_part
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM

MAX_NEXT = 10
AS_WELL = 1.2  # residuals in the other sense of an axis, relative to those in its own, at most
NO_RESIDUAL_MM = 1e-4
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
        (), "CSV file of readings, or the name of a bundled one such as tcp_on.csv", required=True
    )
    kinds: Kinds = option(
        (),
        "points, tracker, sphere, sphere-tcp, lengths, part, or a test with its options such as"
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
    place: Place = option(None, REPORT_PLACE_HELP, unset="that of the scene")
    session_u: float | None = option(
        None,
        "Standard uncertainty of the variation between parts: scales and squareness",
        unit="µm/m and µrad",
        low=0.0,
        high=MAX_SESSION_U,
        unset="estimated from several inspection reports",
    )

    def run(self, scene: Scene, watch: ProgressCallback, /) -> Calibration:
        names = (*self.data, *self.predict)
        kinds = pair_kinds(names, self.kinds)
        placed = place_part(scene, self.place)
        sets = [
            read_readings(name, placed, kind, self.frame)
            for name, kind in zip(names, kinds, strict=True)
        ]
        if self.frame is not None and not any(readings.frame for readings in sets):
            raise OptionError(
                f"{{frame}} {self.frame}: no file holds error vectors ({{kinds}} points, tracker)"
            )
        count, check_cancelled = len(self.data), partial(watch, 0.0)
        found = self.fit_readings(scene, sets[:count], sets[count:], check_cancelled)
        senses = self._sense_notes(scene, sets[:count], kinds, found, check_cancelled)
        return replace(found, notes=(*found.notes, *senses))

    @property
    def fit_options(self) -> FitOptions:
        return FitOptions(self.fit, self.robust, self.priors, self.instrument, self.session_u)

    def _sense_notes(
        self,
        scene: Scene,
        sets: Sequence[Readings],
        kinds: Sequence[str | None],
        found: Calibration,
        check_cancelled: CheckCancelled,
    ) -> Iterator[str]:
        """Fit readings of a ball or sphere with each rotary axis in its other sense as well."""
        if not all(readings.kind.startswith(("r-test", "sphere")) for readings in sets):
            return
        # a circle of the linear axes tells the sense, and the positions were read with it
        known = {circle.axis for readings in sets for circle in readings.circles}
        for name, axis in scene.machine.axes.items():
            turns = any(np.ptp(readings.coordinates[name]) for readings in sets)
            if axis.is_linear or name in known or not turns:
                continue
            machine = scene.machine.with_direction(name, -axis.direction)
            other = replace(scene, model=replace(scene.model, machine=machine))
            try:
                files = zip(self.data, kinds, strict=False)
                again = [read_readings(file, other, kind, self.frame) for file, kind in files]
                after_mm = rms_mm(Fit.of(other, again, self.fit_options, check_cancelled).after)
            except (OptionError, SceneError):  # cannot run in this sense
                continue
            if after_mm <= max(AS_WELL * found.rms_after_mm, NO_RESIDUAL_MM):
                yield (
                    f"{name} may turn in the other sense: the residuals are"
                    f" {after_mm * UM_PER_MM:.3g} µm with machine.direction.{name} ="
                    f" {-axis.direction}, {found.rms_after_mm * UM_PER_MM:.3g} µm with"
                    f" {axis.direction}, and the errors differ. Check which way it turns"
                )

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
    request = request or Calibrate()
    return _report(Fit.of(scene, sets, request.fit_options, check_cancelled), predict)


def _report(fit: Fit, predict: Sequence[Readings]) -> Calibration:
    model, scene, instrument = fit.model, fit.scene, fit.options.instrument
    parameters, combinations = _estimates(fit)
    lack_of_fit, lack_notes = fit.lack_of_fit
    predicted, coverage, prediction_notes = predict_readings(fit, predict)
    budget, terms = None, fit.session_terms
    if instrument.name:
        map_u95 = u95_at(scene, fit.fitted, "map")
        total = map_u95(fit.covariance) or 1.0  # where no error acts
        scatter, *shared = fit.covariance_parts
        parts = (scatter * fit.has_assumed_scatter, *shared)
        budget = build_budget(instrument, model, [(map_u95(part) / total) ** 2 for part in parts])
    return Calibration(
        scene=fit.fitted_scene,
        title=scene.title,
        parameters=parameters,
        combinations=combinations,
        rank=fit.rank,
        slopes=fit.parameters.slopes,
        fit=fit.fitted.keys,
        covariance=fit.covariance,
        unknowns=dict(zip(model.unknowns, fit.solved.unknown.tolist(), strict=True)),
        fitted=join_residuals(model, fit.before, fit.after),
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
            *(terms.notes() if terms else ()),
            *frame_notes(fit),
        ),
        observability=observability(scene, model.sets, model.check_cancelled),
        sessions=terms.as_json() if terms else {},
    )


def _estimates(fit: Fit) -> tuple[tuple[FittedParameter, ...], tuple[Combination, ...]]:
    factors = t_quantile(0.975, fit.effective_dof)
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
