"""The measurement to make next: the one that lowers the uncertainty of the error map most."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.calibration.candidates import Candidate, candidates
from warpspace.calibration.rank import find_rank
from warpspace.calibration.readings import Readings
from warpspace.calibration.results import Calibration
from warpspace.calibration.stack import Stack, Watch, unwatched
from warpspace.calibration.terms import Terms, build_terms
from warpspace.exceptions import OptionError
from warpspace.field.grid import build_grid
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import grid_basis
from warpspace.units import Array

NODES = 5
"""Nodes per axis of the map whose uncertainty counts."""
WIDE = 1000.0
"""Standard uncertainty in µm or µrad of a parameter of which nothing is known."""
LEAST_NOISE_MM = 1e-4
MOST_NEXT = 10


@dataclass(frozen=True, slots=True)
class Step:
    """One measurement to make.

    Attributes
    ----------
    candidate : Candidate
    map_before_um, map_after_um : float, µm
        Standard uncertainty of the position error, root mean square over the volume: without and
        with this measurement, all those before it made.
    covariance : ndarray, [K, K]
        Of the parameters once it is made.
    """

    candidate: Candidate
    map_before_um: float
    map_after_um: float
    covariance: Array


@dataclass(frozen=True, slots=True)
class _Knowledge:
    """What is known: the information on parameters and unknowns of the set-up."""

    names: tuple[str, ...]
    matrix: Array


def next_best(
    scene: Scene,
    sets: Sequence[Readings],
    found: Calibration,
    count: int = 1,
    choice: Sequence[Candidate] | None = None,
    noise_mm: float | None = None,
    watch: Watch = unwatched,
) -> tuple[Step, ...]:
    """Choose measurements one after the other, each for the greatest gain.

    Parameters
    ----------
    scene : Scene
        The machine that is calibrated.
    sets : sequence of Readings
        What has been measured.
    found : Calibration
    count : int, optional
        1 to 10 measurements.
    choice : sequence of Candidate, optional
        Measurements that are possible; by default those of
        `warpspace.calibration.candidates.candidates`.
    noise_mm : float, optional
        Standard uncertainty of one component; by default that of the residuals.
    watch : callable, optional
        Called before each evaluation of the model; what it raises ends the work.

    Returns
    -------
    tuple of Step

    Raises
    ------
    OptionError
        If the count is out of range.

    Notes
    -----
    The information JᵀWJ of what is measured, plus that of the tolerances (1000 µm or µrad where
    there is none), plus that of the candidate; what the set-up leaves unknown is eliminated. First
    order, at the errors found.
    """
    if not 1 <= count <= MOST_NEXT:
        raise OptionError(f"--next {count}; expected 1 to {MOST_NEXT} measurements")
    keys = tuple(one.key for one in found.parameters)
    terms = build_terms(replace(found.scene), keys)
    noise = max(noise_mm or found.sigma_mm, LEAST_NOISE_MM)
    if Stack.of(scene, sets).has_uncertainties and noise_mm is None:
        noise = float(np.median(np.concatenate([_sigma(one, noise) for one in sets])))
    known = _information(Stack.of(scene, sets, watch), terms, noise)
    known = _plus(known, _prior(scene, keys))
    weigh = _map(found.scene, terms)
    rows = [
        (one, _information(Stack.of(scene, [one.readings], watch), terms, noise))
        for one in choice or candidates(scene)
    ]
    steps: list[Step] = []
    before = _map_um(weigh, _covariance(known, keys))
    for _ in range(count):
        watch()
        gains = [(one, _covariance(_plus(known, row), keys), row) for one, row in rows]
        best, covariance, row = min(gains, key=lambda gain: _map_um(weigh, gain[1]))
        after = _map_um(weigh, covariance)
        steps.append(Step(best, before, after, covariance))
        known, before = _plus(known, row), after
    return tuple(steps)


def separating(
    scene: Scene,
    sets: Sequence[Readings],
    found: Calibration,
    choice: Sequence[Candidate] | None = None,
    watch: Watch = unwatched,
) -> dict[tuple[str, ...], str]:
    """Name for each group of parameters that look alike a measurement that tells them apart.

    Parameters
    ----------
    scene : Scene
    sets : sequence of Readings
    found : Calibration
    choice : sequence of Candidate, optional
    watch : callable, optional
        Called before each evaluation of the model; what it raises ends the work.

    Returns
    -------
    dict of tuple of str to str
        Groups that none separates are left out.
    """
    keys = tuple(one.key for one in found.parameters)
    terms = build_terms(scene, keys)
    missing = set(found.rank.confounded)
    told: dict[tuple[str, ...], str] = {}
    for one in choice or candidates(scene):
        if not missing:
            break
        stack = Stack.of(scene, [*sets, one.readings], watch)
        by_parameter, by_unknown = stack.derivatives(terms, terms.start, stack.start())
        rank = find_rank(keys, np.vstack(by_parameter), np.vstack(by_unknown))
        still = {group[0] for group in rank.confounded}
        for group in [group for group in missing if group[0] not in still]:
            told[group] = one.name
            missing.remove(group)
    return {group: told[group] for group in found.rank.confounded if group in told}


def _sigma(readings: Readings, noise_mm: float) -> Array:
    """Give the standard uncertainty of each reading, [n], mm."""
    if readings.sigma_mm is None:
        return np.full(len(readings), noise_mm)
    return readings.sigma_mm


def _information(stack: Stack, terms: Terms, noise_mm: float) -> _Knowledge:
    """Give the information of readings on the parameters and their own unknowns."""
    by_parameter, by_unknown = stack.derivatives(terms, terms.start, stack.start())
    rows = np.hstack([np.vstack(by_parameter), np.vstack(by_unknown)])
    weights = np.concatenate(
        [np.repeat(1.0 / _sigma(one, noise_mm), one.observed_mm.shape[1]) for one in stack.sets]
    )
    weighted = rows * weights[:, None]
    return _Knowledge((*terms.keys, *stack.unknowns), weighted.T @ weighted)


def _prior(scene: Scene, keys: Sequence[str]) -> _Knowledge:
    """Give what the tolerances say."""
    tolerances = [scene.tolerances.get(key) for key in keys]
    widths = [
        WIDE if one is None else max(one.half_width, 1e-6) / np.sqrt(3.0) for one in tolerances
    ]
    return _Knowledge(tuple(keys), np.diag(1.0 / np.array(widths) ** 2))


def _plus(one: _Knowledge, other: _Knowledge) -> _Knowledge:
    """Add information on quantities that may differ."""
    names = tuple(dict.fromkeys((*one.names, *other.names)))
    total = np.zeros((len(names), len(names)))
    for part in (one, other):
        index = [names.index(name) for name in part.names]
        total[np.ix_(index, index)] += part.matrix
    return _Knowledge(names, total)


def _covariance(known: _Knowledge, keys: Sequence[str]) -> Array:
    """Give the covariance of the parameters, [K, K]."""
    scale = np.sqrt(np.diag(known.matrix))
    scale = np.where(scale > 0.0, scale, 1.0)
    inverse = np.linalg.pinv(known.matrix / np.outer(scale, scale), rcond=1e-13, hermitian=True)
    return (inverse / np.outer(scale, scale))[: len(keys), : len(keys)]


def _map(scene: Scene, terms: Terms) -> Array:
    """Give how the map weighs covariances, [K, K]: its mean square is the sum of the products."""
    grid = build_grid(scene.model, scene.workspace, NODES)
    basis = grid_basis(replace(scene, errors=terms.errors), grid, keys=terms.keys)
    flat = basis.position.reshape(len(terms.keys), -1)
    return flat @ flat.T / (flat.shape[1] / 3)


def _map_um(weigh: Array, covariance: Array) -> float:
    """Give the standard uncertainty of the map, root mean square, µm."""
    return float(np.sqrt(max(np.sum(weigh * covariance), 0.0)))
