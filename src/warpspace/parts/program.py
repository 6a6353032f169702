"""Path of a program over the workpiece, nominal and with errors; and the corrected program.

Statistics of errors are weighted by the path length: they do not depend on the sampling.
Geometry only: no forces, heat, wear or servo.

The corrected program moves the tip to its nominal place less the error of the machine there: linear
axes follow, rotary words are unchanged. Words are absolute (G90), arcs become lines, cycles the
moves that they stand for. Other words, comments and the lines of G28, G30, G53, G10 and G52 are
unchanged. An axis is written from the line on that names it, since its initial position is unknown.
The same holds after G28, G30 and G53, another work offset or mode, and for Z after another tool or
length.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from hashlib import sha256
from io import StringIO
from math import tau
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.commands.contributions import budget_words, explain
from warpspace.analysis.description import (
    Analysis,
    ExpandedUncertainty,
    ProgressCallback,
    Result,
    to_json,
)
from warpspace.analysis.options import File, option, place_words
from warpspace.analysis.statistics import P95, Statistics
from warpspace.analysis.uncertainty.propagation import (
    FieldUncertainty,
    combine,
    plus_minus,
    scene_uncertainty,
    u95_lines,
)
from warpspace.bench.placing import follow, following_axes, within_travel
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.formats.source import MAX_LINES, format_comment, format_number
from warpspace.kinematics.model import Loop
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import FULL_TURN_DEG, MAX_LINE_POINTS, MAX_PATH_POINTS
from warpspace.parts.gcode.codes import COMPENSATING
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.cycles import CYCLES
from warpspace.parts.gcode.interpreter import Interpreter, program_lines, read_program
from warpspace.parts.gcode.motion import CORNERS
from warpspace.parts.gcode.parsed import (
    RAPID,
    STAND,
    ParsedProgram,
    axes_at,
    programmed_words,
    with_length,
)
from warpspace.scene.model import Scene, check_magnitude, second_order
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import one_line
from warpspace.units import Array, Integers

TURN_DEG, STEP_MM = 2.0, 10.0  # most that axes, and arcs, move between samples
RESIDUAL_UM, MAX_ITERATIONS = 1e-3, 20  # of the correction
DECIMALS = 4  # of words in mm; in inches one more, in degrees two
_MODES = {"G2", "G3", *CYCLES, "G90", "G91"}  # not of a corrected program
_LAST = {"M0", "M1", "M2", "M5", "M9", "M30", "M60"}  # take effect when the axes have moved
CHORD_MM = 0.01  # largest chordal deviation of a bent path between samples
SAMPLES_AT_ONCE = 50_000
WORST = 10  # blocks with contributions
MAX_LISTED = 20  # words in a caveat
MAX_UNCERTAIN = 200_000  # samples whose uncertainty is propagated


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Samples along a path: its start, the end of each move, and points between."""

    line: Integers  # [n], of the file, from 1
    move: Integers  # [n], row of the program
    coordinates: dict[str, Array]  # [n] each, mm or degrees; without full turns of a rotary axis
    tip_mm: Array  # [n, 3], nominal, w
    error_um: Array  # [n, 3], relative, actual − nominal, w
    outside: NDArray[np.bool_]  # [n], beyond the travel; errors are continued
    step_mm: Array  # [n, 3], from the sample before; zero where the path begins or a tool changes
    uncertainty: FieldUncertainty | None  # with statistics weighted by the path length

    @cached_property
    def norm_um(self) -> Array:
        return np.linalg.norm(self.error_um, axis=1)

    def axes_at(self, sample: int) -> dict[str, Any]:
        return {name: at[sample] for name, at in self.coordinates.items()}

    def deviations(self) -> Iterator[Statistics]:
        """Compute statistics of the error, and of its parts along and across the path.

        Without motion the samples have equal weights, and errors count as across.
        """
        step, next_step = self.step_mm, np.roll(self.step_mm, -1, axis=0)
        follows = (self.move == np.roll(self.move, 1))[:, None]
        bend = np.where(follows, step - np.roll(step, 1, axis=0), 0.0)
        tangent = 2.0 * step + np.where(np.roll(follows, -1, axis=0), next_step - step, bend)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)

        def along(error_um: Array) -> Array:
            return np.sum(error_um * tangent, axis=-1, keepdims=True) * tangent

        for project in (np.asarray, along, lambda um: um - along(um)):
            um = np.linalg.norm(project(self.error_um), axis=1)
            mean, square = np.average([um, um**2], axis=1, weights=self.shares).tolist()
            p95 = float(np.quantile(um, P95, weights=self.shares, method="inverted_cdf"))
            at = int(np.argmax(um))
            x, y, z = self.tip_mm[at].tolist()
            largest = float(um[at]), (x, y, z), self.axes_at(at)
            statistics = Statistics(mean, square**0.5, p95, *largest)
            if self.uncertainty:
                uncertainty = self.uncertainty.transform(project)
                statistics = uncertainty.with_expanded_uncertainty(statistics)
            yield statistics

    @cached_property
    def shares(self) -> Array:
        """Weights of samples by path length, [n]; equal ones without motion."""
        step = np.linalg.norm(self.step_mm, axis=1)
        lengths = step + np.append(step[1:], 0.0)
        if not lengths.any():
            return np.full(len(lengths), 1.0 / len(lengths))
        return lengths / lengths.sum()


def trace_program(program: ParsedProgram, chord_mm: float = CHORD_MM) -> ToolPath:
    """Sample the path of the tool tip over the workpiece and its errors."""
    count = count_samples(program, chord_mm)
    move = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(move)) - (np.cumsum(count) - count)[move] + 1.0) / count[move]
    at, tip, error = along_moves(program, move, share)
    step = np.diff(tip, axis=0, prepend=tip[:1])
    step[0] = 0.0
    # moves that do not begin where the sample before stands: after another length, mode or jump
    begins = np.append(True, np.diff(move) > 0) & (np.append(0, np.diff(move)) > 1)
    begins[1:] |= np.diff(program.length_mm[move]) != 0.0
    (first,) = np.nonzero(begins)
    if len(first):
        start = along_moves(program, move[first], np.zeros(len(first)))[1]
        step[first] = tip[first] - start
    outside = ~within_travel(program.scene.machine, at)
    path = ToolPath(program.line[move], move, at, tip, error, outside, step, None)
    return replace(path, uncertainty=_path_uncertainty(program, path))


def _path_uncertainty(program: ParsedProgram, path: ToolPath) -> FieldUncertainty | None:
    """Return the uncertainty along a path; None where none is stated, or the path is long."""
    scene = program.scene
    uncertainty = scene_uncertainty(scene, Loop.RELATIVE)
    if uncertainty is None or len(path.line) > MAX_UNCERTAIN:
        return None
    view, length = scene.view(Loop.RELATIVE, "workpiece"), program.length_mm[path.move]
    response = np.empty((len(uncertainty.keys), *path.error_um.shape))
    for tool_length in np.unique(length):
        rows = length == tool_length
        axes = {name: at[rows] for name, at in path.coordinates.items()}
        model = with_length(scene.model, tool_length)
        response[:, rows] = uncertainty.respond(model, axes, view).position
    return combine(uncertainty, response, path.error_um, path.shares)


def count_samples(program: ParsedProgram, chord_mm: float) -> Integers:
    """Count the samples of each move, [m]; 0 without motion."""
    is_rotary = np.array([not is_linear(name) for name in program.axes])
    moves = program.kind != STAND
    change = np.abs(np.diff(program.end, axis=0, prepend=program.end[:1]))
    distance, turn = np.linalg.norm(change[:, ~is_rotary], axis=1), change[:, is_rotary]
    is_bent = (program.turn_rad != 0.0) | (~program.tcp & turn.any(axis=1))
    turn = np.maximum(turn.max(axis=1, initial=0.0), np.rad2deg(np.abs(program.turn_rad)))
    count = np.maximum(np.ceil(np.maximum(turn / TURN_DEG, distance / STEP_MM)), 1.0) * moves
    count[-1] += not moves.any()  # the initial positions
    (bent,) = np.nonzero(is_bent & moves)
    if len(bent):  # chordal deviation of the middle of a piece
        share = 0.5 + np.array([-0.5, 0.0, 0.5]) / count[bent, None]
        tip = along_moves(program, np.repeat(bent, 3), share.reshape(-1))[1].reshape(-1, 3, 3)
        away = np.linalg.norm(np.diff(tip, 2, axis=1)[:, 0] / 2.0, axis=1)
        count[bent] = np.ceil(count[bent] * np.maximum(1.0, np.sqrt(away / chord_mm)))
    return _check_count(program, count)


def _check_count(program: ParsedProgram, count: Array) -> Integers:
    """Raise an error for more samples than a line, or a program, may have."""
    of_line = np.bincount(program.line, count)
    line = int(of_line.argmax())
    if of_line[line] > MAX_LINE_POINTS:
        limit = f"expected at most {MAX_LINE_POINTS:,} of a line: fewer turns, or shorter moves"
        raise OptionError(f"line {line}: its moves have {of_line[line]:,.0f} points; {limit}")
    if count.sum() > MAX_PATH_POINTS:
        raise OptionError(f"{count.sum():,.0f} points; expected at most {MAX_PATH_POINTS:,}")
    return count.astype(np.int64)


def along_moves(
    program: ParsedProgram, move: Integers, share: Array, shift_mm: Array | None = None
) -> tuple[dict[str, Array], Array, Array]:
    """Compute axis positions, tip and error at shares of moves, [n].

    The linear axes make a shift of the tip, [n, 3] in w.
    """
    scene = program.scene
    positions = dict(zip(program.axes, program.positions(move, share).T, strict=True))
    tip, error = np.empty((len(move), 3)), np.empty((len(move), 3))
    modes = np.stack([program.tcp, program.length_mm], axis=-1)[move]
    view = scene.view(Loop.RELATIVE, "workpiece")
    for tcp, length in np.unique(modes, axis=0):
        (same,) = np.nonzero((modes == (tcp, length)).all(axis=1))
        model = with_length(scene.model, length)
        for rows in np.array_split(same, -(-len(same) // SAMPLES_AT_ONCE)):
            axes = {name: at[rows] for name, at in positions.items()}
            if tcp:
                axes = axes_at(scene.model, length, axes)
            if shift_mm is not None:
                axes = follow(model, axes, relative_point(model, axes) + shift_mm[rows])
            for name, axis in scene.machine.axes.items():
                low, high = axis.travel
                if not axis.is_linear and high - low >= FULL_TURN_DEG:  # without full turns
                    is_out = (axes[name] < low) | (axes[name] > high)
                    turned = low + (axes[name] - low) % FULL_TURN_DEG
                    axes[name] = np.where(is_out, turned, axes[name])
                positions[name][rows] = axes[name]
            check_magnitude(scene, axes)
            tip[rows] = relative_point(model, axes)
            error[rows] = evaluate_first_order(model, scene.errors, axes, view).error_um
    return positions, tip, error


@dataclass(frozen=True)
class PathPoint:
    """The error at a point of a path, and the contributions to it."""

    line: int
    um: float  # |E|
    axes: Mapping[str, float]  # mm or degrees
    error_um: Array  # [3]
    budget: Mapping[str, float]  # contributions to |E| by parameter, µm, largest first
    # u95_um of |E|; empty if none is stated
    expanded_uncertainty: ExpandedUncertainty[float | None]


def explain_sample(program: ParsedProgram, path: ToolPath, sample: int) -> PathPoint:
    scene, axes = program.scene, path.axes_at(sample)
    view = scene.view(Loop.RELATIVE, "workpiece")
    length = float(program.length_mm[path.move[sample]])
    parts = explain(with_length(scene.model, length), scene.errors, axes, view).contributions
    ranked = sorted(parts, key=lambda part: -part.along_um)
    u95 = ExpandedUncertainty[float | None]()
    if path.uncertainty:
        u95["u95_um"] = path.uncertainty.u95_at(sample)
    line, um = int(path.line[sample]), float(path.norm_um[sample])
    budget = {part.key: part.along_um for part in ranked}
    return PathPoint(line, um, axes, path.error_um[sample], budget, u95)


@dataclass(frozen=True, kw_only=True)
class Program(ControlSettings, Analysis):
    """Evaluate the errors along the path of a program on SCENE.

    G-code: motion in three planes, offsets, lengths, tool centre point, frames, tilted planes,
    drilling cycles, subprograms. The path ends before a word that is neither executed nor known to
    move no axis; it is reported with its line. Errors are those of the tool against the workpiece,
    in the workpiece frame, actual − nominal. Geometry only: no forces, heat, wear or servo.
    """

    name = "program"
    task = "measure"
    file_help = "Corrected program to write: this machine cuts the nominal path with it."
    file: File = option(None, "Program, G-code", positional=True, unset="that of the scene")
    at_line: int | None = option(
        None, "Line whose end is reported", low=1, high=MAX_LINES, unset="none"
    )
    within_um: float = option(
        1.0, "Tolerance of the corrected path between its points",
        unit="µm", low=0.01, high=1000.0,
    )  # fmt: skip
    text: str | None = None  # of the program; `file` is then its name

    def lines(self) -> Iterable[str]:
        file = self.file or ""
        return program_lines(file) if self.text is None else StringIO(self.text, None)

    def of_scene(self, scene: Scene) -> "Program":
        """Return the program itself, or that of the scene where none is stated."""
        if self.file is not None:
            return self
        path, tcp = scene.part.path("program"), cast("Any", scene.part.tcp or self.tcp)
        if path is None:
            raise OptionError("{file} is missing; expected a program")
        return replace(self, file=path, tcp=tcp)

    def read(self, scene: Scene) -> ParsedProgram:
        return read_program(scene, self.lines(), self, self.file or "")

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ProgramResult":
        if self.file is None:
            return self.of_scene(scene).run(scene, watch)
        program = self.read(scene)
        watch(0.3)
        path = trace_program(program)
        watch(0.9)
        order = np.argsort(-path.norm_um, kind="stable")
        worst = order[np.sort(np.unique(path.line[order], return_index=True)[1])[:WORST]]
        ends = np.flatnonzero(path.line == self.at_line)
        if self.at_line and not len(ends):
            lines = np.unique(path.line)
            near = ", ".join(map(str, lines[np.argsort(np.abs(lines - self.at_line))][:3]))
            raise OptionError(f"{{at_line}} {self.at_line} moves no axis; expected {near}")
        deviation, along, across = path.deviations()
        count = np.maximum(np.bincount(path.move, minlength=len(program.line)), 1)
        angle = (np.abs(program.turn_rad) / count)[path.move]
        length = np.linalg.norm(path.step_mm, axis=1) / np.sinc(angle / tau)  # of arcs, not chords
        return ProgramResult(
            length_mm=float(length.sum()),
            outside=int(path.outside.sum()),
            deviation=deviation,
            along=along,
            across=across,
            worst=[explain_sample(program, path, sample) for sample in worst],
            line=explain_sample(program, path, ends[-1]) if len(ends) else None,
            program=program,
            path=path,
            analysis=self,
            second_order=second_order(scene, Loop.RELATIVE),
        )


@dataclass(frozen=True, kw_only=True)
class ProgramResult(Result):
    """Path of a program, and its worst blocks."""

    json_keys = ("length_mm", "outside", "deviation", "along", "across", "worst")
    length_mm: float  # of the nominal path
    outside: int  # samples beyond the travel
    deviation: Statistics
    along: Statistics
    across: Statistics
    worst: Sequence[PathPoint]
    line: PathPoint | None  # the end of `at_line`
    program: ParsedProgram
    path: ToolPath
    analysis: Program

    def output_files(self, _ending: str = "", /) -> Mapping[str, str]:
        return {"": "\n".join([*map(one_line, correct_program(self.analysis, self.program)), ""])}

    def json_fields(self) -> dict[str, Any]:
        program = self.program
        refused = [
            {"line": line, "word": word, "reason": program.reasons[line].removeprefix("; ")}
            for line, word in program.refused.items()
        ]
        remarks = {
            "dialect": program.dialect or None,
            "skipped": [{"line": line, "words": words} for words, line in program.skipped.items()],
            "remarks": [*self.assumptions(), *self.caveats()],
        }
        line = {"line": to_json(self.line)} if self.line else {}
        return {"blocks": program.blocks, "refused": refused, **remarks, **to_json(self), **line}

    def assumptions(self) -> Iterator[str]:
        """List how the program was read."""
        if self.program.dialect:
            yield f"Dialect: {self.program.signs or self.program.dialect}"
        if self.program.skipped:
            words = [f"{words} (line {line})" for words, line in self.program.skipped.items()]
            yield f"Ignored as requested: {', '.join(words[:MAX_LISTED])}"
        if self.program.integer_word:
            word, line = self.program.integer_word
            numbers = "Numbers without a decimal point are mm or degrees"
            yield f"{numbers}: {word} (line {line}); unless a least increment is given"

    def caveats(self) -> Iterator[str]:
        program = self.program
        refused = [f"line {line} {word}" for line, word in program.refused.items()]
        if refused:
            listed, first = ", ".join(refused[:MAX_LISTED]), next(iter(program.reasons.values()))
            yield f"refused: {listed}; the path ends before the first of them{first}"
        remarks = [f"{word} (line {line})" for word, line in program.remarks.items()]
        if remarks:
            yield f"remarks: {', '.join(remarks[:MAX_LISTED])}"
        if program.unused:
            yield f"unused offsets: {', '.join(program.unused)}"
        if program.signs and not program.dialect:
            yield f"words of several dialects: {program.signs}; select the dialect"
        if self.outside:
            yield f"{self.outside} of {len(self.path.line)} points are beyond the travel"

    def blocks(self) -> Iterator[Block]:
        yield f"{self.program.scene.title} · {self.program.blocks} blocks, {self.length_mm:.1f} mm"
        yield from (f"  {assumption}" for assumption in self.assumptions())
        yield "  Geometry only: no forces, heat, wear or servo; errors in the workpiece frame"
        heads = number_columns(("mean", "RMS", "P95", "max"), ".2f", "µm")
        names = {"error": self.deviation, "along the path": self.along, "across it": self.across}
        rows = [(name, *astuple(statistics)[:4]) for name, statistics in names.items()]
        yield Table((Column("", leads=True), *heads), rows)
        uncertainty = self.path.uncertainty
        yield from u95_lines(uncertainty and uncertainty.errors, names)
        columns = (
            Column("line", "d", leads=True),
            *number_columns(("|E|", "x", "y", "z"), ".2f", "µm"),
            Column("U95", lambda u95: plus_minus(u95.get("u95_um")), shows=uncertainty is not None),
            Column("where", place_words, wraps=True),
            Column("largest contributions", budget_words, "µm", wraps=True),
        )
        points = [*self.worst, self.line] if self.line else self.worst
        rows = [
            (at.line, at.um, *at.error_um, at.expanded_uncertainty, at.axes, at.budget)
            for at in points
        ]
        title = "Worst blocks" + ", and the selected line" * bool(self.line)
        yield Table(columns, rows, title)


def corrected_places(program: ParsedProgram, within_mm: float) -> tuple[Integers, Array]:
    """Compute the moves of a program, [n], and corrected places, [n, a], of its lines in turn.

    A move occurs once per piece; its pieces have equal lengths. Between two places the linear axes
    are within a tolerance of the correct path. Places are in the mode of `ParsedProgram.end`.
    """
    count = np.maximum(count_samples(program, within_mm / 4.0), 1)
    count[program.kind == RAPID] = 1
    row, _, places = _corrected(program, count)
    linear = [program.axes.index(name) for name in following_axes(program.scene.model)]
    bend = np.linalg.norm(np.diff(places[:, linear], 2, axis=0), axis=1) / within_mm
    largest = np.zeros(len(count))
    np.maximum.at(largest, row[1:-1], np.where(row[2:] == row[:-2], bend, 0.0))
    # an arc leaves its chord by an eighth of its second difference, a kink by a quarter at most
    count = _check_count(
        program, np.ceil(count * np.maximum(np.sqrt(largest / 8.0), largest / 4.0))
    )
    row, share, places = _corrected(program, np.maximum(count, 1))
    return row[share > 0.0], places[share > 0.0]


def _corrected(program: ParsedProgram, count: Integers) -> tuple[Integers, Array, Array]:
    """Compute row, share and corrected place, [n, a], of the ends of equal pieces of moves."""
    row = np.repeat(np.arange(len(count)), count + 1)
    share = (np.arange(len(row)) - np.searchsorted(row, row)) / count[row]
    shift = np.zeros((len(row), 3))
    for _ in range(MAX_ITERATIONS):
        axes, tip, error_um = along_moves(program, row, share, shift)
        if np.abs(1e3 * shift + error_um).max() <= RESIDUAL_UM:
            break
        shift = -error_um / 1e3
    else:
        raise OptionError("no correction: the errors vary too much over the path")
    places = program.positions(row, share)
    programmed = programmed_words(program.scene.model, tip, axes)
    for name in following_axes(program.scene.model):
        linear = np.where(program.tcp[row], programmed[name], axes[name])
        places[:, program.axes.index(name)] = linear
    return row, share, places


def correct_program(analysis: Program, program: ParsedProgram) -> Iterator[str]:
    """Write the lines of a program with which this machine cuts the nominal path of another."""
    for line, word in {**program.refused, **program.uncorrectable}.items():
        reason = program.reasons.get(line, "; expected no such word in a program to be corrected")
        raise OptionError(f"line {line}: {word}{reason}")
    row, places = corrected_places(program, analysis.within_um / 1e3)
    scene, lines, line_of = program.scene, [*analysis.lines()], program.line[row]
    state = Interpreter(scene, analysis, analysis.file or "")
    linear = {name[0] for name in following_axes(scene.model)}
    missing = ", ".join(linear - state.index.keys())
    if missing:
        raise OptionError(f"no word moves axis {missing}; expected one axis of each letter")
    named, mode, number = set[str](), ("", False), 0
    header = _header(scene, analysis, program.dialect)
    for number, line in enumerate(state.run(lines), start=1):
        codes, letters = {*state.codes}, state.words.keys() & state.index.keys()
        if codes or state.words:
            yield from header  # once
        if mode != (state.system, state.tcp):
            mode, named = (state.system, state.tcp), set()
        if state.once in {"G28", "G30", "G53", "G10", "G52"}:
            named -= letters or named
        elif codes & {"M6", "G56", *COMPENSATING} or "D" in state.words:
            named -= {"Z"}
        places_here = np.arange(*np.searchsorted(line_of, [number, number + 1]))
        moving = places_here[program.kind[row[places_here]] != STAND]
        if state.once or not (letters or len(moving)):
            block = [word for key, word in state.tokens if key not in _MODES]
            is_relative = state.once in {"G28", "G30"} and not state.absolute
            if is_relative:
                block.insert(0, "G91")
            yield state.skip + " ".join(block) if state.tokens else line.rstrip()
            if is_relative:
                yield "G90"
            continue
        missing = ", ".join(sorted((linear | letters) - named))
        if missing and not (state.absolute and state.motion in {"G0", "G1"}):
            state.fail(f"moves from a place not known; expected G90 and {missing} before")
        named |= letters
        rows = moving if len(moving) else places_here[-1:]
        output_letters = [x for x in state.index if x in letters | (named & linear)]
        yield from _blocks(state, output_letters, program.kind[row[rows]], places[rows])
    yield from (line.rstrip() for line in lines[number:])


def _header(scene: Scene, analysis: Program, dialect: str) -> Iterator[str]:
    digest = sha256(scene_to_toml(scene).encode(errors="replace")).hexdigest()[:12]
    title = f"{scene.title[:80]}, chain {scene.machine.chain}, errors {digest}"
    setup = [f"{name}={value:g}" for name, value in analysis.offset]
    setup += [f"dialect {dialect}"] * bool(dialect)
    setup += [f"ignored words {' '.join(analysis.skip)}"] * bool(analysis.skip)
    if analysis.least_increment:
        setup.append(f"least increment {analysis.least_increment:g}")
    marks = (";", "") if dialect == "sinumerik" else ("(", ")")
    for text in (
        f"corrected for {title}",
        ", ".join([f"TCP {analysis.tcp}", f"length {analysis.length_mm:g} mm", *setup]),
        f"within {analysis.within_um:g} um between points; geometry only",
    ):
        yield format_comment(marks[0], text, marks[1])
    yield "G90"


def _blocks(
    state: Interpreter, letters: Sequence[str], kinds: Integers, places: Array
) -> Iterator[str]:
    """Write the current line of a control as straight blocks to places, [n, a]."""
    number = [word for key, word in state.tokens if key == "N"]
    replaced = _MODES | _LAST | {"N", "G0", "G1", *state.index}
    replaced |= {"CR", "RND", "CHR", *CORNERS, *("IJKLPQR" if state.cycle else "")}
    replaced |= {
        *("F" if state.inverse_time else ""),
        *("IJKPR" if state.motion in {"G2", "G3"} else ""),
    }
    other_words = [word for key, word in state.tokens if key not in replaced]
    last = [code for code in state.codes if code in _LAST]
    for index, (kind, place) in enumerate(zip(kinds, places, strict=True), start=1):
        is_rapid = kind == RAPID or (kind == STAND and state.motion == "G0")
        block = ["G0" if is_rapid else "G1"]
        for letter in letters:
            position = float(place[state.index[letter]]) - state.place(letter, 0.0)
            digits = DECIMALS + (2 if letter in "ABC" else state.unit_mm != 1.0)
            unit = 1.0 if letter in "ABC" else state.unit_mm
            block.append(letter + format_number(position / unit, digits))
        if state.inverse_time and not is_rapid and "F" in state.words:
            block.append("F" + format_number(state.words["F"] * len(kinds), DECIMALS))
        if index == len(kinds):
            block += last
        yield state.skip + " ".join([*number, *block, *other_words])
        number, other_words = [], []
        if state.motion == "G82" and not is_rapid:
            dwell = format_number(state.cycle.get("P", 0.0), DECIMALS).removesuffix(".0")
            yield f"{state.skip}G4 P{dwell}"
