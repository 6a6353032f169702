"""Interpreter of G-code programs: words, and the moves that they command.

**Words** are axis positions plus the active offset; after G53 they are axis positions. A tool of
length L reaches L beyond the scene's tool point, against the tool axis: tip = tool point − L · tool
axis in the tool frame. G43 H moves Z by +L, so that the tip is at the programmed Z while rotary
axes are at zero. A change of length or offset moves nothing by itself.

**Without tool centre point** (TCP) all axes move in proportion, arcs are arcs of axis positions,
and rotary axes swing the tip. **With it** (G43.4 to G49) X, Y, Z are the tip on the workpiece: the
point of the workpiece frame where the tip is with these words at rotary axes zero. The tip then
runs along lines and arcs of the workpiece, rotary axes turn in proportion, linear axes follow.

The path begins where straight blocks have named all linear axes, or feed one named before: the
initial positions of the others are unknown.
G28 moves to axis positions zero, or to the end of the travel that is nearest.
"""

import re
from array import array
from cmath import phase
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from math import ceil, copysign, sqrt, tau
from pathlib import Path
from typing import Annotated, Literal, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.options import Grammar, option, read_numbers
from warpspace.bench.placing import follow
from warpspace.exceptions import SceneError
from warpspace.formats.source import MAX_LINE, MAX_LINES
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import (
    MAX_CYCLE,
    MAX_CYCLE_MOVES,
    MAX_LENGTH_MM,
    MAX_PATH_POINTS,
    MAX_PROGRAM_BYTES,
    MAX_TURNS,
    MAX_TYPED_NUMBER,
    MAX_WORD,
    MIN_SPAN,
)
from warpspace.scene.model import Scene
from warpspace.scene.text_files import check_file
from warpspace.units import Array, Integers

MM_PER_INCH, MAX_TOOL_MM = 25.4, 1e4  # the latter of offsets, too
SLACK_MM, SLACK = 0.005, 1e-3  # by which radii at both ends of an arc may differ, or its share
FULL_TURN_RAD = 1e-9  # an arc below it is a full circle
STAND, RAPID, FEED, ARC = range(4)  # kinds of moves; STAND: the same place in another mode
PLANES, CENTRES = ("YZ", "ZX", "XY"), ("JK", "KI", "IJ")  # of arcs, by the direction across
CYCLES = "G81", "G82", "G83"
_UNUSED_LETTERS = {"G2": "L", "G3": "L", **dict.fromkeys(CYCLES, "IJ")}  # without meaning there
MAX_REMARKS = 1000  # words listed as not understood
MAX_SHOWN = MAX_TYPED_NUMBER  # characters of a word that a message shows
WORD = re.compile(
    r"([A-Z])\s*+([+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++))(?![.\d#\[=]|E\d)"  # a letter, its number
    r"|\([^()]*+\)|;.*+"  # comments
    r"|(\S[^\s(;]*+)",  # anything else
    re.IGNORECASE | re.ASCII,
)
_SKIP = re.compile(r"(N\s*+\d++\s*+)?+(/[/\d]*+\s*+)(.*+)", re.IGNORECASE)
_TITLE = re.compile(r"%?\s*+<?[O:]\s*+\d++>?\s*+(\([^()]*+\)\s*+)*+", re.IGNORECASE)  # of a program
_CONTROL_FLOW = re.compile(r".*[#\[<=]|GOTO|IF|WHILE|FOR|LOOP|REPEAT|CALL")
_AXES, _POSITIONS = frozenset("XYZUVWABC"), frozenset("XYZUVWABCIJKRQ")
_BENDING = (
    "2.1 2.2 2.3 2.4 3.1 3.2 3.3 3.4 5.2 5.3 6.2 7 10 12 12.1 13 16 27 29 30 31 33 33.1 34 37 38.2"
    " 38.3 38.4 38.5 41 41.1 42 42.1 43.1 43.2 43.5 47 51 51.1 52 54.1 54.2 54.4 59.1 59.2 59.3 65"
    " 66 68 68.2 68.3 70 72 73 74 76 84 85 86 87 88 89 90.1 92 150 154"
)
_NO_EFFECT = (  # on the path
    "G9", "G15", "G40", "G50", "G61", "G61.1", "G64", "G67", "G69", "G91.1", "G96", "G97",
)  # fmt: skip
REFUSED = {"M96", "M97", "M98", "M99", "M198"} | {
    f"G{number}" for number in (*_BENDING.split(), *range(110, 130))
}
"""Codes whose effect on the path is not supported: corrections, rotations, calls, cycles."""


def _shorten(word: str) -> str:
    return word if len(word) < MAX_SHOWN else f"{word[: MAX_SHOWN - 1]}…"


def _offsets(text: str, scene: Scene) -> tuple[tuple[str, float], ...]:
    offsets = read_numbers(text, "G54X=position and H1=length", "G54X=10,H1=85.5")
    for name, value in offsets.items():
        if abs(value) > MAX_TOOL_MM:
            raise ValueError(f"{name}={value:g}; expected at most ±{MAX_TOOL_MM:g}")
        if not re.fullmatch(rf"G5[4-9]({'|'.join(scene.machine.axes)})|H\d+", name):
            raise ValueError(f"{name}; expected G54 to G59 with an axis of the machine, or H1")
    return tuple(offsets.items())


@dataclass(frozen=True, kw_only=True)
class ControlSettings:
    """Settings of a control before a program runs."""

    tcp: Literal["program", "always", "never"] = option(
        "program", "Tool centre point: switched by G43.4 and G49, or on or off throughout"
    )
    length_mm: float = option(
        0.0, "Length of the tool beyond the tool point of the scene", unit="mm",
        low=-MAX_TOOL_MM, high=MAX_TOOL_MM,
    )  # fmt: skip
    offset: Annotated[
        tuple[tuple[str, float], ...], Grammar("G54X=..,H1=..", _offsets, many=True)
    ] = option(
        (), "Positions of axes where words of a work offset are zero, and lengths of tools by H",
        unset="at axes zero; --length for all tools",
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ParsedProgram:
    """Moves of a program, one per row; each begins where the previous one ends."""

    scene: Scene
    axes: tuple[str, ...]  # of its machine, [a]
    line: Integers  # [m], of the file, from 1; 0 for the initial positions
    kind: Integers  # [m]; STAND, RAPID, FEED or ARC
    tcp: NDArray[np.bool_]  # [m]
    across: Integers  # [m]; direction 0 to 2 about which an arc turns
    length_mm: Array  # [m], of the tool
    turn_rad: Array  # [m]; of an arc, positive counter-clockwise seen against that direction
    centre_mm: NDArray[np.complex128]  # [m]; of an arc, along the two axes of its `PLANES`
    # [m, a], mm and degrees; axis positions. With TCP those of the linear axes bring the scene's
    # tool point to where the tip is while rotary axes are at zero: see `upright`
    end: Array
    refused: Mapping[int, str]  # words by line; the path ends before the first
    unknown: Mapping[str, int]  # words not understood: first line of each
    blocks: int  # lines that move an axis

    def positions(self, move: Integers, share: Array) -> Array:
        """Return the axis positions, in the mode of `end`, at shares of moves, [n, a]."""
        start, end = self.end[np.maximum(move - 1, 0)], self.end[move]
        at = start + share[:, None] * (end - start)
        (arc,) = np.nonzero(self.turn_rad[move])
        move, share = move[arc], share[arc]
        columns = [[self.axes.index(x) if x in self.axes else 0 for x in names] for names in PLANES]
        rows, plane = arc[:, None], np.array(columns)[self.across[move]]
        centre = self.centre_mm[move]
        first, last = (places[rows, plane] @ [1.0, 1j] - centre for places in (start, end))
        grown = 1.0 + share * (np.abs(last / first) - 1.0)
        place = centre + first * grown * np.exp(1j * share * self.turn_rad[move])
        at[rows, plane] = np.stack([place.real, place.imag], axis=-1)
        return at


def with_length(model: Model, length_mm: float) -> Model:
    """Return a model whose tool point is the tip of a tool of this length."""
    x, y, z = model.tool_point_mm
    return replace(model, tool_point_mm=(x, y, z - length_mm))


def upright(positions: Mapping[str, Array]) -> dict[str, Array]:
    """Return axis positions with the rotary axes at zero."""
    return {name: at if is_linear(name) else np.zeros(()) for name, at in positions.items()}


def axes_at(model: Model, length_mm: float, programmed: Mapping[str, Array]) -> dict[str, Array]:
    """Compute axis positions from the words of a program with TCP."""
    tip_mm = relative_point(model, upright(programmed))
    return follow(with_length(model, length_mm), programmed, tip_mm)


def programmed_words(model: Model, tip_mm: Array, axes: Mapping[str, Array]) -> dict[str, Array]:
    """Compute the words of a program with TCP from the tip and the rotary axis positions."""
    linear = follow(model, upright(axes), tip_mm)
    return {name: linear[name] if is_linear(name) else at for name, at in axes.items()}


def program_lines(path: str | Path) -> Iterator[str]:
    """Read the lines of a program; bytes that are not UTF-8 are taken for comment text."""
    check_file(Path(path), MAX_PROGRAM_BYTES, str(path))
    try:
        with Path(path).open(encoding="utf-8-sig", errors="replace") as file:
            yield from iter(lambda: file.readline(MAX_LINE + 1), "")
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror or error}"]) from None


def read_program(
    scene: Scene,
    lines: Iterable[str],
    settings: ControlSettings | None = None,
    name: str = "program",
) -> ParsedProgram:
    """Run a program on the control of a machine; a `SceneError` names the line."""
    control = Interpreter(scene, settings or ControlSettings(), name)
    for _ in control.run(lines):
        pass
    rows = np.frombuffer(control.rows).reshape(-1, control.width)
    line, kind, tcp, across = rows[:, :4].T.astype(np.int64)
    kind[: control.first] = STAND
    return ParsedProgram(
        scene, control.names, line, kind, tcp > 0, across, rows[:, 4], rows[:, 5],
        rows[:, 6] + 1j * rows[:, 7], rows[:, 8:], control.refused, control.unknown,
        len(np.unique(line[kind != STAND])),
    )  # fmt: skip


class Interpreter:
    """State of a control: modal codes, axis positions, and the words of the current block."""

    def __init__(self, scene: Scene, settings: ControlSettings, name: str) -> None:
        self.scene, self.settings, self.name = scene, settings, name
        self.line, self.codes, self.words = 0, list[str](), dict[str, float]()
        # words and comments of the block as written, by code or letter, and its skip mark "/"
        self.tokens, self.skip = list[tuple[str, str]](), ""
        self.refused, self.unknown = dict[int, str](), dict[str, int]()
        self.offset = dict(settings.offset)
        self.names = tuple(scene.machine.axes)
        first = [axis[0] for axis in self.names]
        self.index = {x: first.index(x) for x in first if first.count(x) == 1}
        self.motion, self.system, self.across, self.unit_mm = "G0", "G54", 2, 1.0
        self.absolute, self.to_initial, self.inverse_time = True, True, False
        self.is_compensated, self.has_blocks = False, False
        self.unnamed_axes = {i for i, axis in enumerate(self.names) if is_linear(axis)}
        self.first = 0  # first row of the path
        self.once = ""  # non-modal code of the block: G4, G28 or G53
        self.letters: Set[str] = set[str]()  # axes that the block names
        self.cycle: dict[str, float] = {}  # words of a cycle, and the level before it, mm
        self.rows, self.width = array("d"), 8 + len(self.names)
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        self.position = [float(stand[axis]) for axis in self.names]
        self.tcp, self.length_mm = False, settings.length_mm
        self.record(STAND)
        self.switch(tcp=settings.tcp == "always", length_mm=settings.length_mm)

    def run(self, lines: Iterable[str]) -> Iterator[str]:
        """Execute lines and return them one by one, up to the first refused word."""
        for line, raw in enumerate(lines, start=1):
            self.line, self.codes, self.words, self.tokens = line, [], {}, []
            self.skip, self.once, text = "", "", raw.strip()
            if line > MAX_LINES or len(raw) > MAX_LINE or len(self.unknown) > MAX_REMARKS:
                size = f"{MAX_LINES:,} lines of {MAX_LINE:,} characters, {MAX_REMARKS:,}"
                self.fail(f"is no program in G-code; expected at most {size} other words")
            if text.startswith("%") and self.has_blocks:
                return
            skipped = _SKIP.fullmatch(text)
            if skipped:
                self.unknown.setdefault("/", line)
                self.skip, text = skipped[2], (skipped[1] or "") + skipped[3]
            if self.has_blocks or not _TITLE.fullmatch(text):
                for match in WORD.finditer(text.lstrip("%")):
                    self.read_word(match)
            if {"G5", "G5.1"} & {*self.codes} and {"X", "Y", "Z"} & self.words.keys():
                self.refused[line] = "G5"  # a spline; without a place a look-ahead
            self.has_blocks = self.has_blocks or bool(self.codes or self.words)
            if not self.refused:
                self.execute_block()
                yield raw
            if {"M2", "M30"} & {*self.codes} or len(self.refused) > MAX_REMARKS:
                return

    def read_word(self, match: re.Match[str]) -> None:
        """Read a word or comment; after a refused word only further refused words matter."""
        letter, number, other = ((group or "").upper() for group in match.groups())
        value, is_code = float(number or 0.0), letter in {"G", "M"}
        word = f"{letter}{value:g}" if is_code else _shorten(letter + number + other)
        self.tokens.append((word if is_code else letter, match[0]))
        if letter == "O" or word in REFUSED or (other and _CONTROL_FLOW.match(other)):
            self.refused.setdefault(self.line, word)
            return
        limit = MAX_LENGTH_MM if letter in _POSITIONS else MAX_WORD
        if len(number) > MAX_SHOWN or abs(value) > limit:
            unit = " mm or degrees" * (letter in _POSITIONS)
            expected = f"at most ±{limit:.8g}{unit}, in up to {MAX_SHOWN} characters"
            self.reject(f"{letter}{_shorten(number)}; expected {expected}")
        if is_code:
            self.codes.append(word)
            if (letter == "G" and word not in CODES) or word in {"M128", "M129"}:
                self.unknown.setdefault(word, self.line)
        elif letter == "E" or (word[:2].isalpha() and 1 < len(word) < MAX_SHOWN):
            self.unknown.setdefault(word, self.line)
        elif other:  # possibly a language that is not supported
            end = "the end of the comment" if word.startswith("(") else "a letter and a number"
            self.reject(f"{word!r}; expected {end}")
        elif letter:
            if letter in self.words:
                self.reject(f"{word}; expected {letter} once in a line")
            self.words[letter] = value

    def fail(self, problem: str) -> NoReturn:
        raise SceneError(self.name, [f"line {self.line}: {problem}"])

    def reject(self, problem: str) -> None:
        """Fail, unless the path has ended at a refused word."""
        if not self.refused:
            self.fail(problem)

    def execute_block(self) -> None:
        """Execute the codes of the current block, then its motion."""
        for code in self.codes:
            handler = CODES.get(code)
            if handler is not None:
                handler(self, code)
        self.cycle = self.cycle if self.motion in CYCLES else {}
        # X of G4 is a time
        self.letters = set[str]() if self.once == "G4" else self.words.keys() & _AXES
        for letter in self.letters - self.index.keys():
            axes = f"an axis of {self.scene.machine.chain}: {', '.join(self.index)}"
            self.fail(f"{letter}{self.words[letter]:g}; expected {axes}")
        unused = _UNUSED_LETTERS.get(self.motion, "IJKLR") if self.letters else "L"
        for letter in self.words.keys() & {*unused}:
            self.unknown.setdefault(f"{letter} with {self.once or self.motion}", self.line)
        is_arc = self.motion in {"G2", "G3"} and self.words.keys() & {*"IJKR"}
        if self.once == "G28":
            self.move_home()
        elif self.once == "G53" and self.letters:  # to axis positions
            self.line_to({self.index[x]: self.value(x) for x in self.letters}, bare=True)
        elif self.letters or is_arc:
            MOTIONS[self.motion](self)

    def move_home(self) -> None:
        """Move over the programmed point to axis positions zero, or the nearest end of travel."""
        target = self.target()
        if any(self.position[index] != at for index, at in target.items()):
            self.line_to(target, RAPID)
        axes, home = self.scene.machine.axes, dict[int, float]()
        for letter in self.letters or self.index:
            index = self.index[letter]
            home[index] = float(np.clip(0.0, *axes[self.names[index]].travel))
        self.line_to(home, RAPID, bare=True)

    def compensate(self, code: str) -> None:
        """Set the length compensation of the tool, and TCP."""
        length, self.is_compensated = self.length_mm, code != "G49"
        if self.is_compensated:
            number = f"H{self.words.get('H', 0.0):g}"
            length = self.offset.get(number, self.settings.length_mm)
            if not length:
                self.unknown.setdefault(f"{number} without a length", self.line)
        by_word = code == "G43.4" and self.settings.tcp == "program"
        self.switch(tcp=by_word or self.settings.tcp == "always", length_mm=length)

    def switch(self, *, tcp: bool, length_mm: float) -> None:
        """Express the position in another mode; nothing moves."""
        if (tcp or self.tcp) and (tcp, length_mm) != (self.tcp, self.length_mm):
            at = {axis: np.asarray(q) for axis, q in zip(self.names, self.position, strict=True)}
            model = self.scene.model
            if self.tcp:
                at = axes_at(model, self.length_mm, at)
            if tcp:
                at = programmed_words(model, relative_point(with_length(model, length_mm), at), at)
            self.position, self.tcp, self.length_mm = [*map(float, at.values())], tcp, length_mm
            self.record(STAND)
        self.length_mm = length_mm

    def record(self, kind: int, turn: float = 0.0, centre: complex = 0j) -> None:
        if len(self.rows) > MAX_PATH_POINTS * self.width:
            self.fail(f"more than {MAX_PATH_POINTS:,} moves; expected fewer or larger pecks")
        mode = self.line, kind, self.tcp, self.across, self.length_mm
        self.rows.extend((*mode, turn, centre.real, centre.imag, *self.position))

    def value(self, letter: str) -> float:
        """Return the number of a word in mm, degrees or seconds."""
        return self.words[letter] * (1.0 if letter in "ABCP" else self.unit_mm)

    def place(self, letter: str, value: float) -> float:
        """Return the axis position of an absolute word, mm or degrees."""
        is_longer = letter == "Z" and self.is_compensated and not self.tcp
        shift = self.offset.get(self.system + letter, 0.0)
        return value + shift + (self.length_mm if is_longer else 0.0)

    def target(self) -> dict[int, float]:
        """Return the target of the block by number of the axis."""
        to: dict[int, float] = {}
        for letter in self.words.keys() & self.index.keys():
            value, index = self.value(letter), self.index[letter]
            to[index] = self.place(letter, value) if self.absolute else self.position[index] + value
        return to

    def line_to(self, to: Mapping[int, float], kind: int = STAND, *, bare: bool = False) -> None:
        """Move to positions of some axes: bare ones, or places of the tip with TCP."""
        tcp = self.tcp
        self.switch(tcp=tcp and not bare, length_mm=self.length_mm)
        before = self.position
        self.position = [to.get(index, at) for index, at in enumerate(before)]
        kind = kind or (RAPID if self.motion == "G0" else FEED)
        if not self.first or self.unnamed_axes & to.keys():
            self.unnamed_axes -= to.keys()
            self.record(STAND)
            self.first = len(self.rows) // self.width
        elif before == self.position:
            kind = STAND
        elif kind == FEED:  # from here on it is cut
            self.unnamed_axes.clear()
        self.record(kind)
        self.switch(tcp=tcp, length_mm=self.length_mm)

    def move_along_arc(self) -> None:
        to = self.target()
        names, centres = PLANES[self.across], CENTRES[self.across]
        if not set(names) <= self.index.keys():
            self.fail(f"an arc in {names}; expected axes of {self.scene.machine.chain}")
        start = complex(*(self.position[self.index[x]] for x in names))
        self.position = [to.get(index, at) for index, at in enumerate(self.position)]
        self.unnamed_axes.clear()
        end = complex(*(self.position[self.index[x]] for x in names))
        sense = 1.0 if self.motion == "G3" else -1.0
        if "R" in self.words:  # of the longer arc where it is negative
            radius, half = self.value("R"), (end - start) / 2.0
            if abs(half) < MIN_SPAN or abs(half) - abs(radius) > max(SLACK_MM, SLACK * abs(half)):
                chord = f"a chord of {2.0 * abs(half):.4f} mm, above 0"
                self.fail(f"R{self.words['R']:g}; expected a radius for an arc of {chord}")
            height = sqrt(max(0.0, radius * radius - abs(half) ** 2))
            centre = start + half + copysign(sense, sense * radius) * height * 1j * half / abs(half)
        elif self.words.keys() & {*centres}:
            offsets = (self.words.get(letter, 0.0) for letter in centres)
            centre = start + self.unit_mm * complex(*offsets)
        else:
            self.fail(f"{self.motion} without I, J, K or R")
        radius, other = abs(start - centre), abs(end - centre)
        if radius < MIN_SPAN or abs(radius - other) > max(SLACK_MM, SLACK * radius):
            self.fail(f"{self.motion}: radii {radius:.4f} and {other:.4f} mm; expected one radius")
        turns = self.words.get("P", 1.0)
        if turns > MAX_TURNS:
            self.fail(f"P{turns:g}; expected at most {MAX_TURNS:,} turns of an arc")
        turn = sense * phase((end - centre) / (start - centre))
        extra_turns = max(ceil(turns), 1) - (turn > FULL_TURN_RAD)  # P: turns begun
        self.record(ARC, sense * (turn + extra_turns * tau), centre)

    def drill(self) -> None:
        """Drill at the place of the line, K or L times: R plane, depth, in pecks of Q with G83."""
        deep = "XYZ"[self.across]
        self.cycle |= {x: self.value(x) for x in {deep, "R", "Q", "P"} & self.words.keys()}
        if deep not in self.index or not {deep, "R"} <= self.cycle.keys():
            self.fail(f"{self.motion} without {deep} and R")
        index, letter = self.index[deep], "K" if "K" in self.words else "L"
        repeats = int(self.words.get(letter, 1.0))
        initial = self.cycle.setdefault("initial", self.position[index])
        clear = initial + self.cycle["R"]
        bottom = clear + self.cycle[deep]
        if self.absolute:
            clear, bottom = (self.place(deep, self.cycle[letter]) for letter in ("R", deep))
        peck = abs(self.cycle.get("Q", 0.0)) if self.motion == "G83" else clear - bottom or 1.0
        if bottom > clear or peck <= 0.0 or (clear - bottom) / peck > MAX_CYCLE:
            expected = f"a depth below R, in up to {MAX_CYCLE:,} pecks of Q above 0"
            self.fail(f"{self.motion} from {clear:g} to {bottom:g} mm; expected {expected}")
        pecks = ceil((clear - bottom) / peck)
        moves = repeats * 3 * (pecks + 1)
        if moves > MAX_CYCLE_MOVES:
            expected = f"at most {MAX_CYCLE_MOVES:,} moves in a line"
            self.fail(f"{letter}{repeats} comes to {moves:,} moves; expected {expected}")
        for _ in range(repeats):
            self.line_to({index: max(clear, self.position[index])}, RAPID)
            self.line_to({**self.target(), index: self.position[index]}, RAPID)
            for number in range(pecks):
                self.line_to({index: clear}, RAPID)
                self.line_to({index: clear - number * peck}, RAPID)
                self.line_to({index: max(bottom, clear - (number + 1) * peck)}, FEED)
            self.line_to({index: max(initial, clear) if self.to_initial else clear}, RAPID)


CodeHandler: TypeAlias = Callable[[Interpreter, str], None]


def _modal(name: str, value: object) -> CodeHandler:
    return lambda control, _code: setattr(control, name, value)


CODES: Mapping[str, CodeHandler] = {
    **{code: _modal("motion", code) for code in ("G0", "G1", "G2", "G3", *CYCLES)},
    "G80": _modal("motion", "G0"),
    "G17": _modal("across", 2), "G18": _modal("across", 1), "G19": _modal("across", 0),
    "G20": _modal("unit_mm", MM_PER_INCH), "G21": _modal("unit_mm", 1.0),
    "G90": _modal("absolute", value=True), "G91": _modal("absolute", value=False),
    "G93": _modal("inverse_time", value=True),
    **dict.fromkeys(("G94", "G95"), _modal("inverse_time", value=False)),
    "G98": _modal("to_initial", value=True), "G99": _modal("to_initial", value=False),
    **{code: _modal("system", code) for code in ("G54", "G55", "G56", "G57", "G58", "G59")},
    **dict.fromkeys(("G43", "G43.4", "G49"), Interpreter.compensate),
    **{code: _modal("once", code) for code in ("G4", "G28", "G53")},
    **dict.fromkeys(_NO_EFFECT, lambda _control, _code: None),
}  # fmt: skip
"""Effects of the supported codes."""
MOTIONS: Mapping[str, Callable[[Interpreter], None]] = {
    **dict.fromkeys(("G0", "G1"), lambda control: control.line_to(control.target())),
    **dict.fromkeys(("G2", "G3"), Interpreter.move_along_arc),
    **dict.fromkeys(CYCLES, Interpreter.drill),
}
"""Motions of a block by its modal code."""
