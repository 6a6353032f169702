"""The path of a program over the workpiece, nominal and with errors; and the program mended.

Lengths of errors are weighed by the way: mean, RMS and P95 do not depend on where samples lie.
Geometry only: no forces, heat, wear or servo.

In the program mended the tip is sent to where it belongs less the error that the machine has there:
linear axes follow, rotary words stay. Words come out absolute (G90), arcs as lines, cycles as the
moves they stand for. The other words, comments and the lines of G28 and G53 are kept. An axis is
written from the line on that names it: where it stands before, nobody knows. The same holds behind
G28 and G53, another work offset or mode, and for Z behind another tool or length.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from hashlib import sha256
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.blocks import Block, Column, Table, number_columns
from warpspace.analysis.commands.contributions import budget_words, explain
from warpspace.analysis.description import Analysis, ProgressCallback, Result, to_json
from warpspace.analysis.options import File, option, place_words
from warpspace.analysis.statistics import P95, Statistics
from warpspace.analysis.uncertainty.propagation import (
    FieldUncertainty,
    combine,
    plus_minus,
    scene_uncertainty,
    u95_lines,
)
from warpspace.bench.placing import ball_point, follow, following_axes, within_travel
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.formats.source import MAX_LINES, format_comment, format_number
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import FULL_TURN_DEG, MAX_LINE_POINTS, MAX_PATH_POINTS
from warpspace.parts import interpreter
from warpspace.scene.model import Scene, check_magnitude, second_order
from warpspace.scene.scene_writer import scene_to_toml
from warpspace.scene.text_files import one_line
from warpspace.units import Array, Integers

TURN_DEG, STEP_MM = 2.0, 10.0  # most that axes, and arcs, move between samples
LEFT_UM, ROUNDS = 1e-3, 20  # of an error that is taken back; how often
DECIMALS = 4  # of words in mm; in inches one more, in degrees two
_MODES = {"G2", "G3", *interpreter.CYCLES, "G90", "G91"}  # not of a corrected program
_LAST = {"M0", "M1", "M2", "M5", "M9", "M30", "M60"}  # take effect when the axes have moved
CHORD_MM = 0.01  # most that a bent path leaves the line between samples
MOST_AT_ONCE = 50_000  # samples
WORST = 10  # blocks that are split by parameter
SAID = 20  # words that a remark lists
MOST_SURE = 200_000  # samples whose uncertainty is told


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Samples along a path: where it begins, the end of each move, and what lies between."""

    line: Integers  # [n], of the file, from 1
    move: Integers  # [n], row of the program
    coordinates: dict[str, Array]  # [n] each, mm or degrees; full turns of a rotary axis left out
    tip_mm: Array  # [n, 3], nominal, w
    error_um: Array  # [n, 3], relative, actual − nominal, w
    outside: NDArray[np.bool_]  # [n], beyond the travel; errors are continued
    step_mm: Array  # [n, 3], from the sample before; zero where the path begins or a tool changes
    uncertainty: FieldUncertainty | None  # how sure its errors are; statistics over the way

    @cached_property
    def norm_um(self) -> Array:
        return np.linalg.norm(self.error_um, axis=1)

    def axes_at(self, sample: int) -> dict[str, Any]:
        return {name: at[sample] for name, at in self.coordinates.items()}

    def deviations(self) -> Iterator[Statistics]:
        """Sum errors up over the way: their length, and how much is along the path, and across it.

        Where nothing moves each sample counts once, and is across.
        """
        back, ahead = self.step_mm, np.roll(self.step_mm, -1, axis=0)
        follows = (self.move == np.roll(self.move, 1))[:, None]
        bend = np.where(follows, back - np.roll(back, 1, axis=0), 0.0)
        tangent = 2.0 * back + np.where(np.roll(follows, -1, axis=0), ahead - back, bend)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
        for seen in (
            np.asarray,
            lambda um: _along(um, tangent),
            lambda um: um - _along(um, tangent),
        ):
            um = np.linalg.norm(seen(self.error_um), axis=1)
            mean, square = np.average([um, um**2], axis=1, weights=self.shares).tolist()
            p95 = float(np.quantile(um, P95, weights=self.shares, method="inverted_cdf"))
            at = int(np.argmax(um))
            x, y, z = self.tip_mm[at].tolist()
            found = Statistics(mean, square**0.5, p95, float(um[at]), (x, y, z), self.axes_at(at))
            yield (
                self.uncertainty.transform(seen).with_expanded_uncertainty(found)
                if self.uncertainty
                else found
            )

    @cached_property
    def shares(self) -> Array:
        """Of the way, [n]; equal ones where nothing moves."""
        step = np.linalg.norm(self.step_mm, axis=1)
        ways = step + np.append(step[1:], 0.0)
        return ways / ways.sum() if ways.any() else np.full(len(ways), 1.0 / len(ways))


def _along(error_um: Array, tangent: Array) -> Array:
    return np.sum(error_um * tangent, axis=-1, keepdims=True) * tangent


def trace_program(read: interpreter.ReadProgram, chord_mm: float = CHORD_MM) -> ToolPath:
    """Follow the tip of the tool over the workpiece."""
    count = count_samples(read, chord_mm)
    move = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(move)) - (np.cumsum(count) - count)[move] + 1.0) / count[move]
    at, tip, error = along_moves(read, move, share)
    same_tool = np.diff(read.length_mm[move], prepend=read.length_mm[move[:1]]) == 0.0
    step = np.diff(tip, axis=0, prepend=tip[:1]) * same_tool[:, None]
    outside = ~within_travel(read.scene.machine, at)
    found = ToolPath(read.line[move], move, at, tip, error, outside, step, None)
    return replace(found, uncertainty=_path_doubt(read, found))


def _path_doubt(read: interpreter.ReadProgram, path: ToolPath) -> FieldUncertainty | None:
    """Say how sure the errors along a path are; None where a scene does not say, or it is long."""
    doubt, scene = scene_uncertainty(read.scene, Loop.RELATIVE), read.scene
    if doubt is None or len(path.line) > MOST_SURE:
        return None
    view, length = scene.view(Loop.RELATIVE, "workpiece"), read.length_mm[path.move]
    response = np.empty((len(doubt.keys), *path.error_um.shape))
    for one in np.unique(length):
        here = {name: at[length == one] for name, at in path.coordinates.items()}
        model = interpreter.with_length(scene.model, one)
        response[:, length == one] = doubt.respond(model, here, view).position
    return combine(doubt, response, path.error_um, path.shares)


def count_samples(read: interpreter.ReadProgram, chord_mm: float) -> Integers:
    """Count the samples of each move, [m]; 0 where nothing moves."""
    is_rotary = np.array([not is_linear(name) for name in read.axes])
    moves = read.kind != interpreter.STAND
    change = np.abs(np.diff(read.end, axis=0, prepend=read.end[:1]))
    way, turn = np.linalg.norm(change[:, ~is_rotary], axis=1), change[:, is_rotary]
    is_bent = (read.turn_rad != 0.0) | (~read.tcp & turn.any(axis=1))
    turn = np.maximum(turn.max(axis=1, initial=0.0), np.rad2deg(np.abs(read.turn_rad)))
    count = np.maximum(np.ceil(np.maximum(turn / TURN_DEG, way / STEP_MM)), 1.0) * moves
    count[-1] += not moves.any()  # where the axes stand
    (bent,) = np.nonzero(is_bent & moves)
    if len(bent):  # how far the middle of a piece is from the line between its ends
        share = 0.5 + np.array([-0.5, 0.0, 0.5]) / count[bent, None]
        tip = along_moves(read, np.repeat(bent, 3), share.reshape(-1))[1].reshape(-1, 3, 3)
        away = np.linalg.norm(np.diff(tip, 2, axis=1)[:, 0] / 2.0, axis=1)
        count[bent] = np.ceil(count[bent] * np.maximum(1.0, np.sqrt(away / chord_mm)))
    return _checked(read, count)


def _checked(read: interpreter.ReadProgram, count: Array) -> Integers:
    """Refuse more samples of moves than a line, or a program, may come to."""
    of_line = np.bincount(read.line, count)
    line = int(of_line.argmax())
    if of_line[line] > MAX_LINE_POINTS:
        most = f"expected at most {MAX_LINE_POINTS:,} of a line: fewer turns, or shorter moves"
        raise OptionError(f"line {line}: its moves come to {of_line[line]:,.0f} points; {most}")
    if count.sum() > MAX_PATH_POINTS:
        raise OptionError(f"{count.sum():,.0f} points; expected at most {MAX_PATH_POINTS:,}")
    return count.astype(np.int64)


def along_moves(
    read: interpreter.ReadProgram, move: Integers, share: Array, shift_mm: Array | None = None
) -> tuple[dict[str, Array], Array, Array]:
    """Give positions of axes, tip and error at shares of moves, [n].

    A shift of the tip, [n, 3] in w, is made by the linear axes.
    """
    scene, found = read.scene, dict(zip(read.axes, read.positions(move, share).T, strict=True))
    tip, error = np.empty((len(move), 3)), np.empty((len(move), 3))
    modes = np.stack([read.tcp, read.length_mm], axis=-1)[move]
    view = scene.view(Loop.RELATIVE, "workpiece")
    for tcp, length in np.unique(modes, axis=0):
        (same,) = np.nonzero((modes == (tcp, length)).all(axis=1))
        model = interpreter.with_length(scene.model, length)
        for part in np.array_split(same, -(-len(same) // MOST_AT_ONCE)):
            here = {name: values[part] for name, values in found.items()}
            here = interpreter.axes_at(scene.model, length, here) if tcp else here
            if shift_mm is not None:
                here = follow(model, here, ball_point(model, here) + shift_mm[part])
            for name, axis in scene.machine.axes.items():
                low, high = axis.travel
                if not axis.is_linear and high - low >= FULL_TURN_DEG:  # leave full turns out
                    is_out = (here[name] < low) | (here[name] > high)
                    turned = low + (here[name] - low) % FULL_TURN_DEG
                    here[name] = np.where(is_out, turned, here[name])
                found[name][part] = here[name]
            check_magnitude(scene, here)
            tip[part] = ball_point(model, here)
            error[part] = evaluate_first_order(model, scene.errors, here, view).error_um
    return found, tip, error


@dataclass(frozen=True)
class PathPoint:
    """The error at a place of a path, split by parameter."""

    line: int
    um: float  # |E|
    axes: Mapping[str, float]  # mm or degrees
    error_um: Array  # [3]
    budget: Mapping[str, float]  # µm of |E| by parameter, which add up to it, the largest first
    expanded_uncertainty: Mapping[str, float | None]  # u95_um of |E|; empty where nothing is stated


@dataclass(frozen=True, kw_only=True)
class Program(interpreter.Setup, Analysis):
    """Run a program on SCENE: the errors along its path.

    G-code: G0 to G3 in three planes, G17 to G21, G28, G43, G43.4, G49, G53 to G59, G80 to G83, G90,
    G91. Subprograms and variables are refused by line: the path ends before them. Errors are those
    of the tool against the workpiece, in the workpiece frame, actual − nominal. Geometry only: no
    forces, heat, wear or servo.
    """

    name = "program"
    task = "measure"
    file_help = "Corrected program to write: this machine cuts the nominal path with it."
    file: File = option(None, "Program, G-code", positional=True, unset="that of the scene")
    at_line: int | None = option(
        None, "Line whose end is told", low=1, high=MAX_LINES, unset="none"
    )
    within_um: float = option(
        1.0, "How far a corrected program may be from the nominal path between its points",
        unit="µm", low=0.01, high=1000.0,
    )  # fmt: skip
    text: str | None = None  # of one that is read already; `file` is then its name

    def lines(self) -> Iterable[str]:
        file = self.file or ""
        return interpreter.program_lines(file) if self.text is None else StringIO(self.text, None)

    def run(self, scene: Scene, watch: ProgressCallback, /) -> "ProgramResult":
        if self.file is None:
            if (path := scene.part.path("program")) is None:
                raise OptionError("{file} is missing; expected a program")
            tcp: Any = scene.part.tcp or self.tcp
            return replace(self, file=path, tcp=tcp).run(scene, watch)
        read = interpreter.read_program(scene, self.lines(), self, self.file)
        watch(0.3)
        path = trace_program(read)
        watch(0.9)
        order = np.argsort(-path.norm_um, kind="stable")
        worst = order[np.sort(np.unique(path.line[order], return_index=True)[1])[:WORST]]

        def explained(sample: int) -> PathPoint:
            axes, length = path.axes_at(sample), float(read.length_mm[path.move[sample]])
            view = scene.view(Loop.RELATIVE, "workpiece")
            model = interpreter.with_length(scene.model, length)
            parts = explain(model, scene.errors, axes, view).contributions
            ranked = sorted(parts, key=lambda part: -part.along_um)
            budget, um = {part.key: part.along_um for part in ranked}, float(path.norm_um[sample])
            at = int(path.line[sample]), um, axes, path.error_um[sample], budget
            return PathPoint(
                *at, {"u95_um": path.uncertainty.u95_at(sample)} if path.uncertainty else {}
            )

        ends = np.flatnonzero(path.line == self.at_line)
        if self.at_line and not len(ends):
            lines = np.unique(path.line)
            near = ", ".join(map(str, lines[np.argsort(np.abs(lines - self.at_line))][:3]))
            raise OptionError(f"{{at_line}} {self.at_line} moves no axis; expected {near}")
        deviation, along, across = path.deviations()
        return ProgramResult(
            length_mm=float(np.linalg.norm(path.step_mm, axis=1).sum()),
            outside=int(path.outside.sum()),
            deviation=deviation,
            along=along,
            across=across,
            worst=[explained(sample) for sample in worst],
            line=explained(ends[-1]) if len(ends) else None,
            read=read,
            path=path,
            asked=self,
            second_order=second_order(scene, Loop.RELATIVE),
        )


@dataclass(frozen=True, kw_only=True)
class ProgramResult(Result):
    """The path of a program, and its worst blocks."""

    keys = ("length_mm", "outside", "deviation", "along", "across", "worst")
    length_mm: float  # of the nominal path
    outside: int  # samples beyond the travel
    deviation: Statistics
    along: Statistics
    across: Statistics
    worst: Sequence[PathPoint]
    line: PathPoint | None  # the end of the line asked for
    read: interpreter.ReadProgram
    path: ToolPath
    asked: Program

    def texts(self, _ending: str = "", /) -> Mapping[str, str]:
        return {"": "\n".join([*map(one_line, correct_program(self.asked, self.read)), ""])}

    def as_plain(self) -> dict[str, Any]:
        refused = [{"line": line, "word": word} for line, word in self.read.refused.items()]
        said = {"blocks": self.read.blocks, "refused": refused, **to_json(self)}
        return said | ({"line": to_json(self.line)} if self.line else {})

    def doubts(self) -> Iterator[str]:
        if refused := [f"line {line} {word}" for line, word in self.read.refused.items()]:
            yield f"refused: {', '.join(refused[:SAID])}; the path ends before the first of them"
        if unknown := [f"{word} (line {line})" for word, line in self.read.unknown.items()]:
            yield f"not followed: {', '.join(unknown[:SAID])}"
        if self.outside:
            yield f"{self.outside} of {len(self.path.line)} points are beyond the travel"

    def blocks(self) -> Iterator[Block]:
        yield f"{self.read.scene.title} · {self.read.blocks} blocks, {self.length_mm:.1f} mm"
        yield "  Geometry only: no forces, heat, wear or servo; errors in the workpiece frame"
        heads = number_columns(("mean", "RMS", "P95", "max"), ".2f", "µm")
        names = {"error": self.deviation, "along the path": self.along, "across it": self.across}
        rows = [(name, *astuple(one)[:4]) for name, one in names.items()]
        yield Table((Column("", leads=True), *heads), rows)
        sure = self.path.uncertainty
        yield from u95_lines(sure and sure.errors, names)
        columns = (
            Column("line", "d", leads=True),
            *number_columns(("|E|", "x", "y", "z"), ".2f", "µm"),
            Column("U95", lambda one: plus_minus(one.get("u95_um")), shows=sure is not None),
            Column("where", place_words, wraps=True),
            Column("most of it", budget_words, "µm", wraps=True),
        )
        told = [*self.worst, *([self.line] if self.line else [])]
        rows = [
            (one.line, one.um, *one.error_um, one.expanded_uncertainty, one.axes, one.budget)
            for one in told
        ]
        title = "Worst blocks" + ", and the line asked for" * bool(self.line)
        yield Table(columns, rows, title)


def corrected_places(read: interpreter.ReadProgram, within_mm: float) -> tuple[Integers, Array]:
    """Give rows of a program, [n], and corrected places, [n, a], that its lines lead to in turn.

    A row comes as often as its move has pieces, all of one length. Between two places the linear
    axes stay within a distance of where they have to be. Places are those of `ReadProgram.end`.
    """
    count = np.maximum(count_samples(read, within_mm / 4.0), 1)
    count[read.kind == interpreter.RAPID] = 1
    row, _, places = _corrected(read, count)
    linear = [read.axes.index(name) for name in following_axes(read.scene.model)]
    bend = np.linalg.norm(np.diff(places[:, linear], 2, axis=0), axis=1) / within_mm
    most = np.zeros(len(count))
    np.maximum.at(most, row[1:-1], np.where(row[2:] == row[:-2], bend, 0.0))
    # an arc leaves its chord by an eighth of its second difference, a kink by a quarter at most
    count = _checked(read, np.ceil(count * np.maximum(np.sqrt(most / 8.0), most / 4.0)))
    row, share, places = _corrected(read, np.maximum(count, 1))
    return row[share > 0.0], places[share > 0.0]


def _corrected(read: interpreter.ReadProgram, count: Integers) -> tuple[Integers, Array, Array]:
    """Give row and share of the ends of equal pieces of moves, and corrected places, [n, a]."""
    row = np.repeat(np.arange(len(count)), count + 1)
    share = (np.arange(len(row)) - np.searchsorted(row, row)) / count[row]
    shift = np.zeros((len(row), 3))
    for _ in range(ROUNDS):
        found, tip, error_um = along_moves(read, row, share, shift)
        if np.abs(1e3 * shift + error_um).max() <= LEFT_UM:
            break
        shift = -error_um / 1e3
    else:
        raise OptionError("the errors change too much from place to place to be corrected")
    places, words = read.positions(row, share), interpreter.words_at(read.scene.model, tip, found)
    for name in following_axes(read.scene.model):
        places[:, read.axes.index(name)] = np.where(read.tcp[row], words[name], found[name])
    return row, share, places


def correct_program(asked: Program, read: interpreter.ReadProgram) -> Iterator[str]:
    """Give the lines of a program that leaves the nominal path of another one on this machine."""
    idle = {line: word for word, line in read.unknown.items() if " with G" in word}
    for line, word in {**read.refused, **idle}.items():
        raise OptionError(f"line {line}: {word} is not followed; expected a program that is")
    row, places = corrected_places(read, asked.within_um / 1e3)
    scene, lines, own = read.scene, [*asked.lines()], read.line[row]
    state = interpreter.Interpreter(scene, asked, asked.file or "")
    linear = {name[0] for name in following_axes(scene.model)}
    if missing := ", ".join(linear - state.index.keys()):
        raise OptionError(f"no word moves axis {missing}; expected one axis of each letter")
    known, mode, header, number = set[str](), ("", False), _header(scene, asked), 0
    for number, line in enumerate(state.run(lines), start=1):
        codes, letters = {*state.codes}, state.words.keys() & state.index.keys()
        if codes or state.words:
            yield from header  # once
        if mode != (state.system, state.tcp):
            mode, known = (state.system, state.tcp), set()
        if codes & {"G28", "G53"}:
            known -= letters or known
        elif codes & {"M6", "G43", "G43.4", "G49"}:
            known -= {"Z"}
        here = np.arange(*np.searchsorted(own, [number, number + 1]))
        moving = here[read.kind[row[here]] != interpreter.STAND]
        if codes & {"G4", "G28", "G53"} or not (letters or len(moving)):
            kept = [word for key, word in state.tokens if key not in _MODES]
            way = ["G91"] * ("G28" in codes and not state.absolute)
            yield state.skip + " ".join(way + kept) if state.tokens else line.rstrip()
            yield from ["G90"] * len(way)
            continue
        missing = ", ".join(sorted((linear | letters) - known))
        if missing and not (state.absolute and state.motion in {"G0", "G1"}):
            state.fail(f"moves from a place not known; expected G90 and {missing} before")
        known |= letters
        chosen = moving if len(moving) else here[-1:]
        written = [letter for letter in state.index if letter in letters | (known & linear)]
        yield from _blocks(state, written, read.kind[row[chosen]], places[chosen])
    yield from (line.rstrip() for line in lines[number:])


def _header(scene: Scene, asked: Program) -> Iterator[str]:
    digest = sha256(scene_to_toml(scene).encode()).hexdigest()[:12]
    said = f"for {scene.title[:80]}, chain {scene.machine.chain}, errors {digest}"
    yield format_comment("(", f"corrected {said}", ")")
    setup = "".join(f", {name}={value:g}" for name, value in asked.offset)
    yield f"(TCP {asked.tcp}, length {asked.length_mm:g} mm{setup})"
    yield f"(within {asked.within_um:g} um between points; geometry only)"
    yield "G90"


def _blocks(
    state: interpreter.Interpreter, letters: Sequence[str], kinds: Integers, places: Array
) -> Iterator[str]:
    """Write the line that a control is at as straight blocks to places, [n, a]."""
    number = [word for key, word in state.tokens if key == "N"]
    said = _MODES | _LAST | {"N", "G0", "G1", *state.index}
    said |= {*("KLPQR" if state.cycle else ""), *("F" if state.inverse_time else "")}
    said |= {*("IJKPR" if state.motion in {"G2", "G3"} else "")}
    rest = [word for key, word in state.tokens if key not in said]
    last = [code for code in state.codes if code in _LAST]
    for left, kind, place in zip(range(len(kinds))[::-1], kinds, places, strict=True):
        is_rapid = kind == interpreter.RAPID or (kind == interpreter.STAND and state.motion == "G0")
        words = ["G0" if is_rapid else "G1"]
        for letter in letters:
            value = float(place[state.index[letter]]) - state.place(letter, 0.0)
            digits = DECIMALS + (2 if letter in "ABC" else state.unit_mm != 1.0)
            unit = 1.0 if letter in "ABC" else state.unit_mm
            words.append(letter + format_number(value / unit, digits))
        if state.inverse_time and not is_rapid and "F" in state.words:
            words.append("F" + format_number(state.words["F"] * len(kinds), DECIMALS))
        yield state.skip + " ".join([*number, *words, *(() if left else last), *rest])
        number, rest = [], []
        if state.motion == "G82" and not is_rapid:
            dwell = format_number(state.cycle.get("P", 0.0), DECIMALS).removesuffix(".0")
            yield f"{state.skip}G4 P{dwell}"
