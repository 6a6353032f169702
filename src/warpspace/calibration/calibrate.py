"""Calibration: least squares of the errors of a machine to readings, and what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from warpspace.calibration.rank import Rank, find_rank
from warpspace.calibration.readings import Readings
from warpspace.calibration.results import Calibration, Found, Request, Residuals
from warpspace.calibration.solve import MAD, Solved, covariance_of, solve
from warpspace.calibration.stack import Stack, Watch, named, rms_mm, unwatched
from warpspace.calibration.terms import Terms, automatic, build_terms
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_ERROR, MAX_TEXT
from warpspace.scene.model import Scene
from warpspace.units import UM_PER_MM, Array

CALIBRATED = ", calibrated"
"""Behind the title of a calibrated scene."""
OUTLIER = 4.0
"""Robust standard deviations beyond which a reading is named."""


def calibrate(
    scene: Scene,
    sets: Sequence[Readings],
    request: Request | None = None,
    predict: Sequence[Readings] = (),
    watch: Watch = unwatched,
) -> Calibration:
    """Find the errors of a machine in readings.

    Parameters
    ----------
    scene : Scene
        The machine, and the errors to begin with.
    sets : sequence of Readings
    request : Request, optional
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
    it keeps the value of the scene. Standard uncertainties: out of the covariance
    ``s²·(JᵀWJ)⁻¹``, s from the residuals where the readings have no uncertainties of their own,
    intervals with Student's t (ISO/IEC Guide 98-3, H.3).

    Examples
    --------
    >>> from warpspace import load_scene
    >>> from warpspace.calibration import read_readings
    >>> scene = load_scene("fork_head_bc")
    >>> found = calibrate(scene, [read_readings("tcp_on.csv", scene)])
    >>> round(found.rms_before_mm, 3), round(found.rms_after_mm, 3)
    (0.278, 0.061)
    """
    request = request or Request()
    if not sets:
        raise OptionError("no readings; expected at least one file (--data FILE)")
    sets, assumed = _weighed(scene, sets, request, watch)
    stack = Stack.of(scene, sets, watch)
    terms = build_terms(scene, automatic(scene, sets) if request.keys is None else request.keys)
    if not terms.keys:
        raise OptionError("no axis moves whose errors could be found; expected --fit KEYS")
    begin = solve(stack, terms.only(()), request)
    rank = _rank(stack, terms, begin.unknown)
    prior = _prior(scene, terms.keys) if request.priors else None
    free = terms.keys if prior is not None else rank.kept
    _check_count(stack, rank, len(free), prior is not None)
    solved = solve(stack, terms.only(free), request, prior, begin.unknown)
    before = stack.residuals(terms, terms.start, begin.unknown)
    part = terms.only(free)
    after = stack.residuals(part, solved.amplitudes, solved.unknown)
    used = stack.size + (len(free) if prior is not None else 0)
    freedom = used - len(free) - len(stack.unknowns)
    sigma = _sigma(stack, after, freedom)
    covariance = covariance_of(solved, len(free)) * (1.0 if stack.has_uncertainties else sigma**2)
    errors = part.errors_with(solved.amplitudes)
    _check_size(part, solved.amplitudes)
    title = f"{scene.title.removesuffix(CALIBRATED)}{CALIBRATED}"[:MAX_TEXT]
    fitted_scene = replace(scene, title=title, errors=errors)
    outliers = _outliers(stack, after)
    held, held_notes = _predict(scene, terms, part, predict, stack, begin, solved, request)
    return Calibration(
        fitted_scene,
        _found(terms, part, rank, solved, covariance, freedom, stack),
        rank,
        terms.slopes,
        part.keys,
        _correlation(covariance),
        covariance,
        named(stack.unknowns, solved.unknown),
        tuple(Residuals(*row) for row in zip(stack.sets, before, after, outliers, strict=True)),
        held,
        rms_mm(before),
        rms_mm(after),
        rms_mm([one.before_mm for one in held]) if held else None,
        rms_mm([one.after_mm for one in held]) if held else None,
        sigma,
        freedom,
        (*assumed, *(note for one in (*sets, *predict) for note in one.notes), *held_notes),
    )


def _weighed(
    scene: Scene, sets: Sequence[Readings], request: Request, watch: Watch
) -> tuple[Sequence[Readings], tuple[str, ...]]:
    """Give readings an uncertainty where tolerances are to be weighed against them."""
    if not request.priors or all(one.sigma_mm is not None for one in sets):
        return sets, ()
    width = calibrate(scene, sets, replace(request, priors=False), (), watch).sigma_mm
    weighed = [
        one if one.sigma_mm is not None else replace(one, sigma_mm=np.full(len(one), width))
        for one in sets
    ]
    note = f"readings without u_um are taken as ± {UM_PER_MM * width:.3g} µm: what a fit leaves"
    return weighed, (note,)


def _rank(stack: Stack, terms: Terms, unknown: Array) -> Rank:
    """Find out what the readings can tell apart."""
    by_parameter, by_unknown = stack.derivatives(terms, terms.start, unknown)
    weights = np.concatenate(stack.weights())[:, None]
    return find_rank(terms.keys, weights * np.vstack(by_parameter), weights * np.vstack(by_unknown))


def _check_count(stack: Stack, rank: Rank, fitted: int, has_prior: bool) -> None:
    """Refuse what readings cannot answer."""
    if not rank.kept and not has_prior:
        raise OptionError(
            f"{stack.size} numbers in {sum(map(len, stack.sets))} readings determine none of the"
            " parameters; expected more poses, other axes, or another --fit"
        )
    if not has_prior and stack.size <= fitted + len(stack.unknowns):
        need = fitted + len(stack.unknowns) + 1
        raise OptionError(
            f"{stack.size} numbers for {fitted} parameters and {len(stack.unknowns)} unknown"
            f" coordinates of the set-up; expected at least {need}: more readings, or fewer"
            " parameters (--fit KEYS)"
        )


def _prior(scene: Scene, keys: Sequence[str]) -> tuple[Array, Array]:
    """Give centre and standard uncertainty of each parameter out of its tolerance, [K] twice."""
    missing = scene.tolerances.missing(keys)
    if missing:
        raise OptionError(
            f"--priors: {', '.join(missing)} have no tolerance; expected one each in [tolerances]"
        )
    rows = [tolerance for key in keys if (tolerance := scene.tolerances.get(key)) is not None]
    widths = np.array([max(row.half_width, 1e-6) for row in rows])
    return np.array([row.centre for row in rows]), widths / np.sqrt(3.0)


def _sigma(stack: Stack, after: Sequence[Array], freedom: int) -> float:
    """Give the standard deviation of one weighted component."""
    rows = np.concatenate([row.ravel() for row in after]) * np.concatenate(stack.weights())
    return float(np.sqrt(np.sum(rows**2) / max(freedom, 1)))


def _correlation(covariance: Array) -> Array:
    """Give correlations out of a covariance."""
    width = np.sqrt(np.diag(covariance))
    width = np.where(width > 0.0, width, 1.0)
    return covariance / np.outer(width, width)


def _found(
    terms: Terms,
    part: Terms,
    rank: Rank,
    solved: Solved,
    covariance: Array,
    freedom: int,
    stack: Stack,
) -> tuple[Found, ...]:
    """Collect every parameter that was asked for."""
    factor = 1.959964 if stack.has_uncertainties else float(student.ppf(0.975, max(freedom, 1)))
    rows: list[Found] = []
    for at, key in enumerate(terms.keys):
        before = float(terms.start[at])
        if key not in part.keys:
            rows.append(Found(key, before, before, None, None, identifiable=False))
            continue
        own = part.keys.index(key)
        value, width = float(solved.amplitudes[own]), float(np.sqrt(covariance[own, own]))
        interval = (value - factor * width, value + factor * width)
        rows.append(Found(key, before, value, width, interval, rank.is_identifiable(key)))
    return tuple(rows)


def _outliers(stack: Stack, after: Sequence[Array]) -> list[tuple[int, ...]]:
    """Name the readings that lie further off than the others let expect."""
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


def _check_size(terms: Terms, amplitudes: Array) -> None:
    """Refuse errors that no rigid-body model holds."""
    for row, value in zip(terms.parameters, amplitudes, strict=True):
        if not abs(value) <= MAX_ERROR:
            raise OptionError(
                f"{row.key} comes out as {value:.4g} {row.unit}; expected at most ±{MAX_ERROR:g}."
                " Are units, kind of readings and machine right?"
            )


def _predict(
    scene: Scene,
    terms: Terms,
    part: Terms,
    predict: Sequence[Readings],
    stack: Stack,
    begin: Solved,
    solved: Solved,
    request: Request,
) -> tuple[tuple[Residuals, ...], tuple[str, ...]]:
    """Predict readings that were not fitted; set-ups that were not fitted are placed by them."""
    if not predict:
        return (), ()
    held = Stack.of(scene, predict, stack.watch)
    known_before = named(stack.unknowns, begin.unknown)
    known_after = named(stack.unknowns, solved.unknown)
    new = [name for name in held.unknowns if name not in known_after]
    notes: tuple[str, ...] = ()
    before, after = dict(known_before), dict(known_after)
    if new:
        own_before = solve(held, terms.only(()), request).unknown
        fixed = replace(
            part, keys=(), start=np.zeros(0), errors=part.errors_with(solved.amplitudes)
        )
        own_after = solve(held, fixed, request).unknown
        before |= {k: v for k, v in named(held.unknowns, own_before).items() if k in new}
        after |= {k: v for k, v in named(held.unknowns, own_after).items() if k in new}
        notes = (f"predicted readings place their own set-up: {', '.join(new)}",)
    rows_before = held.residuals(terms, terms.start, _values(held, before))
    rows_after = held.residuals(part, solved.amplitudes, _values(held, after))
    outliers = _outliers(held, rows_after)
    rows = zip(held.sets, rows_before, rows_after, outliers, strict=True)
    return tuple(Residuals(*row) for row in rows), notes


def _values(stack: Stack, known: Mapping[str, float]) -> Array:
    """Give the unknowns of a stack, [m], mm."""
    return np.array([known[name] for name in stack.unknowns])
