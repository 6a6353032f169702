"""A program as a control runs it: modal words, and the moves that they come to.

**Words** are axis positions plus the active offset; after G53 they are axis positions. A tool of
length L reaches L beyond the scene's tool point, against the tool axis: tip = tool point − L · tool
axis in the tool frame. G43 H moves Z by +L, so that the tip is at the programmed Z while rotary
axes are at zero. A change of length or offset moves nothing by itself.

**Without tool centre point** (TCP) all axes go in proportion, arcs are arcs of axis positions,
and rotary axes swing the tip. **With it** (G43.4 to G49) X, Y, Z are the tip on the workpiece: the
point of the workpiece frame where the tip is with these words at rotary axes zero. The tip then
runs along lines and arcs of the workpiece, rotary axes turn in proportion, linear axes follow.

The path begins where the first straight block ends: nobody knows where the machine stood before.
G28 goes to axis positions zero, or to the end of the travel that is nearest.
"""

import re
from array import array
from cmath import phase
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil, sqrt, tau
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.options import Grammar, option, read_numbers
from warpspace.bench.placing import ball_point, follow, following_axes
from warpspace.kinematics.model import Model, complete_coordinates
from warpspace.machine.limits import MAX_CYCLE, MAX_LENGTH_MM, MAX_PATH_POINTS
from warpspace.parts.words import Block, Reader, Refused
from warpspace.scene.model import Scene
from warpspace.units import Array

MM_PER_INCH = 25.4
RADIUS_SLACK = 0.5, 0.005, 1e-3  # mm, and mm with share of the radius: both ends of an arc differ
FULL_TURN_RAD = 1e-9  # an arc below it is a full circle
STAND, RAPID, FEED, ARC = range(4)  # kinds of moves; STAND is the same place in other words
PLANES = "YZ", "ZX", "XY"  # of arcs, by the direction across
SYSTEMS = tuple(f"G{number}" for number in range(54, 60))
_AXIS_LETTERS = frozenset("XYZUVWABC")
_MODAL: Mapping[str, tuple[str, object]] = {
    **{code: ("motion", code) for code in ("G0", "G1", "G2", "G3", "G81", "G82", "G83")},
    "G80": ("motion", "G0"),
    "G17": ("across", 2), "G18": ("across", 1), "G19": ("across", 0),
    "G20": ("unit_mm", MM_PER_INCH), "G21": ("unit_mm", 1.0),
    "G90": ("absolute", True), "G91": ("absolute", False),
    "G90.1": ("absolute_centre", True), "G91.1": ("absolute_centre", False),
    "G98": ("to_initial", True), "G99": ("to_initial", False),
    **{code: ("system", code) for code in SYSTEMS},
}  # fmt: skip


def _offsets(text: str, scene: Scene) -> tuple[tuple[str, str, float], ...]:
    found: list[tuple[str, str, float]] = []
    system = ""
    for part in filter(None, text.upper().replace(" ", "").split(",")):
        given, _, word = part.rpartition("=")
        system = given or system
        read = re.fullmatch(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))", word)
        if system not in SYSTEMS or not read or read[1] not in scene.machine.axes:
            known = f"G54 to G59 and axes of {', '.join(scene.machine.axes)}"
            raise ValueError(f"{part!r}; expected {known}, for instance G54=X10,Y-5.5")
        found.append((system, read[1], float(read[2])))
    return tuple(found)


def _lengths(text: str, _scene: Scene) -> tuple[tuple[str, float], ...]:
    return tuple(read_numbers(text, "H=length", "H1=120,H2=85.5").items())


Lengths = Annotated[tuple[tuple[str, float], ...], Grammar("H1=..,H2=..", _lengths, many=True)]
Offsets = Annotated[tuple[tuple[str, str, float], ...], Grammar("G54=X..", _offsets, many=True)]
"""Work offset, axis, and its position where the word is zero, mm or degrees."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What is set on a control before a program runs."""

    tcp: Literal["program", "always", "never"] = option(
        "program", "Tool centre point: switched by G43.4 and G49, or on or off throughout"
    )
    length_mm: float = option(
        0.0, "Length of the tool beyond the tool point of the scene", unit="mm", low=-1e4, high=1e4
    )
    lengths: Lengths = option((), "Lengths of tools by their H", unset="--length for all")
    offset: Offsets = option(
        (), "Where the zero of the program is: axis positions by work offset", unset="at axes zero"
    )


@dataclass(frozen=True, eq=False)
class ReadProgram:
    """Moves of a program, one a row; each begins where the one before it ends."""

    axes: tuple[str, ...]  # of the machine, [a]
    line: NDArray[np.int64]  # [m], of the file, from 1; 0 for where the axes stand at first
    kind: NDArray[np.int64]  # [m]; STAND, RAPID, FEED or ARC
    tcp: NDArray[np.bool_]  # [m]
    length_mm: Array  # [m], of the tool
    # [m, a], mm and degrees; axis positions. With TCP those of the linear axes bring the scene's
    # tool point to where the tip is while rotary axes are at zero: see `upright`
    end: Array
    across: NDArray[np.int64]  # [m]; direction 0 to 2 about which an arc turns
    turn_rad: Array  # [m]; of an arc, positive counter-clockwise seen against that direction
    centre_mm: Array  # [m, 2]; of an arc, along the two axes of its `PLANES`
    refused: tuple[Refused, ...]  # the path ends before the first of them
    unknown: Mapping[str, int]  # words that are not understood, to their first line

    @property
    def moves(self) -> NDArray[np.bool_]:
        return self.kind != STAND

    @property
    def blocks(self) -> int:
        """How many lines move an axis."""
        return len(np.unique(self.line[self.moves]))

    def positions(self, move: NDArray[np.int64], share: Array) -> Array:
        """Give the positions of axes, as `end` has them, at shares of moves, [n, a]."""
        start, end = self.end[np.maximum(move - 1, 0)], self.end[move]
        at = start + share[:, None] * (end - start)
        (arc,) = np.nonzero(self.turn_rad[move])
        columns = [[self.axes.index(x) if x in self.axes else 0 for x in names] for names in PLANES]
        rows, plane = arc[:, None], np.array(columns)[self.across[move[arc]]]
        first, last = (places[rows, plane] - self.centre_mm[move[arc]] for places in (start, end))
        radius, further = np.linalg.norm(first, axis=1), np.linalg.norm(last, axis=1)
        radius = radius + share[arc] * (further - radius)
        angle = np.arctan2(first[:, 1], first[:, 0]) + share[arc] * self.turn_rad[move[arc]]
        around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        at[rows, plane] = self.centre_mm[move[arc]] + radius[:, None] * around
        return at


def upright(model: Model, words: Mapping[str, Array]) -> dict[str, Array]:
    """Give where the axes stand at words of a program with TCP, were its rotary axes at zero."""
    axes = model.machine.axes
    return {name: at if axes[name].is_linear else np.zeros(()) for name, at in words.items()}


def with_length(model: Model, length_mm: float) -> Model:
    """Give a model whose tool point is the tip of a tool of this length."""
    x, y, z = model.tool_point_mm
    return replace(model, tool_point_mm=(x, y, z - length_mm))


def read_program(
    scene: Scene, lines: Iterable[str], setup: Setup | None = None, name: str = "program"
) -> ReadProgram:
    """Run the lines of a program on the control of a machine; a `SceneError` names its line."""
    reader = Reader(name)
    control = Control(scene, setup or Setup(), reader)
    for block in reader.blocks(lines):
        control.run(block)
    rows = np.frombuffer(control.rows).reshape(-1, 8 + len(control.names))
    line, kind, tcp, across = rows[:, :4].T.astype(np.int64)
    return ReadProgram(
        axes=control.names, line=line, kind=kind, tcp=tcp > 0, across=across, length_mm=rows[:, 4],
        turn_rad=rows[:, 5], centre_mm=rows[:, 6:8], end=rows[:, 8:],
        refused=tuple(reader.refused), unknown=reader.unknown,
    )  # fmt: skip


class Control:
    """Modal words of a control, and where its axes stand."""

    def __init__(self, scene: Scene, setup: Setup, reader: Reader) -> None:
        self.scene, self.setup, self.reader = scene, setup, reader
        self.offset = {(system, axis): at for system, axis, at in setup.offset}
        self.names = tuple(scene.machine.axes)
        first = [axis[0] for axis in self.names]
        self.index = {x: first.index(x) for x in first if first.count(x) == 1}
        self.motion, self.system, self.across, self.unit_mm = "G0", "G54", 2, 1.0
        self.absolute, self.absolute_centre, self.to_initial = True, False, True
        self.is_compensated, self.tcp, self.length_mm = False, False, setup.length_mm
        self.cycle: dict[str, float] = {}
        self.rows, self.begun, self.block = array("d"), False, Block(reader.program, 0)
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        self.at = [float(stand[axis]) for axis in self.names]
        self.switch(tcp=setup.tcp == "always", length_mm=self.length_mm)
        if not self.rows:
            self.record(STAND)

    def run(self, block: Block) -> None:
        self.block, words, once = block, block.numbers, ""
        if len(self.rows) > MAX_PATH_POINTS * (8 + len(self.names)):
            block.refuse(f"more than {MAX_PATH_POINTS:,} moves; expected fewer or larger pecks")
        for code in block.codes:
            if code in _MODAL:
                setattr(self, *_MODAL[code])
            elif code in {"G43", "G43.4", "G49"}:
                self.compensate(code)
            elif code in {"G4", "G28", "G53"}:
                once = code
        drills = self.motion in {"G81", "G82", "G83"}
        self.cycle = self.cycle if drills else {}
        letters = words.keys() & _AXIS_LETTERS
        if once == "G4":  # X is a time there
            return
        for letter in letters - self.index.keys():
            self.refuse(letter, f"an axis of {self.scene.machine.chain}: {', '.join(self.index)}")
        if once == "G28":
            self.go_home(letters)
        elif once == "G53" and letters:
            with self.bare_axes():
                self.line_to(self.target(bare=True))
        elif self.motion in {"G2", "G3"}:
            if letters or words.keys() & set("IJKR"):
                self.arc_to(self.target())
        elif letters and drills:
            self.drill()
        elif letters:
            self.line_to(self.target())

    def refuse(self, letter: str, expected: str) -> None:
        value = self.block.numbers.get(letter)
        word = letter if value is None else f"{letter}{value:g}"
        self.block.refuse(f"{word}; expected {expected}")

    def compensate(self, code: str) -> None:
        length, lengths = self.length_mm, dict(self.setup.lengths)
        if code != "G49":
            number = f"H{self.block.numbers.get('H', 0.0):g}"
            if not (length := lengths.get(number, self.setup.length_mm)):
                self.reader.unknown.setdefault(f"{number} without a length", self.block.line)
        self.is_compensated = code != "G49"
        by_word = code == "G43.4" and self.setup.tcp == "program"
        self.switch(tcp=by_word or self.setup.tcp == "always", length_mm=length)

    def switch(self, *, tcp: bool, length_mm: float) -> None:
        """Say where the axes stand in the words of another mode; nothing moves."""
        if (tcp or self.tcp) and (tcp, length_mm) != (self.tcp, self.length_mm):
            at = {axis: np.asarray(q) for axis, q in zip(self.names, self.at, strict=True)}
            model = self.scene.model
            if self.tcp:
                tip = ball_point(model, upright(model, at))
                at = follow(with_length(model, self.length_mm), at, tip)
            if tcp:
                tip = ball_point(with_length(model, length_mm), at)
                words = follow(model, upright(model, at), tip)
                at |= {name: words[name] for name in following_axes(model)}
            self.at, self.tcp, self.length_mm = [*map(float, at.values())], tcp, length_mm
            self.record(STAND)
        self.length_mm = length_mm

    @contextmanager
    def bare_axes(self) -> Generator[None]:
        """Count positions of axes while the block lasts, not places of the tip."""
        tcp = self.tcp
        self.switch(tcp=False, length_mm=self.length_mm)
        yield
        self.switch(tcp=tcp, length_mm=self.length_mm)

    def record(self, kind: int, turn: float = 0.0, centre: complex = 0j) -> None:
        mode = self.block.line, kind, self.tcp, self.across, self.length_mm
        self.rows.extend((*mode, turn, centre.real, centre.imag, *self.at))

    def place(self, letter: str, value: float) -> float:
        """Give the position of an axis of an absolute word."""
        is_longer = letter == "Z" and self.is_compensated and not self.tcp
        shift = self.offset.get((self.system, letter), 0.0)
        return value + shift + (self.length_mm if is_longer else 0.0)

    def word(self, letter: str, position: float) -> float:
        """Give the absolute word that leads an axis to a position."""
        value = position - self.place(letter, 0.0)
        return value if letter in "ABC" else value / self.unit_mm

    def target(self, without: str = "", *, bare: bool = False) -> list[float]:
        """Give where the words of the block lead; after G53 they are axis positions."""
        to = self.at.copy()
        for letter, value in self.block.numbers.items():
            if letter == without or (index := self.index.get(letter)) is None:
                continue
            place = value if letter in "ABC" else value * self.unit_mm
            if not bare:
                place = self.place(letter, place) if self.absolute else to[index] + place
            if not abs(place) <= MAX_LENGTH_MM:
                self.refuse(letter, f"at most ±{MAX_LENGTH_MM:g} mm or degrees")
            to[index] = place
        return to

    def line_to(self, to: list[float], kind: int | None = None) -> None:
        if kind is None:
            kind = RAPID if self.motion == "G0" else FEED
        moves, self.at = not self.begun or to != self.at, to
        if not self.begun:
            self.record(STAND)
        self.record(kind if moves else STAND)
        self.begun = True

    def go_home(self, letters: Iterable[str]) -> None:
        if letters and (over := self.target()) != self.at:
            self.line_to(over, RAPID)
        with self.bare_axes():
            to = self.at.copy()
            for letter in letters or self.index:
                low, high = self.scene.machine.axes[self.names[self.index[letter]]].travel
                to[self.index[letter]] = min(max(0.0, low), high)
            self.line_to(to, RAPID)

    def arc_to(self, to: list[float]) -> None:
        words, names = self.block.numbers, PLANES[self.across]
        if not set(names) <= self.index.keys():
            self.block.refuse(f"an arc in {names}; expected axes of {self.scene.machine.chain}")
        (x, y), (u, v) = ([place[self.index[name]] for name in names] for place in (self.at, to))
        start, end, sense = complex(x, y), complex(u, v), 1.0 if self.motion == "G3" else -1.0
        offsets = [words.get("IJK"["XYZ".index(name)]) for name in names]
        if "R" in words:
            centre = self.centre_of_radius(start, end, sense)
        elif offsets == [None, None]:
            self.block.refuse(f"{self.motion} without I, J, K or R")
        else:
            begin = (x, y) if not self.absolute_centre else (self.place(n, 0.0) for n in names)
            centre = complex(
                *(at + (by or 0.0) * self.unit_mm for at, by in zip(begin, offsets, strict=True))
            )
        radius, other = abs(start - centre), abs(end - centre)
        most, least, share = RADIUS_SLACK
        if not radius or abs(radius - other) > min(most, max(least, share * radius)):
            self.block.refuse(
                f"{self.motion}: its ends are {radius:.4f} and {other:.4f} mm from its centre;"
                " expected one radius above 0"
            )
        turn = sense * phase((end - centre) / (start - centre))
        turn += 0.0 if turn > FULL_TURN_RAD else tau
        self.at, self.begun = to, True
        self.record(ARC, sense * turn, centre)

    def centre_of_radius(self, start: complex, end: complex, sense: float) -> complex:
        """Find the centre of an arc of a given radius: of the longer one where it is negative."""
        radius, chord = self.block.numbers["R"] * self.unit_mm, abs(end - start)
        if not chord or chord / 2.0 - abs(radius) > max(RADIUS_SLACK[1], RADIUS_SLACK[2] * chord):
            self.refuse("R", f"a radius for an arc of a chord of {chord:.4f} mm, above 0")
        height = sqrt(max(0.0, radius * radius - chord * chord / 4.0))
        side = sense if radius > 0.0 else -sense
        return (start + end) / 2.0 + side * height * 1j * (end - start) / chord

    def drill(self) -> None:
        """Drill a hole at the place of the block: R plane, depth, in pecks of Q with G83."""
        words, deep = self.block.numbers, "XYZ"[self.across]
        self.cycle |= {x: words[x] * self.unit_mm for x in {deep, "R", "Q"} & words.keys()}
        if deep not in self.index or not {deep, "R"} <= self.cycle.keys():
            self.block.refuse(f"{self.motion} without {deep} and R")
        index = self.index[deep]
        initial = self.cycle.setdefault("initial", self.at[index])
        clear = initial + self.cycle["R"]
        bottom = clear + self.cycle[deep]
        if self.absolute:
            clear, bottom = (self.place(deep, self.cycle[letter]) for letter in ("R", deep))
        if bottom > clear:
            self.refuse(deep, f"a depth below R at {clear:g} mm")
        peck = self.cycle.get("Q", 0.0) if self.motion == "G83" else clear - bottom or 1.0
        if peck <= 0.0 or (clear - bottom) / peck > MAX_CYCLE:
            self.refuse("Q", f"a depth of a peck above 0, at most {MAX_CYCLE:,} pecks")

        def go(level: float, kind: int = RAPID) -> None:
            self.line_to([level if i == index else q for i, q in enumerate(self.at)], kind)

        go(max(clear, self.at[index]))
        self.line_to(self.target(deep), RAPID)
        for number in range(ceil((clear - bottom) / peck)):
            go(clear)
            go(clear - number * peck)
            go(max(bottom, clear - (number + 1) * peck), FEED)
        go(max(initial, clear) if self.to_initial else clear)
