"""Calibration: least squares of the errors of a machine to readings, and what is left."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np

from warpspace.analysis.description import Analysis
from warpspace.analysis.description import ProgressCallback as Share
from warpspace.analysis.options import PLACE, Files, Grammar, option, typed_word
from warpspace.calibration.calibration_result import (
    TARGETS,
    Calibration,
    Combination,
    FittedParameter,
    Residuals,
    Target,
    target_words,
)
from warpspace.calibration.instruments import (
    NO_INSTRUMENT,
    Instrument,
    common_mode,
    effective_freedom,
    instrument_names,
    load_instrument,
    share_out,
)
from warpspace.calibration.kinds import in_other_frame
from warpspace.calibration.next_best import next_best, observability, separating, u95_at
from warpspace.calibration.readings import Readings, read_readings
from warpspace.calibration.solve import (
    MAD,
    FitParameters,
    MeasurementModel,
    Rank,
    Solved,
    Watch,
    automatic,
    build_terms,
    covariance_of,
    find_rank,
    named,
    orthonormal,
    read_keys,
    rms_mm,
    solve,
    unwatched,
    without,
)
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import build_basis
from warpspace.kinematics.model import Loop
from warpspace.machine.errors import Covariance
from warpspace.machine.limits import MAX_ERROR, MAX_TEXT
from warpspace.scene.model import Scene
from warpspace.units import MM_PER_UM, UM_PER_MM, Array

LEFT = "what a fit leaves"
CALIBRATED = ", calibrated"  # behind the title of a calibrated scene
OUTLIER = 4.0  # robust standard deviations beyond which a reading is named
MOST_NEXT = 10
POSES = 60  # at which it is seen whether errors act
ACTS = 0.01  # share of the effect of one error, below which together they do nothing
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
    """Find the errors of the machine of SCENE in measured data.

    Least squares with the exact model; it says which parameters the readings determine, which they
    cannot tell apart, standard uncertainties and 95 % intervals, and what is left. Readings with a
    column u_um (standard uncertainty) are weighted by it. A column session, or run, tells set-ups
    apart: each has its own place of the sphere or the station, or its own shift.
    """

    name = "calibrate"
    task = "measure"
    doing = "fitting"
    makes_scenes = True
    scene_help = "Write SCENE with the errors found"
    has_chart = True
    chart_help = "residuals before and after, and the errors found"
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
        "Frame of error vectors whose columns do not say it (ex_R_um: machine, ex_w_um: workpiece)",
        unset="workpiece",
    )
    fit: Annotated[tuple[str, ...] | None, Grammar("KEYS|auto", read_keys, many=True)] = option(
        None,
        "Parameters to find, with commas between; KEY:ramp and KEY:constant choose the curve of a"
        " component error",
        unset="auto: those that the readings can show",
    )
    predict: Files = option((), "Readings that are not fitted but predicted")
    robust: bool = option(False, "Let readings far off count less")
    priors: bool = option(False, "Count the tolerances of SCENE as knowledge")
    next_count: int | None = option(
        None,
        "Name the N measurements that would lower the uncertainty most, per minute of work",
        flag="--next",
        low=1,
        high=MOST_NEXT,
    )
    target: Annotated[Target, Grammar("map|corner|part|verdict|X=..,Y=..", _target)] = option(
        "map",
        "What they are to make sure: the map as a whole, its least sure node, the part of SCENE,"
        " the verdicts on its tolerances, or a point",
        flag="--for",
    )
    instrument: Budget = option(
        NO_INSTRUMENT,
        f"Instrument, its uncertainties count: {', '.join(instrument_names())}, or a file. Readings"
        " without u_um have its scatter; what all of them share widens what is found",
        unset="none",
    )

    def run(self, scene: Scene, watch: Share, /) -> Calibration:
        names = (*self.data, *self.predict)
        each = self.kinds if len(self.kinds) > 1 else (self.kinds or (None,)) * len(names)
        if len(each) != len(names):
            raise OptionError(
                f"{{kinds}} is given {len(each)} times for {len(names)} files; expected 1 or"
                f" {len(names)}"
            )
        read = [
            read_readings(name, scene, kind, self.frame)
            for name, kind in zip(names, each, strict=True)
        ]
        if self.frame is not None and not any(one.frame for one in read):
            raise OptionError(
                f"{{frame}} {self.frame}: no file holds error vectors ({{kinds}} points, tracker)"
            )
        count = len(self.data)
        return self.find(scene, read[:count], read[count:], lambda: watch(0.0))

    def find(
        self,
        scene: Scene,
        sets: Sequence[Readings],
        held: Sequence[Readings] = (),
        watch: Watch = unwatched,
    ) -> Calibration:
        found = calibrate(scene, sets, self, held, watch)
        count = self.next_count or int(self.target != "map")
        if not count and not found.rank.confounded:
            return found
        weighed, asked = [one.readings for one in found.fitted], (self.target, self.instrument)
        steps = next_best(scene, weighed, found, count, None, watch, *asked)
        apart = separating(scene, sets, found, watch=watch)
        none = f"no {'further ' if steps else ''}measurement takes 1 % from U95"
        notes = (f"{none} {target_words(self.target)}",) if len(steps) < count else ()
        notes = (*found.notes, *notes)
        return replace(found, apart=apart, steps=steps, target=self.target, notes=notes)


def calibrate(
    scene: Scene,
    sets: Sequence[Readings],
    request: Calibrate | None = None,
    predict: Sequence[Readings] = (),
    watch: Watch = unwatched,
) -> Calibration:
    """Find the errors of a machine in readings.

    Parameters
    ----------
    scene : Scene
        The machine, and the errors to begin with.
    sets : sequence of Readings
    request : Calibrate, optional
        What is looked for, and how: `fit`, `robust`, `priors`.
    predict : sequence of Readings, optional
        Readings that are not fitted but predicted.
    watch : callable, optional
        Called before each evaluation of the model; what it raises ends the work.

    Returns
    -------
    Calibration

    Raises
    ------
    OptionError, UnknownNameError
        If nothing can be found: too few readings, a parameter the machine does not have, a fit
        that does not converge, errors larger than a rigid-body model holds.

    Notes
    -----
    Weighted least squares (``scipy.optimize.least_squares``) with the exact model; derivatives to
    first order. The parameters are taken in order; one that looks in the readings like those before
    it keeps the value of the scene, and only a combination of them has an interval. Standard
    uncertainties: out of the covariance ``s²·(JᵀWJ)⁻¹``, s from the residuals where the readings
    have no uncertainties of their own, intervals with Student's t (ISO/IEC Guide 98-3, H.3). With
    readings far off counting less, s² is Huber's robust one (`warpspace.calibration.solve`).

    Examples
    --------
    >>> from warpspace import load_scene
    >>> from warpspace.calibration import read_readings
    >>> scene = load_scene("fork_head_bc")
    >>> found = calibrate(scene, [read_readings("tcp_on.csv", scene)])
    >>> round(found.rms_before_mm, 3), round(found.rms_after_mm, 3)
    (0.278, 0.061)
    """
    request = request or Calibrate()
    if not sets:
        raise OptionError("no readings; expected at least one file ({data} FILE)")
    found = _fit(scene, sets, request, predict, watch)
    notes = (*found.notes, *_frame_notes(scene, sets, request, found, watch))
    return replace(found, notes=notes, merit=observability(scene, sets, watch))


def _frame_notes(
    scene: Scene, sets: Sequence[Readings], request: Calibrate, found: Calibration, watch: Watch
) -> tuple[str, ...]:
    others = [in_other_frame(scene, one) for one in sets]
    turned = [at for at, one in enumerate(others) if one is not None]
    best, changed = found, turned[:0]
    for tried in [turned, *([at] for at in turned if turned[1:])] if turned else []:
        mixed = [others[at] or one if at in tried else one for at, one in enumerate(sets)]
        with suppress(OptionError):  # errors that no machine has fit no better
            fitted = _fit(scene, mixed, request, (), watch)
            best, changed = min((best, changed), (fitted, tried), key=lambda one: one[0].sigma_mm)
    from scipy.stats import f

    least = max(best.sigma_mm, 1e-12)
    freedom = max(found.freedom, 1)
    if (found.sigma_mm / least) ** 2 < max(4.0, float(f.ppf(0.999, freedom, freedom))):
        return ()
    files = ", ".join(Path(sets[at].source).name for at in changed)
    other = "workpiece" if sets[changed[0]].frame == "machine" else "machine"
    words = (
        f"{files}: taken in the {sets[changed[0]].frame} frame these vectors leave"
        f" {UM_PER_MM * found.rms_after_mm:.3g} µm (RMS), in the {other} frame"
        f" {UM_PER_MM * best.rms_after_mm:.3g} µm: what is found here is likely wrong; expected"
        f" --frame {other}, or columns ex_{'w' if other == 'workpiece' else 'R'}_um and so on"
    )
    return (words,)


def _fit(
    scene: Scene,
    sets: Sequence[Readings],
    request: Calibrate,
    predict: Sequence[Readings],
    watch: Watch,
) -> Calibration:
    instrument, is_assumed = request.instrument, any(one.sigma_mm is None for one in sets)
    sets, assumed = _weighed(scene, sets, request, watch)
    if instrument.scatter[0]:
        predict = _weighed(scene, predict, request, watch)[0]
    stack = MeasurementModel.of(scene, sets, watch)
    terms = build_terms(scene, automatic(scene, sets) if request.fit is None else request.fit)
    if not terms.keys:
        raise OptionError("no axis moves whose errors could be found; expected {fit} KEYS")
    begin = solve(stack, terms.only(()), robust=request.robust)
    rank = _rank(stack, terms, begin.unknown)
    prior = _prior(scene, terms.keys) if request.priors else None
    free = terms.keys if prior is not None else rank.kept
    _check_count(stack, rank, len(free), prior is not None)
    solved = solve(stack, terms.only(free), prior, begin.unknown, robust=request.robust)
    before = stack.residuals(terms, terms.start, begin.unknown)
    part = terms.only(free)
    after = stack.residuals(part, solved.amplitudes, solved.unknown)
    used = stack.size + (len(free) if prior is not None else 0)
    freedom = used - len(free) - len(stack.unknowns)
    misses = np.concatenate([row.ravel() for row in after]) * np.concatenate(stack.weights())
    sigma = solved.scale or float(np.sqrt(np.sum(misses**2) / max(freedom, 1)))
    is_scaled = stack.has_uncertainties or solved.scale is not None
    whole = covariance_of(solved, solved.weighted.shape[1]) * (1.0 if is_scaled else sigma**2)
    scattered = whole[: len(free), : len(free)]
    moved = _moved(instrument, stack, solved)
    shared = np.array([one @ one.T for one in (row[: len(free)] for row in moved)])
    shared = shared.reshape(-1, len(free), len(free))
    covariance = scattered + shared.sum(axis=0)
    own = float(max(freedom, 1))
    if stack.has_uncertainties:
        own = instrument.scatter[1] if is_assumed else np.inf
    variances = np.diagonal(np.stack([scattered, *shared]), axis1=1, axis2=2)
    degrees = effective_freedom(variances, [own, *(one.dof for one in instrument.shared)])
    told = u95_at(scene, part, "map")
    whole_map = told(covariance) or 1.0  # nothing acts there
    shares = [(told(one) / whole_map) ** 2 for one in (scattered * is_assumed, *shared)]
    parameters, combinations = _found(
        terms, part, rank, solved, covariance, degrees, has_prior=prior is not None
    )
    errors = part.errors_with(solved.amplitudes)
    for row, value in zip(part.parameters, solved.amplitudes, strict=True):
        if not abs(value) <= MAX_ERROR:
            raise OptionError(
                f"{row.key} comes out as {value:.4g} {row.unit}; expected at most ±{MAX_ERROR:g}."
                " Are units, kind of readings and machine right?"
            )
    lack, lack_notes = _lack_of_fit(stack, after, sigma, freedom)
    rows = tuple(map(tuple, ((covariance + covariance.T) / 2.0).tolist()))
    least, missed = float(degrees.min(initial=np.inf)), (lack or 0.0) if lack_notes else 0.0
    told_together = Covariance(part.keys, rows, least, lack_of_fit=missed)
    ways = () if request.priors else rank.null_space
    title = f"{scene.title.removesuffix(CALIBRATED)}{CALIBRATED}"[:MAX_TEXT]
    fitted_scene = replace(
        scene,
        title=title,
        errors=errors,
        uncertainty={key: one for key, one in scene.uncertainty.items() if key not in part.keys},
        covariance=_covariance(scene, terms, ways, told_together.extended(stack.positions)),
    )
    outliers = _outliers(stack, after)
    held, coverage, held_notes = _predict(
        stack, terms, part, predict, begin, solved, whole, (sigma, own), request, moved
    )
    return Calibration(
        scene=fitted_scene,
        title=scene.title,
        parameters=parameters,
        combinations=combinations,
        rank=rank,
        slopes=terms.slopes,
        fit=part.keys,
        covariance=covariance,
        unknowns=named(stack.unknowns, solved.unknown),
        fitted=tuple(
            Residuals(*row) for row in zip(stack.sets, before, after, outliers, strict=True)
        ),
        predicted=held,
        rms_before_mm=rms_mm(before),
        rms_after_mm=rms_mm(after),
        rms_predicted_before_mm=rms_mm([one.before_mm for one in held]) if held else None,
        rms_predicted_after_mm=rms_mm([one.after_mm for one in held]) if held else None,
        predicted_coverage_95=coverage,
        sigma_mm=sigma,
        freedom=freedom,
        lack_of_fit=lack,
        instrument=share_out(instrument, stack, shares) if instrument.name else None,
        notes=(
            *assumed,
            *(note for one in (*sets, *predict) for note in one.notes),
            *held_notes,
            *lack_notes,
        ),
    )


def _weighed(
    scene: Scene, sets: Sequence[Readings], request: Calibrate, watch: Watch
) -> tuple[Sequence[Readings], tuple[str, ...]]:
    if all(one.sigma_mm is not None for one in sets):
        return sets, ()
    width, why = MM_PER_UM * request.instrument.scatter[0], "scatter of the instrument"
    if request.priors and not width:
        width, why = _fit(scene, sets, replace(request, priors=False), (), watch).sigma_mm, LEFT
    if not width:
        return sets, ()
    weighed = [
        one if one.sigma_mm is not None else replace(one, sigma_mm=np.full(len(one), width))
        for one in sets
    ]
    return weighed, (f"readings without u_um are taken as ± {UM_PER_MM * width:.3g} µm: {why}",)


def _moved(instrument: Instrument, stack: MeasurementModel, solved: Solved) -> list[Array]:
    """Give what one u of what readings share moves: parameters and set-ups, [n, c] each."""
    weights = np.sqrt(solved.trust) * np.concatenate(stack.weights())[:, None]
    answer = covariance_of(solved, solved.weighted.shape[1]) @ solved.weighted.T
    answer = answer[:, : len(weights)]
    return [-answer @ (weights * common_mode(stack, one)) for one in instrument.shared]


def _rank(stack: MeasurementModel, terms: FitParameters, unknown: Array) -> Rank:
    by_parameter, by_unknown = stack.derivatives(terms, terms.start, unknown)
    weights = np.concatenate(stack.weights())[:, None]
    return find_rank(terms.keys, weights * by_parameter, weights * by_unknown, stack.blind)


def _check_count(stack: MeasurementModel, rank: Rank, fitted: int, has_prior: bool) -> None:
    if not rank.kept and not has_prior:
        raise OptionError(
            f"{stack.size} numbers in {sum(map(len, stack.sets))} readings determine none of the"
            " parameters; expected more poses, other axes, or another {fit}"
        )
    if not has_prior and stack.size <= fitted + len(stack.unknowns):
        need = fitted + len(stack.unknowns) + 1
        raise OptionError(
            f"{stack.size} numbers for {fitted} parameters and {len(stack.unknowns)} unknown"
            f" coordinates of the set-up; expected at least {need}: more readings, or fewer"
            " parameters ({fit} KEYS)"
        )


def _prior(scene: Scene, keys: Sequence[str]) -> tuple[Array, Array]:
    missing = scene.tolerances.missing(keys)
    if missing:
        raise OptionError(
            f"{{priors}}: {', '.join(missing)} have no tolerance; expected one each in [tolerances]"
        )
    rows = [tolerance for key in keys if (tolerance := scene.tolerances.get(key)) is not None]
    widths = np.array([max(row.half_width, 1e-6) for row in rows])
    return np.array([row.centre for row in rows]), widths / np.sqrt(3.0)


def _covariance(
    scene: Scene, terms: FitParameters, ways: Sequence[Mapping[str, float]], found: Covariance
) -> Covariance | None:
    """Join what was found with what the scene knew of other errors, and say what is left open.

    A way is a sum of errors that does not show in the readings. Where it moves no point either,
    in the working volume and at the poses of the readings, nothing is lost by holding one of them.
    """
    known = (scene.covariance or Covariance((), ())).without(found.keys)
    stated = {*scene.uncertainty} - {*found.keys} | {*known.keys}
    ends, draw = found.extended(scene.workspace.ranges).measured_range, np.random.default_rng(0)
    poses = {axis: draw.uniform(*ends[axis], POSES) for axis in ends}
    undetermined: dict[str, float] = {}
    for loop in (Loop.TOOL, Loop.RELATIVE) if ways else ():
        basis = build_basis(scene.model, terms.errors, terms.keys, poses, scene.view(loop))
        for way in ways:
            parts = [share * basis.position[terms.keys.index(key)] for key, share in way.items()]
            if np.abs(sum(parts)).max() > ACTS * max(np.abs(part).max() for part in parts):
                undetermined |= way
    left = tuple(key for key in (*undetermined, *known.undetermined) if key not in stated)
    found = found.without(left)
    if not (keys := (*found.keys, *known.keys)) and not left:
        return None
    matrix, cut = np.zeros((len(keys),) * 2), len(found.keys)
    matrix[:cut, :cut], matrix[cut:, cut:] = found.matrix, known.matrix
    rows, freedom = tuple(map(tuple, matrix.tolist())), min(found.dof, known.dof)
    lack = max(found.lack_of_fit, known.lack_of_fit)
    whole = Covariance(keys, rows, freedom, known.measured_range, tuple(dict.fromkeys(left)), lack)
    return whole.extended(found.measured_range)


def _found(
    terms: FitParameters,
    part: FitParameters,
    rank: Rank,
    solved: Solved,
    covariance: Array,
    degrees: Array,
    *,
    has_prior: bool,
) -> tuple[tuple[FittedParameter, ...], tuple[Combination, ...]]:
    from scipy.stats import t

    factors = t.ppf(0.975, degrees)
    held = dict(zip(terms.keys, terms.start.tolist(), strict=True))
    rows: list[FittedParameter] = []
    sums: list[Combination] = []
    for at, key in enumerate(terms.keys):
        before = float(terms.start[at])
        if key not in part.keys:
            rows.append(FittedParameter(key, before, before, None, None, "no"))
            continue
        own = part.keys.index(key)
        value, width = float(solved.amplitudes[own]), float(np.sqrt(covariance[own, own]))
        half = float(factors[own]) * width
        told = "yes" if rank.is_identifiable(key) else "in part"
        if told == "yes" or has_prior:
            rows.append(
                FittedParameter(key, before, value, width, (value - half, value + half), told)
            )
            continue
        rows.append(FittedParameter(key, before, value, None, None, told))
        shares = rank.confounded_with(key)
        total = value + sum(shares[other] * held[other] for other in shares if other != key)
        sums.append(Combination(shares, total, width, (total - half, total + half)))
    return tuple(rows), tuple(sums)


def _outliers(stack: MeasurementModel, after: Sequence[Array]) -> list[tuple[int, ...]]:
    weights = stack.weights()
    lengths = [
        np.linalg.norm(row * weight.reshape(row.shape), axis=-1)
        for row, weight in zip(after, weights, strict=True)
    ]
    every = np.concatenate(lengths)
    middle = float(np.median(every))
    width = MAD * float(np.median(np.abs(every - middle)))
    limit = middle + OUTLIER * max(width, 1e-9)
    return [tuple(int(row) for row in np.flatnonzero(one > limit)) for one in lengths]


def _predict(
    stack: MeasurementModel,
    terms: FitParameters,
    part: FitParameters,
    predict: Sequence[Readings],
    begin: Solved,
    solved: Solved,
    covariance: Array,
    scatter: tuple[float, float],
    request: Calibrate,
    moved: Sequence[Array],
) -> tuple[tuple[Residuals, ...], float | None, tuple[str, ...]]:
    """Predict readings that were not fitted; set-ups that were not fitted are placed by them.

    Beside them the share of components inside the 95 % intervals stated for them: of what readings
    scatter (mm, degrees of freedom), of the covariance of all that was fitted, and of what the
    instrument, one and the same, adds to all readings: less what the fit has taken of that.
    """
    if not predict:
        return (), None, ()
    held = MeasurementModel.of(stack.scene, predict, stack.watch)
    before = named(stack.unknowns, begin.unknown)
    after = named(stack.unknowns, solved.unknown)
    new = [name for name in held.unknowns if name not in after]
    notes: tuple[str, ...] = ()
    if new:
        own_before = solve(held, terms.only(()), robust=request.robust).unknown
        fixed = replace(part.only(()), errors=part.errors_with(solved.amplitudes))
        own_after = solve(held, fixed, robust=request.robust).unknown
        before |= {k: v for k, v in named(held.unknowns, own_before).items() if k in new}
        after |= {k: v for k, v in named(held.unknowns, own_after).items() if k in new}
        notes = (f"predicted readings place their own set-up: {', '.join(new)}",)
    values = [np.array([known[name] for name in held.unknowns]) for known in (before, after)]
    rows_before = held.residuals(terms, terms.start, values[0])
    rows_after = held.residuals(part, solved.amplitudes, values[1])
    rows = zip(held.sets, rows_before, rows_after, _outliers(held, rows_after), strict=True)
    found = tuple(Residuals(*row) for row in rows)
    if stack.has_uncertainties and not held.has_uncertainties:
        return found, None, notes  # nobody says how well these were read
    from scipy.stats import t

    weights = np.concatenate(held.weights(scatter[0]))[:, None]
    by_parameter, by_unknown = held.derivatives(part, solved.amplitudes, values[1])
    own = np.isin(held.unknowns, new)
    at = [len(part.keys) + stack.unknowns.index(n) for n in held.unknowns if n not in new]
    chosen = [*range(len(part.keys)), *at]
    placed = orthonormal(weights * by_unknown[:, own])  # what placing its own set-up takes away
    slopes = without(weights * np.hstack([by_parameter, by_unknown[:, ~own]]), placed)
    variance = np.sum((slopes @ covariance[np.ix_(chosen, chosen)]) * slopes, axis=1)
    for one, taken in zip(request.instrument.shared, moved, strict=True):
        added = without(weights * common_mode(held, one), placed) - slopes @ taken[chosen]
        variance += np.sum(added**2, axis=1)
    width = t.ppf(0.975, scatter[1]) * np.sqrt(variance + 1.0 - np.sum(placed**2, axis=1))
    misses = weights[:, 0] * np.concatenate([row.ravel() for row in rows_after])
    return found, float(np.mean(np.abs(misses) <= width)), notes


CHANCE = 0.01  # of calling a model incomplete that is not


def _lack_of_fit(
    stack: MeasurementModel, after: Sequence[Array], sigma_mm: float, freedom: int
) -> tuple[float | None, tuple[str, ...]]:
    """Compare the scatter of residuals with that of readings, stated or seen in repeated ones.

    The root of χ²/ν, or of F of lack of fit over pure error (Draper and Smith, Applied Regression
    Analysis, 2.1). None where readings state no uncertainty and no pose is repeated.
    """
    from scipy.stats import chi2, f

    ratio, rest = sigma_mm**2, max(freedom, 1)
    if stack.has_uncertainties:
        what = "their uncertainty allows"
        limit = float(chi2.isf(CHANCE, rest)) / rest
    else:
        scatter, repeated, weights = 0.0, 0, stack.weights()
        for one, left, weight in zip(stack.sets, after, weights, strict=True):
            row = left * weight.reshape(left.shape)
            labels = np.unique(one.session, return_inverse=True)[1]
            poses = np.round(np.column_stack([labels, *one.coordinates.values()]), 6)
            group = np.unique(poses, axis=0, return_inverse=True)[1].ravel()
            means = np.array([row[group == at].mean(axis=0) for at in range(group.max() + 1)])
            scatter += float(np.sum((row - means[group]) ** 2))
            repeated += (len(row) - len(means)) * row.shape[1]
        if repeated < 1 or rest <= repeated or scatter <= 0.0:
            return None, ()
        total, rest = ratio * rest, rest - repeated
        ratio, what = (total - scatter) / rest * repeated / scatter, "repeated readings scatter"
        limit = float(f.isf(CHANCE, rest, repeated))
    times = f"residuals are {np.sqrt(ratio):.1f} times what {what}"
    notes = (f"the model misses something: {times}",) if ratio > limit else ()
    return float(np.sqrt(max(ratio, 0.0))), notes
