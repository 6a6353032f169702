"""Next measurement: the one that reduces an uncertainty most per minute of work."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from warpspace.analysis.uncertainty.propagation import coverage_factor
from warpspace.bench.placing import PLANES, within_travel
from warpspace.calibration import solve
from warpspace.calibration.calibration_result import Calibration, Candidate, NextMeasurement, Target
from warpspace.calibration.instruments import NO_INSTRUMENT, Instrument, common_mode
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import TestReadings
from warpspace.calibration.spheres import rotary_axes, solve_linear
from warpspace.exceptions import OptionError, SceneError, UnknownNameError
from warpspace.field.evaluate import build_basis
from warpspace.field.grid import build_grid
from warpspace.kinematics.model import complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear, parameter
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_SCENE_BYTES
from warpspace.scene.model import Scene, grid_basis
from warpspace.scene.text_files import read_text
from warpspace.units import UM_PER_MM, Array

# Poses and small tests on the machine of a scene.

PLACES = (0.0, 0.5, 1.0)  # shares of the working volume, the ends at the ends
TURNS_DEG = (-90.0, -60.0, -30.0, 0.0, 30.0, 60.0, 90.0, 180.0, 270.0)
ON_CIRCLE = 36
POSES, RANGE = 60, (-180.0, 180.0)  # poses, mm and degrees, of the maximum observability
ARM_MM = 250.0  # lever arm of rotations in comparison with locations
SESSION = "next"  # the new set-up of a planned measurement


def candidates(scene: Scene) -> tuple[Candidate, ...]:
    return (*_trackers(scene), *_tests(scene), *_spheres(scene))


def _spans(scene: Scene) -> dict[str, tuple[float, float]]:
    ranges = scene.workspace.ranges
    return {name: span for name, span in ranges.items() if span[0] < span[1]}


def _complete(scene: Scene, positions: Mapping[str, Array]) -> dict[str, Array]:
    count = max(len(values) for values in positions.values())
    complete = {**scene.workspace.positions, **positions}
    return {name: np.broadcast_to(complete[name], (count,)) for name in scene.machine.axes}


def _nominal(scene: Scene, kind: str, at: Mapping[str, Array], observed_mm: Array) -> Readings:
    tip, count = relative_point(scene.model, at), len(observed_mm)
    lines = tuple(range(1, count + 1))
    return Readings(kind, at, tip, observed_mm, None, (SESSION,) * count, lines, "")


def _trackers(scene: Scene) -> Iterator[Candidate]:
    spans = _spans(scene)
    for shares in (PLACES[::2], PLACES):
        grid = [[low + share * (high - low) for share in shares] for low, high in spans.values()]
        places = np.array(list(product(*grid))).T
        if places.shape[-1] > 1:
            count = f"{places.shape[-1]} points, {len(shares)} along each of {', '.join(spans)}"
            title = f"tracker: error vectors at {count}; its position and rotation unknown"
            at = _complete(scene, dict(zip(spans, places, strict=True)))
            yield Candidate(title, _nominal(scene, "tracker", at, np.zeros(places.T.shape)))


def _tests(scene: Scene) -> Iterator[Candidate]:
    spans = {
        name: span for name, span in _spans(scene).items() if scene.machine.axes[name].is_linear
    }
    for name in spans:
        yield from _test(scene, f"positioning:axis={name}", f"laser along {name}")
        for across in "xyz":
            title = f"probe along {name}, sensing {across} against a straight edge"
            yield from _test(scene, f"straightness:axis={name}:across={across}:points=11", title)
    yield from _test(scene, "diagonals", "laser along the four body diagonals")
    for plane in PLANES:
        if not {*plane} <= set(spans):
            continue
        yield from _test(scene, f"squareness:plane={plane}:points=11", f"square in {plane}, probed")
        normal = [name for name in spans if name not in plane]
        radius = 0.4 * min(spans[name][1] - spans[name][0] for name in plane)
        options = f"circular:plane={plane}:radius={radius:g}:points={ON_CIRCLE // 2}"
        for share in PLACES[:: 2 if normal else 3]:
            at = [f"{n}={spans[n][0] + share * (spans[n][1] - spans[n][0]):g}" for n in normal]
            title = f"ball bar, circle {plane}, radius {radius:g} mm"
            title += f" at {', '.join(at).replace('=', ' ')}" if at else ""
            yield from _test(scene, options + f":at={','.join(at)}" * bool(at), title)


def _test(scene: Scene, kind: str, title: str) -> Iterator[Candidate]:
    with suppress(OptionError, UnknownNameError):
        readings = TestReadings(kind).plan_readings(scene)
        setup = readings.plan.setup if readings.plan else ()
        unknown = ", ".join(name.rpartition("_")[0].replace("_", " ") for name in setup)
        count = f"{len(readings)} readings of one component"
        yield Candidate(f"{title}: {count}; unknown: {unknown}", readings)


def _spheres(scene: Scene) -> Iterator[Candidate]:
    at_rest = {name: np.array([value]) for name, value in scene.workspace.positions.items()}
    centre = relative_point(scene.model, at_rest)
    turns: dict[str, Array] = {}
    for name in rotary_axes(scene):
        low, high = scene.machine.axes[name].travel
        turns[name] = np.array([turn for turn in TURNS_DEG if low <= turn <= high])
    for name, angles_deg in turns.items():
        for other in [axis for axis in turns if axis != name] or [""]:
            for turn in turns.get(other, np.zeros(1)):
                if len(angles_deg) < 2 or (other and abs(turn) > 90.0):
                    continue
                place = {name: angles_deg}
                fixed = ""
                if other:
                    place[other] = np.full(len(angles_deg), turn)
                    fixed = f" at {other} {turn:g}°"
                at, target = _complete(scene, place), np.repeat(centre, len(angles_deg), axis=0)
                with suppress(SceneError):
                    at = solve_linear(scene, at, target, "")
                    inside = within_travel(scene.machine, at)
                    at = {axis: values[inside] for axis, values in at.items()}
                    count = len(at[name])
                    if count > 1:
                        angles = ", ".join(f"{angle:g}" for angle in at[name])
                        title = f"sphere, TCP on: {name} at {angles}°{fixed}"
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
"""Minutes of work by kind: set-up, and per reading. Typical of an experienced operator; the ranking
depends on them."""


def minutes(readings: Readings) -> float:
    set_up, per_reading = MINUTES.get(readings.kind.partition(":")[0], (30.0, 0.5))
    return set_up + per_reading * len(readings)


NODES = 5  # nodes per axis of the map whose uncertainty is minimised
WIDE = 1000.0  # standard uncertainty in µm or µrad of a parameter without tolerance
MIN_NOISE_MM = 1e-4
MIN_GAIN = 0.01  # minimum reduction of U95, as a share, unless candidates are specified


def next_best(
    scene: Scene,
    sets: Sequence[Readings],
    calibration: Calibration,
    count: int = 1,
    choice: Sequence[Candidate] | None = None,
    check_cancelled: solve.CheckCancelled = solve.never_cancelled,
    target: Target = "map",
    instrument: Instrument = NO_INSTRUMENT,
) -> tuple[NextMeasurement, ...]:
    """Choose measurements one after the other, each for the greatest reduction per minute.

    Notes
    -----
    The information of the readings, JᵀWJ less that of common contributions of the instrument, plus
    that of the tolerances (1000 µm or µrad where there is none), plus that of the candidate. The
    unknowns of set-ups are eliminated; each candidate has a new set-up. First order, at the fitted
    errors.
    """
    if not count:
        return ()
    keys = tuple(row.key for row in calibration.parameters)
    parameters = solve.build_fit_parameters(calibration.scene, keys)
    noise = max(calibration.sigma_mm, MIN_NOISE_MM)
    stated = [readings.sigma_mm for readings in sets if readings.sigma_mm is not None]
    if len(stated) == len(sets):
        noise = float(np.median(np.concatenate(stated)))
    present = solve.MeasurementModel.of(scene, sets, check_cancelled)
    information = _information(present, parameters, noise, instrument) + _prior(scene, keys)
    map_u95 = u95_at(calibration.scene, parameters, "map")
    target_u95 = u95_at(calibration.scene, parameters, target)
    options: list[tuple[Candidate, Array]] = []
    for candidate in choice or candidates(scene):
        model = solve.MeasurementModel.of(scene, [candidate.readings], check_cancelled)
        options.append((candidate, _information(model, parameters, noise)))
    steps: list[NextMeasurement] = []
    before = _covariance(information)
    for _ in range(count):
        check_cancelled()
        u95_before = target_u95(before)
        min_gain = -np.inf if choice else MIN_GAIN * u95_before
        useful: list[tuple[float, Candidate, Array, Array]] = []
        for candidate, added in options:
            after = _covariance(information + added)
            gain = u95_before - target_u95(after)
            if gain >= min_gain:
                useful.append((gain / minutes(candidate.readings), candidate, after, added))
        if not useful:
            break
        _, candidate, after, added = max(useful, key=lambda row: row[0])
        maps = map_u95(before) / FACTOR, map_u95(after) / FACTOR
        duration, u95_after = minutes(candidate.readings), target_u95(after)
        steps.append(NextMeasurement(candidate, duration, u95_before, u95_after, *maps, after))
        information, before = information + added, after
    return tuple(steps)


def find_separating(
    scene: Scene,
    sets: Sequence[Readings],
    calibration: Calibration,
    check_cancelled: solve.CheckCancelled = solve.never_cancelled,
) -> dict[tuple[str, ...], str]:
    """Find for each confounded group the first candidate that separates its parameters."""
    keys = tuple(row.key for row in calibration.parameters)
    parameters = solve.build_fit_parameters(scene, keys)
    remaining = set(calibration.rank.confounded)
    separated_by: dict[tuple[str, ...], str] = {}
    for candidate in candidates(scene):
        if not remaining:
            break
        model = solve.MeasurementModel.of(scene, [*sets, candidate.readings], check_cancelled)
        jacobian = model.derivatives(parameters, parameters.start, model.start())
        rank = solve.find_rank(keys, *jacobian, model.rank_tolerance)
        confounded = {group[0] for group in rank.confounded}
        separated = {group for group in remaining if group[0] not in confounded}
        separated_by |= dict.fromkeys(separated, candidate.name)
        remaining -= separated
    groups = calibration.rank.confounded
    return {group: separated_by[group] for group in groups if group in separated_by}


def _information(
    model: solve.MeasurementModel,
    parameters: solve.FitParameters,
    noise_mm: float,
    instrument: Instrument = NO_INSTRUMENT,
) -> Array:
    by_parameter, by_unknown = model.derivatives(parameters, parameters.start, model.start())
    weights = model.weights(noise_mm)[:, None]
    common = [common_mode(model, contribution) for contribution in instrument.shared]
    jacobian = weights * np.hstack([by_parameter, *common])
    jacobian = solve.project_out(jacobian, solve.orthonormal_basis(weights * by_unknown))
    gram, count = jacobian.T @ jacobian, len(parameters.keys)
    # common contributions are unknown too, with a prior standard uncertainty of one
    shared = gram[count:, count:] + np.eye(len(gram) - count)
    lost = gram[:count, count:] @ np.linalg.solve(shared, gram[count:, :count])
    return gram[:count, :count] - lost


def _prior(scene: Scene, keys: Sequence[str]) -> Array:
    tolerances = [scene.tolerances.get(key) for key in keys]
    widths = [
        WIDE if tolerance is None else max(tolerance.half_width, 1e-6) / np.sqrt(3.0)
        for tolerance in tolerances
    ]
    return np.diag(1.0 / np.array(widths) ** 2)


def _covariance(information: Array) -> Array:
    scale = np.sqrt(np.diag(information))
    inverse = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-13, hermitian=True)
    return inverse / np.outer(scale, scale)


FACTOR = coverage_factor(np.inf)


def u95_at(
    scene: Scene, parameters: solve.FitParameters, target: Target
) -> Callable[[Array], float]:
    """Build the function from the covariance of the parameters to U95 of a target, µm.

    Of the map the root mean square over the volume, of its corners the largest at a node; of the
    part the root mean square over its placed vertices, or the largest of the measurands with a
    tolerance, µm or µrad.
    """
    if target in ("part", "verdict"):
        return _u95_of_part(scene, parameters, str(target))
    if isinstance(target, str):
        grid = build_grid(scene.model, scene.workspace, NODES)
        basis = grid_basis(replace(scene, errors=parameters.errors), grid, keys=parameters.keys)
        weights = grid.weights.ravel() if target == "map" else None
    else:
        at = complete_coordinates(scene.machine, dict(target), scene.workspace.positions)
        basis = build_basis(scene.model, parameters.errors, parameters.keys, at, scene.view())
        weights = None
    flat = basis.position.reshape(len(parameters.keys), -1)

    def u95(covariance: Array) -> float:
        variance = np.sum(flat * (covariance @ flat), axis=0).reshape(-1, 3).sum(axis=1)
        total = variance.max() if weights is None else weights @ variance
        return FACTOR * float(np.sqrt(max(total, 0.0)))

    return u95


def _u95_of_part(
    scene: Scene, parameters: solve.FitParameters, target: str
) -> Callable[[Array], float]:
    from warpspace.parts import inspection, refinement, workpiece

    file = scene.part.path("file")
    if file is None:
        raise OptionError(f"{{target}} {target}: expected a scene whose [part] has a file")
    mesh = workpiece.load_workpiece(file, scene.part.unit or None)
    mesh, _ = refinement.refine(mesh, scene)
    points = workpiece.evaluate_points(scene, workpiece.place_workpiece(mesh, scene).vertices_mm)
    gains = workpiece.point_basis(
        replace(scene, errors=parameters.errors), points, parameters.keys
    ).position
    features = scene.part.path("features")
    if target == "part":
        gains = workpiece.subtract_best_fit(points.point_mm, gains, mesh.shares)
        gains = (gains * np.sqrt(mesh.shares)[:, None]).reshape(len(parameters.keys), -1)
        return lambda covariance: FACTOR * float(np.sqrt(np.sum(gains * (covariance @ gains))))
    if features is not None:
        tolerances = features, read_text(Path(features), MAX_SCENE_BYTES)
        gains = inspection.measure_changes(mesh, points, gains, tolerances)
    if features is None or not gains.size:
        raise OptionError("{target} verdict: expected a scene whose [part] has tolerances")

    def worst_u95(covariance: Array) -> float:
        return FACTOR * float(np.sqrt(np.sum(gains * (covariance @ gains), axis=0).max()))

    return worst_u95


def observability(
    scene: Scene,
    sets: Sequence[Readings],
    check_cancelled: solve.CheckCancelled = solve.never_cancelled,
) -> dict[str, float]:
    """Compute the observability of location and orientation errors by rotary axis.

    The smallest singular value of the readings' Jacobian, set-ups eliminated, µm per µm: the
    observability index O3 (Nahvi, Hollerbach and Hayward 1994; Sun and Hollerbach 2008). At the
    nominal machine, with equal weights, so that it does not depend on the observations. Without the
    combinations that no pose can separate from a shift of the set-up.
    """
    scene = replace(scene, errors=ErrorSet())
    rows = [parameter(key) for key in scene.machine.parameter_keys]
    rows = [row for row in rows if row.is_constant and not is_linear(row.axis)]
    if not rows:
        return {}
    parameters = solve.build_fit_parameters(scene, [row.key for row in rows])
    scale = np.array([UM_PER_MM * (UM_PER_MM / ARM_MM if row.is_rotation else 1.0) for row in rows])

    def gram(readings: Sequence[Readings]) -> Array:
        unweighted = [replace(one_set, sigma_mm=None) for one_set in readings]
        model = solve.MeasurementModel.of(scene, unweighted, check_cancelled)
        return _information(model, parameters, 1.0) * np.outer(scale, scale)

    rng, travels = np.random.default_rng(0), {n: a.travel for n, a in scene.machine.axes.items()}
    poses = {
        name: rng.uniform(*np.clip(travel, *RANGE), size=POSES) for name, travel in travels.items()
    }
    present = gram(sets)
    possible = gram([_nominal(scene, "points", poses, np.zeros((POSES, 3)))])
    indices: dict[str, float] = {}
    for axis in dict.fromkeys(row.axis for row in rows):
        block = np.ix_(*[[at for at, row in enumerate(rows) if row.axis == axis]] * 2)
        eigenvalues, vectors = np.linalg.eigh(possible[block])
        vectors = vectors[:, eigenvalues > solve.RANK_TOLERANCE**2 * eigenvalues[-1]]
        if vectors.size:
            smallest = np.linalg.eigvalsh(vectors.T @ present[block] @ vectors).min()
            indices[axis] = float(np.sqrt(max(smallest, 0.0)))
    return indices
