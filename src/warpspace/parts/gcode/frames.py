"""Frames of a program: shifted, rotated and mirrored coordinates, and tilted planes.

A frame transforms words to words relative to the active work offset. In a tilted plane (3+2 axes)
the rotary axes have turned the tool along z of the frame: words are the tip on the workpiece, as
with tool centre point, while the rotary axes stand. Axes that a feed has not named since their
coordinates changed are refused: controls differ in whether they then move.
"""

from collections.abc import Mapping, Sequence
from math import tau

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import FULL_TURN_DEG
from warpspace.parts.gcode.control import Control
from warpspace.parts.gcode.parsed import PLANES, axes_at, programmed_words
from warpspace.units import Array

ALIGNED = 1e-9


def rotation(index: int, angle_deg: float) -> Array:
    """Build a rotation about x, y or z, [4, 4]."""
    turned = transforms.axis_rotation(index, tau * angle_deg / FULL_TURN_DEG)
    return transforms.rigid(turned, np.zeros(3))


class Frames(Control):
    """Frames and tilted planes of a control."""

    def set_frame(self, code: str, frame: Array | None = None, *, is_tilted: bool = False) -> None:
        """Change the frame; the axes whose coordinates change are to be programmed again."""
        if not {*"XYZ"} <= self.index.keys():
            self.refuse(code, "expected axes X, Y and Z")
        self.uncorrectable.setdefault(self.line, code)
        before, tcp = self.local(), self.tcp and not self.is_tilted
        self.frame, self.is_tilted, self.tilt = frame, is_tilted, None
        self.frame_code = code if frame is not None else ""
        self.switch(tcp=tcp or is_tilted, length_mm=self.length_mm)
        changed = [abs(x - y) > ALIGNED for x, y in zip(before, self.local(), strict=True)]
        is_mixing = frame is not None and np.count_nonzero(frame[:3, :3]) > 3
        unknown = self.unnamed_axes | self.lost if is_mixing else set[int]()
        linear = {x: index for x, index in self.index.items() if x in "XYZ"}
        self.pending |= {x for x, index in linear.items() if changed[index] or index in unknown}

    def check_alone(self, code: str) -> None:
        """Refuse a frame of SINUMERIK beside other codes, or after a word."""
        keys = [key for key, _ in self.tokens if key not in {"", "N", "skipped"}]
        if keys[0] != code or len(self.codes) > 1:
            self.refuse(code, "expected it first in its block, without other codes")

    def rotate(self, code: str) -> None:
        """Rotate coordinates in the plane about a point (G68), until G69."""
        if code == "G69":
            if self.frame_code in {"G68", "G53.1"} or self.tilt is not None:
                self.set_frame(code)
            return
        self.check_free(code)
        names = PLANES[self.across]
        if not self.absolute or not {*names} <= {*self.index}:
            self.refuse(code, f"expected G90 and axes {names}")
        if "R" not in self.words or (self.letters and self.letters != {*names}):
            self.refuse(code, f"expected R, and both {names[0]} and {names[1]} or neither")
        pivot = np.zeros(3)
        for x in names:
            present = self.position[self.index[x]] - self.place(x, 0.0)
            pivot["XYZ".index(x)] = self.value(x) if self.letters else present
        turned = rotation(self.across, self.value("R"))
        self.set_frame(
            code, transforms.translation(pivot) @ turned @ transforms.translation(-pivot)
        )

    def mirror(self, code: str) -> None:
        """Mirror coordinates at positions of axes: G51.1, or G101 of Haas; until G50.1 or G100."""
        if code in {"G50.1", "G100"}:
            if self.frame is not None and self.frame_code in {"G51.1", "G101"}:
                mirrored = [
                    x for x, at in zip("XYZ", np.diag(self.frame), strict=False) if at < 0.0
                ]
                if self.letters and self.letters != {*mirrored}:
                    self.refuse(code, f"expected {' and '.join(mirrored)}")
                self.set_frame(code)
            return
        self.check_free(code)
        if not self.letters or not self.letters <= {*"XYZ"} or not self.absolute:
            self.refuse(code, "expected axes of X Y Z, and G90")
        frame = np.eye(4)
        for x in self.letters:
            row = "XYZ".index(x)
            frame[row, row], frame[row, 3] = -1.0, 2.0 * self.value(x)
            if code == "G101" and frame[row, 3]:
                self.refuse(f"{x}{self.words[x]:g}", f"expected {x}0")
        self.set_frame(code, frame)

    def program_frame(self, code: str) -> None:
        """Shift, rotate or mirror coordinates on SINUMERIK; an additive one begins with A."""
        self.check_alone(code)
        kind, letters = code.removeprefix("A"), {*self.words} - {"N"}
        old = None if self.programmed is None or kind == code else self.programmed
        if not letters <= {*"XYZ", *(("RPL",) if kind == "ROT" else ())} or (
            kind == "ROT" and len(letters) > 1
        ):
            expected = "one angle: X, Y, Z or RPL=" if kind == "ROT" else "X, Y, Z"
            self.refuse(code, f"expected {expected} in its block")
        new = np.eye(4)
        for x in letters:
            row = self.across if x == "RPL" else "XYZ".index(x)
            if kind == "ROT":
                new = rotation(row, self.words[x])
            elif kind == "TRANS":
                new[row, 3] = self.value(x)
            else:
                new[row, row] = -1.0
        self.programmed = (
            (new if old is None else old @ new) if letters or old is not None else None
        )
        frame = self.programmed
        if self.swivelled is not None:
            frame = self.swivelled if frame is None else self.swivelled @ frame
        self.set_frame(code, frame, is_tilted=self.is_tilted)

    def transform(self, code: str) -> None:
        """Switch the tool centre point by TRAORI and TRAFOOF."""
        if code == "TRAORI" and self.length_mm and not self.is_compensated:
            self.refuse(code, "expected D before")
        if self.is_tilted:
            self.refuse(code, "expected CYCLE800() before")
        self.remark_turned(code)
        by_word = code == "TRAORI" and self.settings.tcp == "program"
        self.switch(tcp=by_word or self.settings.tcp == "always", length_mm=self.length_mm)

    def follow_table(self, code: str) -> None:
        """Let the work offset follow the turned table (G254 of Haas), until G255."""
        old = self.shift.pop("G254", {})
        self.uncorrectable.setdefault(self.line, code)
        if code == "G254":
            self.check_free(code)
            chain = self.scene.machine.chain
            at = dict(zip(self.names, map(np.asarray, self.position), strict=True))
            if any(at[name] for name in chain.tool if not is_linear(name)):
                self.refuse(code, "expected the rotary axes of the tool at zero")
            length = self.length_mm if self.is_compensated else 0.0
            zero = {x: self.place(x, 0.0) - length * (x == "Z") for x in "XYZ" if x in self.index}
            at |= {self.names[self.index[x]]: np.asarray(value) for x, value in zero.items()}
            turned = axes_at(self.scene.model, 0.0, at)
            self.shift["G254"] = {
                x: float(turned[self.names[self.index[x]]]) - value for x, value in zero.items()
            }
            self.remark_turned(code)
        new = self.shift.get("G254", {})
        self.pending |= {x for x in "XYZ" if abs(new.get(x, 0.0) - old.get(x, 0.0)) > ALIGNED}

    def remark_turned(self, code: str, frame: str = "at rotary zero") -> bool:
        """Remark that the table is not at zero where its position matters."""
        turned = " ".join(
            f"{name}{at:g}"
            for name, at in zip(self.names, self.position, strict=True)
            if at and not is_linear(name) and name in self.scene.machine.chain.workpiece
        )
        if turned:
            self.remarks.setdefault(f"{code} at {turned}: workpiece frame {frame}", self.line)
        return bool(turned)

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
        if by_word and self.is_tilted:
            self.refuse(code, "expected G69 before")
        if self.frame_code in {"G43.4", "G234"}:
            self.frame, self.frame_code = None, ""
        tcp = by_word or self.is_tilted or self.settings.tcp == "always"
        self.switch(tcp=tcp or (code == "D" and self.tcp), length_mm=length)
        if not by_word:
            return
        present = self.settings.tcp_frame == "present" or (
            self.settings.tcp_frame == "auto" and self.dialect == "fanuc"
        )
        name = "as it stands" if present else "at rotary zero"
        if self.remark_turned(code, f"{name} (--tcp-frame)") and present:
            if self.frame is not None:
                self.refuse(code, "expected frames cancelled before")
            self.frame, self.frame_code = self.table_frame(), code
            self.uncorrectable.setdefault(self.line, code)

    def table_frame(self) -> Array:
        """Compute the frame in which words of the present table are places at rotary zero."""
        model, chain = self.scene.model, self.scene.machine.chain
        zero = np.array([self.place(x, 0.0) for x in "XYZ"])
        places = zero + np.vstack([np.zeros(3), np.eye(3)])
        at: dict[str, Array] = {}
        for name, position in zip(self.names, self.position, strict=True):
            at[name] = np.full(4, position if is_linear(name) or name in chain.workpiece else 0.0)
        names = [self.names[self.index[x]] for x in "XYZ"]
        at |= dict(zip(names, places.T, strict=True))
        axes = programmed_words(model, relative_point(model, at), at)
        points = np.stack([axes[name] for name in names], axis=-1)
        return transforms.rigid((points[1:] - points[0]).T, points[0] - zero)

    def check_pending(self) -> None:
        """Refuse a feed before axes whose coordinates changed are programmed."""
        if self.pending:
            axes = ", ".join(sorted(self.pending))
            self.refuse(self.motion, f"expected {axes} before: not programmed in this frame")

    def target(self) -> dict[int, float]:
        """Return the target of the block, in the frame, by number of the axis."""
        to: dict[int, float] = {}
        if self.tilt is not None and self.letters & {*"XYZ"}:
            self.refuse(self.motion, "expected G53.1 before")
        local = self.position if self.frame is None else self.local()
        for letter in (x for x in self.words if x in self.index):
            value, index = self.value(letter), self.index[letter]
            mode = self.modes.get(letter, "")
            is_absolute = mode == "AC" if mode else self.absolute
            if not is_absolute and letter in self.pending:
                self.refuse(f"{letter}{self.words[letter]:g}", "expected G90 in another frame")
            to[index] = self.place(letter, value) if is_absolute else local[index] + value
        if self.pending:
            self.pending -= self.letters
        return to

    def _linear(self) -> tuple[list[int], Array, float]:
        """Return indices of X, Y, Z, the places of words 0, and the length that Z includes."""
        zero = np.array([self.place(x, 0.0) for x in "XYZ"])
        length = self.length_mm if self.is_tilted and not self.is_compensated else 0.0
        return [self.index[x] for x in "XYZ"], zero, length

    def local(self) -> list[float]:
        """Return the position in the frame, where words lead without it."""
        if self.frame is None:
            return self.position
        indices, zero, length = self._linear()
        coordinates = transforms.apply(
            transforms.inverse(self.frame), np.array(self.position)[indices] - zero
        )
        coordinates[2] += length
        local = np.array(self.position)
        local[indices] = coordinates + zero
        return local.tolist()

    def axis_targets(self, to: Mapping[int, float]) -> Mapping[int, float]:
        """Transform a target in the frame to the axes that reach it."""
        if self.frame is None:
            return to
        local, (indices, zero, length) = self.local(), self._linear()
        coordinates = np.array([to.get(index, local[index]) for index in indices]) - zero
        coordinates[2] -= length
        places = zip(
            indices, (transforms.apply(self.frame, coordinates) + zero).tolist(), strict=True
        )
        moved = {i: at for i, at in places if i in to or abs(at - self.position[i]) > ALIGNED}
        return {**{i: at for i, at in to.items() if i not in indices}, **moved}

    def arc_centre(
        self, places: Mapping[int, float], indices: Sequence[int], centre: complex
    ) -> tuple[complex, int]:
        """Return the centre of an arc along the axes of its frame, and the row of the frame."""
        if self.frame is None:
            return centre, 0
        if not np.array_equal(self.frames[-1], self.frame[:3, :3]):
            self.frames.append(self.frame[:3, :3])
        targets = self.axis_targets(places)
        linear = np.array([targets.get(i, self.position[i]) for i in self._linear()[0]])
        along = self.frame[:3, :3].T @ linear
        first, second = ("XYZ".index(self.names[index][0]) for index in indices)
        return complex(along[first], along[second]), len(self.frames) - 1
