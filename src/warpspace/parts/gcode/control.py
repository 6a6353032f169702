"""State of a control: modes, offsets, and the position in them."""

from array import array
from collections.abc import Set
from typing import NoReturn

import numpy as np

from warpspace.exceptions import SceneError
from warpspace.kinematics.model import complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_PATH_POINTS
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.parsed import STAND, axes_at, programmed_words, with_length
from warpspace.scene.model import Scene
from warpspace.units import Array

MM_PER_INCH = 25.4
HEAD = 9  # columns of a move before the positions
SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59")


class RefusedError(Exception):
    """A word, and why its block is not executed."""


class Control:
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
        self.offset = dict(settings.offset)
        self.names = tuple(scene.machine.axes)
        first = [axis[0] for axis in self.names]
        self.index = {x: first.index(x) for x in first if first.count(x) == 1}
        self.motion, self.system, self.across, self.unit_mm = "G0", "G54", 2, 1.0
        self.absolute, self.to_initial, self.inverse_time = True, True, False
        self.is_compensated, self.has_blocks = False, False
        self.shift: dict[str, dict[str, float]] = {}  # by G52, G92, G254 and letter, mm or degrees
        self.frame: Array | None = None  # [4, 4], of the words; see `frames`
        self.frame_code = ""  # that set it
        self.swivelled: Array | None = None  # parts of it: by CYCLE800, and by TRANS, ROT …
        self.programmed: Array | None = None
        self.tilt: Array | None = None  # frame that waits for G53.1
        self.is_tilted, self.arguments = False, ""  # the latter of a call
        self.pending: set[str] = set()  # letters not named since their coordinates changed
        self.frames = [np.eye(3)]  # rotations of arcs
        self.unnamed_axes: set[int] = {i for i, axis in enumerate(self.names) if is_linear(axis)}
        self.lost: set[int] = set()  # axes whose position is unknown after G30
        self.first = 0  # first row of the path
        self.once = ""  # non-modal code of the block, such as G4, G28 or G53
        self.letters: Set[str] = set[str]()  # axes that the block names
        self.cycle: dict[str, float] = {}  # words of a cycle, and the level before it, mm
        self.corner: tuple[str, float, int] | None = None  # of the last move: ",R", mm, its row
        self.integer_word: tuple[str, int] | None = None  # the first read as mm or degrees
        self.rows, self.width = array("d"), HEAD + len(self.names)
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        self.position = [float(stand[axis]) for axis in self.names]
        self.tcp, self.length_mm = False, settings.length_mm
        self.record(STAND)
        self.switch(tcp=settings.tcp == "always", length_mm=settings.length_mm)

    def fail(self, problem: str) -> NoReturn:
        raise SceneError(self.name, [f"line {self.line}: {problem}"])

    def refuse(self, word: str, reason: str) -> NoReturn:
        """End the path before the current block."""
        raise RefusedError(word, reason)

    def compensate_radius(self, code: str) -> None:
        """Refuse a compensation of the cutter radius, unless its offset is given as zero."""
        number = f"D{self.words.get('D', 0.0):g}"
        self.used.add(number)
        if self.offset.get(number):
            self.refuse(
                code, f"expected the offset {number}=0: other cutter radii are not compensated"
            )
        if number not in self.offset:
            expected = f"the offset {number}=0 where the programmed path is that of the tool centre"
            self.refuse(code, f"expected {expected}")

    def select_system(self, code: str) -> None:
        """Select a work offset; it is refused where its block may mean another thing."""
        is_move = {"G0", "G1", "G2", "G3", "G53"} & {*self.codes}
        if code in {"G58", "G59"} and self.letters and not (is_move or self.dialect):
            expected = "the dialect fanuc (a work offset and a move) or sinumerik (a shift)"
            self.refuse(code, f"expected {expected}")
        system, self.system = self.system, code
        if code in {"G54.1", "G154"}:
            self.system = f"G54.1P{self.words.get('P', 0.0):g}"
        elif code == "G15":
            self.system = f"G15H{self.words.get('H', 0.0):g}"
        is_followed = self.frame is not None and self.tcp and not self.is_tilted
        if self.system != system and (is_followed or "G254" in self.shift):
            self.refuse(code, "expected G49 or G255 before, since the table is turned")

    def shift_by(self, code: str) -> None:
        """Shift the work offset (G52), or so that the position has given coordinates (G92)."""
        if code == "G92.1":
            self.shift.pop("G92", None)
        self.check_free(code)
        for letter in sorted(self.letters):
            value = self.value(letter)
            if code == "G92":
                self.uncorrectable.setdefault(self.line, code)
                if self.index[letter] in self.unnamed_axes | self.lost:
                    at = "at a position that no block has commanded"
                    self.remarks.setdefault(f"G92 {letter} {at}", self.line)
                at = self.position[self.index[letter]] - self.place(letter, value)
                value = self.shift.get("G92", {}).get(letter, 0.0) + at
            self.shift.setdefault(code, {})[letter] = value

    def set_offset(self, code: str) -> None:
        """Set a work offset (L2; L20 according to the dialect) or a tool length (L10)."""
        kind, number = self.words.get("L", 0.0), f"{self.words.get('P', 0.0):g}"
        is_listed = self.dialect in {"fanuc", "haas"}
        if kind == 10 and "R" in self.words:
            self.offset[f"H{number}"] = self.value("R")
            return
        if self.frame is not None or "G254" in self.shift:
            self.refuse(code, "expected frames cancelled before")
        if kind not in {2, 20} or not self.absolute or (kind == 20 and not self.dialect):
            expected = "L2, L10 R, or L20 with a dialect, in G90"
            self.refuse(f"{code} L{kind:g}", f"expected {expected}")
        system = self.system if number == "0" else (*SYSTEMS, *[""] * 6)[:6][int(number) - 1]
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

    def check_free(self, code: str) -> None:
        """Refuse a change of coordinates beside a frame or the tool centre point."""
        if self.frame is not None or self.tilt is not None or "G254" in self.shift or self.tcp:
            self.refuse(code, "expected frames and tool centre point cancelled before")

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

    def record(self, kind: int, turn: float = 0.0, centre: complex = 0j, frame: int = 0) -> None:
        if len(self.rows) > MAX_PATH_POINTS * self.width:
            self.fail(f"more than {MAX_PATH_POINTS:,} moves; expected fewer or larger pecks")
        mode = self.line, kind, self.tcp, self.across, frame, self.length_mm
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
        for shift in self.shift.values():
            value += shift.get(letter, 0.0)
        return value + (self.length_mm if is_longer else 0.0)
