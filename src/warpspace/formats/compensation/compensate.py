"""The command `compensate`: write a compensation table and evaluate the residual error."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

import numpy as np

from warpspace.analysis.blocks import Block, Column, Curve, Lines, Table, number_columns
from warpspace.analysis.description import Analysis, ProgressCallback, Result, to_json
from warpspace.analysis.options import LOOP_UNSET, PLACED_HELP, Grammar, option
from warpspace.analysis.statistics import Statistics
from warpspace.analysis.uncertainty.propagation import u95_lines
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import find_placement, fit_placement
from warpspace.field.grid import RESIDUAL_NODES, build_grid
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
from warpspace.formats.registry import SIGNS, Files, Format, find_format, formats
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection
from warpspace.scene.model import Scene, with_direction, with_placement
from warpspace.scene.text_files import parse_whole
from warpspace.units import Array, spell_fixed

SMALL_NODES = 7  # nodes and points per axis with which the placement of a workpiece is fitted
STEP = 1000.0  # µm and µrad; change of a placement that measures the response of a table
ROUNDING = 5e-3  # error of the response of a table, whose numbers are rounded
PLACED_ASSUMPTION = (
    "best-fit placement: three shifts and three small rotations of the workpiece are fitted out"
    " of the errors before and after"
)
NO_OFFSETS = ", because the format cannot correct them"
RESOLUTION = (0.0, 0.1)  # mm or degrees
MAX_TABLES = 32  # compensations of one sweep
SWEEP = (
    *("sinumerik-enc", "sinumerik-cec", "heidenhain", "fanuc-3d", "isg-csv"),
    *("linuxcnc-matrix", "marlin"),
)
"""Formats of the default sweep; the skew of Klipper equals that of Marlin."""
MIN_CHART_UM = 1e-3  # lower end of the chart of a sweep
Points: TypeAlias = int | tuple[tuple[str, int], ...]
"""Points of a table: one number for all axes, or one per axis."""


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
    """Write a compensation table and report the residual error.

    The program reads its own file back and evaluates it as the controller does: it interpolates,
    rounds and clips, and adds the corrections to the commanded positions. The residual error is
    evaluated with the exact chain over the working volume, between the points of the table.

    Formats without constant offsets (Klipper, Marlin, the matrix of LinuxCNC) cannot correct the
    placement of the workpiece: in the relative loop they always imply --placed.

    --sweep 3,5,9,17 compares formats and table sizes instead.
    """

    name = "compensate"
    task = "improve"
    doing = "compensating"
    file_help = "File to write; further files of the table are written next to it."
    has_chart = True
    chart_help = "maps before and after, or the residual error over the size of the table,"
    formats: Annotated[tuple[str, ...], Grammar("F", _read_format, each=True)] = option(
        (),
        "Format of the table, see `warpspace import --formats`; with --sweep repeatable",
        flag="--format",
    )
    points: Annotated[Points | None, Grammar("N|X=N,…", read_points, many=True)] = option(
        None, "Points of the table along each axis", flag="--grid", unset="default of the format"
    )
    resolution: float = option(
        0.0,
        "Resolution of the values, mm or degrees; for fanuc-3d the detection unit",
        low=RESOLUTION[0],
        high=RESOLUTION[1],
        unset="that of the format",
    )
    sign: Literal["error", "correction"] | None = option(
        None,
        "Sign of the table: the error, which the controller subtracts, or the correction, which it"
        " adds",
        unset="as in the manual of the controller",
    )
    loop: Literal["tool", "relative"] | None = option(
        None,
        "Structural loop to correct",
        unset=LOOP_UNSET,
    )
    placed: bool = option(False, PLACED_HELP)
    orientation: bool = option(
        False, "Correct the tool axis too, with the rotary axes, if the format supports it"
    )
    sweep: Annotated[tuple[int, ...], Grammar("N,N,…", _read_sizes, many=True)] = option(
        (), "Compare tables with these numbers of points per axis instead of writing one"
    )
    stem: str = "compensation"  # of the file names

    def for_output(self, stem: str | None) -> "Compensate":
        if not self.sweep and (len(self.formats) != 1 or stem is None):
            raise OptionError(
                "expected {formats} F and {output} FILE; {sweep} compares several tables"
            )
        if self.sweep and (stem or self.points or self.orientation):
            raise OptionError(
                "{sweep} writes no table; expected no {output}, {points}, {orientation} with it"
            )
        if stem and not stem.isprintable():  # files name each other
            raise OptionError(f"{stem!r}: expected a name of printable characters")
        return self if stem is None else replace(self, stem=stem)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "Compensation | Sweep":
        scene = with_placement(scene, self.loop, placed=self.placed)
        if self.sweep:
            return sweep(scene, self)
        return compensate(scene, self, check_cancelled=lambda: watch(0.0))


@dataclass(frozen=True)
class Compensation(BeforeAfter, Result):
    """A compensation table and the residual error."""

    drawn_by: ClassVar[str] = "warpspace.outputs.charts.result_charts:compensation_chart"
    format: Format
    files: Mapping[str, str]  # texts by the suffix of the file name
    points: Mapping[str, int]  # points of the table per axis
    controller: Controller  # that has read the files
    # "forward" and "backward", where errors depend on the direction of travel
    directions: Mapping[str, BeforeAfter] = field(default_factory=dict[str, BeforeAfter])
    reversal: tuple[str, ...] = ()  # notes on reversal errors that the format cannot represent
    resolution: float = 0.0  # mm or degrees; 0 where the format sets it
    # with the placement of the workpiece, where it is fitted out of the errors
    unplaced: BeforeAfter | None = None

    @property
    def loop(self) -> str:
        return str(self.controller.loop)

    @property
    def axes(self) -> tuple[str, ...]:
        return self.controller.corrector.moved

    @property
    def assumed(self) -> tuple[str, ...]:
        """Assumptions about the format, the senses of the axes and the placement."""
        machine = self.controller.scene.machine
        directions = {1: "positive direction, according to", -1: "negative direction, contrary to"}
        assumptions = list(self.controller.assumed)
        for sense, direction in directions.items():
            axes = ", ".join(axis for axis in self.axes if machine.sense(axis) == sense)
            if axes:
                motion = f"the tool moves over the workpiece in the {direction} ISO 841"
                assumptions.append(f"positive {axes}: {motion}")
        if self.placed:
            assumptions.append(PLACED_ASSUMPTION + ("" if self.format.offsets else NO_OFFSETS))
        return tuple(assumptions)

    @property
    def placed(self) -> bool:
        """True if the placement of the workpiece is fitted out of the errors."""
        return self.controller.scene.view(self.controller.loop).placed_over is not None

    @property
    def notes(self) -> tuple[str, ...]:
        return (*self.controller.notes, *self.reversal)

    @property
    def expected(self) -> dict[str, float | None]:
        """Expected RMS residual error of the machine, with the uncertainty of its errors."""
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

    def output_files(self, _ending: str = "", /) -> Mapping[str, str]:
        return self.files

    def as_json(self) -> dict[str, Any]:
        """Return the JSON mapping; the caller that writes the files adds their names."""
        after = self.after_statistics
        return {
            "format": self.format.name,
            "loop": self.loop,
            "corrected": list(self.axes),
            "points": dict(self.points) if self.format.has_grid else {},
            "numbers": self.controller.size,
            "files": [],
            "before": to_json(self.before_statistics),
            "after": to_json(after) | self.expected,
            "worst_after_um": after.max_um,
            "orientation": {
                name: dict(zip(("mean_urad", "max_urad"), self.tilt_urad(field), strict=True))
                for name, field in (("before", self.before), ("after", self.after))
            },
            "directions": {
                direction: errors.as_statistics() for direction, errors in self.directions.items()
            },
            "unplaced": self.unplaced and self.unplaced.as_statistics(),
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
        unplaced = {"without placement fit": self.unplaced} if self.unplaced else {}
        rows = [
            (f"{name} {direction}".rstrip(), *statistics.four, *errors.tilt_urad(field))
            for direction, errors in {"": self, **unplaced, **self.directions}.items()
            for name, statistics, field in (
                ("before", errors.before_statistics, errors.before),
                ("after", errors.after_statistics, errors.after),
            )
        ]
        yield Table(columns, rows)
        named = {"before": self.before_statistics, "after": self.after_statistics}
        yield from u95_lines(self.field_uncertainty and self.field_uncertainty.errors, named)
        rms = self.expected.get("expected_rms_um")
        if rms is not None:
            expected = f"{spell_fixed(rms)} µm, with the uncertainty of its errors"
            yield f"  expected RMS on the machine {expected}"
        axes = ", ".join(self.axes)
        yield f"  {self.controller.size} numbers; corrected: {axes}; {self.points_text}"
        yield from (f"  assumed: {text}" for text in self.assumed)
        yield from (f"  {text}" for text in self.notes)


def format_points(kind: Format, points: Mapping[str, int]) -> str:
    if not kind.has_grid:
        return "no grid"
    return ", ".join(f"{axis} {count}" for axis, count in points.items()) + " points"


def table_points(kind: Format, scene: Scene, points: Points | None) -> dict[str, int]:
    axes = [axis for axis in scene.machine.axes if axis in scene.workspace.volume_axes]
    if not axes:
        raise OptionError(f"{scene.name}: nothing to correct; expected a range in [workspace]")
    if isinstance(points, tuple):
        by_axis = dict(points)
        for axis in by_axis:
            if axis not in axes:
                raise OptionError(f"{{points}} {axis}: expected one of {', '.join(axes)}")
        counts = {axis: by_axis.get(axis, kind.points) for axis in axes}
    else:
        counts = dict.fromkeys(axes, points or kind.points)
    for axis, count in counts.items():
        if not 2 <= count <= kind.most_points:
            raise OptionError(
                f"{{points}} {axis}={count}: expected 2 to {kind.most_points} for {kind.name}"
            )
    return counts


def compensate(
    scene: Scene,
    options: Compensate,
    nodes: int = RESIDUAL_NODES,
    *,
    check_cancelled: Callable[[], None] = lambda: None,
) -> Compensation:
    kind, loop, sign = find_format(options.formats[0]), options.loop or "", options.sign or ""
    if kind.write is None:
        raise OptionError(
            f"{kind.name} cannot be written; expected one of"
            f" {', '.join(kind.name for kind in formats() if kind.can_write)}"
        )
    if options.orientation and not kind.orientation:
        raise OptionError(f"{{orientation}}: {kind.name} corrects the position only")
    if sign and (sign not in SIGNS or kind.tables is None):
        raise OptionError(f"{{sign}} {sign!r}: expected error or correction, of a table")
    if scene.model.direction == TravelDirection.DIFFERENCE:
        scene = with_direction(scene, TravelDirection.MEAN)
    scene, loop = placed_for([kind], scene, loop)
    corrector = build_corrector(scene, loop, orientation=options.orientation)
    points = table_points(kind, scene, options.points)
    corrections = RequiredCorrections(
        scene, corrector, points, options.resolution, sign, options.stem
    )
    check_cancelled()
    if kind.tables is not None and kind.offsets:
        corrections = replace(
            corrections, corrector=_with_placement(kind, kind.write, corrections, check_cancelled)
        )
    files = kind.write(corrections)
    check_cancelled()
    grid = build_grid(scene.model, scene.workspace, nodes)
    label = f"{kind.title.partition(',')[0]} ({format_points(kind, points)})"
    controller = read_back(kind, files, corrections, label)
    check_cancelled()
    comparison = evaluate_before_after(controller, grid, scene.model.direction)
    check_cancelled()
    unplaced: BeforeAfter | None = None
    fixed = controller
    if scene.view(controller.loop).placed_over is not None:
        fixed = replace(controller, scene=replace(scene, placed=False))
        unplaced = evaluate_before_after(fixed, grid, scene.model.direction)
        check_cancelled()
    directions: dict[str, BeforeAfter] = {}
    reversal: tuple[str, ...] = ()
    if scene.errors.has_directions:
        for direction in ("forward", "backward"):  # one placement for both
            directions[direction] = evaluate_before_after(fixed, grid, direction)
        reversal = reversal_notes(directions, scene.errors, scene.model.direction)
        check_cancelled()
    return Compensation(
        comparison.before, comparison.after, grid, comparison.field_uncertainty,
        comparison.before_statistics, kind, files, points, controller, directions, reversal,
        options.resolution, unplaced,
    )  # fmt: skip


def placed_for(kinds: Sequence[Format], scene: Scene, loop: str) -> tuple[Scene, str]:
    """Return scene and loop, with best-fit placement if one of the formats has no offsets.

    Such a format only changes the shape of the part.
    """
    if loop == Loop.TOOL or all(kind.offsets for kind in kinds):
        return scene, loop
    return replace(scene, placed=True), Loop.RELATIVE


def _with_placement(
    kind: Format,
    write: Callable[[RequiredCorrections], Files],
    corrections: RequiredCorrections,
    check_cancelled: Callable[[], None],
) -> Corrector:
    """Return the corrector with the placement of the workpiece that fits the residual error best.

    The table changes the residual error, and so the placement that fits it best. Both are linear:
    seven small tables determine the fit. Placements that the table compensates stay unchanged.
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
    slopes = [(fitted(start + STEP * direction) - base) / STEP for direction in np.eye(6)]
    change = np.linalg.lstsq(np.eye(6) - np.array(slopes).T, base - start, rcond=ROUNDING)[0]
    return replace(corrector, placement=start + change)


@dataclass(frozen=True)
class SweepStep:
    """One compensation of a sweep."""

    json_keys: ClassVar[tuple[str, ...]] = (
        "format", "points", "pitch", "numbers", "bytes", "after", "worst_after_um",
    )  # fmt: skip
    format: str
    points: int  # per axis; 0 where there is no grid
    numbers: int  # size in the controller and of the files
    bytes: int
    pitch: float  # largest step of the table, mm or degrees; 0 where there is none
    after: Statistics
    # true if the placement of the workpiece is fitted out, as in all tables of the sweep then
    placed: bool = False

    @property
    def worst_after_um(self) -> float:
        return self.after.max_um


@dataclass(frozen=True, kw_only=True)
class Sweep(Result):
    """Residual errors by format and number of points."""

    title: str  # of the scene
    before: Statistics
    steps: tuple[SweepStep, ...]
    left_out: tuple[str, ...]  # formats that cannot be used, with reasons

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
            (step.format, step.points or None, step.pitch or None, step.numbers, *step.after.four)
            for step in self.steps
        ]
        yield Table(columns, rows)
        if any(step.placed for step in self.steps):
            yield f"  assumed: {PLACED_ASSUMPTION}"
        yield from (f"  not possible: {text}" for text in self.left_out)
        for label, statistic in (("maximum", "max_um"), ("mean over the volume", "mean_um")):
            title, x_label = f"Residual error: {label}", "numbers in the controller"
            yield Lines("lines", title, x_label, "|E| [µm]", self._curves(statistic), log=True)

    def _curves(self, statistic: str) -> tuple[Curve, ...]:
        sizes = [max(step.numbers, 1) for step in self.steps]
        before = np.full(2, max(getattr(self.before, statistic), MIN_CHART_UM))
        curves = [Curve("before", np.array([min(sizes), max(sizes)], float), before, style="thin")]
        for number, kind in enumerate(dict.fromkeys(step.format for step in self.steps)):
            steps = [step for step in self.steps if step.format == kind]
            x = np.array([max(step.numbers, 1) for step in steps], float)
            y = np.array([max(getattr(step.after, statistic), MIN_CHART_UM) for step in steps])
            curves += [Curve(kind, x, y, number), Curve("", x, y, number, "dots")]
        return tuple(curves)


def sweep(scene: Scene, options: Compensate) -> Sweep:
    names = list(dict.fromkeys(options.formats)) or [*SWEEP]
    tables: list[tuple[str, int]] = []
    for name in names:
        kind = find_format(name)
        counts = [count for count in options.sweep if count <= kind.most_points]
        if not kind.has_grid:
            counts = [0]
        tables += [(name, count) for count in counts]
    if len(tables) > MAX_TABLES:
        raise OptionError(f"{{sweep}} of {len(tables)} tables; expected at most {MAX_TABLES}")
    title = scene.title
    scene, loop = placed_for([find_format(name) for name in names], scene, options.loop or "")
    options = replace(options, loop=loop or None)
    before: Statistics | None = None
    steps: list[SweepStep] = []
    left_out: dict[str, str] = {}
    ranges = scene.workspace.ranges.items()
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
        points = compensation.points
        steps.append(
            SweepStep(
                format=name,
                points=count,
                numbers=compensation.controller.size,
                bytes=sum(len(text.encode()) for text in compensation.files.values()),
                pitch=max(
                    np.ptp(span) / (points[axis] - 1) for axis, span in ranges if axis in points
                )
                if count
                else 0.0,
                after=compensation.after_statistics,
                placed=compensation.placed,
            )
        )
    if before is None:
        raise OptionError(
            f"{{sweep}}: none of the tables is possible: {'; '.join(left_out.values())}"
        )
    reasons = tuple(f"{name}: {reason}" for name, reason in left_out.items())
    return Sweep(title=title, before=before, steps=tuple(steps), left_out=reasons)
