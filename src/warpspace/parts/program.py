"""The path that a program takes over the workpiece, nominal and with the errors of a machine.

Lengths of errors are weighed by the way: mean, RMS and P95 do not depend on where samples lie.
Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.description import Analysis, Result, Watch, plain
from warpspace.analysis.options import File, option, place_words
from warpspace.analysis.statistics import P95, Statistics, Summary
from warpspace.bench.placing import ball_point, follow, within_travel
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import amplitudes_of, build_basis, evaluate_first_order
from warpspace.formats.source import MAX_LINES
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear
from warpspace.machine.description import Axis
from warpspace.machine.limits import FULL_TURN_DEG, MAX_PATH_POINTS
from warpspace.parts.control import ReadProgram, Setup, read_program, upright, with_length
from warpspace.parts.words import program_lines
from warpspace.scene.model import Scene, check_magnitude, second_order
from warpspace.units import Array

MOST_AT_ONCE = 50_000  # samples
WORST = 10  # blocks that are split by parameter
SAID = 20  # words that a remark lists


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Samples along a path: where it begins, the end of each move, and what lies between."""

    line: NDArray[np.int64]  # [n], of the file, from 1
    move: NDArray[np.int64]  # [n], row of the program
    is_end: NDArray[np.bool_]  # [n], whether a block ends there
    coordinates: dict[str, Array]  # [n] each, mm or degrees; full turns of a rotary axis left out
    tip_mm: Array  # [n, 3], nominal, w
    error_um: Array  # [n, 3], relative, actual − nominal, w
    outside: NDArray[np.bool_]  # [n], beyond the travel; errors are continued
    step_mm: Array  # [n, 3], from the sample before; zero where the path begins or a tool changes

    def axes_at(self, sample: int) -> dict[str, float]:
        return {name: float(at[sample]) for name, at in self.coordinates.items()}

    @cached_property
    def way_mm(self) -> Array:
        """Length of the nominal path up to each sample, [n]."""
        return np.cumsum(np.linalg.norm(self.step_mm, axis=1))

    @cached_property
    def across_um(self) -> Array:
        """What of the errors is across the path, [n, 3]; all of them where nothing moves."""
        back, ahead = self.step_mm, np.roll(self.step_mm, -1, axis=0)
        follows = (self.move == np.roll(self.move, 1))[:, None]
        bend = np.where(follows, back - np.roll(back, 1, axis=0), 0.0)
        bend = np.where(np.roll(follows, -1, axis=0), ahead - back, bend)
        along = 2.0 * back + bend
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        return self.error_um - np.sum(self.error_um * along, axis=1, keepdims=True) * along

    def summary(self, length_um: Array) -> Summary:
        """Sum lengths of errors up over the way; each sample counts once where there is none."""
        way = np.diff(self.way_mm, prepend=0.0)
        weight = way + np.append(way[1:], 0.0)
        weight = weight / weight.sum() if weight.any() else np.full(len(way), 1.0 / len(way))
        order = np.argsort(length_um)
        place = np.cumsum(weight[order]) - weight[order] / 2.0
        rms = float(np.sqrt(weight @ length_um**2))
        p95 = float(np.interp(P95, place, length_um[order]))
        return Summary(float(weight @ length_um), rms, p95, float(length_um.max()))


def trace_program(
    scene: Scene,
    read: ReadProgram,
    *,
    chord_mm: float = 0.01,
    turn_deg: float = 2.0,
    step_mm: float = 10.0,
) -> ToolPath:
    """Follow the tip of the tool over the workpiece.

    Between samples a bent path leaves its chord by `chord_mm` at most, rotary axes and arcs turn by
    `turn_deg` at most, and linear axes move by `step_mm` at most.
    """
    count = samples_of_moves(scene, read, chord_mm, turn_deg, step_mm)
    if count.sum() > MAX_PATH_POINTS:
        raise OptionError(
            f"the path has {count.sum():,} points; expected at most {MAX_PATH_POINTS:,}"
        )
    move = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(move)) - (np.cumsum(count) - count)[move] + 1.0) / count[move]
    coordinates, tip, error = along_moves(scene, read, move, share)
    line = read.line[move]
    same_tool = np.diff(read.length_mm[move], prepend=read.length_mm[move[:1]]) == 0.0
    return ToolPath(
        line=line,
        move=move,
        is_end=(share == 1.0) & (np.append(line[1:], -1) != line),
        coordinates=coordinates,
        tip_mm=tip,
        error_um=error,
        outside=~within_travel(scene.machine, coordinates),
        step_mm=np.diff(tip, axis=0, prepend=tip[:1]) * same_tool[:, None],
    )


def samples_of_moves(
    scene: Scene, read: ReadProgram, chord_mm: float, turn_deg: float, step_mm: float
) -> NDArray[np.int64]:
    """Count the samples of each move, [m]; 0 where nothing moves."""
    is_rotary = np.array([not scene.machine.axes[name].is_linear for name in read.axes])
    change = np.abs(np.diff(read.end, axis=0, prepend=read.end[:1]))
    way, turn = np.linalg.norm(change[:, ~is_rotary], axis=1), change[:, is_rotary]
    is_bent = (read.turn_rad != 0.0) | (~read.tcp & turn.any(axis=1))
    turn = np.maximum(turn.max(axis=1, initial=0.0), np.rad2deg(np.abs(read.turn_rad)))
    count = np.ceil(np.maximum(turn / turn_deg, way / step_mm))
    count = np.where(read.moves, np.maximum(count, 1.0), 0.0)
    if not read.moves.any():
        count[-1] = 1.0
    (bent,) = np.nonzero(is_bent & read.moves)
    if len(bent):  # how far the middle of a piece is from the line between its ends
        half = 0.5 / count[bent]
        start, middle, end = (
            along_moves(scene, read, bent, 0.5 + at)[1] for at in (-half, 0, half)
        )
        away = np.linalg.norm(middle - (start + end) / 2.0, axis=1)
        count[bent] = np.ceil(count[bent] * np.maximum(1.0, np.sqrt(away / chord_mm)))
    return count.astype(np.int64)


def along_moves(
    scene: Scene,
    read: ReadProgram,
    move: NDArray[np.int64],
    share: Array | float,
    shift_mm: Array | None = None,
) -> tuple[dict[str, Array], Array, Array]:
    """Give positions of axes, tip and error at shares of moves, [n].

    A shift of the tip, [n, 3] in w, is made by the linear axes.
    """
    at = read.positions(move, np.broadcast_to(share, move.shape))
    found = dict(zip(read.axes, at.T, strict=True))
    tip, error = np.empty((len(move), 3)), np.empty((len(move), 3))
    modes = np.stack([read.tcp, read.length_mm], axis=-1)[move]
    view = scene.view(Loop.RELATIVE, "workpiece")
    for tcp, length in np.unique(modes, axis=0):
        (same,) = np.nonzero((modes == (tcp, length)).all(axis=1))
        model = with_length(scene.model, length)
        for part in np.array_split(same, -(-len(same) // MOST_AT_ONCE)):
            here = {name: values[part] for name, values in found.items()}
            if tcp:
                target = ball_point(scene.model, upright(scene.model, here))
                here = follow(model, here, target)
            for name, axis in scene.machine.axes.items():
                found[name][part] = here[name] = _unwound(axis, here[name])
            if shift_mm is not None:
                here = follow(model, here, ball_point(model, here) + shift_mm[part])
                for name in here:
                    found[name][part] = here[name]
            check_magnitude(scene, here)
            tip[part] = ball_point(model, here)
            error[part] = evaluate_first_order(model, scene.errors, here, view).error_um
    return found, tip, error


def _unwound(axis: Axis, at: Array) -> Array:
    """Leave full turns out beyond the travel of a rotary axis that can turn once round."""
    low, high = axis.travel
    if axis.is_linear or high - low < FULL_TURN_DEG:
        return at
    return np.where((at < low) | (at > high), low + (at - low) % FULL_TURN_DEG, at)


@dataclass(frozen=True)
class WorstBlock:
    """The worst place of a block."""

    line: int
    um: float  # |E|
    axes: Mapping[str, float]  # mm or degrees
    error_um: Array  # [3]
    budget: Mapping[str, float]  # µm of |E| by parameter, which add up to it


@dataclass(frozen=True, kw_only=True)
class Program(Setup, Analysis):
    """Run a program on SCENE: the errors along its path.

    G-code: G0 to G3 in three planes, G17 to G21, G28, G43, G43.4, G49, G53 to G59, G80 to G83, G90,
    G91. Subprograms and variables are refused by line: the path ends before them. Errors are those
    of the tool against the workpiece, in the workpiece frame, actual − nominal. Geometry only: no
    forces, heat, wear or servo.
    """

    name = "program"
    task = "measure"
    has_table = True
    file_help = "Corrected program to write: this machine cuts the nominal path with it."
    file: File = option(None, "Program, G-code", positional=True, unset="that of the scene")
    chord_mm: float = option(
        0.01, "How far the path may bend between samples", unit="mm", low=1e-5, high=10.0
    )
    at_line: int | None = option(
        None, "Line whose end is told", low=1, high=MAX_LINES, unset="none"
    )
    within_um: float = option(
        1.0, "How far a corrected program may be from the nominal path between its points",
        unit="µm", low=0.01, high=1000.0,
    )  # fmt: skip
    decimals: int = option(
        4, "Decimals of corrected words in mm; in inches one more, in degrees two", low=1, high=9
    )
    text: str | None = None  # of one that is read already; `file` is then its name

    def lines(self) -> Iterable[str]:
        """Give the lines of the program."""
        return program_lines(self.file or "") if self.text is None else self.text.splitlines()

    def run(self, scene: Scene, watch: Watch, /) -> "ProgramResult":
        if self.file is None:
            if (path := scene.part.path("program")) is None:
                raise OptionError("{file} is missing; expected a program")
            tcp: Any = scene.part.tcp or self.tcp
            return replace(self, file=path, tcp=tcp).run(scene, watch)
        read = read_program(scene, self.lines(), self, self.file)
        watch(0.3)
        path = trace_program(scene, read, chord_mm=self.chord_mm)
        watch(0.9)
        norm, across = (np.linalg.norm(one, axis=1) for one in (path.error_um, path.across_um))
        order = np.lexsort((-norm, path.line))
        block = order[np.unique(path.line[order], return_index=True)[1]]
        at, (mean, rms, p95, largest) = int(np.argmax(norm)), astuple(path.summary(norm))
        x, y, z = path.tip_mm[at].tolist()
        return ProgramResult(
            read=read,
            path=path,
            deviation=Statistics(mean, rms, p95, largest, (x, y, z), path.axes_at(at)),
            along=path.summary(np.sqrt(np.maximum(norm**2 - across**2, 0.0))),
            across=path.summary(across),
            worst=_split(scene, path, block[np.argsort(-norm[block], kind="stable")][:WORST]),
            line=None if self.at_line is None else _end_of(path, self.at_line),
            of_lines=block,
            scene=scene,
            asked=self,
            second_order=second_order(scene, Loop.RELATIVE),
        )


def _end_of(path: ToolPath, line: int) -> dict[str, Any]:
    (found,) = np.nonzero(path.is_end & (path.line == line))
    if not len(found):
        lines = np.unique(path.line[path.is_end])
        near = ", ".join(map(str, lines[np.argsort(np.abs(lines - line))][:3])) or "none"
        raise OptionError(f"{{at_line}} {line} moves no axis; expected a line that does: {near}")
    at = int(found[-1])
    return {"axes": path.axes_at(at), "error_um": path.error_um[at]}


def _split(scene: Scene, path: ToolPath, chosen: NDArray[np.int64]) -> tuple[WorstBlock, ...]:
    """Split the errors of some samples by parameter."""
    at = {name: values[chosen] for name, values in path.coordinates.items()}
    keys = [key for key in scene.parameter_keys if scene.errors.amplitude(key)]
    point = transforms.apply(branch_pose(scene.model, "workpiece", at), path.tip_mm[chosen])
    view = scene.view(Loop.RELATIVE, "workpiece")
    basis = build_basis(scene.model, scene.errors, keys, at, view, point)
    error = path.error_um[chosen]
    norm = np.linalg.norm(error, axis=1)
    along = error / np.where(norm > 0.0, norm, 1.0)[:, None]
    share = amplitudes_of(scene.errors, keys)[:, None] * np.sum(basis.position * along, axis=-1)
    budgets = (dict(zip(keys, parts, strict=True)) for parts in share.T.tolist())
    rows = zip(chosen, norm.tolist(), error, budgets, strict=True)
    return tuple(
        WorstBlock(int(path.line[at]), um, path.axes_at(at), errors, parts)
        for at, um, errors, parts in rows
    )


def _most(budget: Mapping[str, float]) -> str:
    first = sorted(budget.items(), key=lambda share: -share[1])[:3]
    return "  ".join(f"{key} {um:.1f}" for key, um in first)


@dataclass(frozen=True, kw_only=True)
class ProgramResult(Result):
    """The path of a program, and its worst blocks."""

    read: ReadProgram
    path: ToolPath
    deviation: Statistics
    along: Summary
    across: Summary
    worst: tuple[WorstBlock, ...]
    line: Mapping[str, Any] | None  # axes and error at the end of the line asked for
    of_lines: NDArray[np.int64]  # the worst sample of each line
    scene: Scene
    asked: Program

    def texts(self, _ending: str = "", /) -> Mapping[str, str]:
        from warpspace.parts.correction import correct_program

        lines = [*self.asked.lines()]
        return {"": "\n".join([*correct_program(self.scene, lines, self.read, self.asked), ""])}

    def as_plain(self) -> dict[str, Any]:
        said = {
            "blocks": self.read.blocks,
            "length_mm": self.path.way_mm[-1],
            "outside": self.path.outside.sum(),
            "refused": self.read.refused,
            "deviation": self.deviation,
            "along": self.along,
            "across": self.across,
            "worst": self.worst,
        }
        return plain(said | ({"line": self.line} if self.line else {}))

    def doubts(self) -> Iterator[str]:
        if refused := [f"line {one.line} {one.word}" for one in self.read.refused[:SAID]]:
            yield f"refused: {', '.join(refused)}; the path ends before the first of them"
        if unknown := [f"{word} (line {line})" for word, line in self.read.unknown.items()]:
            yield f"not followed: {', '.join(unknown[:SAID])}"
        if outside := self.path.outside.sum():
            yield f"{outside} of {len(self.path.line)} points are beyond the travel"
        if not self.read.blocks:
            yield "no block moves an axis: the errors are those where the axes stand"

    def blocks(self) -> Iterator[Block]:
        yield f"{self.scene.title} · {self.read.blocks} blocks, {self.path.way_mm[-1]:.1f} mm"
        yield "  relative error in the workpiece frame"
        yield "  Geometry only: no forces, heat, wear or servo"
        heads = number_columns(("mean", "RMS", "P95", "max"), ".2f", "µm")
        names = {"error": self.deviation, "along the path": self.along, "across it": self.across}
        rows = [(name, *astuple(one)[:4]) for name, one in names.items()]
        yield Table((Column("", leads=True), *heads), rows)
        if self.line:
            said = ", ".join(f"{value:.2f}" for value in self.line["error_um"])
            yield f"{place_words(self.line['axes'])}: x, y, z {said} µm"
        lines = self.path.line[self.of_lines]
        samples = self.of_lines[np.searchsorted(lines, [one.line for one in self.worst])]
        yield self.table(samples, [one.budget for one in self.worst])

    def file_table(self) -> Table:
        return self.table(self.of_lines, [None] * len(self.of_lines))

    def table(
        self, samples: NDArray[np.int64], budgets: Sequence[Mapping[str, float] | None]
    ) -> Table:
        """Give the places of samples, their errors and, unless it is for a file, whose they are."""
        path = self.path
        both = (np.linalg.norm(error, axis=1) for error in (path.error_um, path.across_um))
        places = *path.coordinates.values(), *path.tip_mm.T, *path.error_um.T
        hidden = [f"{name}_{'mm' if is_linear(name) else 'deg'}" for name in path.coordinates]
        hidden += ["x_mm", "y_mm", "z_mm", "error_x_um", "error_y_um", "error_z_um"]
        columns = (
            Column("line", "d", key="line", leads=True),
            *number_columns(("|E|", "across"), ".2f", "µm", ("norm_um", "across_um")),
            *(Column(key=key, shows=False) for key in hidden),
            Column(key="outside", shows=False),
            Column("most of it", _most, "µm"),
        )
        numbers = np.column_stack([values[samples] for values in (*both, *places)]).tolist()
        told = (path.line[samples].tolist(), numbers, path.outside[samples].tolist(), budgets)
        rows = [(line, *row, outside, of) for line, row, outside, of in zip(*told, strict=True)]
        return Table(columns, rows, "Worst blocks")
