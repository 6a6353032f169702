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
initial positions of the others are unknown. After G30 the positions of its axes are unknown again.
G28 moves to axis positions zero, or to the end of the travel that is nearest.

A block with a word that is neither executed nor known to move no axis (`dialects`) is not executed:
the path ends before it.
"""

import re
from array import array
from cmath import exp, phase
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from math import ceil, copysign, sqrt, tan, tau
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
    FULL_TURN_DEG,
    MAX_CALLS,
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
from warpspace.parts.dialects import (
    DIALECTS,
    KLARTEXT,
    MODAL_LETTERS,
    NO_AXES,
    WHOLE_BLOCK,
    DialectName,
    detect_dialects,
    motionless_words,
)
from warpspace.scene.model import Scene
from warpspace.scene.text_files import check_file
from warpspace.units import Array, Integers

MM_PER_INCH, MAX_TOOL_MM = 25.4, 1e4  # the latter of offsets, too
SLACK_MM, SLACK = 0.005, 1e-3  # by which radii at both ends of an arc may differ, or its share
FULL_TURN_RAD = 1e-9  # an arc below it is a full circle
STAND, RAPID, FEED, ARC = range(4)  # kinds of moves; STAND: the same place in another mode
PLANES, CENTRES = ("YZ", "ZX", "XY"), ("JK", "KI", "IJ")  # of arcs, by the direction across
PECKING, TAPPING, STOPPING = {"G73", "G83"}, {"G74", "G84"}, {"G76", "G86", "G88", "G89"}
FED_BACK = TAPPING | {"G85", "G89"}  # cycles that leave the hole at the feed
CYCLES = "G81", "G82", "G85", *sorted(PECKING | TAPPING | STOPPING)
MAX_REMARKS = 1000  # words listed as not understood
MAX_SHOWN = MAX_TYPED_NUMBER  # characters of a word that a message shows
_NUMBER = r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)"
WORD = re.compile(
    rf"([A-Z])\s*+({_NUMBER})(?![.\d#\[=]|E\d++(?![.\d]))"  # a letter, its number
    r"|\([^()]*+\)|;.*+"  # comments
    rf"|(CR|[A-Z]|S\d)\s*+=\s*+(?:([AI]C)\s*+\()?\s*+({_NUMBER}|\"[^\"]*+\")(?(4)\s*+\))"
    r"(?![^\s;(])"  # an assignment of SINUMERIK
    r"|(\S[^\s(;]*+)",  # anything else
    re.IGNORECASE | re.ASCII,
)
_SKIP = re.compile(r"(N\s*+\d++\s*+)?+(/[/\d]*+\s*+)(.*+)", re.IGNORECASE)
_HEADER = re.compile(  # lines before the first block
    r"%.*+|\$[^%\s]++%|O?<[^<>]++>\s*+(\([^()]*+\)\s*+)*+|[O:]\s*+\d++\s*+(\([^()]*+\)\s*+)*+",
    re.IGNORECASE,
)
_CORNER = re.compile(rf"(,[RC])\s*+({_NUMBER})")
_LABEL = re.compile(r"\s*+(?:/\d?\s*+)?+(?:([O:N])\s*+0*+(\d++))", re.IGNORECASE)
_CONTROL_FLOW = re.compile(r".*[#\[<=]|GOTO|IF|WHILE|FOR|LOOP|REPEAT|CALL")
_AXES, _POSITIONS = frozenset("XYZUVWABC"), frozenset("XYZUVWABCIJKRQ")
_CYCLE_LETTERS = "RQPKL"
_LETTERS = {  # beside axes, by the code that they belong to
    "G0": ["E"], "G1": ["E", ",R", ",C"], **dict.fromkeys(("G2", "G3"), "IJKRPE"),
    **dict.fromkeys(CYCLES, _CYCLE_LETTERS),
    "G4": "PXUFS", "G10": "LPR", "G54.1": "P", "G154": "P", "G68": "R", "G92": "E",
    "M98": "PL", "M97": "PL",
}  # fmt: skip
_SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59")


def _shorten(word: str) -> str:
    return word if len(word) < MAX_SHOWN else f"{word[: MAX_SHOWN - 1]}…"


def _offsets(text: str, scene: Scene) -> tuple[tuple[str, float], ...]:
    offsets = read_numbers(text, "G54X=position and H1=length", "G54X=10,H1=85.5")
    systems = r"G5[4-9]|G54\.1P\d+|G15H\d+"
    for name, value in offsets.items():
        if abs(value) > MAX_TOOL_MM:
            raise ValueError(f"{name}={value:g}; expected at most ±{MAX_TOOL_MM:g}")
        if not re.fullmatch(rf"({systems})({'|'.join(scene.machine.axes)})|[HD]\d+", name):
            expected = "G54 to G59, G54.1P1 or G15H1 with an axis of the machine, H1 or D1"
            raise ValueError(f"{name}; expected {expected}")
    return tuple(offsets.items())


def _spell(letter: str, number: str) -> str:
    """Return the spelling of a word that is compared: codes without leading zeros."""
    is_code = letter in {"G", "M"} and len(number) < MAX_SHOWN
    return f"{letter}{float(number):g}" if is_code else _shorten(letter + number)


def _skipped_words(text: str, _scene: Scene) -> tuple[str, ...]:
    names = [part.strip().upper() for part in text.split(",") if part.strip()]
    matches = [(name, re.fullmatch(rf"([A-Z])({_NUMBER})", name)) for name in names]
    return tuple(_spell(match[1], match[2]) if match else name for name, match in matches)


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
    dialect: DialectName = option(
        "auto", "Dialect of the program, which determines the meaning of words; auto: by its words"
    )
    skip: Annotated[tuple[str, ...], Grammar("WORD,..", _skipped_words, many=True)] = option(
        (), "Words to ignore, each with the rest of its block up to the next G or M code;"
        " or letters", unset="none",
    )  # fmt: skip
    least_increment: float | None = option(
        None, "Value of the last digit of a number without a decimal point, mm or degrees; in"
        " inches a tenth of it", low=1e-5, high=1.0, unset="such numbers are mm or degrees",
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
    reasons: Mapping[int, str]  # why they are refused, and what was expected
    remarks: Mapping[str, int]  # first line of each assumption, and of words without effect
    skipped: Mapping[str, int]  # words ignored by `ControlSettings.skip`: first line of each
    uncorrectable: Mapping[int, str]  # words by line that a corrected program cannot contain
    unused: tuple[str, ...]  # offsets that no word called for
    dialect: str  # "" if unknown
    signs: str  # dialects by the words that they were recognised by, with their lines
    integer_word: tuple[str, int] | None  # the first number without a decimal point, and its line
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
        with Path(path).open("rb") as binary:
            is_utf16 = binary.read(2) in {b"\xff\xfe", b"\xfe\xff"}
        encoding = "utf-16" if is_utf16 else "utf-8-sig"
        with Path(path).open(encoding=encoding, errors="replace") as file:
            yield from iter(lambda: file.readline(MAX_LINE + 1), "")
    except OSError as error:
        raise SceneError(str(path), [f"cannot be read: {error.strerror or error}"]) from None


def read_program(
    scene: Scene,
    lines: Iterable[str],
    settings: ControlSettings | None = None,
    name: str = "program",
) -> ParsedProgram:
    """Run a program on the control of a machine, up to the first block that is not understood.

    Raises a `SceneError` with line, word and expectation if no block moves an axis.
    """
    control = Interpreter(scene, settings or ControlSettings(), name)
    for _ in control.run(lines):
        pass
    if not control.first:
        problems = [f"line {n}: {word}{control.reasons[n]}" for n, word in control.refused.items()]
        raise SceneError(name, problems[:1] or ["moves no axis; expected blocks in G-code"])
    rows = np.frombuffer(control.rows).reshape(-1, control.width)
    line, kind, tcp, across = rows[:, :4].T.astype(np.int64)
    kind[: control.first] = STAND
    return ParsedProgram(
        scene, control.names, line, kind, tcp > 0, across, rows[:, 4], rows[:, 5],
        rows[:, 6] + 1j * rows[:, 7], rows[:, 8:], control.refused, control.reasons,
        control.remarks, control.skipped, control.uncorrectable,
        tuple(key for key, _ in control.settings.offset if key not in control.used),
        control.dialect, control.signs, control.integer_word, len(np.unique(line[kind != STAND])),
    )  # fmt: skip


class _RefusedError(Exception):
    """A word, and why its block is not executed."""


class Interpreter:
    """State of a control: modal codes, axis positions, and the words of the current block."""

    def __init__(self, scene: Scene, settings: ControlSettings, name: str) -> None:
        self.scene, self.settings, self.name = scene, settings, name
        self.line, self.codes, self.words = 0, list[str](), dict[str, float]()
        self.integers, self.modes = set[str](), dict[str, str]()  # letters; AC or IC by letter
        # words and comments of the block as written, by code or letter, and its skip mark "/"
        self.tokens, self.skip = list[tuple[str, str]](), ""
        self.refused, self.reasons = dict[int, str](), dict[int, str]()
        self.remarks, self.skipped = dict[str, int](), dict[str, int]()
        self.uncorrectable, self.used = dict[int, str](), set[str]()
        self.dialect, self.signs = "", ""
        self.handlers: Mapping[str, CodeHandler] = {}
        self.motionless: Mapping[str, str] = {}
        self.once_codes: Mapping[str, str] = {}  # codes whose block has another motion, or none
        self.offset = dict(settings.offset)
        self.names = tuple(scene.machine.axes)
        first = [axis[0] for axis in self.names]
        self.index = {x: first.index(x) for x in first if first.count(x) == 1}
        self.motion, self.system, self.across, self.unit_mm = "G0", "G54", 2, 1.0
        self.absolute, self.to_initial, self.inverse_time = True, True, False
        self.is_compensated, self.has_blocks = False, False
        self.shift = {"G52": dict[str, float](), "G92": dict[str, float]()}  # by letter, mm or °
        self.rotation, self.pivot, self.rotated_about = 1.0 + 0j, 0j, 2  # of G68
        self.needs_both = False  # axes of the plane, in the first block after G68 or G69
        self.unnamed_axes = {i for i, axis in enumerate(self.names) if is_linear(axis)}
        self.lost = set[int]()  # axes whose position is unknown after G30
        self.first = 0  # first row of the path
        self.once = ""  # non-modal code of the block, such as G4, G28 or G53
        self.letters: Set[str] = set[str]()  # axes that the block names
        self.cycle: dict[str, float] = {}  # words of a cycle, and the level before it, mm
        self.corner: tuple[str, float, int] | None = None  # of the last move: ",R", mm, its row
        self.calls, self.next_line = list[tuple[int, int, int]](), 0  # of subprograms
        self.labels: dict[tuple[str, float], int] = {}
        self.ordinary = (MODAL_LETTERS - {"H"}) | self.index.keys()  # checked no further
        self.integer_word: tuple[str, int] | None = None  # the first read as mm or degrees
        self.rows, self.width = array("d"), 8 + len(self.names)
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        self.position = [float(stand[axis]) for axis in self.names]
        self.tcp, self.length_mm = False, settings.length_mm
        self.record(STAND)
        self.switch(tcp=settings.tcp == "always", length_mm=settings.length_mm)

    def choose_dialect(self, lines: Sequence[str]) -> None:
        """Set the dialect, from the options or from its signs in the program."""
        self.dialect: str = self.settings.dialect
        if self.dialect == "auto":
            signs = detect_dialects(lines)
            self.dialect = next(iter(signs)) if len(signs) == 1 else ""
            listed = [f"{name} (line {line}, {sign})" for name, (line, sign) in signs.items()]
            self.signs = ", ".join(map(_shorten, listed))
        codes = {**CODES, **_DIALECT_CODES.get(self.dialect, {})}
        self.once_codes = {
            code: name
            for code, name in _ONCE.items()
            if codes.get(code) is CODES.get(code, _ignore)
        }
        self.handlers = {code: handler for code, handler in codes.items() if handler}
        self.motionless = motionless_words(self.dialect)

    def run(self, lines: Iterable[str]) -> Iterator[str]:
        """Execute lines and return them one by one, up to the first refused word."""
        program = [*islice(lines, MAX_LINES + 1)]
        self.choose_dialect(program)
        for line, text in enumerate(program, start=1):
            label = _LABEL.match(text)
            if label and len(label[2]) < MAX_SHOWN:
                kind = "N" if label[1] in "nN" else "O"
                self.labels.setdefault((kind, int(label[2])), line)
        executed = 0
        while self.next_line < len(program):
            raw, self.line, executed = program[self.next_line], self.next_line + 1, executed + 1
            self.next_line += 1
            if executed > MAX_LINES or len(raw) > MAX_LINE or len(self.remarks) > MAX_REMARKS:
                size = f"{MAX_LINES:,} lines of {MAX_LINE:,} characters, {MAX_REMARKS:,}"
                self.fail(f"is no program in G-code; expected at most {size} other words")
            self.codes, self.words, self.tokens = [], {}, []
            self.integers, self.modes = set[str](), {}
            self.skip, self.once, text = "", "", raw.replace("\0", "").strip()
            if text.startswith("%") and self.has_blocks and not self.calls:
                return
            skipped = _SKIP.fullmatch(text)
            if skipped:
                self.remarks.setdefault("/", self.line)
                self.skip, text = skipped[2], (skipped[1] or "") + skipped[3]
            try:
                if not self.has_blocks and KLARTEXT.match(text):
                    self.refuse("BEGIN PGM", "HEIDENHAIN Klartext; expected G-code (ISO)")
                if self.has_blocks or not _HEADER.fullmatch(text):
                    self.read_words(text)
                if not self.refused:
                    self.execute_block()
                    yield raw
            except _RefusedError as refusal:
                word, reason = refusal.args
                self.refused.setdefault(self.line, word)
                self.reasons.setdefault(self.line, reason and f"; {reason}")
            self.has_blocks = self.has_blocks or bool(self.codes or self.words)
            if {"M2", "M30"} & {*self.codes} or len(self.refused) > MAX_REMARKS:
                return
        if self.calls and not self.refused:
            self.refused[self.line] = program[-1].strip()[:MAX_SHOWN]
            self.reasons[self.line] = "; expected M99 at the end of the subprogram"

    def read_words(self, text: str) -> None:
        """Read the words and comments of a block."""
        ignored, is_rest = list[str](), False  # words of `ControlSettings.skip`, and after them
        for match in WORD.finditer(text):
            groups = ((group or "").upper() for group in match.groups())
            letter, number, name, mode, value, other = groups
            letter, number = letter or name, number or value
            if not (letter or other):  # a comment
                self.tokens.append(("", match[0]))
                continue
            is_code = letter in {"G", "M"} or bool(other)
            word = _spell(letter, number) if letter and not name else _shorten(match[0].upper())
            if {word, letter} & {*self.settings.skip} or (is_rest and not is_code):
                is_rest = is_rest or is_code
                ignored.append(word)
                self.tokens.append(("skipped", match[0]))
                continue
            is_rest = False
            self.tokens.append((word if is_code else letter, match[0]))
            if not is_code:
                self.read_number(match[0], letter, number, mode)
            elif word in self.handlers or word in self.motionless:
                self.codes.append(word)
                if self.motionless.get(word) == WHOLE_BLOCK and word not in self.handlers:
                    self.tokens[-1] = word, text[match.start() :]
                    break
            elif word in {*self.index, *"WO"} and "G28" in self.codes and self.dialect == "printer":
                self.words |= {word: 0.0} if word in self.index else {}
            elif _CORNER.fullmatch(word):
                self.tokens[-1] = word[:2], match[0]
                self.read_number(word, word[:2], word[2:].strip(), "")
            elif other and _CONTROL_FLOW.match(other):
                self.refuse(
                    word, "expected numbers and codes, no variables, macros or calls by name"
                )
            elif other.startswith("("):
                self.refuse(word, "expected the end of the comment")
            elif other and not re.fullmatch(r",[A-Z][-+.\d]*|[A-Z_]\w+", other):
                spelling = word if word.isprintable() else repr(word)
                self.refuse(spelling, "expected a letter and a number")
            else:
                dialects = [
                    f", --dialect {name}"
                    for name in DIALECTS
                    if word in motionless_words(name) or _DIALECT_CODES.get(name, {}).get(word)
                ]
                options = "".join(dialects) + f", or --skip {word}"
                self.refuse(word, f"expected a word that is executed or moves no axis{options}")
        if ignored:
            self.skipped.setdefault(" ".join(ignored), self.line)

    def read_number(self, word: str, letter: str, number: str, mode: str) -> None:
        """Read a letter and its number, or an assignment of SINUMERIK."""
        spelling = f"{letter}{_shorten(number)}"
        if "=" in word:
            is_text = number.startswith('"')
            if self.dialect != "sinumerik" or (is_text and letter != "T"):
                self.refuse(_shorten(word.upper()), "expected a letter and a number")
            letter, number = "R" if letter == "CR" else letter[0], "0" if is_text else number
            self.modes[letter] = mode
        limit = MAX_LENGTH_MM if letter[-1] in _POSITIONS else MAX_WORD
        value = float(number)
        if len(number) > MAX_SHOWN or abs(value) > limit:
            unit = " mm or degrees" * (letter in _POSITIONS)
            expected = f"at most ±{limit:.8g}{unit}, in up to {MAX_SHOWN} characters"
            self.refuse(spelling, f"expected {expected}")
        if letter == "O":
            self.refuse(spelling, "expected one program or subprogram, ended by M30 or M99")
        if letter in self.words:
            self.refuse(spelling, f"expected {letter} once in a line")
        self.words[letter] = value
        if letter[-1] in _POSITIONS and "." not in number:
            self.integers.add(letter)

    def fail(self, problem: str) -> NoReturn:
        raise SceneError(self.name, [f"line {self.line}: {problem}"])

    def refuse(self, word: str, reason: str) -> NoReturn:
        """End the path before the current block."""
        raise _RefusedError(word, reason)

    def check_letters(self, motion: str) -> None:
        """Refuse letters of the block that belong to none of its codes, and axes not present."""
        claimed = {*MODAL_LETTERS}
        for code in self.codes:
            claimed |= {*_LETTERS.get(code, ""), *self.motionless.get(code, "")}
        if self.once in {"", "G53"}:
            claimed |= {*_LETTERS[motion]}
            if motion == "G83" and self.dialect == "haas":
                claimed |= {"I", "J"}
        for letter, value in self.words.items():
            word = f"{letter}{value:g}"
            if letter in _AXES and letter not in self.index and letter not in claimed:
                axes = f"{self.scene.machine.chain}: {', '.join(self.index)}"
                self.refuse(word, f"expected an axis of {axes}")
            if letter not in _AXES and letter not in claimed:
                self.refuse(word, f"expected no {letter} with {self.once or motion}")

    def execute_block(self) -> None:
        """Execute the codes of the current block, then its motion."""
        motions = [code for code in self.codes if code in MOTIONS]
        if len({*motions}) > 1:
            self.refuse(motions[-1], f"expected it in another block than {motions[0]}")
        self.once = next((self.once_codes[x] for x in self.codes if x in self.once_codes), "")
        motion = motions[0] if motions else "G0" if "G80" in self.codes else self.motion
        if not self.words.keys() <= self.ordinary:
            self.check_letters(motion)
        if "H" in self.words and not _WITH_H & {*self.codes}:
            self.remarks.setdefault(f"H{self.words['H']:g} without G43", self.line)
        if self.words.keys() & _AXES:
            for code in self.codes:
                if code not in self.handlers and self.motionless[code].endswith(NO_AXES):
                    self.refuse(code, "expected no axis in its block")
        # X of G4 is a time
        self.letters = set[str]() if self.once == "G4" else self.words.keys() & _AXES
        if self.dialect == "sinumerik" and "D" in self.words:
            self.compensate("D")
        for code in self.codes:
            if code in self.handlers:
                self.handlers[code](self, code)
        self.cycle = self.cycle if self.motion in CYCLES else {}
        if self.corner and (self.once or (self.letters and self.motion != "G1")):
            self.refuse(self.once or self.motion, f"expected G1 after a corner {self.corner[0]}")
        is_arc = self.motion in {"G2", "G3"} and self.words.keys() & {*"IJKR"}
        if self.once in {"G28", "G30"}:
            self.move_home()
        elif self.once == "G53" and self.letters:  # to axis positions
            self.line_to({self.index[x]: self.value(x) for x in sorted(self.letters)}, bare=True)
        elif not self.once and (self.letters or is_arc):
            if "E" in self.words:
                self.remarks.setdefault("E is no axis", self.line)
            MOTIONS[self.motion](self)
        for code in {"M97", "M98", "M99"} & {*self.codes}:
            self.call(code)

    def call(self, code: str) -> None:
        """Continue at a subprogram or after its call, or end the program."""
        self.uncorrectable.setdefault(self.line, code)
        if code == "M99":
            start, repeats, caller = self.calls.pop() if self.calls else (0, 0, MAX_LINES)
            self.next_line = start if repeats else caller
            if repeats:
                self.calls.append((start, repeats - 1, caller))
            return
        kind, number, repeats = "NO"[code == "M98"], self.words.get("P", 0.0), self.count("L")
        if (kind, number) not in self.labels and "L" not in self.words:
            repeats, number = max(int(number) // 10_000, 1), number % 10_000
        if (kind, number) not in self.labels:
            self.refuse(f"{code} P{number:g}", f"expected {kind}{number:g} in this file")
        if len(self.calls) >= MAX_CALLS:
            self.refuse(code, f"expected at most {MAX_CALLS} subprograms within each other")
        start = self.labels[kind, int(number)] - (kind == "N")
        if repeats:
            self.calls.append((start, repeats - 1, self.next_line))
            self.next_line = start

    def count(self, letter: str) -> int:
        """Return the number of repetitions."""
        value = self.words.get(letter, 1.0)
        if value < 0.0 or value % 1.0:
            self.refuse(f"{letter}{value:g}", "expected a whole number of repetitions")
        return int(value)

    def move_home(self) -> None:
        """Move over the programmed point to axis positions zero, or the nearest end of travel."""
        target = self.target() if self.dialect != "printer" else {}
        if any(self.position[index] != at for index, at in target.items()):
            self.line_to(target, RAPID)
        indices = {self.index[letter] for letter in self.letters or self.index}
        if self.once == "G30":
            if self.first:
                self.lost |= indices
            self.unnamed_axes |= {i for i in indices if is_linear(self.names[i]) and not self.first}
            return
        axes, home = self.scene.machine.axes, dict[int, float]()
        for index in indices:
            home[index] = float(np.clip(0.0, *axes[self.names[index]].travel))
        self.line_to(home, RAPID, bare=True)

    def compensate(self, code: str) -> None:
        """Set the length compensation of the tool, and TCP."""
        letter = "D" if code == "D" else "H"
        number = f"{letter}{self.words.get(letter, 0.0):g}"
        length, self.is_compensated = self.length_mm, code != "G49" and number != "D0"
        if self.is_compensated:
            length = self.offset.get(number, self.settings.length_mm)
            self.used.add(number)
            if not length:
                self.remarks.setdefault(f"{number} without a length", self.line)
        by_word = code in {"G43.4", "G234"} and self.settings.tcp == "program"
        machine = self.scene.machine
        turned = [
            f"{axis}{at:g}"
            for axis, at in zip(self.names, self.position, strict=True)
            if by_word and at and not is_linear(axis) and axis in machine.chain.workpiece
        ]
        if turned:
            at_zero = f"{code} at {' '.join(turned)}: workpiece frame at rotary zero"
            self.remarks.setdefault(at_zero, self.line)
        self.switch(tcp=by_word or self.settings.tcp == "always", length_mm=length)

    def compensate_radius(self, code: str) -> None:
        """Refuse a compensation of the cutter radius, unless its offset is given as zero."""
        number = f"D{self.words.get('D', 0.0):g}"
        self.used.add(number)
        if self.offset.get(number):
            self.refuse(
                code, f"expected --offset {number}=0: other cutter radii are not compensated"
            )
        if number not in self.offset:
            expected = f"--offset {number}=0 where the programmed path is that of the tool centre"
            self.refuse(code, f"expected {expected}")

    def select_system(self, code: str) -> None:
        """Select a work offset; it is refused where its block may mean another thing."""
        is_move = {"G0", "G1", "G2", "G3", "G53"} & {*self.codes}
        if code in {"G58", "G59"} and self.letters and not (is_move or self.dialect):
            expected = "--dialect fanuc (a work offset and a move) or sinumerik (a shift)"
            self.refuse(code, f"expected {expected}")
        self.system = code
        if code in {"G54.1", "G154"}:
            self.system = f"G54.1P{self.words.get('P', 0.0):g}"
        elif code == "G15":
            self.system = f"G15H{self.words.get('H', 0.0):g}"

    def shift_by(self, code: str) -> None:
        """Shift the work offset (G52), or so that the position has given coordinates (G92)."""
        if code == "G92.1":
            self.shift["G92"] = {}
        if self.rotation != 1.0 or self.tcp:
            self.refuse(code, "expected G69 and G49 before")
        for letter in sorted(self.letters):
            value = self.value(letter)
            if code == "G92":
                self.uncorrectable.setdefault(self.line, code)
                if self.index[letter] in self.unnamed_axes | self.lost:
                    at = "at a position that no block has commanded"
                    self.remarks.setdefault(f"G92 {letter} {at}", self.line)
                at = self.position[self.index[letter]] - self.place(letter, value)
                value = self.shift["G92"].get(letter, 0.0) + at
            self.shift[code][letter] = value

    def set_offset(self, code: str) -> None:
        """Set a work offset (L2; L20 according to the dialect) or a tool length (L10)."""
        kind, number = self.words.get("L", 0.0), f"{self.words.get('P', 0.0):g}"
        is_listed = self.dialect in {"fanuc", "haas"}
        if kind == 10 and "R" in self.words:
            self.offset[f"H{number}"] = self.value("R")
            return
        if kind not in {2, 20} or not self.absolute or (kind == 20 and not self.dialect):
            expected = "L2, L10 R, or L20 with --dialect, in G90"
            self.refuse(f"{code} L{kind:g}", f"expected {expected}")
        system = self.system if number == "0" else (*_SYSTEMS, *[""] * 6)[:6][int(number) - 1]
        if kind == 20 and is_listed:
            system = f"G54.1P{number}"
        for letter in sorted(self.letters):
            value = self.value(letter)
            if kind == 20 and not is_listed:  # the coordinate of the present position
                self.system, active = system, self.system
                value = self.position[self.index[letter]] - self.place(letter, value)
                value += self.offset.get(system + letter, 0.0)
                self.system = active
            self.offset[system + letter] = value

    def rotate(self, code: str) -> None:
        """Rotate coordinates in the plane about a point, until G69."""
        if code == "G69":
            self.needs_both, self.rotation = self.needs_both or self.rotation != 1.0, 1.0 + 0j
            return
        names = PLANES[self.across]
        if self.tcp or not self.absolute or self.rotation != 1.0 or not {*names} & {*self.index}:
            self.refuse(code, "expected G49, G90, and one rotation at a time")
        if "R" not in self.words or (self.letters and self.letters != {*names}):
            self.refuse(code, f"expected R, and both {names[0]} and {names[1]} or neither")
        self.uncorrectable.setdefault(self.line, code)
        start = complex(*(self.position[self.index[x]] - self.place(x, 0.0) for x in names))
        self.pivot = complex(*map(self.value, names)) if self.letters else start
        self.rotation = exp(1j * tau * self.value("R") / FULL_TURN_DEG)
        self.rotated_about = self.across
        self.needs_both = True

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
        is_angle = letter in "ABCP" or (self.once == "G68" and letter == "R")
        value = self.words[letter] * (1.0 if is_angle else self.unit_mm)
        if letter in self.integers and value:
            if self.settings.least_increment:
                per_inch = 0.1 if self.unit_mm != 1.0 and not is_angle else 1.0
                return value * self.settings.least_increment * per_inch
            if not self.integer_word and self.dialect in {"", "fanuc", "haas", "okuma"}:
                self.integer_word = f"{letter}{self.words[letter]:g}", self.line
        return value

    def place(self, letter: str, value: float) -> float:
        """Return the axis position of an absolute word, mm or degrees."""
        is_longer = letter == "Z" and self.is_compensated and not self.tcp
        key = self.system + letter
        if key in self.offset:
            self.used.add(key)
            value += self.offset[key]
        value += self.shift["G52"].get(letter, 0.0) + self.shift["G92"].get(letter, 0.0)
        return value + (self.length_mm if is_longer else 0.0)

    def target(self) -> dict[int, float]:
        """Return the target of the block by number of the axis."""
        to: dict[int, float] = {}
        names = PLANES[self.rotated_about]
        is_rotated = self.rotation != 1.0 and bool(self.letters & {*names})
        if self.needs_both and self.letters & {*names}:
            if not (self.absolute and self.letters >= {*names}):
                self.refuse(self.motion, f"expected {' and '.join(names)} in the first move")
            self.needs_both = False
        for letter in (x for x in self.words if x in self.index):
            value, index = self.value(letter), self.index[letter]
            mode = self.modes.get(letter, "")
            is_absolute = mode == "AC" if mode else self.absolute
            to[index] = self.place(letter, value) if is_absolute else self.position[index] + value
        if is_rotated:
            self.turn_target(to, names)
        return to

    def turn_target(self, to: dict[int, float], names: str) -> None:
        """Rotate the target in the plane of G68."""
        zero = complex(*(self.place(x, 0.0) for x in names)) + self.pivot
        indices = [self.index[x] for x in names]
        start = complex(*(self.position[index] for index in indices)) - zero
        if self.absolute:
            before = start / self.rotation + zero
            first, second = indices
            new = complex(to.get(first, before.real), to.get(second, before.imag))
            turned = zero + self.rotation * (new - zero)
        else:
            step = complex(*(to.get(i, self.position[i]) - self.position[i] for i in indices))
            turned = zero + start + self.rotation * step
        to |= dict(zip(indices, (turned.real, turned.imag), strict=True))

    def line_to(self, to: Mapping[int, float], kind: int = STAND, *, bare: bool = False) -> None:
        """Move to positions of some axes: bare ones, or places of the tip with TCP."""
        tcp = self.tcp
        self.switch(tcp=tcp and not bare, length_mm=self.length_mm)
        before = self.position
        self.position = [to.get(index, at) for index, at in enumerate(before)]
        kind = kind or (RAPID if self.motion == "G0" else FEED)
        if self.lost - to.keys() and kind == FEED and self.first:
            axes = ", ".join(self.names[index] for index in self.lost - to.keys())
            self.refuse(self.motion, f"expected {axes} before: its position is unknown after G30")
        if self.lost and self.first:  # not a part of the path
            kind = STAND
            self.lost -= to.keys()
            self.unnamed_axes -= to.keys()
        elif not self.first or self.unnamed_axes & to.keys():
            self.unnamed_axes -= to.keys()
            self.record(STAND)
            self.first = len(self.rows) // self.width
        elif before == self.position:
            kind = STAND
        elif kind == FEED:  # from here on it is cut
            self.unnamed_axes.clear()
        if self.corner and self.motion == "G1":
            self.cut_corner(before, kind)
        self.record(kind)
        for letter in {",R", ",C"} & self.words.keys():
            if kind != FEED or self.tcp:
                self.refuse(letter, "expected a move by G1 without tool centre point")
            self.corner = letter, self.value(letter), len(self.rows) // self.width - 1
        self.switch(tcp=tcp, length_mm=self.length_mm)

    def cut_corner(self, at: Sequence[float], kind: int) -> None:
        """Round or chamfer the corner between the last move and the one to the position."""
        letter, size, row = self.corner or ("", 0.0, 0)
        self.corner = None
        indices = [self.index[x] for x in PLANES[self.across] if x in self.index]
        first = self.rows[(row - 1) * self.width + 8 : row * self.width]
        flat = [complex(*(place[i] for i in indices)) for place in (first, at, self.position)]
        arrival, departure = flat[1] - flat[0], flat[2] - flat[1]
        across = {*range(len(self.names))} - {*indices}
        is_flat = all(first[i] == at[i] == self.position[i] for i in across)
        if not is_flat or kind != FEED or not arrival or not departure:
            self.refuse(letter, "expected two moves in the plane")
        angle = phase(departure / arrival)
        length = size * tan(abs(angle) / 2.0) if letter == ",R" else size
        limit = min(abs(arrival), abs(departure))
        if size <= 0.0 or length > limit:
            self.refuse(f"{letter}{size:g}", f"expected a corner within moves of {limit:.4f} mm")
        starts = flat[1] - length * arrival / abs(arrival)
        ends = flat[1] + length * departure / abs(departure)
        for index, coordinate in zip(indices, (starts.real, starts.imag), strict=True):
            self.rows[row * self.width + 8 + index] = coordinate
        target, self.position = self.position, [*at]
        for index, coordinate in zip(indices, (ends.real, ends.imag), strict=True):
            self.position[index] = coordinate
        centre = starts + copysign(size, angle) * 1j * arrival / abs(arrival)
        if letter == ",R" and angle:
            self.record(ARC, angle, centre)
        else:
            self.record(FEED)
        self.position = target

    def centre_offset(self, name: str, letter: str) -> float:
        """Return the offset of the centre of an arc from its start along an axis."""
        if letter not in self.words:
            return 0.0
        is_absolute = self.modes.get(letter) == "AC"
        start = self.position[self.index[name]] if is_absolute else 0.0
        return (self.place(name, self.value(letter)) if is_absolute else self.value(letter)) - start

    def move_along_arc(self) -> None:
        to = self.target()
        names, centres = PLANES[self.across], CENTRES[self.across]
        if not set(names) <= self.index.keys():
            self.refuse(self.motion, f"expected axes {names} in {self.scene.machine.chain}")
        if self.lost or (self.rotation != 1.0 and self.across != self.rotated_about):
            self.refuse(self.motion, "expected all positions known, and one plane with G68")
        for letter in "IJK":
            if self.words.get(letter) and (letter not in centres or "R" in self.words):
                word = f"{letter}{self.words[letter]:g}"
                self.refuse(word, f"expected either R or {' and '.join(centres)}")
        start = complex(*(self.position[self.index[x]] for x in names))
        offset = self.rotation * complex(*map(self.centre_offset, names, centres))
        self.position = [to.get(index, at) for index, at in enumerate(self.position)]
        self.unnamed_axes.clear()
        end = complex(*(self.position[self.index[x]] for x in names))
        sense = 1.0 if self.motion == "G3" else -1.0
        if "R" in self.words:  # of the longer arc where it is negative
            radius, half = self.value("R"), (end - start) / 2.0
            if abs(half) < MIN_SPAN or abs(half) - abs(radius) > max(SLACK_MM, SLACK * abs(half)):
                chord = f"a chord of {2.0 * abs(half):.4f} mm, above 0"
                word = f"R{self.words['R']:g}"
                self.refuse(word, f"expected a radius for an arc of {chord}")
            height = sqrt(max(0.0, radius * radius - abs(half) ** 2))
            centre = start + half + copysign(sense, sense * radius) * height * 1j * half / abs(half)
        elif self.words.keys() & {*centres}:
            centre = start + offset
        else:
            self.refuse(self.motion, f"expected {' or '.join(centres)} or R with an arc")
        radius, other = abs(start - centre), abs(end - centre)
        if radius < MIN_SPAN or abs(radius - other) > max(SLACK_MM, SLACK * radius):
            radii = f"radii are {radius:.4f} and {other:.4f} mm"
            if radius < MIN_SPAN or self.dialect != "printer" or abs(radius - other) > radius / 10:
                self.refuse(self.motion, f"{radii}; expected one radius")
            self.remarks.setdefault(f"{self.motion}: {radii}, joined by a spiral", self.line)
        turns = self.words.get("P", 1.0)
        if turns > MAX_TURNS:
            self.refuse(f"P{turns:g}", f"expected at most {MAX_TURNS:,} turns of an arc")
        turn = sense * phase((end - centre) / (start - centre))
        extra_turns = max(ceil(turns), 1) - (turn > FULL_TURN_RAD)  # P: turns begun
        self.first = self.first or len(self.rows) // self.width
        self.record(ARC, sense * (turn + extra_turns * tau), centre)

    def drill(self) -> None:
        """Drill at the place of the line, K or L times: R plane, depth, pecks."""
        deep, motion = "XYZ"[self.across], self.motion
        stored = {deep, "R", "Q", "P"}
        if motion in PECKING and self.dialect == "haas":
            stored |= {*"IJK"}  # first peck, reduction, minimum
        elif motion in PECKING and "K" in self.words and "K" not in self.integers:
            expected = "repetitions without a decimal point, or --dialect haas (minimum peck)"
            self.refuse(f"K{self.words['K']:g}", f"expected {expected}")
        self.cycle |= {x: self.value(x) for x in stored & self.words.keys()}
        if deep not in self.index or not {deep, "R"} <= self.cycle.keys():
            self.refuse(motion, f"expected {deep} and R")
        index, letter = self.index[deep], "K" if self.words.keys() - stored >= {"K"} else "L"
        repeats = self.count(letter)
        initial = self.cycle.setdefault("initial", self.position[index])
        clear = initial + self.cycle["R"]
        bottom = clear + self.cycle[deep]
        if self.absolute:
            clear, bottom = (self.place(deep, self.cycle[letter]) for letter in ("R", deep))
        depths = self.depths(clear - bottom)
        moves = repeats * 3 * (len(depths) + 1)
        if moves > MAX_CYCLE_MOVES:
            expected = f"at most {MAX_CYCLE_MOVES:,} moves in a line"
            self.refuse(f"{letter}{repeats}", f"{moves:,} moves; expected {expected}")
        if motion in TAPPING | STOPPING:  # the spindle is reversed, stops, or dwells
            self.uncorrectable.setdefault(self.line, motion)
        if motion in {"G73", "G76"}:
            unknown = "retraction of its pecks" if motion == "G73" else "shift at its bottom"
            self.remarks.setdefault(f"{motion} without the {unknown}", self.line)
        for _ in range(repeats):
            self.line_to({index: max(clear, self.position[index])}, RAPID)
            self.line_to({**self.target(), index: self.position[index]}, RAPID)
            for before, depth in pairwise([0.0, *depths]):
                if motion == "G83" or not before:
                    self.line_to({index: clear}, RAPID)
                    self.line_to({index: clear - before}, RAPID)
                self.line_to({index: max(bottom, clear - depth)}, FEED)
            if motion in FED_BACK:
                self.line_to({index: clear}, FEED)
            self.line_to({index: max(initial, clear) if self.to_initial else clear}, RAPID)

    def depths(self, depth: float) -> Sequence[float]:
        """Return the depths of the pecks of a hole below its R plane, mm."""
        if self.motion not in PECKING and depth >= 0.0:
            return [depth]
        peck, reduction, least = abs(self.cycle.get("Q", 0.0)), 0.0, 0.0
        if "I" in self.cycle and not peck:
            peck, reduction, least = (abs(self.cycle.get(letter, 0.0)) for letter in "IJK")
            least = max(least, MIN_SPAN)
        depths = [peck]
        while depths[-1] < depth and peck > 0.0 and len(depths) <= MAX_CYCLE:
            # equal pecks without the rounding of their sum
            peck = max(peck - reduction, min(peck, least))
            depths.append(depths[-1] + peck if reduction else peck * (len(depths) + 1))
        if depth < 0.0 or peck <= 0.0 or len(depths) > MAX_CYCLE:
            expected = f"a depth below R, in up to {MAX_CYCLE:,} pecks of Q above 0"
            self.refuse(self.motion, f"{depth:g} mm below R; expected {expected}")
        return depths


CodeHandler: TypeAlias = Callable[[Interpreter, str], None]


def _modal(name: str, value: object) -> CodeHandler:
    return lambda control, _code: setattr(control, name, value)


def _ignore(_control: Interpreter, _code: str) -> None:
    """Leave the state as it is."""


COMPENSATING = ("G43", "G43.4", "G234", "G49")
_WITH_H = {*COMPENSATING, "G15", "G56"}
_ONCE = {
    **{code: code for code in ("G4", "G10", "G28", "G30", "G52", "G53", "G68", "G92", "G92.1")},
    "SUPA": "G53", "G153": "G53",
}  # fmt: skip
CODES: Mapping[str, CodeHandler] = {
    **{code: _modal("motion", code) for code in ("G0", "G1", "G2", "G3", *CYCLES)},
    "G80": _modal("motion", "G0"),
    "G17": _modal("across", 2), "G18": _modal("across", 1), "G19": _modal("across", 0),
    "G20": _modal("unit_mm", MM_PER_INCH), "G21": _modal("unit_mm", 1.0),
    "G90": _modal("absolute", value=True), "G91": _modal("absolute", value=False),
    "G93": _modal("inverse_time", value=True),
    **dict.fromkeys(("G94", "G95"), _modal("inverse_time", value=False)),
    "G98": _modal("to_initial", value=True), "G99": _modal("to_initial", value=False),
    **dict.fromkeys((*_SYSTEMS, "G54.1"), Interpreter.select_system),
    **dict.fromkeys(("G43", "G43.4", "G49"), Interpreter.compensate),
    **dict.fromkeys(("G41", "G42"), Interpreter.compensate_radius),
    **dict.fromkeys(("G52", "G92", "G92.1"), Interpreter.shift_by),
    **dict.fromkeys(("G68", "G69"), Interpreter.rotate),
    "G10": Interpreter.set_offset,
    **dict.fromkeys(("G4", "G28", "G30", "G53", "M97", "M98", "M99"), _ignore),
}  # fmt: skip
"""Effects of the supported codes."""
_DIALECT_CODES: Mapping[str, Mapping[str, CodeHandler | None]] = {  # None: another meaning
    "haas": {"G234": Interpreter.compensate, "G154": Interpreter.select_system},
    "sinumerik": {
        **dict.fromkeys(("SUPA", "G153"), _ignore),
        **dict.fromkeys(("G70", "G700"), _modal("unit_mm", MM_PER_INCH)),
        **dict.fromkeys(("G71", "G710"), _modal("unit_mm", 1.0)),
        **dict.fromkeys(("G58", "G59", "G10", "G52", "G68", "G92", "G92.1", "G43", *CYCLES)),
    },
    "okuma": {
        "G56": Interpreter.compensate, "G53": Interpreter.compensate,
        "G15": Interpreter.select_system,
        **dict.fromkeys(("G54", "G55", "G57", "G58", "G59", "G28", "G43", *CYCLES)),
    },
    "printer": {"G10": None},
}  # fmt: skip
MOTIONS: Mapping[str, Callable[[Interpreter], None]] = {
    **dict.fromkeys(("G0", "G1"), lambda control: control.line_to(control.target())),
    **dict.fromkeys(("G2", "G3"), Interpreter.move_along_arc),
    **dict.fromkeys(CYCLES, Interpreter.drill),
}
"""Motions of a block by its modal code."""
