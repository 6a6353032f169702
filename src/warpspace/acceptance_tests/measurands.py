"""Largest deviations of the measurands of a part that machines which pass cut."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from warpspace.acceptance_tests.error_curves import ErrorCurves
from warpspace.acceptance_tests.next_tests import keep_share
from warpspace.acceptance_tests.polytope import GAP, Constraint, Polytope, find_largest_error
from warpspace.analysis.description import NO_JSON, ProgressCallback
from warpspace.analysis.uncertainty.verdict import Verdict
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_SCENE_BYTES
from warpspace.parts import inspection
from warpspace.parts.inspection import LinearMeasure, MeasureKey
from warpspace.parts.refinement import refine
from warpspace.parts.workpiece import (
    evaluate_points,
    load_workpiece,
    place_workpiece,
    point_basis,
    subtract_best_fit,
)
from warpspace.scene.model import Scene
from warpspace.scene.text_files import read_text
from warpspace.units import Array, Integers

MACHINES = 2000  # random ones in which points of a form are extreme
STARTS = 8  # of them, from which the largest form error is searched
COVERED = 0.0025  # share of a form error by which points are means of others
POINTS = 600  # of a surface that are paired, unless more are extreme in random machines
PAIRS = 300  # pairs of points of a surface that are solved
RANK_TOLERANCE = 1e-9  # share of the largest response
NEGLIGIBLE_UM = 1e-6
REPORTED_UM = 0.5  # interpolation errors that are reported


@dataclass(frozen=True, eq=False)
class Measurand:
    """Largest |deviation| of a measurand over the machines that pass, placed part."""

    name: str  # of the feature
    measure: str
    bound: tuple[float, float]  # attained, and proved
    without_tests: float
    unit: str
    tolerance: tuple[float, float] | None
    is_kept: bool | None  # by every machine that passes; None between the bounds
    machine: Array = field(metadata=NO_JSON)  # [V], the worst one that passes

    @property
    def verdict(self) -> Verdict | str:
        """Conformity of the parts of all machines that pass; empty without tolerance."""
        if self.tolerance is None:
            return ""
        return Verdict.PASS if self.is_kept else Verdict.UNDECIDED


class Extreme(NamedTuple):
    """Largest value over a polytope, between two bounds, and its machine."""

    low: float
    high: float
    machine: Array  # [V]


class PartModel:
    """The part of a scene, its measures and their responses to the errors of machines."""

    def __init__(self, curves: ErrorCurves, watch: ProgressCallback) -> None:
        scene = curves.scene
        file = scene.part.path("file")
        if file is None:
            raise OptionError("{part}: expected a scene whose [part] has a file")
        mesh = load_workpiece(file, scene.part.unit or None)
        count = len(mesh.triangles)
        if count > MAX_FEATURE_TRIANGLES:
            raise OptionError(
                f"{{part}}: {count:,} triangles; features are evaluated for up to"
                f" {MAX_FEATURE_TRIANGLES:,}"
            )
        watch(0.0)
        # the machine whose errors bend most at knots, so that vertices represent all machines
        is_odd = np.array([knot % 2 for _, knot in curves.variables], dtype=bool)
        bent = curves.build_scene(np.where(is_odd, curves.lower, curves.upper))
        fine, self.interpolation_um = refine(mesh, bent)
        points = evaluate_points(scene, place_workpiece(fine, scene).vertices_mm)
        self.outside = int(points.outside[: len(mesh.vertices_mm)].sum())
        source = scene.part.path("features")
        tolerances = source and (source, read_text(Path(source), MAX_SCENE_BYTES))
        self.names, features, bands = inspection.read_measures(fine, tolerances or None)
        chosen = [measure for measure, band in bands.items() if band] or list(bands)
        self.bands = {measure: bands[measure] for measure in chosen}
        turn = inspection.mesh_rotation(fine, points)
        linear: list[LinearMeasure | None] = []

        def respond(unit: Scene) -> Array:
            watch(0.0)
            moves = point_basis(unit, points).position @ turn
            moves = subtract_best_fit(fine.vertices_mm, moves, fine.shares)
            linear[:] = inspection.linearise_measures(features, chosen, moves)
            return np.concatenate([np.zeros((0, len(moves))), *(x.rows for x in linear if x)])

        rows, self.linear = curves.respond(respond), dict[MeasureKey, LinearMeasure]()
        for measure, each in zip(chosen, linear, strict=True):
            if each is not None:
                self.linear[measure] = each._replace(rows=rows[: len(each.rows)])
                rows = rows[len(each.rows) :]

    def remarks(self) -> Iterator[str]:
        nonlinear = [self.spell(measure) for measure in self.bands if measure not in self.linear]
        if nonlinear:
            yield f"no bound, not linear in the errors: {', '.join(nonlinear)}"
        if self.outside:
            far = f"{self.outside:,} vertices of the part"
            yield f"{far} are beyond the travel; their errors are continued"
        if self.interpolation_um > REPORTED_UM:
            yield (
                "errors between evaluated points of the part deviate by up to"
                f" {self.interpolation_um:.1f} µm more"
            )

    def spell(self, measure: MeasureKey) -> str:
        return f"{self.names[measure[1][0]]} · {inspection.spell_measure(measure, self.names)}"


def find_largest_deviations(
    curves: ErrorCurves,
    constraints: Sequence[Constraint],
    model: PartModel,
    watch: ProgressCallback,
) -> Iterator[Measurand]:
    """Find the largest |deviation| of each linear measure over the machines that pass."""
    passing, all_machines = curves.polytope(constraints), curves.polytope(())
    for done, (measure, linear) in enumerate(model.linear.items()):
        tick = partial(keep_share, watch, done / len(model.linear))
        tick(0.0)
        band, kind = model.bands[measure], inspection.KINDS[measure[0]]
        ends = _find_extremes(passing, linear, tick)
        largest, is_kept = max(ends, key=attrgetter("low")), None
        if band is not None:
            (down, up), (low, high) = ends, band
            is_kept = down.high <= -low and up.high <= high
            if not is_kept and down.low <= -low and up.low <= high:
                is_kept = None
        yield Measurand(
            model.names[measure[1][0]],
            inspection.spell_measure(measure, model.names),
            (largest.low, max(end.high for end in ends)),
            max(end.low for end in _find_extremes(all_machines, linear, tick)),
            "urad" if kind.is_angle else "um",
            band,
            is_kept,
            largest.machine,
        )


def _find_extremes(
    polytope: Polytope, linear: LinearMeasure, tick: ProgressCallback
) -> tuple[Extreme, Extreme]:
    """Find the largest deviations downwards and upwards; 0 where there is none."""
    rows, none = linear.rows, Extreme(0.0, 0.0, 0.0 * polytope.upper)
    if len(rows) == 1:
        down, up = (
            Extreme(vertex.maximum, vertex.maximum, vertex.point)
            for vertex in (polytope.maximise(sign * rows[0]) for sign in (-1.0, 1.0))
        )
        if not linear.sign:
            return down, up
        largest = max(down, up, key=attrgetter("low"))
    elif len(rows) == 3:
        worst = find_largest_error(polytope, rows[None], tick)
        largest = Extreme(worst.low_um, worst.high_um, worst.machine)
    else:
        largest = find_largest_span(polytope, rows, tick)
    return (none, largest) if linear.sign > 0.0 else (largest, none)


class _LargestSpanSearch:
    def __init__(self, polytope: Polytope, rows: Array) -> None:
        self.polytope, self.rows = polytope, rows
        self.middle = (polytope.upper + polytope.lower) / 2.0
        self.half = (polytope.upper - polytope.lower) / 2.0
        self.best = Extreme(0.0, 0.0, self.middle)

    def maximise(self, first: int, second: int) -> float:
        """Maximise the difference of two points; improve the machine, its pair iterated."""
        maximum = None
        while True:
            vertex = self.polytope.maximise(self.rows[first] - self.rows[second])
            maximum = vertex.maximum if maximum is None else maximum
            values = self.rows @ vertex.point
            span = float(np.ptp(values))
            if span <= self.best.low * (1.0 + 1e-4):
                return maximum
            self.best = Extreme(span, 0.0, vertex.point)
            first, second = int(values.argmax()), int(values.argmin())

    def choose_points(self) -> tuple[Integers, float]:
        """Return points that can be extreme, and the largest remainder of others."""
        rng = np.random.default_rng(0)
        signs = rng.choice((-1.0, 1.0), (MACHINES, len(self.half)))
        values = self.rows @ (self.middle + self.half * signs).T
        low, high = values.argmin(axis=0), values.argmax(axis=0)
        for first, second in zip(high[:STARTS], low[:STARTS], strict=True):
            self.maximise(int(first), int(second))
        chosen = np.unique([low, high])
        points = np.column_stack([self.rows * self.half, self.rows @ self.middle])
        remainder = find_remainders(points, chosen)
        order = np.argsort(-remainder)[: max(POINTS - len(chosen), 0)]
        added = order[remainder[order] > max(COVERED * self.best.low, NEGLIGIBLE_UM)]
        remainder[added] = 0.0
        return np.union1d(chosen, added), float(remainder.max())

    def find_maxima(self, chosen: Integers, sign: float, tick: ProgressCallback) -> Array:
        maxima = list[float]()
        for point in self.rows[chosen]:
            tick(0.0)
            maxima.append(self.polytope.maximise(sign * point).maximum)
        return np.array(maxima)


def find_largest_span(polytope: Polytope, rows: Array, tick: ProgressCallback) -> Extreme:
    """Find the largest span of rows @ machine, rows [n, V], over a polytope.

    It is that of two points, each extreme for some machine. Paired are the points that are extreme
    for one of `MACHINES` random ones, and those that are not weighted means of these within
    `COVERED`; the upper bound includes the remainder. The difference of a pair is bounded by the
    tolerances and by the largest values of both points, linear programs. The pair with the largest
    bound is solved next, until the bounds differ by `GAP`, or after `PAIRS`: the upper bound is
    proved in any case.
    """
    search = _LargestSpanSearch(polytope, rows)
    chosen, remainder = search.choose_points()
    points = rows[chosen]
    up = search.find_maxima(chosen, 1.0, tick)
    down = up if polytope.is_symmetric else search.find_maxima(chosen, -1.0, tick)
    by_tolerances = np.array([polytope.bounds(point - points) for point in points])
    upper = np.minimum(by_tolerances, up[:, None] + down)
    upper = np.triu(upper) if polytope.is_symmetric else upper
    for _ in range(PAIRS):
        first, second = divmod(int(upper.argmax()), len(chosen))
        if upper[first, second] + 2.0 * remainder <= (1.0 + GAP) * search.best.low + NEGLIGIBLE_UM:
            break
        tick(0.0)
        upper[first, second] = search.maximise(chosen[first], chosen[second])
    high = float(upper.max()) + 2.0 * remainder
    return search.best._replace(high=max(search.best.low, high))


def find_remainders(points: Array, chosen: Integers) -> Array:
    """Compute what remains of points, [n, d], as weighted means of chosen ones, sums of sizes."""
    from scipy.optimize import nnls

    vectors, size, _ = np.linalg.svd(points, full_matrices=False)
    is_used, ones = size > RANK_TOLERANCE * size[0], np.full(len(points), size[0] or 1.0)
    coordinates = np.column_stack([vectors[:, is_used] * size[is_used], ones])
    remainders, basis = np.zeros(len(points)), coordinates[chosen].T
    for index in np.setdiff1d(np.arange(len(points)), chosen):
        weights, _ = nnls(basis, coordinates[index])
        mean = weights @ points[chosen] / weights.sum()
        remainders[index] = np.abs(points[index] - mean).sum()
    return remainders
