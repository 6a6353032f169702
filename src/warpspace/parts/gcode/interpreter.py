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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from warpspace.exceptions import SceneError
from warpspace.formats.source import MAX_LINE, MAX_LINES
from warpspace.machine.limits import MAX_CALLS, MAX_LENGTH_MM, MAX_PROGRAM_BYTES, MAX_WORD
from warpspace.parts.gcode.codes import CODES, MOTIONS, ONCE, WITH_H, CodeHandler
from warpspace.parts.gcode.control import HEAD, RefusedError
from warpspace.parts.gcode.control_settings import (
    MAX_SHOWN,
    NUMBER,
    ControlSettings,
    shorten,
    spell,
)
from warpspace.parts.gcode.cycles import CYCLES, Cycles
from warpspace.parts.gcode.dialects.detection import DIALECTS, KLARTEXT, detect_dialects
from warpspace.parts.gcode.dialects.dialect import COMMON, MODAL_LETTERS, NO_AXES, WHOLE_BLOCK
from warpspace.parts.gcode.motion import CORNERS
from warpspace.parts.gcode.parsed import STAND, ParsedProgram
from warpspace.scene.model import Scene
from warpspace.scene.text_files import check_file

MAX_REMARKS = 1000  # words listed as not understood
WORD = re.compile(
    rf"([A-Z])\s*+({NUMBER})(?![.\d#\[=]|E\d++(?![.\d]))"  # a letter, its number
    r"|\([^()]*+\)|;.*+"  # comments
    rf"|(CR|RPL|RND|CHR|CHF|[A-Z]|S\d)\s*+=\s*+(?:([AI]C)\s*+\()?\s*+({NUMBER}|\"[^\"]*+\")(?(4)\s*+\))"
    r"(?![^\s;(])"  # an assignment of SINUMERIK
    r"|(\S[^\s(;]*+)",  # anything else
    re.IGNORECASE | re.ASCII,
)
_SKIP = re.compile(r"(N\s*+\d++\s*+)?+(/[/\d]*+\s*+)(.*+)", re.IGNORECASE)
_HEADER = re.compile(  # lines before the first block
    r"%.*+|\$[^%\s]++%|O?<[^<>]++>\s*+(\([^()]*+\)\s*+)*+|[O:]\s*+\d{1,8}+\s*+(\([^()]*+\)\s*+)*+",
    re.IGNORECASE,
)
_CORNER = re.compile(rf"(,[RC])\s*+({NUMBER})")
_LABEL = re.compile(r"\s*+(?:/\d?\s*+)?+(?:([O:N])\s*+0*+(\d++))", re.IGNORECASE)
_FLOW = re.compile(  # of LinuxCNC, without variables
    r"O\s*(\d++|<[^<>]++>)\s*(SUB|ENDSUB|CALL|REPEAT|ENDREPEAT)\s*(?:\[\s*(\d{1,6})\s*\])?\s*"
    r"(?:[(;].*)?",
    re.IGNORECASE,
)
_CONTROL_FLOW = re.compile(r".*[#\[<=]|GOTO|IF|WHILE|FOR|LOOP|REPEAT|CALL")
_AXES, _POSITIONS = frozenset("XYZUVWABC"), frozenset("XYZUVWABCIJKRQ")
_CYCLE_LETTERS = "RQPKL"
CALLS = frozenset(("M97", "M98", "M99"))
_LETTERS = {  # beside axes, by the code that they belong to
    "G0": ["E"], "G1": ["E", ",R", ",C", "CHF"], **dict.fromkeys(("G2", "G3"), "IJKRPE"),
    **dict.fromkeys(CYCLES, _CYCLE_LETTERS),
    "G4": "PXUFS", "G10": "LPR", "G54.1": "P", "G154": "P", "G68": "R", "G92": "E",
    "M98": "PL", "M97": "PL", "G68.2": "IJK", "ROT": ["RPL"], "AROT": ["RPL"],
}  # fmt: skip


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
    if control.corner and not control.refused:
        control.refused[control.line] = control.corner[0]
        control.reasons[control.line] = "; expected G1 after a corner"
    if not control.first:
        problems = [f"line {n}: {word}{control.reasons[n]}" for n, word in control.refused.items()]
        raise SceneError(name, problems[:1] or ["moves no axis; expected blocks in G-code"])
    rows = np.frombuffer(control.rows).reshape(-1, control.width)
    line, kind, tcp, across, frame = rows[:, :5].T.astype(np.int64)
    kind[: control.first] = STAND
    return ParsedProgram(
        scene, control.names, line, kind, tcp > 0, across, frame, rows[:, 5], rows[:, 6],
        rows[:, 7] + 1j * rows[:, 8], rows[:, HEAD:], np.array(control.frames), control.refused,
        control.reasons, control.remarks, control.skipped, control.uncorrectable,
        tuple(key for key, _ in control.settings.offset if key not in control.used),
        control.dialect, control.signs, control.integer_word, len(np.unique(line[kind != STAND])),
    )  # fmt: skip


class Interpreter(Cycles):
    """Control that reads and executes the blocks of a program."""

    def __init__(self, scene: Scene, settings: ControlSettings, name: str) -> None:
        super().__init__(scene, settings, name)
        self.handlers: Mapping[str, CodeHandler] = {}
        self.motionless: Mapping[str, str] = {}
        self.once_codes: Mapping[str, str] = {}  # codes whose block has another motion, or none
        self.calls, self.next_line = list[tuple[int, int, int]](), 0  # of subprograms
        self.labels: dict[tuple[str, float], int] = {}
        self.flow: dict[tuple[str, str], int] = {}  # lines of O-words by word and name
        self.ordinary = (MODAL_LETTERS - {"H"}) | self.index.keys()  # checked no further

    def choose_dialect(self, lines: Sequence[str]) -> None:
        """Set the dialect, from the options or from its signs in the program."""
        self.dialect: str = self.settings.dialect
        if self.dialect == "auto":
            signs = detect_dialects(lines)
            self.dialect = next(iter(signs)) if len(signs) == 1 else ""
            listed = [f"{name} (line {line}, {sign})" for name, (line, sign) in signs.items()]
            self.signs = ", ".join(map(shorten, listed))
        dialect = DIALECTS.get(self.dialect)
        codes = {**CODES, **(dialect.codes if dialect else {})}
        self.once_codes = {**ONCE, **(dialect.once if dialect else {})}
        self.handlers = {code: handler for code, handler in codes.items() if handler}
        self.motionless = {**COMMON, **(dialect.motionless if dialect else {})}

    def run(self, lines: Iterable[str]) -> Iterator[str]:
        """Execute lines and return them one by one, up to the first refused word."""
        program = [*islice(lines, MAX_LINES + 1)]
        self.choose_dialect(program)
        for line, text in enumerate(program, start=1):
            label = _LABEL.match(text)
            if label and len(label[2]) < MAX_SHOWN:
                kind = "N" if label[1] in "nN" else "O"
                self.labels.setdefault((kind, int(label[2])), line)
            flow = _FLOW.fullmatch(text.strip()) if text.lstrip().startswith(("O", "o")) else None
            if flow:
                self.flow.setdefault((flow[2].upper(), flow[1].upper()), line)
        executed = 0
        while self.next_line < len(program):
            raw, self.line, executed = program[self.next_line], self.next_line + 1, executed + 1
            self.next_line += 1
            if executed > MAX_LINES or len(raw) > MAX_LINE or len(self.remarks) > MAX_REMARKS:
                size = f"{MAX_LINES:,} lines of {MAX_LINE:,} characters, {MAX_REMARKS:,}"
                self.fail(f"is no program in G-code; expected at most {size} other words")
            self.codes, self.words, self.tokens = [], {}, []
            self.integers, self.modes = set[str](), {}
            self.skip, self.once, self.arguments, text = "", "", "", raw.replace("\0", "").strip()
            if text.startswith("%") and self.has_blocks and not self.calls:
                return
            skipped = _SKIP.fullmatch(text)
            if skipped:
                self.remarks.setdefault("/", self.line)
                self.skip, text = skipped[2], (skipped[1] or "") + skipped[3]
            try:
                if not self.has_blocks and KLARTEXT.match(text):
                    self.refuse("BEGIN PGM", "HEIDENHAIN Klartext; expected G-code (ISO)")
                flow = _FLOW.fullmatch(text) if self.dialect in {"", "linuxcnc"} else None
                if flow:
                    self.follow_flow(flow[1].upper(), flow[2].upper(), flow[3])
                elif self.has_blocks or not _HEADER.fullmatch(text):
                    self.read_words(text)
                if not self.refused:
                    self.execute_block()
                    yield raw
            except RefusedError as refusal:
                word, reason = refusal.args
                self.refused.setdefault(self.line, word)
                self.reasons.setdefault(self.line, reason and f"; {reason}")
            self.has_blocks = self.has_blocks or bool(self.codes or self.words)
            if {"M2", "M30"} & {*self.codes} or len(self.refused) > MAX_REMARKS:
                return
        if self.calls and not self.refused:
            self.refused[self.line] = program[-1].strip()[:MAX_SHOWN] or "end of file"
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
                if match[0][0] == "(" and self.codes[-1:] == ["CYCLE800"]:
                    self.arguments = match[0][1:-1]
                continue
            is_code = letter in {"G", "M"} or bool(other)
            word = spell(letter, number) if letter and not name else shorten(match[0].upper())
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
                    f", dialect {name}"
                    for name, dialect in DIALECTS.items()
                    if word in dialect.motionless or dialect.codes.get(word)
                ]
                options = "".join(dialects) + f", or {word} to be skipped"
                self.refuse(word, f"expected a word that is executed or moves no axis{options}")
        if ignored:
            self.skipped.setdefault(" ".join(ignored), self.line)

    def read_number(self, word: str, letter: str, number: str, mode: str) -> None:
        """Read a letter and its number, or an assignment of SINUMERIK."""
        spelling = f"{letter}{shorten(number)}"
        if "=" in word:
            is_text = number.startswith('"')
            if self.dialect != "sinumerik" or (is_text and letter != "T"):
                self.refuse(shorten(word.upper()), "expected a letter and a number")
            names = {"CR": "R", "RND": ",R", "CHR": ",C", "RPL": "RPL", "CHF": "CHF"}
            letter, number = names.get(letter, letter[0]), "0" if is_text else number
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
            corners = CORNERS & self.words.keys()
            if letter in corners and (
                len(corners) > 1 or not self.words.keys() & self.index.keys()
            ):
                self.refuse(word, "expected one corner and a move in its block")
            if letter in _AXES and letter not in self.index and letter not in claimed:
                axes = f"{self.scene.machine.chain}: {', '.join(self.index)}"
                self.refuse(word, f"expected an axis of {axes}")
            if letter not in _AXES and letter not in claimed:
                self.refuse(word, f"expected no {letter} with {self.once or motion}")

    def execute_block(self) -> None:
        """Execute the codes of the current block, then its motion."""
        motions = [code for code in self.codes if code in MOTIONS]
        once = [code for code in self.codes if self.once_codes.get(code)]
        if len({*motions}) > 1 or len(once) > 1:
            first, *_, last = once if len(once) > 1 else motions
            self.refuse(last, f"expected it in another block than {first}")
        self.once = self.once_codes[once[0]] if once else ""
        motion = motions[0] if motions else "G0" if "G80" in self.codes else self.motion
        if not self.words.keys() <= self.ordinary:
            self.check_letters(motion)
        if "H" in self.words and not WITH_H & {*self.codes}:
            self.remarks.setdefault(f"H{self.words['H']:g} without G43", self.line)
        # X of G4 is a time
        axes = self.words.keys() & _AXES
        self.letters = set[str]() if self.once == "G4" else axes
        for code in self.codes if axes else ():
            if code not in self.handlers and self.motionless[code].endswith(NO_AXES):
                self.refuse(code, "expected no axis in its block")
        if self.dialect == "sinumerik" and "D" in self.words:
            self.compensate("D")
        for code in self.codes:
            if code in self.handlers:
                self.handlers[code](self, code)
            elif code in {"G5", "G8"} and "P" not in self.words:
                self.refuse(code, "expected P")
        self.cycle = self.cycle if self.motion in CYCLES else {}
        if self.corner and (self.once or (self.letters and self.motion != "G1")):
            self.refuse(self.once or self.motion, f"expected G1 after a corner {self.corner[0]}")
        calls = [code for code in self.codes if code in CALLS]
        subprogram = self.find_subprogram(calls) if calls else None
        is_arc = self.motion in {"G2", "G3"} and self.words.keys() & {*"IJKR"}
        if self.once in {"G28", "G30"}:
            self.move_home()
        elif self.once == "G53" and self.letters:  # to axis positions
            self.line_to({self.index[x]: self.value(x) for x in sorted(self.letters)}, bare=True)
        elif not self.once and (self.letters or is_arc):
            if "E" in self.words:
                self.remarks.setdefault("E is no axis", self.line)
            MOTIONS[self.motion](self)
        if subprogram:
            self.enter(*subprogram)
        elif "M99" in self.codes:
            self.leave()

    def follow_flow(self, name: str, word: str, count: str | None) -> None:
        """Continue as an O-word of LinuxCNC demands."""
        self.uncorrectable.setdefault(self.line, f"O{name}")
        other = {"SUB": "ENDSUB", "CALL": "SUB", "REPEAT": "ENDREPEAT"}.get(word)
        at = self.flow.get((other or word, name))
        if at is None or (word == "REPEAT") != (count is not None) or not (other or self.calls):
            partner = other or "CALL or REPEAT before"
            self.refuse(f"O{name} {word}", f"expected O{name} {partner}, [number] with REPEAT")
        if other is None:
            self.leave()
        elif word == "SUB":
            self.next_line = at
        else:
            start, caller = (at, self.next_line) if word == "CALL" else (self.next_line, at)
            self.enter(word, start, int(count or 1), caller)

    def enter(self, word: str, start: int, repeats: int, caller: int) -> None:
        """Continue at a subprogram, or after it."""
        if len(self.calls) >= MAX_CALLS:
            self.refuse(word, f"expected at most {MAX_CALLS} subprograms within each other")
        self.next_line = start if repeats else caller
        if repeats:
            self.calls.append((start, repeats - 1, caller))

    def leave(self) -> None:
        """Repeat a subprogram, continue after its call, or end the program."""
        self.enter("M99", *(self.calls.pop() if self.calls else (0, 0, MAX_LINES)))

    def find_subprogram(self, codes: Sequence[str]) -> tuple[str, int, int, int] | None:
        """Find the subprogram that a block calls: code, start, repetitions, and line after it."""
        for other in codes[1:]:
            self.refuse(other, f"expected it in another block than {codes[0]}")
        code = codes[0]
        self.uncorrectable.setdefault(self.line, code)
        if code == "M99":
            return None
        kind, number, repeats = "NO"[code == "M98"], self.words.get("P", 0.0), self.count("L")
        if (kind, number) not in self.labels and "L" not in self.words:
            repeats, number = max(int(number) // 10_000, 1), number % 10_000
        if (kind, number) not in self.labels:
            self.refuse(f"{code} P{number:g}", f"expected {kind}{number:g} in this file")
        return code, self.labels[kind, int(number)] - (kind == "N"), repeats, self.next_line
