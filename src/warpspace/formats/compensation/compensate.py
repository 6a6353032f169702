"""A compensation from a scene to the controller and back: written, read, evaluated, applied."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table, number_columns
from warpspace.analysis.description import Analysis, ProgressCallback, Result, to_json
from warpspace.analysis.options import PLACED_HELP, Grammar, option
from warpspace.analysis.statistics import Statistics
from warpspace.analysis.uncertainty.propagation import u95_lines
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import find_placement, fit_placement
from warpspace.field.grid import build_grid
from warpspace.formats.compensation.controller import (
    BeforeAfter,
    Controller,
    evaluate_before_after,
    read_back,
    reversal_notes,
)
from warpspace.formats.compensation.corrections import (
    Corrector,
    RequiredCorrections,
    build_corrector,
)
from warpspace.formats.registry import SIGNS, Files, Format, find_format
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection
from warpspace.scene.model import Scene, in_direction, placed_in
from warpspace.scene.text_files import parse_whole
from warpspace.units import Array

NODES = 28  # nodes per axis that what is left is evaluated at: between the points of usual tables
SMALL_NODES = 7  # nodes and points per axis that the placement of a workpiece is fitted with
STEP = 100.0  # µm and µrad by which a placement is changed to see what a table makes of it
MOVABLE = 0.05  # A table that leaves less than this share of a displaced part can move it
PLACED_ASSUMPTION = (
    "a part is judged by its shape: where it lies (three shifts, three small rotations) is fitted"
    " out of the errors before and after"
)
NO_OFFSETS = ", since the format has no place for it"
RESOLUTION = (0.0, 0.1)  # mm or degrees
SIZES = (3, 5, 9, 17)
MAX_TABLES = 32  # compensations of one sweep
GRIDLESS = ("linuxcnc-matrix", "marlin")
"""Formats without a grid that a sweep shows where none are named; Klipper's skew is Marlin's."""
TABLES = ("sinumerik-enc", "sinumerik-cec", "heidenhain", "fanuc-3d", "isg-csv")
MIN_CHART_UM = 1e-3  # lower end of the chart of a sweep, where nothing is left
Points: TypeAlias = int | tuple[tuple[str, int], ...]
"""Points of a table along every axis, or along each."""


def read_points(text: str, _scene: Scene | None = None) -> Points:
    try:
        if "=" not in text:
            return parse_whole(text)
        pairs = [part.partition("=") for part in text.split(",")]
        return tuple({name.strip().upper(): parse_whole(n) for name, _, n in pairs}.items())
    except ValueError:
        raise ValueError(
            "expected a number of points, or AXIS=NUMBER with commas between"
        ) from None


def _read_format(text: str, _scene: Scene) -> str:
    return find_format(text).name


def _read_sizes(text: str, _scene: Scene) -> tuple[int, ...]:
    try:
        sizes = tuple(dict.fromkeys(parse_whole(part) for part in text.split(",")))
    except ValueError:
        sizes = ()
    if not sizes or not all(2 <= count <= 1000 for count in sizes):
        raise ValueError("expected numbers of points with commas between, for instance 3,5,9,17")
    return sizes


@dataclass(frozen=True, kw_only=True)
class Compensate(Analysis):
    """Write a table of compensation, and say what it leaves.

    The program reads its own file back and does with it what the controller does: it interpolates,
    rounds and clips, and adds the result to the commanded positions. What is left is evaluated with
    the exact chain over the working volume, between the points of the table.

    A format that cannot move all positions by the same (Klipper, Marlin, the matrix of LinuxCNC)
    corrects no part that lies elsewhere: in the relative loop it is always --placed.

    --sweep 3,5,9,17 compares kinds of table by their size instead.
    """

    name = "compensate"
    task = "improve"
    doing = "compensating"
    file_help = "File to write; tables of several files stand beside it."
    has_chart = True
    chart_help = "maps before and after, or what is left by the size of the table,"
    formats: Annotated[tuple[str, ...], Grammar("F", _read_format, each=True)] = option(
        (),
        "Format of the table, see `warpspace import --formats`; with --sweep repeatable",
        flag="--format",
    )
    points: Annotated[Points | None, Grammar("N|X=N,…", read_points, many=True)] = option(
        None, "Points of the table along each axis", flag="--grid", unset="as the format needs"
    )
    resolution: float = option(
        0.0,
        "Smallest step of a value, mm or degrees; of fanuc-3d the detection unit",
        low=RESOLUTION[0],
        high=RESOLUTION[1],
        unset="that of the format",
    )
    sign: Literal["error", "correction"] | None = option(
        None,
        "What the numbers of the table are: the error, which the controller takes back, or what it"
        " adds",
        unset="what the manual says",
    )
    loop: Literal["tool", "relative"] | None = option(
        None,
        "Structural loop that is corrected",
        unset="relative where a linear axis, or with --orientation all rotary axes, carry the"
        " workpiece",
    )
    placed: bool = option(False, PLACED_HELP)
    orientation: bool = option(
        False,
        "Correct the tool axis too, with the rotary axes, where the format has a place for it",
    )
    sweep: Annotated[tuple[int, ...], Grammar("N,N,…", _read_sizes, many=True)] = option(
        (), "Instead of one table, compare tables with so many points per axis"
    )
    stem: str = "compensation"  # name of the files

    def written(self, stem: str | None) -> "Compensate":
        if not self.sweep and (len(self.formats) != 1 or stem is None):
            raise OptionError(
                "expected {formats} F and {output} FILE; {sweep} compares several tables"
            )
        if self.sweep and (stem or self.points or self.orientation):
            raise OptionError(
                "{sweep} writes no table: expected it without {output}, {points}, {orientation}"
            )
        if stem and not stem.isprintable():  # files name each other
            raise OptionError(f"{stem!r}: expected a name of printable characters")
        return self if stem is None else replace(self, stem=stem)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "Compensation | Sweep":
        options = replace(self, loop="relative") if self.placed and self.loop is None else self
        scene = placed_in(scene, options.loop or "", placed=self.placed)
        if self.sweep:
            return sweep(scene, options)
        return compensate(scene, options, check_cancelled=lambda: watch(0.0))


@dataclass(frozen=True)
class Compensation(BeforeAfter, Result):
    """A compensation and what it leaves."""

    drawn_by: ClassVar[str] = "warpspace.outputs.charts.result_charts:compensation_chart"
    format: Format
    files: Mapping[str, str]  # texts by what is added to the name of the file
    points: Mapping[str, int]  # points of the table per axis
    controller: Controller  # it has read the files
    # "forward" and "backward", where errors depend on the direction of travel
    directions: Mapping[str, BeforeAfter] = field(default_factory=dict[str, BeforeAfter])
    reversal: tuple[str, ...] = ()  # what of that the format has no place for, in words
    resolution: float = 0.0  # mm or degrees; smallest step that was asked for

    @property
    def size(self) -> int:
        return self.controller.size

    @property
    def loop(self) -> str:
        return str(self.controller.loop)

    @property
    def axes(self) -> tuple[str, ...]:
        return self.controller.corrector.moved

    @property
    def assumed(self) -> tuple[str, ...]:
        """What the format leaves open, in which sense axes move, and what is left out by itself."""
        machine = self.controller.scene.machine
        senses = (
            (1, "the positive direction, as ISO 841 has it"),
            (-1, "the negative direction, against ISO 841"),
        )
        senses_text = (
            f"positive {', '.join(axes)}: the tool moves over the workpiece in {words}"
            for sense, words in senses
            if (axes := [axis for axis in self.axes if machine.sense(axis) == sense])
        )
        placed = (
            [f"{PLACED_ASSUMPTION}{'' if self.format.offsets else NO_OFFSETS}"]
            if self.placed
            else []
        )
        return (*self.controller.assumed, *senses_text, *placed)

    @property
    def placed(self) -> bool:
        """Whether the errors before and after leave out where the workpiece lies."""
        return self.controller.scene.view(self.controller.loop).placed_over is not None

    @property
    def notes(self) -> tuple[str, ...]:
        return (*self.controller.notes, *self.reversal)

    @property
    def expected(self) -> dict[str, float | None]:
        """RMS that the machine has to be expected to keep, as its errors are not known better."""
        if self.field_uncertainty is None:
            return {}
        square = self.after.norm_um**2 + np.trace(
            self.field_uncertainty.covariance_um2, axis1=-2, axis2=-1
        )
        rms = float(np.sqrt(np.sum(self.grid.weights * square)))
        return {"expected_rms_um": rms if self.field_uncertainty.errors.is_known else None}

    @property
    def points_text(self) -> str:
        return format_points(self.format, self.points)

    @property
    def bytes(self) -> int:
        return sum(len(text.encode()) for text in self.files.values())

    def texts(self, _ending: str = "", /) -> Mapping[str, str]:
        return self.files

    def as_json(self) -> dict[str, Any]:
        """Spell it; who writes the files names them."""
        after = self.after_statistics
        return {
            "format": self.format.name,
            "loop": self.loop,
            "corrected": list(self.axes),
            "points": dict(self.points) if not self.format.grid.startswith("none") else {},
            "numbers": self.size,
            "files": [],
            "before": to_json(self.before_statistics),
            "after": to_json(after) | self.expected,
            "worst_after_um": after.max_um,
            "orientation": {
                word: dict(zip(("mean_urad", "max_urad"), self.tilt_urad(field), strict=True))
                for word, field in (("before", self.before), ("after", self.after))
            },
            "directions": {
                way: {
                    "before": to_json(one.before_statistics),
                    "after": to_json(one.after_statistics),
                }
                for way, one in self.directions.items()
            },
            "assumed": list(self.assumed),
            "notes": list(self.notes),
        }

    def blocks(self) -> Iterator[Block]:
        yield f"{self.controller.scene.title} · {self.format.title} · loop {self.loop}"
        columns = (
            Column("", leads=True),
            *number_columns(("mean", "RMS", "P95", "max"), ".3f", "µm"),
            *number_columns(("mean tilt", "max tilt"), ".2f", "µrad"),
        )
        rows = [
            (f"{word} {way}".rstrip(), *numbers.four, *one.tilt_urad(field))
            for way, one in {"": self, **self.directions}.items()
            for word, numbers, field in (
                ("before", one.before_statistics, one.before),
                ("after", one.after_statistics, one.after),
            )
        ]
        yield Table(columns, rows)
        named = {"before": self.before_statistics, "after": self.after_statistics}
        yield from u95_lines(self.field_uncertainty and self.field_uncertainty.errors, named)
        if (rms := self.expected.get("expected_rms_um")) is not None:
            yield f"  expected on the machine: RMS {rms:.2f} µm, as its errors are not known better"
        yield f"  {self.size} numbers; corrected: {', '.join(self.axes)}; {self.points_text}"
        yield from (f"  assumed: {text}" for text in self.assumed)
        yield from (f"  {text}" for text in self.notes)


def format_points(kind: Format, points: Mapping[str, int]) -> str:
    if kind.grid.startswith("none"):
        return "no grid"
    return ", ".join(f"{axis} {count}" for axis, count in points.items()) + " points"


def table_points(kind: Format, scene: Scene, points: Points | None) -> dict[str, int]:
    axes = [axis for axis in scene.machine.axes if axis in scene.workspace.volume_axes]
    if not axes:
        raise OptionError(f"{scene.name}: no axis has a range in [workspace]; nothing to correct")
    if isinstance(points, tuple):
        by_axis = dict(points)
        for axis in by_axis:
            if axis not in axes:
                raise OptionError(f"{{points}} {axis}: expected one of {', '.join(axes)}")
        counts = {axis: by_axis.get(axis, kind.points) for axis in axes}
    else:
        counts = dict.fromkeys(axes, points or kind.points)
    for axis, count in counts.items():
        if not 2 <= count <= kind.max_points:
            raise OptionError(
                f"{{points}} {axis}={count}: {kind.name} takes 2 to {kind.max_points} points an"
                " axis"
            )
    return counts


def compensate(
    scene: Scene,
    options: Compensate,
    nodes: int = NODES,
    *,
    check_cancelled: Callable[[], None] = lambda: None,
) -> Compensation:
    kind, loop, sign = find_format(options.formats[0]), options.loop or "", options.sign or ""
    if kind.write is None:
        raise OptionError(
            f"{kind.name} is read only; `warpspace import --formats` lists what can be written"
        )
    if options.orientation and not kind.orientation:
        raise OptionError(f"{{orientation}}: {kind.name} corrects the position only")
    if sign and (sign not in SIGNS or kind.tables is None):
        raise OptionError(f"{{sign}} {sign!r}: expected error or correction, of a table")
    if scene.model.direction == TravelDirection.DIFFERENCE:
        scene = in_direction(scene, TravelDirection.MEAN)
    scene = placed_for([kind], scene, loop)
    corrector = build_corrector(scene, loop, orientation=options.orientation)
    points = table_points(kind, scene, options.points)
    corrections = RequiredCorrections(
        scene, corrector, points, options.resolution, sign, options.stem
    )
    check_cancelled()
    if kind.tables is not None:
        corrections = replace(
            corrections, corrector=_placed(kind, kind.write, corrections, check_cancelled)
        )
    files = kind.write(corrections)
    check_cancelled()
    grid = build_grid(scene.model, scene.workspace, nodes)
    label = f"{kind.title.partition(',')[0]} ({format_points(kind, points)})"
    controller = read_back(kind, files, corrections, label)
    check_cancelled()
    comparison = evaluate_before_after(controller, grid, scene.model.direction)
    check_cancelled()
    directions: dict[str, BeforeAfter] = {}
    reversal: tuple[str, ...] = ()
    if scene.errors.has_directions:
        forward, backward = (
            evaluate_before_after(controller, grid, way)
            for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
        )
        directions = {"forward": forward, "backward": backward}
        reversal = reversal_notes(forward, backward, scene.errors, scene.model.direction)
        check_cancelled()
    return Compensation(
        comparison.before, comparison.after, grid, comparison.field_uncertainty, kind, files, points, controller, directions,
        reversal, options.resolution,
    )  # fmt: skip


def placed_for(kinds: Sequence[Format], scene: Scene, loop: str) -> Scene:
    """Leave out where the workpiece lies, should one of some formats have no place for it."""
    unplaced = all(kind.offsets for kind in kinds)
    if unplaced or build_corrector(scene, loop).loop is not Loop.RELATIVE:
        return scene
    return replace(scene, placed=True)


def _placed(
    kind: Format,
    write: Callable[[RequiredCorrections], Files],
    corrections: RequiredCorrections,
    check_cancelled: Callable[[], None],
) -> Corrector:
    """Let the corrector leave alone where the workpiece lies, if that is fitted out.

    What a table does to the errors changes which placement fits best what it leaves. Both are
    linear: seven small tables tell it. What a table could make of any placement stays as it is.
    """
    scene, corrector = corrections.scene, corrections.corrector
    view = replace(scene.view(corrector.loop), reference=None)
    start = find_placement(corrector.model, corrector.errors, view, exact=True)
    if start is None:
        return corrector
    bare = replace(scene, placed=False, reference=None)
    grid = build_grid(scene.model, scene.workspace, SMALL_NODES)
    coarse = {axis: min(count, SMALL_NODES) for axis, count in corrections.points.items()}

    def fitted(placement: Array) -> Array:
        check_cancelled()
        placed_corrector = replace(corrector, placement=placement)
        trial = replace(corrections, corrector=placed_corrector, points=coarse, resolution=0.0)
        controller = read_back(kind, write(trial), trial, kind.name)
        field = controller.field(grid.coordinates, grid.nominal_mm, bare)
        return fit_placement(scene.model, grid, field.error_um)

    base = fitted(start)
    slopes = [(fitted(start + STEP * one) - base) / STEP for one in np.eye(6)]
    left_vectors, sizes, right_vectors = np.linalg.svd(np.eye(6) - np.array(slopes).T)
    reciprocals = np.divide(1.0, sizes, out=np.zeros(6), where=sizes > MOVABLE)
    placement_fit = start + right_vectors.T @ (reciprocals * (left_vectors.T @ (base - start)))
    return replace(corrector, placement=placement_fit)


@dataclass(frozen=True)
class SweepStep:
    """One compensation of a sweep."""

    keys: ClassVar[tuple[str, ...]] = (
        "format", "points", "pitch", "numbers", "bytes", "after", "worst_after_um",
    )  # fmt: skip
    format: str
    points: int  # per axis; 0 where there is no grid
    numbers: int  # size in the controller and of the files
    bytes: int
    pitch: float  # largest step of the table, mm or degrees; 0 where there is none
    after: Statistics
    # whether it leaves out where the workpiece lies, as all of a sweep do then
    placed: bool = False

    @property
    def worst_after_um(self) -> float:
        return self.after.max_um


@dataclass(frozen=True, kw_only=True)
class Sweep(Result):
    """Which table is worth it: what is left, by kind of table and number of points."""

    title: str  # of the scene
    before: Statistics
    steps: tuple[SweepStep, ...]
    left_out: tuple[str, ...]  # formats of which no table can be made, and why

    def as_json(self) -> dict[str, Any]:
        steps = to_json(self.steps)
        return {"before": to_json(self.before), "sweep": steps, "left_out": list(self.left_out)}

    def blocks(self) -> Iterator[Block]:
        mean, rms, p95, largest = (f"{number:.3f}" for number in self.before.four)
        yield f"{self.title} · before: mean {mean}, RMS {rms}, P95 {p95}, max {largest} µm"
        columns = (
            Column("format", leads=True), Column("points", "d"), Column("pitch", ".4g"),
            Column("numbers", "d"), *number_columns(("mean", "RMS", "P95", "max"), ".3f", "µm"),
        )  # fmt: skip
        rows = [
            (one.format, one.points or None, one.pitch or None, one.numbers, *one.after.four)
            for one in self.steps
        ]
        yield Table(columns, rows)
        if any(one.placed for one in self.steps):
            yield f"  assumed: {PLACED_ASSUMPTION}"
        yield from (f"  left out: {text}" for text in self.left_out)
        for label, statistic in (("largest", "max_um"), ("mean over the volume", "mean_um")):
            title = f"Left over the working volume: {label}"
            yield Lines(
                "lines",
                title,
                "numbers in the controller",
                "|E| [µm]",
                self._curves(statistic),
                log=True,
            )

    def _curves(self, statistic: str) -> tuple[Curve, ...]:
        sizes = [max(one.numbers, 1) for one in self.steps]
        before = np.full(2, max(getattr(self.before, statistic), MIN_CHART_UM))
        curves = [Curve("before", np.array([min(sizes), max(sizes)], float), before, style="thin")]
        for number, kind in enumerate(dict.fromkeys(one.format for one in self.steps)):
            steps = [one for one in self.steps if one.format == kind]
            x = np.array([max(one.numbers, 1) for one in steps], float)
            y = np.array([max(getattr(one.after, statistic), MIN_CHART_UM) for one in steps])
            curves += [Curve(kind, x, y, number), Curve("", x, y, number, "dots")]
        return tuple(curves)


def sweep(scene: Scene, options: Compensate) -> Sweep:
    names = list(dict.fromkeys(options.formats)) or [*TABLES, *GRIDLESS]
    tables: list[tuple[str, int]] = []
    for name in names:
        kind, sizes = find_format(name), options.sweep or SIZES
        gridless = kind.grid.startswith("none")
        counts = [0] if gridless else [count for count in sizes if 2 <= count <= kind.max_points]
        tables += [(name, count) for count in counts]
    if len(tables) > MAX_TABLES:
        raise OptionError(f"{{sweep}} of {len(tables)} tables; expected at most {MAX_TABLES}")
    title = scene.title
    scene = placed_for([find_format(name) for name in names], scene, options.loop or "")
    before: Statistics | None = None
    steps: list[SweepStep] = []
    left_out: dict[str, str] = {}
    for name, count in tables:
        kind = find_format(name)
        single = replace(
            options,
            formats=(name,),
            points=count or None,
            resolution=0.0 if kind.parametric else options.resolution,
            sign=options.sign if kind.tables else None,
        )
        try:
            compensation = compensate(scene, single)
        except OptionError as error:
            if options.formats:
                raise
            left_out[name] = str(error)
            continue
        before = compensation.before_statistics
        steps.append(_step(scene, compensation, count))
    if before is None:
        raise OptionError(f"{{sweep}}: no table can be made: {'; '.join(left_out.values())}")
    reasons = tuple(f"{name}: {why}" for name, why in left_out.items())
    return Sweep(title=title, before=before, steps=tuple(steps), left_out=reasons)


def _step(scene: Scene, compensation: Compensation, count: int) -> SweepStep:
    spans = [
        (scene.workspace.ranges[axis][1] - scene.workspace.ranges[axis][0]) / (number - 1)
        for axis, number in compensation.points.items()
    ]
    pitch = max(spans) if count else 0.0
    size, after = (compensation.size, compensation.bytes), compensation.after_statistics
    return SweepStep(compensation.format.name, count, *size, pitch, after, compensation.placed)
