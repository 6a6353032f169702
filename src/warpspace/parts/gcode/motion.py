"""Motions of a block: lines, arcs, corners, and reference points."""

from cmath import phase
from collections.abc import Mapping, Sequence
from math import ceil, copysign, cos, pi, sqrt, tan, tau

import numpy as np

from warpspace.machine.axes import is_linear
from warpspace.machine.limits import MAX_TURNS, MIN_SPAN
from warpspace.parts.gcode.control import HEAD
from warpspace.parts.gcode.frames import Frames
from warpspace.parts.gcode.parsed import ARC, FEED, PLANES, RAPID, STAND

SLACK_MM, SLACK = 0.005, 1e-3  # by which radii at both ends of an arc may differ, or its share
FULL_TURN_RAD = 1e-9  # an arc below it is a full circle
CORNERS = frozenset((",R", ",C", "CHF"))
CENTRES = "JK", "KI", "IJ"  # of arcs, by the direction across


class Motion(Frames):
    """Lines, arcs and corners of a control."""

    def line_to(self, to: Mapping[int, float], kind: int = STAND, *, bare: bool = False) -> None:
        """Move to positions of some axes: bare ones, or places of the tip with TCP."""
        tcp = self.tcp
        if bare:
            self.switch(tcp=False, length_mm=self.length_mm)
        before, to = self.position, to if bare or self.frame is None else self.axis_targets(to)
        self.position = [to.get(index, at) for index, at in enumerate(before)]
        kind = kind or (RAPID if self.motion == "G0" else FEED)
        if self.is_tilted or "G254" in self.shift:
            for index, at in to.items():
                if not is_linear(self.names[index]) and at != before[index]:
                    word = f"{self.names[index]}{at:g}"
                    self.refuse(word, "expected the tilted plane or G254 cancelled before")
        if self.pending and kind == FEED and not bare:
            self.check_pending()
        if self.lost - to.keys() and kind == FEED and self.first:
            axes = ", ".join(self.names[index] for index in self.lost - to.keys())
            self.refuse(self.motion, f"expected {axes} before: its position is unknown")
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
        for letter in CORNERS & self.words.keys():
            is_tilted = self.frame is not None and abs(self.frame[self.across, self.across]) < 1.0
            if kind != FEED or self.tcp or is_tilted:
                self.refuse(letter, "expected a move of G1 in the plane, without tool centre point")
            self.corner = letter, self.value(letter), len(self.rows) // self.width - 1
        if bare:
            self.switch(tcp=tcp, length_mm=self.length_mm)

    def cut_corner(self, at: Sequence[float], kind: int) -> None:
        """Round or chamfer the corner between the last move and the one to the position."""
        letter, size, row = self.corner or ("", 0.0, 0)
        self.corner = None
        indices = [self.index[x] for x in PLANES[self.across] if x in self.index]
        first = self.rows[(row - 1) * self.width + HEAD : row * self.width]
        flat = [complex(*(place[i] for i in indices)) for place in (first, at, self.position)]
        arrival, departure = flat[1] - flat[0], flat[2] - flat[1]
        across = {*range(len(self.names))} - {*indices}
        is_flat = all(first[i] == at[i] == self.position[i] for i in across)
        angle = phase(departure / arrival) if arrival and departure else pi
        half = abs(angle) / 2.0
        if not is_flat or kind != FEED or pi - abs(angle) < FULL_TURN_RAD:
            self.refuse(letter, "expected two moves in the plane, not back")
        length = {",R": size * tan(half), ",C": size}.get(letter, size / (2.0 * cos(half)))
        limit = min(abs(arrival), abs(departure))
        if size <= 0.0 or length > limit:
            self.refuse(f"{letter}{size:g}", f"expected a corner within moves of {limit:.4f} mm")
        starts = flat[1] - length * arrival / abs(arrival)
        ends = flat[1] + length * departure / abs(departure)
        for index, coordinate in zip(indices, (starts.real, starts.imag), strict=True):
            self.rows[row * self.width + HEAD + index] = coordinate
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
        start = self.local()[self.index[name]] if is_absolute else 0.0
        return (self.place(name, self.value(letter)) if is_absolute else self.value(letter)) - start

    def move_along_arc(self) -> None:
        to = self.target()
        names, centres = PLANES[self.across], CENTRES[self.across]
        if not set(names) <= self.index.keys():
            self.refuse(self.motion, f"expected axes {names} in {self.scene.machine.chain}")
        if self.lost:
            self.refuse(self.motion, "expected all positions known")
        self.check_pending()
        for letter in "IJK":
            if self.words.get(letter) and (letter not in centres or "R" in self.words):
                word = f"{letter}{self.words[letter]:g}"
                self.refuse(word, f"expected either R or {' and '.join(centres)}")
        indices = [self.index[x] for x in names]
        before = self.local()
        start = complex(*(before[index] for index in indices))
        offset = complex(*map(self.centre_offset, names, centres))
        end = complex(*(to.get(index, before[index]) for index in indices))
        self.unnamed_axes.clear()
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
        places = dict(zip(indices, (centre.real, centre.imag), strict=True))
        centre, frame = self.arc_centre(places, indices, centre)
        to = self.axis_targets(to)
        self.position = [to.get(index, at) for index, at in enumerate(self.position)]
        self.record(ARC, sense * (turn + extra_turns * tau), centre, frame)

    def move_home(self) -> None:
        """Move over the programmed point to axis positions zero, or the nearest end of travel."""
        target = self.target() if self.dialect != "printer" else {}
        if any(self.local()[index] != at for index, at in target.items()):
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
