"""A program as a control runs it, and the path that the tool takes over the workpiece.

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

from array import array
from cmath import phase
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import ceil, sqrt, tau
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.bench.placing import SLACK, ball_point, follow, following_axes
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.kinematics.model import Loop, Model, complete_coordinates
from warpspace.machine.description import Axis
from warpspace.machine.limits import FULL_TURN_DEG, MAX_CYCLE, MAX_LENGTH_MM, MAX_PATH_POINTS
from warpspace.parts.words import Block, Refused, Remarks, read_blocks
from warpspace.scene.model import Scene, check_magnitude
from warpspace.units import Array

Tcp: TypeAlias = Literal["program", "always", "never"]
MM_PER_INCH = 25.4
RADIUS_SLACK = 0.5, 0.005, 1e-3  # mm, and mm with share of the radius: both ends of an arc differ
FULL_TURN_RAD = 1e-9  # an arc below it is a full circle
STAND, RAPID, FEED, ARC = range(
    4
)  # kinds of moves; axes that stand are the same place in new words
PLANES = "YZ", "ZX", "XY"  # of arcs, by the direction across
MOST_AT_ONCE = 50_000  # samples
_AXIS_LETTERS = frozenset("XYZUVWABC")
_MODAL: Mapping[str, tuple[str, object]] = {
    **{f"G{motion}": ("motion", f"G{motion}") for motion in (0, 1, 2, 3, 81, 82, 83)},
    "G80": ("motion", ""),
    "G17": ("across", 2), "G18": ("across", 1), "G19": ("across", 0),
    "G20": ("unit_mm", MM_PER_INCH), "G21": ("unit_mm", 1.0),
    "G90": ("absolute", True), "G91": ("absolute", False),
    "G90.1": ("absolute_centre", True), "G91.1": ("absolute_centre", False),
    "G98": ("to_initial", True), "G99": ("to_initial", False),
    **{f"G{system}": ("system", f"G{system}") for system in range(54, 60)},
}  # fmt: skip


@dataclass(frozen=True)
class Setup:
    """What is set on a control before a program runs."""

    # of work coordinate systems by name, "G54", axis to mm or degrees; zero where none is given
    offsets: Mapping[str, Mapping[str, float]] = field(
        default_factory=dict[str, Mapping[str, float]]
    )
    tcp: Tcp = "program"  # whether G43.4 and G49 switch it, or it is on or off throughout
    length_mm: float = 0.0  # of the tool, and of every H without a length of its own
    lengths_mm: Mapping[str, float] = field(default_factory=dict[str, float])  # "H1" to its length


@dataclass(frozen=True, eq=False)
class ReadProgram:
    """Moves of a program, one a row; each begins where the one before it ends."""

    axes: tuple[str, ...]  # of the machine, [a]
    line: NDArray[np.int64]  # [m], of the file, from 1; 0 for where the axes stand at first
    kind: NDArray[np.int64]  # [m]; STAND, RAPID, FEED or ARC
    tcp: NDArray[np.bool_]  # [m]
    length_mm: Array  # [m], of the tool
    # [m, a], mm and degrees; axis positions. With TCP those of the linear axes are what the scene's
    # tool point has where the tip is, rotary axes at zero: `Frame` takes them to the workpiece
    end: Array
    across: NDArray[np.int64]  # [m]; direction 0 to 2 about which an arc turns
    turn_rad: Array  # [m]; of an arc, positive counter-clockwise seen against that direction
    centre_mm: Array  # [m, 2]; of an arc, along the two directions that follow `across`
    refused: tuple[Refused, ...]  # the path ends before the first of them
    unknown: Mapping[str, int]  # words that are not understood, to their first line

    @property
    def moves(self) -> NDArray[np.bool_]:
        return self.kind != STAND

    @property
    def blocks(self) -> int:
        """How many lines move an axis."""
        return len(np.unique(self.line[self.moves]))


class Frame:
    """Where words with TCP are on the workpiece: the tool point, rotary axes at zero."""

    def __init__(self, scene: Scene) -> None:
        self.names = following_axes(scene.model)
        stand = {name: np.asarray(at) for name, at in scene.workspace.positions.items()}
        zero = {
            name: at if scene.machine.axes[name].is_linear else np.zeros(())
            for name, at in complete_coordinates(scene.machine, stand).items()
        }
        at_zero = {**zero, **dict.fromkeys(self.names, np.zeros(()))}
        self.origin_mm = ball_point(scene.model, at_zero)
        far = np.asarray(1024.0)  # a power of two: differences keep their digits
        ends = [ball_point(scene.model, {**at_zero, name: far}) for name in self.names]
        self.directions = (np.stack(ends, axis=-1) - self.origin_mm[:, None]) / far

    def to_workpiece(self, words_mm: Array) -> Array:
        """Give points of w, [..., 3], of words of the three axes, [..., 3]."""
        return self.origin_mm + words_mm @ self.directions.T

    def to_words(self, point_mm: Array) -> Array:
        return np.linalg.inv(self.directions) @ (point_mm - self.origin_mm)


def with_length(model: Model, length_mm: float) -> Model:
    """Give a model whose tool point is the tip of a tool of this length."""
    x, y, z = model.tool_point_mm
    return replace(model, tool_point_mm=(x, y, z - length_mm))


def read_program(
    scene: Scene, lines: Iterable[str], setup: Setup | None = None, name: str = "program"
) -> ReadProgram:
    """Run a program on the control of a machine.

    Parameters
    ----------
    scene : Scene
    lines : iterable of str
        Its lines, as `warpspace.parts.words.program_lines` reads them from a file.
    setup : Setup, optional
    name : str, optional
        What messages call it.

    Raises
    ------
    SceneError
        If a block cannot be run; names line and word.
    """
    control, remarks = _Control(scene, setup or Setup(), name), Remarks()
    for block in read_blocks(lines, name, remarks):
        control.run(block)
    rows = np.frombuffer(control.rows).reshape(-1, 8 + len(control.names))
    whole = rows[:, :5].astype(np.int64)
    return ReadProgram(
        axes=control.names,
        line=whole[:, 0],
        kind=whole[:, 1],
        tcp=whole[:, 2] > 0,
        across=whole[:, 3],
        length_mm=rows[:, 4],
        turn_rad=rows[:, 5],
        centre_mm=rows[:, 6:8],
        end=rows[:, 8:],
        refused=tuple(remarks.refused),
        unknown=remarks.unknown | control.without_length,
    )


class _Control:
    """Modal words of a control, and where its axes stand."""

    def __init__(self, scene: Scene, setup: Setup, name: str) -> None:
        self.scene, self.setup = scene, setup
        self.names = tuple(scene.machine.axes)
        first = [axis[0] for axis in self.names]
        self.index = {x: first.index(x) for x in first if first.count(x) == 1}
        self.rotary = [not scene.machine.axes[axis].is_linear for axis in self.names]
        self.motion, self.system, self.across, self.unit_mm = "", "G54", 2, 1.0
        self.absolute, self.absolute_centre, self.to_initial = True, False, True
        self.is_compensated, self.tcp, self.length_mm = False, False, setup.length_mm
        self.cycle: dict[str, float] = {}
        self.without_length: dict[str, int] = {}
        self.rows = array("d")
        self.frame: Frame | None = None
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        self.at = [float(stand[axis]) for axis in self.names]
        self.begun = False
        self.block = Block(name, 0)
        self.switch(tcp=setup.tcp == "always", length_mm=self.length_mm)
        if not self.rows:
            self.record(STAND)

    def run(self, block: Block) -> None:
        self.block, words, once = block, block.numbers, ""
        for code in block.codes:
            if code in _MODAL:
                setattr(self, *_MODAL[code])
            elif code in {"G43", "G43.4", "G49"}:
                self.compensate(code)
            elif code in {"G4", "G28", "G53"}:
                once = code
        drills = self.motion in {"G81", "G82", "G83"}
        if not drills:
            self.cycle = {}
        if once == "G4":  # X is a time there
            return
        letters = words.keys() & _AXIS_LETTERS
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

    @contextmanager
    def bare_axes(self) -> Generator[None]:
        """Count positions of axes while the block lasts, not places of the tip."""
        tcp = self.tcp
        self.switch(tcp=False, length_mm=self.length_mm)
        yield
        self.switch(tcp=tcp, length_mm=self.length_mm)

    def refuse(self, letter: str, expected: str) -> None:
        value = self.block.numbers.get(letter)
        word = letter if value is None else f"{letter}{value:g}"
        self.block.refuse(f"{word}; expected {expected}")

    def compensate(self, code: str) -> None:
        length = self.length_mm
        if code != "G49":
            number = f"H{self.block.numbers.get('H', 0.0):g}"
            if number not in self.setup.lengths_mm and not self.setup.length_mm:
                self.without_length.setdefault(f"{number} (no length given)", self.block.line)
            length = self.setup.lengths_mm.get(number, self.setup.length_mm)
        self.is_compensated = code != "G49"
        by_word = code == "G43.4" and self.setup.tcp == "program"
        self.switch(tcp=by_word or self.setup.tcp == "always", length_mm=length)

    def switch(self, *, tcp: bool, length_mm: float) -> None:
        """Say the place where the axes stand in the words of another mode; nothing moves."""
        if not (tcp or self.tcp) or (tcp, length_mm) == (self.tcp, self.length_mm):
            self.length_mm = length_mm
            return
        frame = self.frame = self.frame or Frame(self.scene)
        at = {axis: np.asarray(q) for axis, q in zip(self.names, self.at, strict=True)}
        if self.tcp:
            tip = frame.to_workpiece(np.array([at[axis] for axis in frame.names]))
            at = follow(with_length(self.scene.model, self.length_mm), at, tip)
        if tcp:
            tip = ball_point(with_length(self.scene.model, length_mm), at)
            at |= dict(zip(frame.names, frame.to_words(tip), strict=True))
        self.at = [float(at[axis]) for axis in self.names]
        self.tcp, self.length_mm = tcp, length_mm
        self.record(STAND)

    def record(self, kind: int, turn: float = 0.0, centre: tuple[float, float] = (0, 0)) -> None:
        self.rows.extend(
            (self.block.line, kind, self.tcp, self.across, self.length_mm, turn, *centre, *self.at)
        )

    def place(self, letter: str, value: float) -> float:
        """Give the position of an axis of an absolute word."""
        shift = self.setup.offsets.get(self.system, {}).get(letter, 0.0)
        if letter == "Z" and self.is_compensated and not self.tcp:
            shift += self.length_mm
        return value + shift

    def target(self, without: str = "", *, bare: bool = False) -> list[float]:
        """Give where the words of the block lead; after G53 they are axis positions."""
        to = self.at.copy()
        for letter, value in self.block.numbers.items():
            if letter == without or (index := self.index.get(letter)) is None:
                continue
            place = value if self.rotary[index] else value * self.unit_mm
            if not bare:
                place = self.place(letter, place) if self.absolute else to[index] + place
            to[index] = place
            if not abs(to[index]) <= MAX_LENGTH_MM:
                self.refuse(letter, f"at most ±{MAX_LENGTH_MM:g} mm or degrees")
        return to

    def line_to(self, to: list[float], kind: int | None = None) -> None:
        if kind is None:
            kind = RAPID if self.motion in {"G0", ""} else FEED
        begins, self.begun = not self.begun, True
        if begins or to != self.at:
            self.at = to
            if begins:
                self.record(STAND)
            self.record(kind)

    def go_home(self, letters: Iterable[str]) -> None:
        if letters:
            self.line_to(self.target(), RAPID)
        with self.bare_axes():
            to = self.at.copy()
            for letter in letters or self.index:
                low, high = self.scene.machine.axes[self.names[self.index[letter]]].travel
                to[self.index[letter]] = min(max(0.0, low), high)
            self.line_to(to, RAPID)

    def arc_to(self, to: list[float]) -> None:
        words, across = self.block.numbers, self.across
        first, second = PLANES[across]
        if first not in self.index or second not in self.index:
            self.block.refuse(f"an arc in {first}{second}; expected axes of the machine")
        i, j = self.index[first], self.index[second]
        start, end = complex(self.at[i], self.at[j]), complex(to[i], to[j])
        sense = 1.0 if self.motion == "G3" else -1.0
        if "R" in words:
            centre = self.centre_of_radius(start, end, sense)
        else:
            offsets = {x: words["IJK"["XYZ".index(x)]] * self.unit_mm
                       for x in (first, second) if "IJK"["XYZ".index(x)] in words}  # fmt: skip
            if not offsets:
                self.block.refuse(f"{self.motion} without I, J, K or R")
            centre = start + complex(offsets.get(first, 0.0), offsets.get(second, 0.0))
            if self.absolute_centre:
                given = {x: self.place(x, value) for x, value in offsets.items()}
                centre = complex(given.get(first, start.real), given.get(second, start.imag))
        radius, other = abs(start - centre), abs(end - centre)
        most, least, share = RADIUS_SLACK
        if not radius or abs(radius - other) > min(most, max(least, share * radius)):
            self.block.refuse(
                f"{self.motion}: its start is {radius:.4f} mm from its centre, its end"
                f" {other:.4f} mm; expected one radius above 0",
            )
        turn = sense * phase((end - centre) / (start - centre))
        turn += 0.0 if turn > FULL_TURN_RAD else tau
        turn += tau * (self.count("P") - 1)
        self.at, self.begun = to, True
        self.record(ARC, sense * turn, (centre.real, centre.imag))

    def count(self, letter: str) -> int:
        """Read how often something is done; once where the word is missing."""
        number = self.block.numbers.get(letter, 1.0)
        if not (1.0 <= number <= MAX_CYCLE and number == int(number)):
            self.refuse(letter, f"a whole number from 1 to {MAX_CYCLE:,}")
        return int(number)

    def centre_of_radius(self, start: complex, end: complex, sense: float) -> complex:
        """Find the centre of an arc of a given radius: of the longer one where it is negative."""
        radius = self.block.numbers["R"] * self.unit_mm
        chord = abs(end - start)
        if not chord or chord / 2.0 - abs(radius) > max(RADIUS_SLACK[1], RADIUS_SLACK[2] * chord):
            self.refuse("R", f"a radius for an arc of a chord of {chord:.4f} mm, above 0")
        height = sqrt(max(0.0, radius * radius - chord * chord / 4.0))
        side = sense if radius > 0.0 else -sense
        return (start + end) / 2.0 + side * height * 1j * (end - start) / chord

    def drill(self) -> None:
        """Drill a hole at the place of the block: R plane, depth, in pecks of Q with G83."""
        words, deep = self.block.numbers, "XYZ"[self.across]
        for letter in {deep, "R", "Q"} & words.keys():
            self.cycle[letter] = words[letter] * self.unit_mm
        if deep not in self.index or not {deep, "R"} <= self.cycle.keys():
            self.block.refuse(f"{self.motion} without {deep} and R")
        index = self.index[deep]
        initial = self.cycle.setdefault("initial", self.at[index])
        if self.absolute:
            clear, bottom = (self.place(deep, self.cycle[letter]) for letter in ("R", deep))
        else:
            clear = initial + self.cycle["R"]
            bottom = clear + self.cycle[deep]
        if bottom > clear:
            self.refuse(deep, f"a depth below R at {clear:g} mm")
        peck = self.cycle.get("Q", 0.0) if self.motion == "G83" else clear - bottom or 1.0
        if peck <= 0.0 or (clear - bottom) / peck > MAX_CYCLE:
            self.refuse("Q", f"a depth of a peck above 0, at most {MAX_CYCLE:,} pecks")
        pecks = ceil((clear - bottom) / peck)
        back = max(initial, clear) if self.to_initial else clear

        def go(level: float, kind: int = RAPID) -> None:
            self.line_to([level if i == index else q for i, q in enumerate(self.at)], kind)

        for _ in range(self.count("L")):
            if self.at[index] < clear:
                go(clear)
            self.line_to([*self.target(deep)], RAPID)
            go(clear)
            for number in range(pecks):
                go(clear - number * peck)
                go(max(bottom, clear - (number + 1) * peck), FEED)
                go(clear)
            go(back)


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
    step_mm: Array  # [n, 3], from the sample before; zero where nothing moved

    @property
    def length_mm(self) -> float:
        return float(np.linalg.norm(self.step_mm, axis=1).sum())


def trace_program(
    scene: Scene,
    read: ReadProgram,
    *,
    chord_mm: float = 0.01,
    turn_deg: float = 2.0,
    step_mm: float = 10.0,
) -> ToolPath:
    """Follow the tip of the tool over the workpiece, nominal and with the errors of the machine.

    Parameters
    ----------
    scene : Scene
    read : ReadProgram
    chord_mm : float, mm
        Largest distance of an arc, or of the swing of a rotary axis, from the line between samples.
    turn_deg, step_mm : float, degrees and mm
        Largest turn of a rotary axis and largest move of the linear ones between samples.
    """
    count = _samples_of_moves(scene, read, chord_mm, turn_deg, step_mm)
    if count.sum() > MAX_PATH_POINTS:
        raise OptionError(
            f"the path has {count.sum():,} points; expected at most {MAX_PATH_POINTS:,}"
        )
    move = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(move)) - (np.cumsum(count) - count)[move] + 1.0) / count[move]
    coordinates, tip, error = _along(scene, read, move, share)
    inside = [within_travel(scene.machine.axes[name], at) for name, at in coordinates.items()]
    line = read.line[move]
    return ToolPath(
        line=line,
        move=move,
        is_end=(share == 1.0) & (np.append(line[1:], -1) != line),
        coordinates=coordinates,
        tip_mm=tip,
        error_um=error,
        outside=~np.all(inside, axis=0),
        step_mm=np.diff(tip, axis=0, prepend=tip[:1]),
    )


def _samples_of_moves(
    scene: Scene, read: ReadProgram, chord_mm: float, turn_deg: float, step_mm: float
) -> NDArray[np.int64]:
    is_rotary = np.array([not scene.machine.axes[name].is_linear for name in read.axes])
    change = np.abs(np.diff(read.end, axis=0, prepend=read.end[:1]))
    way, turn = np.linalg.norm(change[:, ~is_rotary], axis=1), change[:, is_rotary]
    is_bent = (read.kind == ARC) | (~read.tcp & turn.any(axis=1))
    turn = np.maximum(turn.max(axis=1, initial=0.0), np.rad2deg(np.abs(read.turn_rad)))
    count = np.ceil(np.maximum(turn / turn_deg, way / step_mm))
    count = np.where(read.moves, np.maximum(count, 1.0), 0.0)
    if not read.moves.any():
        count[-1] = 1.0
    (bent,) = np.nonzero(is_bent & read.moves)
    if len(bent):  # how far the middle of a piece is from the line between its ends
        half = 0.5 / count[bent]
        start, middle, end = (_along(scene, read, bent, 0.5 + at).tip_mm for at in (-half, 0, half))
        away = np.linalg.norm(middle - (start + end) / 2.0, axis=1)
        count[bent] = np.ceil(count[bent] * np.maximum(1.0, np.sqrt(away / chord_mm)))
    return count.astype(np.int64)


class _Samples(NamedTuple):
    coordinates: dict[str, Array]
    tip_mm: Array
    error_um: Array


def _along(
    scene: Scene, read: ReadProgram, move: NDArray[np.int64], share: Array | float
) -> _Samples:
    """Evaluate the path at shares of moves, [n]."""
    at = _places(read, move, np.broadcast_to(share, move.shape))
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
                frame = Frame(scene)
                words = np.stack([here[name] for name in frame.names], axis=-1)
                here = follow(model, here, frame.to_workpiece(words))
            for name, axis in scene.machine.axes.items():
                found[name][part] = here[name] = _unwound(axis, here[name])
            check_magnitude(scene, here)
            tip[part] = ball_point(model, here)
            error[part] = evaluate_first_order(model, scene.errors, here, view).error_um
    return _Samples(found, tip, error)


def _places(read: ReadProgram, move: NDArray[np.int64], share: Array) -> Array:
    """Give the words at shares of moves, [n, a]."""
    start, end = read.end[np.maximum(move - 1, 0)], read.end[move]
    at = start + share[:, None] * (end - start)
    (arcs,) = np.nonzero(read.kind[move] == ARC)
    if len(arcs):
        columns = [[read.axes.index(x) if x in read.axes else 0 for x in names] for names in PLANES]
        rows, of_arc = arcs[:, None], move[arcs]
        plane, centre = np.array(columns)[read.across[of_arc]], read.centre_mm[of_arc]
        first, last = (places[rows, plane] - centre for places in (start, end))
        radius, further = np.linalg.norm(first, axis=1), np.linalg.norm(last, axis=1)
        radius = radius + share[arcs] * (further - radius)
        angle = np.arctan2(first[:, 1], first[:, 0]) + share[arcs] * read.turn_rad[of_arc]
        around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        at[rows, plane] = centre + radius[:, None] * around
    return at


def _unwound(axis: Axis, at: Array) -> Array:
    """Leave full turns out beyond the travel of a rotary axis that can turn once round."""
    low, high = axis.travel
    if axis.is_linear or high - low < FULL_TURN_DEG:
        return at
    return np.where(within_travel(axis, at), at, low + (at - low) % FULL_TURN_DEG)


def within_travel(axis: Axis, at: Array) -> NDArray[np.bool_]:
    low, high = axis.travel
    return (at >= low - SLACK) & (at <= high + SLACK)
