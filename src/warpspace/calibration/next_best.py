"""The measurement to make next: the one that lowers an uncertainty most per minute of work."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from warpspace.analysis.uncertainty.propagation import coverage_factor
from warpspace.bench.placing import PLANES, ball_point, within_travel
from warpspace.calibration import solve
from warpspace.calibration.calibration_result import Calibration, Candidate, NextMeasurement, Target
from warpspace.calibration.instruments import NO_INSTRUMENT, Instrument, common_mode
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings
from warpspace.calibration.spheres import solve_linear
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.field.evaluate import build_basis
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import complete_coordinates
from warpspace.machine.axes import default_keys, is_linear, parameter
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene.model import Scene, grid_basis
from warpspace.scene.text_files import read_text
from warpspace.units import UM_PER_MM, Array

# Poses and small tests on the machine of a scene.

PLACES = (0.0, 0.5, 1.0)  # shares of the working volume, the ends at the ends
TURNS_DEG = (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0, 180.0, 270.0)
ON_CIRCLE = 36
POSES, REACH = 60, (-180.0, 180.0)  # poses, mm and degrees, that tell all that can be told
ARM_MM = 250.0  # at which a rotation counts like a location
SESSION = "next"  # the set-up of a measurement not made yet: a sphere put somewhere anew


def candidates(scene: Scene) -> tuple[Candidate, ...]:
    return (*_trackers(scene), *_tests(scene), *_spheres(scene))


def _spans(scene: Scene) -> dict[str, tuple[float, float]]:
    ranges = scene.workspace.ranges
    return {name: span for name, span in ranges.items() if span[0] < span[1]}


def _complete(scene: Scene, positions: Mapping[str, Array]) -> dict[str, Array]:
    count = max(len(values) for values in positions.values())
    still = scene.workspace.positions
    return {
        name: np.asarray(positions[name] if name in positions else np.full(count, still[name]))
        for name in scene.machine.axes
    }


def _nominal(scene: Scene, kind: str, at: Mapping[str, Array], observed_mm: Array) -> Readings:
    tip, count = ball_point(scene.model, at), len(observed_mm)
    lines = tuple(range(1, count + 1))
    return Readings(kind, at, tip, observed_mm, None, (SESSION,) * count, lines, "")


def _trackers(scene: Scene) -> Iterator[Candidate]:
    spans = _spans(scene)
    for shares in (PLACES[::2], PLACES):
        each = [[low + share * (high - low) for share in shares] for low, high in spans.values()]
        places = np.array(list(product(*each))).T
        if places.shape[-1] > 1:
            count = f"{places.shape[-1]} points, {len(shares)} along each of {', '.join(spans)}"
            title = f"tracker: error vectors at {count}; its place and turn unknown"
            at = _complete(scene, dict(zip(spans, places, strict=True)))
            yield Candidate(title, _nominal(scene, "tracker", at, np.zeros(places.T.shape)))


def _tests(scene: Scene) -> Iterator[Candidate]:
    spans = {
        name: span for name, span in _spans(scene).items() if scene.machine.axes[name].is_linear
    }
    for name in spans:
        yield from _test(scene, f"positioning:axis={name}", f"laser along {name}")
        for across in "xyz":
            words = f"probe along {name}, sensing {across} against a straight edge"
            yield from _test(scene, f"straightness:axis={name}:across={across}:points=11", words)
    yield from _test(scene, "diagonals", "laser along the four body diagonals")
    for plane, (first, second, _) in PLANES.items():
        if not {first, second} <= set(spans):
            continue
        yield from _test(scene, f"squareness:plane={plane}:points=11", f"square in {plane}, probed")
        others = [name for name in spans if name not in (first, second)]
        radius = 0.4 * min(spans[name][1] - spans[name][0] for name in (first, second))
        options = f"circular:plane={plane}:radius={radius:g}:points={ON_CIRCLE // 2}"
        for share in PLACES[:: 2 if others else 3]:
            at = [f"{n}={spans[n][0] + share * (spans[n][1] - spans[n][0]):g}" for n in others]
            place = f":at={','.join(at)}" if at else ""
            words = f"ball bar, circle {plane}, radius {radius:g} mm" + (
                f" at {', '.join(at).replace('=', ' ')}" if at else ""
            )
            yield from _test(scene, options + place, words)


def _test(scene: Scene, kind: str, words: str) -> Iterator[Candidate]:
    with suppress(OptionError, UnknownNameError):
        readings = TestReadings(kind).planned(scene)
        setup = readings.plan.setup if readings.plan else ()
        unknown = ", ".join(name.rpartition("_")[0].replace("_", " ") for name in setup)
        read = f"{len(readings)} readings of one component"
        yield Candidate(f"{words}: {read}; unknown: {unknown}", readings)


def _spheres(scene: Scene) -> Iterator[Candidate]:
    still = {name: np.array([value]) for name, value in scene.workspace.positions.items()}
    centre = ball_point(scene.model, still)
    rotary = [name for name, axis in scene.machine.axes.items() if not axis.is_linear]
    travels = {name: scene.machine.axes[name].travel for name in rotary}
    turns = {
        name: np.array([turn for turn in TURNS_DEG if low <= turn <= high])
        for name, (low, high) in travels.items()
    }
    for name in rotary:
        others = [other for other in rotary if other != name] or [""]
        for other in others:
            for turn in turns.get(other, np.zeros(1)):
                if len(turns[name]) < 2 or (other and abs(turn) > 90.0):
                    continue
                place = {name: turns[name]}
                held = ""
                if other:
                    place[other] = np.full(len(turns[name]), turn)
                    held = f" at {other} {turn:g}°"
                at, target = _complete(scene, place), np.repeat(centre, len(turns[name]), axis=0)
                with suppress(SceneError):
                    at = solve_linear(scene, at, target, "")
                    inside = within_travel(scene.machine, at)
                    at = {axis: values[inside] for axis, values in at.items()}
                    if (count := len(at[name])) > 1:
                        spelled = ", ".join(f"{value:g}" for value in at[name])
                        title = f"sphere, TCP on: {name} at {spelled}°{held}"
                        yield Candidate(title, _nominal(scene, "sphere-tcp", at, target[:count]))


MINUTES = {
    "tracker": (30.0, 0.5),
    "positioning": (45.0, 0.2),
    "diagonals": (90.0, 0.2),
    "straightness": (20.0, 0.5),
    "squareness": (20.0, 0.5),
    "circular": (12.0, 0.05),
    "sphere-tcp": (10.0, 1.0),
}
"""Minutes of work by kind: to set up, and for each reading. Typical, of somebody who does it often;
what a shop needs differs, and the ranking with it."""


def minutes(readings: Readings) -> float:
    set_up, each = MINUTES.get(readings.kind.partition(":")[0], (30.0, 0.5))
    return set_up + each * len(readings)


NODES = 5  # nodes per axis of the map whose uncertainty counts
WIDE = 1000.0  # standard uncertainty in µm or µrad of a parameter of which nothing is known
LEAST_NOISE_MM = 1e-4
LEAST_GAIN = 0.01  # share of U95 that a measurement has to take away, unless it is asked about


def next_best(
    scene: Scene,
    sets: Sequence[Readings],
    found: Calibration,
    count: int = 1,
    choice: Sequence[Candidate] | None = None,
    watch: solve.Watch = solve.unwatched,
    target: Target = "map",
    instrument: Instrument = NO_INSTRUMENT,
) -> tuple[NextMeasurement, ...]:
    """Choose measurements one after the other, each for the greatest gain per minute.

    Notes
    -----
    The information of what is measured, JᵀWJ less what its instrument shares, plus that of the
    tolerances (1000 µm or µrad where there is none), plus that of the candidate; what a set-up
    leaves unknown is eliminated, and each candidate has one of its own. First order, at the errors
    found.
    """
    if not count:
        return ()
    keys = tuple(one.key for one in found.parameters)
    terms = solve.build_terms(found.scene, keys)
    noise = max(found.sigma_mm, LEAST_NOISE_MM)
    stated = [one.sigma_mm for one in sets if one.sigma_mm is not None]
    if len(stated) == len(sets):
        noise = float(np.median(np.concatenate(stated)))
    made = solve.MeasurementModel.of(scene, sets, watch)
    known = _information(made, terms, noise, instrument) + _prior(scene, keys)
    over_map = u95_at(found.scene, terms, "map")
    told = u95_at(found.scene, terms, target)
    rows = [
        (one, _information(solve.MeasurementModel.of(scene, [one.readings], watch), terms, noise))
        for one in choice or candidates(scene)
    ]
    steps: list[NextMeasurement] = []
    covariance = _covariance(known)
    for _ in range(count):
        watch()
        before, map_before = told(covariance), over_map(covariance)
        least = -np.inf if choice else LEAST_GAIN * before
        after = [(one, _covariance(known + row), row) for one, row in rows]
        gains = [(before - told(one[1]), *one) for one in after]
        useful = [gain for gain in gains if gain[0] >= least]
        if not useful:
            break
        _, best, covariance, row = max(useful, key=lambda gain: gain[0] / minutes(gain[1].readings))
        ends = before, told(covariance), map_before / FACTOR, over_map(covariance) / FACTOR
        steps.append(NextMeasurement(best, minutes(best.readings), *ends, covariance))
        known = known + row
    return tuple(steps)


def separating(
    scene: Scene,
    sets: Sequence[Readings],
    found: Calibration,
    watch: solve.Watch = solve.unwatched,
) -> dict[tuple[str, ...], str]:
    """Name for each group of parameters that look alike a measurement that tells them apart."""
    keys = tuple(one.key for one in found.parameters)
    terms = solve.build_terms(scene, keys)
    missing = set(found.rank.confounded)
    told: dict[tuple[str, ...], str] = {}
    for one in candidates(scene):
        if not missing:
            break
        stack = solve.MeasurementModel.of(scene, [*sets, one.readings], watch)
        both = stack.derivatives(terms, terms.start, stack.start())
        rank = solve.find_rank(keys, *both, stack.blind)
        still = {group[0] for group in rank.confounded}
        for group in [group for group in missing if group[0] not in still]:
            told[group] = one.name
            missing.remove(group)
    return {group: told[group] for group in found.rank.confounded if group in told}


def _information(
    stack: solve.MeasurementModel,
    terms: solve.FitParameters,
    noise_mm: float,
    instrument: Instrument = NO_INSTRUMENT,
) -> Array:
    by_parameter, by_unknown = stack.derivatives(terms, terms.start, stack.start())
    weights = np.concatenate(stack.weights(noise_mm))[:, None]
    common = [common_mode(stack, one) for one in instrument.shared]
    seen = weights * np.hstack([by_parameter, *common])
    seen = solve.without(seen, solve.orthonormal(weights * by_unknown))
    whole, count = seen.T @ seen, len(terms.keys)
    # what readings share is unknown as well, but by a standard uncertainty of one
    shared = whole[count:, count:] + np.eye(len(whole) - count)
    lost = whole[:count, count:] @ np.linalg.solve(shared, whole[count:, :count])
    return whole[:count, :count] - lost


def _prior(scene: Scene, keys: Sequence[str]) -> Array:
    tolerances = [scene.tolerances.get(key) for key in keys]
    widths = [
        WIDE if one is None else max(one.half_width, 1e-6) / np.sqrt(3.0) for one in tolerances
    ]
    return np.diag(1.0 / np.array(widths) ** 2)


def _covariance(known: Array) -> Array:
    scale = np.sqrt(np.diag(known))
    inverse = np.linalg.pinv(known / np.outer(scale, scale), rcond=1e-13, hermitian=True)
    return inverse / np.outer(scale, scale)


FACTOR = coverage_factor(np.inf)


def u95_at(scene: Scene, terms: solve.FitParameters, target: Target) -> Callable[[Array], float]:
    """Give what tells U95 of a position error, µm, by the covariance of the parameters.

    Of the map the root mean square over the volume, of its corners the largest at a node; of the
    scene's part the root mean square over its vertices, placed, or the largest at a measure with a
    tolerance, µm or µrad.
    """
    if target in ("part", "verdict"):
        return _u95_of_part(scene, terms, str(target))
    if isinstance(target, str):
        grid = build_grid(scene.model, scene.workspace, NODES)
        basis = grid_basis(replace(scene, errors=terms.errors), grid, keys=terms.keys)
        weights = grid.weights.ravel() if target == "map" else None
    else:
        at = complete_coordinates(scene.machine, dict(target), scene.workspace.positions)
        basis = build_basis(scene.model, terms.errors, terms.keys, at, scene.view())
        weights = None
    flat = basis.position.reshape(len(terms.keys), -1)

    def told(covariance: Array) -> float:
        variance = np.sum(flat * (covariance @ flat), axis=0).reshape(-1, 3).sum(axis=1)
        whole = variance.max() if weights is None else weights @ variance
        return FACTOR * float(np.sqrt(max(whole, 0.0)))

    return told


def _u95_of_part(scene: Scene, terms: solve.FitParameters, target: str) -> Callable[[Array], float]:
    from warpspace.parts.inspection import measure_changes
    from warpspace.parts.workpiece import (
        evaluate_points,
        load_workpiece,
        place_workpiece,
        point_basis,
        subtract_best_fit,
    )

    if (file := scene.part.path("file")) is None:
        raise OptionError(f"{{target}} {target}: expected a scene whose [part] has a file")
    mesh = load_workpiece(file, scene.part.unit or None)
    made = evaluate_points(scene, place_workpiece(mesh, scene).vertices_mm)
    gains = point_basis(replace(scene, errors=terms.errors), made, terms.keys).position
    features, count = scene.part.path("features"), len(made.point_mm)
    if target == "part":
        gains = subtract_best_fit(made.point_mm, gains).reshape(len(terms.keys), -1) / np.sqrt(
            count
        )
        return lambda found: FACTOR * float(np.sqrt(np.sum(gains * (found @ gains))))
    if features is not None:
        told = features, read_text(Path(features), MAX_SCENE_BYTES)
        gains = measure_changes(mesh, made, gains, told)
    if features is None or not gains.size:
        raise OptionError("{target} verdict: expected a scene whose [part] has tolerances")
    return lambda found: FACTOR * float(np.sqrt(np.sum(gains * (found @ gains), axis=0).max()))


def observability(
    scene: Scene, sets: Sequence[Readings], watch: solve.Watch = solve.unwatched
) -> dict[str, float]:
    """Say for each rotary axis how well poses tell its location and orientation errors.

    The smallest singular value of the readings' Jacobian, set-ups eliminated, µm per µm: the
    observability index O3 (Nahvi, Hollerbach and Hayward 1994; Sun and Hollerbach 2008). At the
    nominal machine, each reading counting alike, so that deviations play no part. Combinations that
    error vectors at no pose tell, since they look like a shift, are left out.
    """
    scene = replace(scene, errors=ErrorSet())
    rows = [parameter(key) for key in default_keys(scene.machine.chain.axes)]
    rows = [row for row in rows if row.is_constant and not is_linear(row.axis)]
    if not rows:
        return {}
    terms = solve.build_terms(scene, [row.key for row in rows])
    scale = np.array([UM_PER_MM * (UM_PER_MM / ARM_MM if row.is_rotation else 1.0) for row in rows])

    def gram(readings: Sequence[Readings]) -> Array:
        alike = [replace(one, sigma_mm=None) for one in readings]
        stack = solve.MeasurementModel.of(scene, alike, watch)
        return _information(stack, terms, 1.0) * np.outer(scale, scale)

    draw, ends = np.random.default_rng(0), {n: a.travel for n, a in scene.machine.axes.items()}
    anywhere = {name: draw.uniform(*np.clip(ends[name], *REACH), size=POSES) for name in ends}
    found, most = gram(sets), gram([_nominal(scene, "points", anywhere, np.zeros((POSES, 3)))])
    merit: dict[str, float] = {}
    for axis in dict.fromkeys(row.axis for row in rows):
        own = np.ix_(*[[at for at, row in enumerate(rows) if row.axis == axis]] * 2)
        values, told = np.linalg.eigh(most[own])
        told = told[:, values > solve.BLIND**2 * values[-1]]
        least = np.linalg.eigvalsh(told.T @ found[own] @ told).min(initial=np.inf)
        merit |= {axis: float(np.sqrt(max(least, 0.0)))} if told.size else {}
    return merit
