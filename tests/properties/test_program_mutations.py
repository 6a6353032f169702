"""Mutated programs against a second interpreter, with frames as plain 4 × 4 matrices.

A mutated word either leads to the path of the second interpreter, or ends the path before its block
with line, word and expectation: no number changes silently.
"""

import re
from collections.abc import Iterator
from math import atan2, cos, pi, radians, sin, tan
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from warpspace.exceptions import SceneError
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.gcode.parsed import ARC, STAND
from warpspace.scene.library import parse_scene

LINEAR = "X = [-900, 900]\nY = [-900, 900]\nZ = [-900, 900]\n"
TABLE = parse_scene(
    'title = "m"\n[machine]\nchain = "wCBFXYZt"\n[machine.offset_mm]\nC = [0, 0, 40]\n'
    f"[machine.travel]\n{LINEAR}B = [-120, 120]\nC = [-360, 360]\n"
    f"[workspace]\n{LINEAR}B = 0\nC = 0",
    "table",
)
ZERO = np.array([40.0, -25.0, 70.0])  # G54 on the machine
OFFSET = tuple(zip(("G54X", "G54Y", "G54Z"), ZERO.tolist(), strict=True))
PROGRAMS = {
    "sinumerik": """G0 X0 Y0 Z10 B0 C0
TRANS X100 Y50
G0 X0 Y0 Z5
G1 X20 F100
AROT Z30
X10 Y5 Z2
ATRANS X-5 Y8 Z1
X0 Y0 Z0
MIRROR X0
X5 Y6 Z1
AMIRROR Y0
X3 Y3 Z3
ROT RPL=45
X1 Y2 Z2
TRANS
X0 Y0 Z0
X50 RND=5
Y50 CHR=2
X0 CHF=2
Y0
G91 X5 Z1
G90 X0 Y9
CYCLE800(0,"T",0,27,5,-3,12,10,-20,35,0,0,0,-1)
G0 X0 Y0 Z20
G1 Z-5
X30 Y10
M30""",
    "fanuc": """G0 X0 Y0 Z10 B0 C0
G51.1 X10
G1 X20 Y0 F500
X25 Y5
G50.1 X10
X0 Y0
G68 X5 Y5 R30
X10 Y0
X10 Y5 Z0
G69
X0 Y0
G52 X7 Y3
X1 Y1
G52 X0 Y0
X0 Y0 Z0
X50 ,R5.
Y50 ,C2.
X0
M98 P12 L2
X1 Y1 Z1
G68.2 X5 Y-3 Z12 I25 J20 K-70
G53.1
G0 X0 Y0 Z20
G1 Z-5
X30 Y10
M30
O12
G91 X3
Y2 Z1
G90
M99""",
    "haas": """G0 X0 Y0 Z90 B0 C0
G101 X0
X10 Y4 Z80
G100
X10 Y4
B30 C45
G254
G0 X0 Y0 Z50
G1 X3 Z5 F100
Y9
G255
G0 X1 Y2 Z60
M97 P5 L2
M30
N5 G91 X3
G90 Y7
M99""",
    "linuxcnc": """G0 X0 Y0 Z10 B0 C0
o100 sub
G91 X1 Y2
G90
o100 endsub
G1 X2 F100
o100 call
o2 repeat [3]
o100 call
X0 Z5
o2 endrepeat
o3 repeat [0]
X99
o3 endrepeat
Z9
M2""",
}
FRAMES = ("TRANS", "ROT", "MIRROR")
ONCE = {
    "fanuc": ("G51.1", "G50.1", "G68", "G52", "G68.2", "G53.1"),
    "haas": ("G101", "G100", "G51.1", "G50.1", "G52", "G68"),
    "linuxcnc": ("G51.1", "G50.1", "G52", "G68"),
    "sinumerik": (),
}  # fmt: skip
KNOWN = {
    "fanuc": ("G69", "M98", "M99"), "haas": ("G254", "G255", "M97", "M98", "M99"),
    "linuxcnc": ("M98", "M99"),
    "sinumerik": (),
}  # fmt: skip
FOREIGN = (
    "TRANS", "AROT Z30", "G101 X0", "G254", "G68.2 X0 Y0", "G53.1", "G51.1 X0", "G68 R30", "RND=5",
    "CHF=2", ",R5", "CYCLE800()", "o100 call", "M98 P12", "M97 P5", "RPL=45", "TRAORI", "G50.1",
    "MIRROR X0", "R30", "L2", "I5", "M99", "endsub", "SUPA", "G234", "TRAFOOF", "ATRANS X1", "K1",
)  # fmt: skip
OTHERS = {
    *("M0", "M3", "M5", "M9", "G2", "G3", "G4", "G9", "G28", "G53", "G54", "G69", "G80"),
    *("G234", "TRAORI", "TRAFOOF", "SUPA"),
}
WORD = re.compile(
    r"\s*(?:(TRAORI|TRAFOOF|SUPA|A?(?:TRANS|ROT|MIRROR))(?![A-Z])|(CYCLE800)\(([^()]*)\)|(,[RC])\s*|((?:RND|CHR|CHF|RPL)"
    r"\s*=\s*)|([A-Z])\s*)([+-]?(?:\d+\.?\d*|\.\d+)(?![.\d]))?"
)
FLOW = re.compile(r"o(\d+)\s*(sub|endsub|call|repeat|endrepeat)\s*(?:\[\s*(\d+)\s*\])?")


class RefusalError(Exception):
    """A block that no control of the dialect executes as written."""


class UnknownError(Exception):
    """A block that this interpreter does not follow; the product may."""


def turn(axis: int, angle_deg: float) -> np.ndarray:
    matrix, (i, j) = np.eye(4), ((1, 2), (2, 0), (0, 1))[axis]
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def shift(vector: Any) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def words_of(text: str, dialect: str) -> tuple[list[str], dict[str, float], str]:
    """Parse a block: codes, words, and arguments of a cycle."""
    codes, words, arguments, at = list[str](), dict[str, float](), "", 0
    text = text.strip()
    while at < len(text):
        match = WORD.match(text, at)
        if not match:
            raise RefusalError(text)
        frame, cycle, inside, corner, assignment, letter, number = match.groups()
        at = match.end()
        key = frame or cycle or corner or assignment or letter
        if frame or cycle:
            if frame in OTHERS and not number:
                raise UnknownError
            if dialect != "sinumerik" or number:
                raise RefusalError(text)
            codes.append(key)
            arguments = inside or arguments
        elif number is None:
            raise RefusalError(text)
        elif letter in {"G", "M"}:
            codes.append(f"{letter}{float(number):g}")
        else:
            key = re.sub(r"[\s=]", "", key)
            if key in words or (assignment and dialect != "sinumerik"):
                raise RefusalError(text)
            words[key] = float(number)
    return codes, words, arguments


class Reference:
    """A control with one machine: vertices of the path in words of the machine axes."""

    def __init__(self, lines: list[str], dialect: str) -> None:
        self.lines, self.dialect = lines, dialect
        self.frame, self.at, self.rotary = np.eye(4), np.zeros(3), {"B": 0.0, "C": 0.0}
        self.known, self.absolute, self.feeds = True, True, False
        self.set_by, self.local_shift, self.carried = "", np.zeros(3), np.zeros(3)
        self.tilt: np.ndarray | None = None
        self.corner: tuple[str, float] | None = None
        self.calls = list[tuple[int, int, int]]()
        self.vertices = list[np.ndarray]()

    def label(self, pattern: str) -> int:
        matches = (n for n, line in enumerate(self.lines) if re.match(pattern, line, re.IGNORECASE))
        found = next(matches, None)
        if found is None:
            raise RefusalError(pattern)
        return found

    def run(self) -> str:
        """Execute the program; return why it ended."""
        line = 0
        for _ in range(1000):
            if line >= len(self.lines):
                return "refusal" if self.calls or self.corner else "end"
            text = self.lines[line].strip()
            try:
                following = self.follow(text, line)
            except RefusalError:
                return "refusal"
            except UnknownError:
                return "unknown"
            if following is None:
                return "refusal" if self.corner else "end"
            line = following
        return "unknown"

    def leave(self) -> int | None:
        if not self.calls:
            return None
        start, repeats, back = self.calls.pop()
        if repeats:
            self.calls.append((start, repeats - 1, back))
        return start if repeats else back

    def follow(self, text: str, line: int) -> int | None:
        """Execute a line; return the next one."""
        if text[:1] in {"o", "O"}:
            flow = FLOW.fullmatch(text.lower()) if self.dialect == "linuxcnc" else None
            if not flow:
                raise RefusalError(text)
            name, word, count = flow.groups()
            if (count is not None) != (word == "repeat"):
                raise RefusalError(text)
            if word == "sub":
                return self.label(rf"\s*o0*{name}\s*endsub\s*$") + 1
            if word == "call":
                self.calls.append((0, 0, line + 1))
                return self.label(rf"\s*o0*{name}\s*sub\s*$") + 1
            if word == "repeat":
                end = self.label(rf"\s*o0*{name}\s*endrepeat\s*$") + 1
                if int(count):
                    self.calls.append((line + 1, int(count) - 1, end))
                return line + 1 if int(count) else end
            if not self.calls:
                raise RefusalError(text)
            return self.leave()
        codes, words, arguments = words_of(text, self.dialect)
        self.execute(codes, words, arguments)
        jumps = {"M97", "M98", "M99"} & {*codes}
        if jumps and {*codes} & {"M2", "M30"}:
            raise UnknownError
        if "M99" in jumps:
            return self.leave()
        if jumps:
            count = words.get("L", 1.0)
            if count % 1 or count < 0:
                raise RefusalError(text)
            letter = "N" if "M97" in jumps else "O"
            start = self.label(rf"\s*{letter}\s*0*{words.get('P', 0):g}(?!\d)")
            start += letter == "O"
            if count:
                self.calls.append((start, int(count) - 1, line + 1))
            return start if count else line + 1
        return None if {*codes} & {"M2", "M30"} else line + 1

    def execute(self, codes: list[str], words: dict[str, float], arguments: str) -> None:
        own = [code for code in codes if code.lstrip("A") in FRAMES or code == "CYCLE800"]
        once = [code for code in codes if code in ONCE[self.dialect]]
        modal = {"G0", "G1", "G90", "G91", "M2", "M30", "G17", *KNOWN[self.dialect]}
        if {*codes} & (OTHERS - modal):
            raise UnknownError
        if not {*codes} <= {*modal, *own, *once}:
            raise RefusalError
        if {"G0", "G1"} <= {*codes} or (own and codes != own) or len(own) > 1 or len(once) > 1:
            raise RefusalError
        if len({"M97", "M98", "M99"} & {*codes}) > 1:
            raise RefusalError
        for code in codes:
            self.absolute = {"G90": True, "G91": False}.get(code, self.absolute)
            self.feeds = {"G0": False, "G1": True}.get(code, self.feeds)
        axes = words.keys() & {*"XYZ"}
        if own or once:
            if self.corner or words.keys() & {"B", "C"}:
                raise RefusalError
            if {*codes} & {"G254", "G255", "G69"}:
                raise UnknownError
            calls = {*"FST"} | ({"P", "L"} if {"M97", "M98"} & {*codes} else set())
            words = {x: value for x, value in words.items() if x not in calls}
            self.change(own[0] if own else once[0], words, arguments)
            return
        allowed = {*"XYZBCFNSTDH"} | ({*"PL"} if {"M97", "M98"} & {*codes} else set())
        corners = words.keys() & {",R", ",C", "RND", "CHR", "CHF"}
        if words.keys() - allowed - corners or (corners and not self.feeds) or len(corners) > 1:
            raise RefusalError
        for code in codes:
            if code == "G69" and self.set_by in {"G68", "G53.1", "G68.2"}:
                self.known = self.known and self.set_by == "G68"
                self.frame, self.set_by, self.tilt = np.eye(4), "", None
            if code in {"G254", "G255"}:
                self.carried = np.zeros(3)
                if code == "G254":
                    arm = turn(2, self.rotary["C"]) @ [*(ZERO - [0, 0, 40]), 1.0] + [0, 0, 40, 0]
                    self.carried = (turn(1, self.rotary["B"]) @ arm)[:3] - ZERO
                    self.set_by = code
                elif self.set_by == "G254":
                    self.set_by = ""
        for letter in words.keys() & {"B", "C"}:
            value = words[letter] + (0.0 if self.absolute else self.rotary[letter])
            if value != self.rotary[letter] and (self.set_by or corners or self.corner):
                raise RefusalError if self.set_by in {"G53.1", "CYCLE800", "G254"} else UnknownError
            self.rotary[letter] = value
        if axes or corners:
            self.move(words, corners)

    def change(self, code: str, words: dict[str, float], arguments: str) -> None:
        """Change the frame."""
        axes = {x: words[x] for x in "XYZ" if x in words}
        kind = code[1:] if code[0] == "A" else code
        if kind in FRAMES:
            if self.set_by == "CYCLE800":
                raise UnknownError
            if words.keys() - {*"XYZN", *({"RPL"} if kind == "ROT" else ())} or (
                kind == "ROT" and len(words.keys() - {"N"}) > 1
            ):
                raise RefusalError
            new = np.eye(4)
            for x, value in {**axes, **({"Z": words["RPL"]} if "RPL" in words else {})}.items():
                row = "XYZ".index(x)
                if kind == "ROT":
                    new = turn(row, value)
                elif kind == "TRANS":
                    new[row, 3] = value
                else:
                    new[row, row] = -1.0
            self.frame = self.frame @ new if code != kind else new
            return
        if code == "G52":
            if words.keys() - {*"XYZN"}:
                raise RefusalError
            for x, value in axes.items():
                self.local_shift["XYZ".index(x)] = value
            return
        if code in {"G50.1", "G100"}:
            if self.set_by in {"G51.1", "G101"}:
                self.frame, self.set_by = np.eye(4), ""
            return
        if code == "G53.1":
            if self.tilt is None or words:
                raise RefusalError
            self.frame, self.set_by, self.known, self.tilt = self.tilt, code, False, None
            return
        if code == "CYCLE800":
            numbers = [re.sub(r"\"[^\"]*\"", "0", part) or "0" for part in arguments.split(",")]
            if words or len(numbers) < 14:
                raise UnknownError if not words and arguments == "" else RefusalError
            try:
                values = [float(number) for number in numbers]
            except ValueError:
                raise RefusalError from None
            if values[3] != 27 or values[13] != -1 or not np.array_equal(self.frame, np.eye(4)):
                raise UnknownError
            a, b, c = values[7:10]
            self.frame = shift(values[4:7]) @ turn(2, c) @ turn(1, b) @ turn(0, a)
            self.frame, self.set_by, self.known = self.frame @ shift(values[10:13]), code, False
            return
        if self.set_by or self.tilt is not None or not self.absolute:
            raise RefusalError
        if code == "G68.2":
            if not {*"XYZIJK"} <= words.keys() <= {*"XYZIJKN"}:
                raise RefusalError
            i, j, k = (words[x] for x in "IJK")
            self.tilt = shift(list(axes.values())) @ turn(2, i) @ turn(0, j) @ turn(2, k)
            return
        if code == "G68":
            if "R" not in words or words.keys() - {*"XYRN"} or len(axes) == 1:
                raise RefusalError
            local = self.at - self.local_shift
            pivot = [axes.get("X", local[0]), axes.get("Y", local[1]), 0.0]
            self.frame = shift(pivot) @ turn(2, words["R"]) @ shift(np.negative(pivot))
        else:  # a mirror
            if not axes or words.keys() - {*"XYZN"}:
                raise RefusalError
            for x, value in axes.items():
                row = "XYZ".index(x)
                self.frame[row, row], self.frame[row, 3] = -1.0, 2.0 * value
            if code == "G101" and any(axes.values()):
                raise RefusalError
        self.set_by = code

    def move(self, words: dict[str, float], corners: Any) -> None:
        """Move to the words in the frame; cut the corner before."""
        if self.tilt is not None:
            raise RefusalError
        if not self.known and not ({*"XYZ"} <= words.keys() and self.absolute):
            raise UnknownError
        self.known = True
        base = self.local_shift + self.carried
        local = (np.linalg.inv(self.frame) @ [*(self.at - base), 1.0])[:3]
        for row, x in enumerate("XYZ"):
            if x in words:
                local[row] = words[x] + (0.0 if self.absolute else local[row])
        to = (self.frame @ [*local, 1.0])[:3] + base
        moves = np.abs(to - self.at).max() > 1e-12
        if self.corner:
            if not self.feeds or not moves:
                raise RefusalError
            self.vertices[-1:] = self.cut(self.vertices[-2], self.vertices[-1], to)
        if corners and not moves:
            raise RefusalError
        self.corner = next(((name, words[name]) for name in corners), None)
        if moves:
            self.vertices.append(to)
            self.at = to

    def cut(self, first: np.ndarray, at: np.ndarray, to: np.ndarray) -> Iterator[np.ndarray]:
        name, size = self.corner or ("", 0.0)
        arrival, departure = at - first, to - at
        before, after = np.linalg.norm(arrival), np.linalg.norm(departure)
        angle = abs(atan2(np.cross(arrival, departure)[2], arrival @ departure))
        length = size
        if name in {",R", "RND"}:
            length = size * tan(angle / 2)
        elif name == "CHF":
            length = size / (2 * cos(angle / 2))
        is_flat = not arrival[2] and not departure[2] and angle < pi - 1e-9
        if not is_flat or length > min(before, after) or size <= 0:
            raise RefusalError
        yield at - length * arrival / before
        yield at + length * departure / after


def distinct(ends: np.ndarray) -> np.ndarray:
    same = np.zeros(len(ends), bool)
    same[1:] = np.abs(np.diff(ends, axis=0)).max(axis=1, initial=0.0) < 1e-9
    return ends[~same]


def product(lines: list[str], dialect: Any) -> tuple[np.ndarray, str]:
    options = ControlSettings(dialect=dialect, offset=OFFSET)
    try:
        program = read_program(TABLE, lines, options)
    except SceneError as error:
        message = str(error)
    else:
        message = ""
    if message:
        assert re.search(r"line \d+: \S.*; .*expected", message)
        return np.zeros((0, 3)), "refused"
    assert all(program.refused.values())
    assert all("expected" in reason for reason in program.reasons.values())
    ends = program.end[program.kind != STAND][:, [program.axes.index(x) for x in "XYZ"]] - ZERO
    assert {*program.kind.tolist()} <= {*range(ARC + 1)}
    return distinct(ends), "refused" if program.refused else "end"


def check(lines: list[str], dialect: str) -> None:
    reference = Reference(lines, dialect)
    outcome = reference.run()
    expected = distinct(np.array([np.zeros(3), *reference.vertices])[1:])
    path, end = product(lines, dialect)
    if reference.corner:  # not cut
        expected = expected[:-1]
    if end == "refused":  # the last corner may not be cut
        path = path[:-1]
    else:
        assert outcome != "refusal"
        assert outcome == "unknown" or len(path) == len(expected)
    count = min(len(path), len(expected))
    np.testing.assert_allclose(path[:count], expected[:count], atol=1e-8)
    assert outcome == "unknown" or len(path) <= len(expected)


@pytest.mark.parametrize("dialect", PROGRAMS)
def test_both_interpreters_agree(dialect: str):
    lines = PROGRAMS[dialect].splitlines()
    assert Reference(lines, dialect).run() == "end"
    assert product(lines, dialect)[1] == "end"
    check(lines, dialect)


def mutate(lines: list[str], kind: str, number: int, at: int, other: int, word: str) -> None:
    words = lines[number].split()
    index = at % len(words)
    if kind == "duplicate":
        words.insert(other % (len(words) + 1), words[index])
    elif kind == "truncate":
        words[index] = words[index][:-1]
    elif kind == "double sign":
        words[index] = re.sub(
            r"([+-]?)(\d)", r"-\1-\2" if at % 2 else r"--\2", words[index], count=1
        )
    elif kind == "insert":
        words.insert(index, word)
    elif kind == "drop a character":
        text = lines[number]
        lines[number] = text[: at % len(text)] + text[at % len(text) + 1 :]
        return
    elif kind in {"move", "drop"}:
        moved = words.pop(index)
        if kind == "move":
            to = 1 + other % (len(lines) - 1)
            target = words if to == number else lines[to].split()
            target.insert(other % (len(target) + 1), moved)
            lines[to] = " ".join(target)
            if to == number:
                return
    lines[number] = " ".join(words)


KINDS = ["duplicate", "truncate", "double sign", "insert", "drop a character", "move", "drop"]


@settings(max_examples=400, deadline=None)
@given(
    dialect=st.sampled_from([*PROGRAMS]),
    kind=st.sampled_from(KINDS),
    number=st.integers(1, 40),
    at=st.integers(0, 60),
    other=st.integers(0, 200),
    word=st.sampled_from(FOREIGN),
)
def test_no_mutation_changes_a_number_silently(
    dialect: str, kind: str, number: int, at: int, other: int, word: str
):
    lines = PROGRAMS[dialect].splitlines()
    mutate(lines, kind, 1 + number % (len(lines) - 1), at, other, word)
    check(lines, dialect)
