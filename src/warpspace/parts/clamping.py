"""Where to clamp a part: its worst deviation over the travel, in the orientations allowed.

Fixtures and collisions are not looked at. Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Literal

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table, number_columns
from warpspace.analysis.description import Analysis, Result, Watch
from warpspace.analysis.options import File, option
from warpspace.bench.placing import following_axes
from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.model import Loop
from warpspace.parts.part import (
    PLACE_HELP,
    PLACE_UNSET,
    Place,
    find_place,
    fit_out,
    load_part,
    make_points,
)
from warpspace.scene.model import Scene, second_order
from warpspace.units import Array

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


@dataclass(frozen=True, kw_only=True)
class Clamp(Analysis):
    """Find where to clamp a part on the machine of SCENE.

    The part stands at places all over the travel, in the orientations that are allowed; where any
    of it would be beyond the travel it does not stand. Fixtures and collisions are not looked at.
    Geometry only: no forces, heat, wear or servo.
    """

    name = "clamp"
    task = "improve"
    has_chart = True
    chart_help = "map of the places"
    has_table = True
    file: File = option(None, "Mesh of the part", positional=True, unset="that of the scene")
    unit: Literal["mm", "cm", "m", "in"] | None = option(
        None, "Unit of its numbers", unset="mm, of .glb m"
    )
    place: Place = option(None, f"{PLACE_HELP}: what others are compared with", unset=PLACE_UNSET)
    turns: Literal["none", "C", "all"] = option(
        "none", "Orientations allowed: this one, 90° steps about z, or all 24"
    )
    grid: int = option(7, "Places along each axis of the plane", low=1, high=31)
    heights: int = option(1, "Places along the third; 1 for that of its lower side", low=1, high=31)
    placed: bool = option(False, "Judge what is left after the best rigid fit of the part")

    def run(self, scene: Scene, watch: Watch, /) -> "ClampResult":
        if (path := self.file or scene.part.path("file")) is None:
            raise OptionError("{file} is missing; expected a mesh, or a scene whose [part] has one")
        mesh = load_part(path, self.unit or ("" if self.file else scene.part.unit) or None)
        own, present = mesh.vertices_mm, find_place(mesh, scene, self.place)
        a, b, c = present[3:]
        turns = [(a, b, c + 90.0 * quarter) for quarter in range(1 if self.turns == "none" else 4)]
        if self.turns == "all":
            turns = [(*tilt, c) for tilt, (_, _, c) in product(TILTS, turns)]
        level = _turned(own, present)[:, 2].min() + present[2]
        outermost = np.random.default_rng(0).standard_normal((3, SEARCHED // 4))
        every = range(0, len(own), -(-len(own) // SEARCHED))
        some = own[np.unique([*np.argmax(own @ outermost, axis=0), *every])]
        places = [
            (*shift, *map(float, turn))
            for turn in turns
            for shift in self.shifts(scene, _turned(own, (0, 0, 0, *turn)), [*present[:2], level])
        ]
        found: list[Clamping] = []
        for number, place in enumerate(places):
            found.append(_judge(scene, some, place))
            watch((number + 1) / len(places))
        if not found:
            raise OptionError(f"{mesh.name} fits nowhere into the travel of {scene.machine.chain}")

        def worst(one: Clamping) -> float:
            return one.placed_um if self.placed else one.max_um

        found.sort(key=worst)
        now, *best = (
            _judge(scene, own, at) for at in (present, *(one.place for one in found[:RIVALS]))
        )
        first = min(best if now.outside else [now, *best], key=worst)
        return ClampResult(
            places=found, best=first, present=now, gain_um=worst(now) - worst(first),
            title=f"{scene.title} · {mesh.name}", placed=self.placed,
            second_order=second_order(scene, Loop.RELATIVE),
        )  # fmt: skip

    def shifts(self, scene: Scene, turned_mm: Array, lowest_mm: list[float]) -> list[list[float]]:
        """Give the shifts of a grid that keep a turned part within the travel, mm."""
        names = following_axes(scene.model)
        at = make_points(scene, np.vstack([np.zeros(3), np.eye(3)])).coordinates
        zero, *rows = np.stack([at[name] for name in names], axis=-1)
        rows = (np.array(rows) - zero).T  # positions of the axes at p of w are zero + rows · p
        reached = zero + turned_mm @ rows.T
        low, high = np.array([scene.machine.axes[name].travel for name in names]).T
        low, high = low - reached.min(axis=0), high - reached.max(axis=0)
        up = int(np.argmax(np.abs(rows[:, 2])))
        counts = [self.heights if axis == up else self.grid for axis in range(3)]
        shares = [np.linspace(0.0, 1.0, n) if n > 1 else np.array([0.5]) for n in counts]
        moves = [low[axis] + share * (high - low)[axis] for axis, share in enumerate(shares)]
        if self.heights == 1:
            kept = rows[up] @ (lowest_mm - np.array([0.0, 0.0, turned_mm[:, 2].min()]))
            moves[up] = np.clip([kept], low[up], high[up])
        fits = bool((low <= high).all())
        return (np.array([*product(*moves)]) @ np.linalg.inv(rows).T).tolist() if fits else []


def _turned(own_mm: Array, place: tuple[float, ...]) -> Array:
    return transforms.apply(transforms.placed(np.zeros(3), place[3:]), own_mm)


def _judge(scene: Scene, own_mm: Array, place: tuple[float, ...]) -> Clamping:
    made = make_points(scene, _turned(own_mm, place) + place[:3])
    both = made.error_um, fit_out(made.point_mm, made.error_um)
    most, placed = (float(np.linalg.norm(error, axis=1).max()) for error in both)
    return Clamping(place, most, placed, int(made.outside.sum()))


@dataclass(frozen=True, kw_only=True)
class ClampResult(Result):
    """Places of a part, the best one, and what it gains."""

    keys = ("places", "best", "present", "gain_um")
    places: list[Clamping]  # by some of the vertices, best first
    best: Clamping
    present: Clamping
    gain_um: float
    title: str
    placed: bool

    def blocks(self) -> Iterator[Block]:
        judged = "largest |E|" + " after the best rigid fit" * self.placed
        yield f"{self.title}: {len(self.places):,} places"
        yield f"  the best one gains {self.gain_um:.2f} µm of the {judged}"
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
        first = self.places[0].place
        here = [one for one in self.places if np.allclose(one.place[2:], first[2:], atol=1e-6)]
        um = np.array([one.placed_um if self.placed else one.max_um for one in here])
        where = np.array([one.place[:2] for one in here])
        edges = np.linspace(um.min(), um.max(), CLASSES + 1)
        which = np.clip(np.searchsorted(edges, um) - 1, 0, CLASSES - 1)
        words = [f"{one:.2f} to {other:.2f} µm" for one, other in pairwise(edges)]
        dots = tuple(
            Curve(words[at], where[which == at, 0], where[which == at, 1], at, "dots")
            for at in np.unique(which).tolist()
        )
        note = f"{judged}. Geometry only: no forces, heat, wear or servo."
        yield Lines("plane", f"Where to clamp: {self.title}", "x [mm]", "y [mm]", dots, (), note)

    def doubts(self) -> Iterator[str]:
        if self.present.outside:
            yield f"at present {self.present.outside:,} vertices are beyond the travel"
