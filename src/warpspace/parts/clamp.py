"""Fixture position with the smallest deviation of a workpiece, over travel and orientations.

Fixtures and collisions are not considered. Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise, product
from operator import attrgetter
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table, number_columns
from warpspace.analysis.description import ExpandedUncertainty, ProgressCallback, Result
from warpspace.analysis.options import option
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, plus_minus
from warpspace.bench.placing import following_axes
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.parts.refinement import refine, sample_vertices
from warpspace.parts.workpiece import (
    Workpiece,
    WorkpieceAnalysis,
    evaluate_points,
    place_workpiece,
    point_uncertainty,
    subtract_best_fit,
)
from warpspace.scene.model import Scene, second_order
from warpspace.units import Array, spell_fixed

MAX_EVALUATED_VERTICES = 4000  # at each place; of larger meshes a sample and the outermost ones
OUTERMOST = 200  # directions
TILTS = (0, 0), (90, 0), (180, 0), (270, 0), (0, 90), (0, 270)  # degrees about x and y
MAX_ROWS, CLASSES = 10, 5  # places of the table; colours of the map


@dataclass(frozen=True)
class Clamping:
    """A fixture position and the largest |E| there."""

    place: tuple[float, ...]  # [6], mm and degrees, in the workpiece frame
    max_um: float
    placed_um: float  # after the best rigid fit
    outside: int  # evaluated points beyond the travel
    expanded_uncertainty: ExpandedUncertainty[float | None] = field(
        default_factory=ExpandedUncertainty[float | None]
    )


CRITERIA = attrgetter("max_um"), attrgetter("placed_um")  # as clamped; after the best rigid fit
U95 = "u95_max_um", "u95_placed_um"


@dataclass(frozen=True, kw_only=True)
class Clamp(WorkpieceAnalysis):
    """Find the best fixture position of a part on SCENE.

    Places over the travel in the allowed orientations are compared with the present place; those
    where a vertex is beyond the travel are excluded. Fixtures and collisions are not considered.
    Geometry only: no forces, heat, wear or servo.
    """

    name = "clamp"
    task = "improve"
    has_chart = True
    chart_help = "map of the places"
    has_table = True
    turns: Literal["none", "C", "all"] = option(
        "none", "Allowed orientations: the present one, 90° steps about z, or all 24"
    )
    grid: int = option(7, "Places along x and along y", low=2, high=31)
    placed: bool = option(False, "Compare deviations after the best rigid fit of the part")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ClampResult":
        mesh = self.load_mesh(scene)
        part = place_workpiece(mesh, scene, self.place)
        a, b, c = part.place[3:]
        tilts = TILTS if self.turns == "all" else [(a, b)]
        quarters = range(1 if self.turns == "none" else 4)
        names = following_axes(scene.model)
        ends = np.array([*product(*(scene.machine.axes[name].travel for name in names))])
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        reach = relative_point(scene.model, {**stand, **dict(zip(names, ends.T, strict=True))})
        level, places = part.vertices_mm[:, 2].min(), list[tuple[float, ...]]()
        for tilt, quarter in product(tilts, quarters):
            turn = (*tilt, c + 90.0 * quarter)
            turned = place_workpiece(mesh, scene, (0.0, 0.0, 0.0, *turn)).vertices_mm
            low, high = (end(reach, axis=0) - end(turned, axis=0) for end in (np.min, np.max))
            z = float(np.clip(level - turned[:, 2].min(), low[2], high[2]))
            grid = np.linspace(low[:2], high[:2], self.grid).T.tolist()
            places += [(x, y, z, *turn) for x, y in product(*grid)]
        fine, _ = refine(mesh, scene, part.place)
        points, shares = sample_vertices(fine, MAX_EVALUATED_VERTICES)
        if len(points) < len(fine.vertices_mm):
            directions = np.random.default_rng(0).standard_normal((OUTERMOST, 3))
            rows = [np.argmax(mesh.vertices_mm @ direction) for direction in directions]
            points = np.concatenate([points, mesh.vertices_mm[rows]])
            shares = np.concatenate([shares, np.zeros(OUTERMOST)])
        sample, clampings = replace(mesh, vertices_mm=points), list[Clamping]()
        for number, place in enumerate(places):
            clamping = _evaluate(scene, place_workpiece(sample, scene, place), shares)
            if not clamping.outside:
                clampings.append(clamping)
            watch((number + 1) / len(places))
        criterion = CRITERIA[self.placed]
        clampings.sort(key=criterion)
        if not clampings:
            raise OptionError(f"{mesh.name} fits nowhere into the travel of {scene.machine.chain}")
        now = _evaluate(scene, place_workpiece(sample, scene, part.place), shares)
        first = min(now, clampings[0], key=lambda at: (at.outside > 0, criterion(at)))
        result = ClampResult(
            places=clampings, best=first, present=now, gain_um=criterion(now) - criterion(first),
            title=f"{scene.title} · {mesh.name}", placed=self.placed, warnings=mesh.warnings,
            second_order=second_order(scene, Loop.RELATIVE),
        )  # fmt: skip
        each = [_uncertainties(scene, sample, shares, clamping.place) for clamping in (now, first)]
        return result.with_expanded_uncertainty(*each) if all(each) else result


def _evaluate(scene: Scene, part: Workpiece, shares: Array) -> Clamping:
    actual = evaluate_points(scene, part.vertices_mm)
    errors = actual.error_um, subtract_best_fit(actual.point_mm, actual.error_um, shares)
    clamped, placed = (float(np.linalg.norm(error, axis=1).max()) for error in errors)
    return Clamping(part.place, clamped, placed, int(actual.outside.sum()))


def _uncertainties(
    scene: Scene, sample: Workpiece, shares: Array, place: Sequence[float]
) -> list[FieldUncertainty]:
    """Return the uncertainty as clamped, and after the best rigid fit."""
    actual = evaluate_points(scene, place_workpiece(sample, scene, place).vertices_mm)
    clamped = point_uncertainty(scene, actual, shares)
    if clamped is None:
        return []
    fit = partial(subtract_best_fit, actual.point_mm, shares=shares)
    return [clamped, clamped.transform(fit)]


@dataclass(frozen=True, kw_only=True)
class ClampResult(Result):
    """Fixture positions of a part, the best one, and its gain."""

    json_keys = ("places", "best", "present", "gain_um", "expanded_uncertainty")
    places: list[Clamping]  # best first
    best: Clamping
    present: Clamping
    gain_um: float
    title: str
    placed: bool
    warnings: tuple[str, ...]  # of the mesh
    expanded_uncertainty: ExpandedUncertainty[float | None] = field(
        default_factory=ExpandedUncertainty[float | None]
    )

    def with_expanded_uncertainty(self, *each: list[FieldUncertainty]) -> "ClampResult":
        """Return the result with U95 at present, at the best place and of the gain."""
        before, after = (uncertainties[self.placed] for uncertainties in each)
        gain = before.u95(before.gradients[-1] - after.gradients[-1])
        clampings: list[Clamping] = []
        for clamping, uncertainties in zip((self.present, self.best), each, strict=True):
            largest = [uncertainty.statistics()["max_um"] for uncertainty in uncertainties]
            u95 = ExpandedUncertainty[float | None](zip(U95, largest, strict=True))
            clampings.append(replace(clamping, expanded_uncertainty=u95))
        return replace(
            self,
            present=clampings[0],
            best=clampings[1],
            expanded_uncertainty={"u95_gain_um": gain if before.errors.is_known else None},
            uncertainty=before.errors,
        )

    def blocks(self) -> Iterator[Block]:
        quantity = "largest |E|" + " after the best rigid fit" * self.placed
        yield f"{self.title}: {len(self.places):,} places"
        yield f"  the best one reduces the {quantity} by {spell_fixed(self.gain_um)} µm"
        if self.expanded_uncertainty:
            name, gain = U95[self.placed], plus_minus(self.expanded_uncertainty["u95_gain_um"])
            now, best = (
                plus_minus(clamping.expanded_uncertainty[name])
                for clamping in (self.present, self.best)
            )
            yield f"  U95: at present {now}, at the best place {best}, of the gain {gain} µm"
        yield "  Geometry only: no forces, heat, wear or servo"
        columns = (
            Column("place", leads=True),
            *number_columns(("x", "y", "z"), ".1f", "mm", ("x_mm", "y_mm", "z_mm")),
            *number_columns(("A", "B", "C"), ".0f", "°", ("a_deg", "b_deg", "c_deg")),
            *number_columns(("|E|", "placed"), ".2f", "µm", ("max_um", "placed_um")),
        )
        labelled = [("present", self.present), ("best", self.best), *(("", x) for x in self.places)]
        rows = [(label, *at.place, at.max_um, at.placed_um) for label, at in labelled]
        yield Table(columns, rows[:MAX_ROWS], file_rows=rows)
        level = [at for at in self.places if at.place[2:] == self.places[0].place[2:]]
        um = [*map(CRITERIA[self.placed], level)]
        x, y, *_ = np.array([at.place for at in level]).T
        ends = np.linspace(0, len(level), min(CLASSES, len(level)) + 1).astype(int)
        dots = tuple(
            Curve(f"{um[at]:.2f} to {um[end - 1]:.2f} µm", x[at:end], y[at:end], number, "dots")
            for number, (at, end) in enumerate(pairwise(ends))
        )
        note = f"{quantity}. Geometry only: no forces, heat, wear or servo."
        yield Lines("plane", f"Fixture positions: {self.title}", "x [mm]", "y [mm]", dots, (), note)

    def caveats(self) -> Iterator[str]:
        yield from (*self.warnings, *super().caveats())
        if self.present.outside:
            yield f"at present {self.present.outside:,} evaluated points are beyond the travel"
