"""Where to clamp a part: its worst deviation over the travel, in the orientations allowed.

Fixtures and collisions are not looked at. Geometry only: no forces, heat, wear or servo.
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
from warpspace.analysis.uncertainty.propagation import (
    FieldUncertainty,
    plus_minus,
    scene_uncertainty,
)
from warpspace.bench.placing import ball_point, following_axes
from warpspace.exceptions import OptionError
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES
from warpspace.parts.workpiece import OfPart, PartMesh, fit_out, made_doubt, make_points, place_part
from warpspace.scene.model import Scene, second_order

SEARCHED = 800  # vertices that tell where a part deviates least; all do at the best places
RIVALS = 3  # best places of the search that are judged by all vertices
TILTS = (0, 0), (90, 0), (180, 0), (270, 0), (0, 90), (0, 270)  # degrees about x and y
SHOWN, CLASSES = 10, 5  # places of the table; colours of the map


@dataclass(frozen=True)
class Clamping:
    """A part at one place, and its largest |E| there."""

    place: tuple[float, ...]  # [6], mm and degrees, in the workpiece frame
    max_um: float
    placed_um: float  # after the best rigid fit
    outside: int  # vertices beyond the travel
    expanded_uncertainty: ExpandedUncertainty[float | None] = field(
        default_factory=ExpandedUncertainty[float | None]
    )


JUDGED = attrgetter("max_um"), attrgetter("placed_um")
"""What is judged: as the part lies, and placed."""
U95 = "u95_max_um", "u95_placed_um"


@dataclass(frozen=True, kw_only=True)
class Clamp(OfPart):
    """Find where to clamp a part on the machine of SCENE.

    The part stands at places all over the travel, in the orientations that are allowed, and is
    compared with where it is clamped; where any of it would be beyond the travel it does not
    stand. Fixtures and collisions are not looked at. Geometry only: no forces, heat, wear or servo.
    """

    name = "clamp"
    task = "improve"
    has_chart = True
    chart_help = "map of the places"
    has_table = True
    turns: Literal["none", "C", "all"] = option(
        "none", "Orientations allowed: this one, 90° steps about z, or all 24"
    )
    grid: int = option(7, "Places along x and along y", low=2, high=31)
    placed: bool = option(False, "Judge what is left after the best rigid fit of the part")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ClampResult":
        mesh = self.find_mesh(scene)
        part = place_part(mesh, scene, self.place)
        a, b, c = part.place[3:]
        tilts = TILTS if self.turns == "all" else [(a, b)]
        quarters = range(1 if self.turns == "none" else 4)
        names = following_axes(scene.model)
        ends = np.array([*product(*(scene.machine.axes[name].travel for name in names))])
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        reach = ball_point(scene.model, {**stand, **dict(zip(names, ends.T, strict=True))})
        level, places = part.vertices_mm[:, 2].min(), list[tuple[float, ...]]()
        for tilt, quarter in product(tilts, quarters):
            turn = (*tilt, c + 90.0 * quarter)
            turned = place_part(mesh, scene, (0.0, 0.0, 0.0, *turn)).vertices_mm
            low, high = (end(reach, axis=0) - end(turned, axis=0) for end in (np.min, np.max))
            z = float(np.clip(level - turned[:, 2].min(), low[2], high[2]))
            grid = np.linspace(low[:2], high[:2], self.grid).T.tolist()
            places += [(x, y, z, *turn) for x, y in product(*grid)]
        own, found = mesh.vertices_mm, list[Clamping]()
        outermost = np.random.default_rng(0).standard_normal((3, SEARCHED // 4))
        every = range(0, len(own), -(-len(own) // SEARCHED))
        some = replace(mesh, vertices_mm=own[[*np.argmax(own @ outermost, axis=0), *every]])
        for number, place in enumerate(places):
            found.append(_judge(scene, place_part(some, scene, place)))
            watch((number + 1) / len(places))
        judged = JUDGED[self.placed]
        found = sorted((one for one in found if not one.outside), key=judged)
        if not found:
            raise OptionError(f"{mesh.name} fits nowhere into the travel of {scene.machine.chain}")
        now, *best = (
            _judge(scene, place_part(mesh, scene, at))
            for at in (part.place, *(one.place for one in found[:RIVALS]))
        )
        first = min(now, *best, key=lambda one: (one.outside > 0, judged(one)))
        result = ClampResult(
            places=found, best=first, present=now, gain_um=judged(now) - judged(first),
            title=f"{scene.title} · {mesh.name}", placed=self.placed, warnings=mesh.warnings,
            second_order=second_order(scene, Loop.RELATIVE),
        )  # fmt: skip
        is_large = len(mesh.triangles) > MAX_FEATURE_TRIANGLES
        if is_large or not scene_uncertainty(scene, Loop.RELATIVE):
            return result
        return result.with_expanded_uncertainty(
            *(_doubts(scene, mesh, one.place) for one in (now, first))
        )


def _judge(scene: Scene, part: PartMesh) -> Clamping:
    made = make_points(scene, part.vertices_mm)
    both = made.error_um, fit_out(made.point_mm, made.error_um)
    most, placed = (float(np.linalg.norm(error, axis=1).max()) for error in both)
    return Clamping(part.place, most, placed, int(made.outside.sum()))


def _doubts(scene: Scene, mesh: PartMesh, place: Sequence[float]) -> list[FieldUncertainty]:
    made = make_points(scene, place_part(mesh, scene, place).vertices_mm)
    found = made_doubt(scene, made)
    return [found, found.transform(partial(fit_out, made.point_mm))] if found else []


@dataclass(frozen=True, kw_only=True)
class ClampResult(Result):
    """Places of a part, the best one, and what it gains."""

    json_keys = ("places", "best", "present", "gain_um", "expanded_uncertainty")
    places: list[Clamping]  # by some of the vertices, best first
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
        """Say U95 at present, at the best place and of the gain."""
        before, after = (found[self.placed] for found in each)
        gain = before.u95(before.gradients[-1] - after.gradients[-1])
        told = ExpandedUncertainty(u95_gain_um=gain if before.errors.is_known else None)
        now, best = (
            replace(
                at,
                expanded_uncertainty=ExpandedUncertainty(
                    zip(U95, [x.statistics()["max_um"] for x in found], strict=True)
                ),
            )
            for at, found in zip((self.present, self.best), each, strict=True)
        )
        return replace(
            self, present=now, best=best, expanded_uncertainty=told, uncertainty=before.errors
        )

    def blocks(self) -> Iterator[Block]:
        judged = "largest |E|" + " after the best rigid fit" * self.placed
        yield f"{self.title}: {len(self.places):,} places"
        yield f"  the best one gains {self.gain_um:.2f} µm of the {judged}"
        if self.expanded_uncertainty:
            name, gain = U95[self.placed], plus_minus(self.expanded_uncertainty["u95_gain_um"])
            now, best = (
                plus_minus(one.expanded_uncertainty[name]) for one in (self.present, self.best)
            )
            yield f"  U95 of that: at present {now}, at the best {best}, of the gain {gain} µm"
        yield "  Geometry only: no forces, heat, wear or servo"
        columns = (
            Column("where", leads=True),
            *number_columns(("x", "y", "z"), ".1f", "mm", ("x_mm", "y_mm", "z_mm")),
            *number_columns(("A", "B", "C"), ".0f", "°", ("a_deg", "b_deg", "c_deg")),
            *number_columns(("|E|", "placed"), ".2f", "µm", ("max_um", "placed_um")),
        )
        told = [("present", self.present), ("best", self.best), *(("", x) for x in self.places)]
        rows = [(word, *one.place, one.max_um, one.placed_um) for word, one in told]
        yield Table(columns, rows[:SHOWN], file_rows=rows)
        here = [one for one in self.places if one.place[2:] == self.places[0].place[2:]]
        um, (x, y, *_) = [*map(JUDGED[self.placed], here)], np.array([one.place for one in here]).T
        ends = np.linspace(0, len(here), min(CLASSES, len(here)) + 1).astype(int)
        dots = tuple(
            Curve(f"{um[at]:.2f} to {um[end - 1]:.2f} µm", x[at:end], y[at:end], number, "dots")
            for number, (at, end) in enumerate(pairwise(ends))
        )
        note = f"{judged}. Geometry only: no forces, heat, wear or servo."
        yield Lines("plane", f"Where to clamp: {self.title}", "x [mm]", "y [mm]", dots, (), note)

    def caveats(self) -> Iterator[str]:
        yield from (*self.warnings, *super().caveats())
        if self.present.outside:
            yield f"at present {self.present.outside:,} vertices are beyond the travel"
