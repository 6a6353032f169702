"""Tilted planes (3+2 axes): the rotary axes turn the tool along z of a frame."""

import re
from itertools import pairwise
from math import atan2, sqrt, tau

import numpy as np

from warpspace.bench.placing import linear_axes, motion_direction
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import tool_axis
from warpspace.kinematics.model import Model
from warpspace.kinematics.relative_motion import programmed_direction
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import FULL_TURN_DEG
from warpspace.parts.gcode.control_settings import NUMBER
from warpspace.parts.gcode.frames import ALIGNED, rotation
from warpspace.parts.gcode.motion import Motion
from warpspace.parts.gcode.parsed import RAPID
from warpspace.units import Array


def align_tool(model: Model, normal: Array) -> list[dict[str, float]]:
    """Compute the positions of two rotary axes at which the tool stands along a direction.

    With e = the tool axis and n = the direction, both over the workpiece at rotary zero, and the
    axes w₁, w₂ from the workpiece to the tool: n = R(w₁) c and c = R(w₂) e, where w₁·c = w₁·n and
    w₂·c = w₂·e. Solutions lack axes whose position is arbitrary; there are none for other machines.

    Parameters
    ----------
    model : Model
    normal : ndarray, [3]
        Unit vector in words of the linear axes.
    """
    machine = model.machine
    zero = {name: np.zeros(()) for name in machine.axes}
    chain = (*reversed(machine.chain.workpiece), *machine.chain.tool)
    names = [name for name in chain if not is_linear(name)]
    linear = linear_axes(machine)
    if len(names) != 2 or len(linear) != 3:
        return []
    moves = np.stack([motion_direction(model, zero, linear[index]) for index in range(3)], axis=-1)
    end, normal = tool_axis(model, zero), moves @ normal
    first, second = (programmed_direction(model, zero, name) for name in names)
    across, cosine = np.cross(first, second), float(first @ second)
    if across @ across < ALIGNED or np.abs(moves[:, 2] - end).max() > ALIGNED:
        return []
    alpha, beta = np.linalg.solve(
        [[1.0, cosine], [cosine, 1.0]], np.array([first @ normal, second @ end])
    )
    square = (1.0 - alpha**2 - beta**2 - 2.0 * alpha * beta * cosine) / (across @ across)
    if square < -ALIGNED:
        return []
    solutions: list[dict[str, float]] = []
    for height in {sqrt(max(square, 0.0)), -sqrt(max(square, 0.0))}:
        middle = alpha * first + beta * second + height * across
        solution: dict[str, float] = {}
        for name, axis, (start, to) in zip(
            reversed(names), (second, first), pairwise((end, middle, normal)), strict=True
        ):
            sine, along = axis @ np.cross(start, to), start @ to - (axis @ start) * (axis @ to)
            if sine**2 + along**2 > ALIGNED**2:
                solution[name] = atan2(sine, along) * FULL_TURN_DEG / tau
        solutions.append(solution)
    return solutions


class TiltedPlanes(Motion):
    """Tilted planes of a control."""

    def tilt_plane(self, code: str) -> None:
        """Define a tilted plane: origin X Y Z, and rotations about z, x and z (G68.2)."""
        self.check_free(code)
        if self.letters != {*"XYZ"} or not {*"IJK"} <= self.words.keys() or not self.absolute:
            self.refuse(code, "expected X Y Z and I J K in G90")
        self.remark_turned(code)
        frame = transforms.translation([self.value(x) for x in "XYZ"])
        for letter, index in (("I", 2), ("J", 0), ("K", 2)):
            frame = frame @ rotation(index, self.words[letter])
        self.tilt = frame

    def align(self, code: str) -> None:
        """Turn the tool along z of the tilted plane (G53.1)."""
        if self.tilt is None or self.letters:
            self.refuse(code, "expected G68.2 before, and no axes")
        self.swivel(code, self.tilt)

    def swivel(self, code: str, frame: Array, sense: float = 0.0) -> None:
        """Turn the rotary axes to a frame: the nearest solution, or by the sense of the first."""
        axes, chain = self.scene.machine.axes, self.scene.machine.chain
        leading = next((x for x in (*chain.tool, *chain.workpiece) if not is_linear(x)), "")
        solutions: list[tuple[float, dict[int, float]]] = []
        for solution in align_tool(self.scene.model, frame[:3, 2]):
            targets: dict[int, float] = {}
            for name, angle in solution.items():
                index, (low, high) = self.names.index(name), axes[name].travel
                turns = np.arange(np.ceil((low - angle) / 360.0 - ALIGNED),
                                  np.floor((high - angle) / 360.0 + ALIGNED) + 1.0)  # fmt: skip
                if len(turns):
                    positions = angle + FULL_TURN_DEG * turns
                    nearest = np.abs(positions - self.position[index]).argmin()
                    targets[index] = float(positions[nearest])
            if len(targets) == len(solution):
                distance = sum(abs(at - self.position[index]) for index, at in targets.items())
                solutions.append(
                    (-sense * solution.get(leading, 0.0) if sense else distance, targets)
                )
        if not solutions:
            self.refuse(code, "expected a plane that two rotary axes reach within their travel")
        _, targets = min(solutions, key=lambda solution: solution[0])
        at = " ".join(f"{self.names[index]}{at:.6g}" for index, at in sorted(targets.items()))
        count = f"of {len(solutions)} solutions within the travel"
        self.remarks.setdefault(f"{code}: {at or 'no rotation'}, {count}", self.line)
        self.line_to(targets, RAPID, bare=True)
        self.set_frame(code, frame, is_tilted=True)

    def swivel_cycle(self, code: str) -> None:
        """Execute CYCLE800 with rotations axis by axis; without arguments end the plane."""
        self.check_alone(code)
        arguments = [argument.strip() for argument in self.arguments.split(",")]
        if self.programmed is not None or (self.tcp and not self.is_tilted) or self.letters:
            self.refuse(code, "expected no axes, and TRANS without axes and TRAFOOF before")
        self.swivelled, additive = None, self.swivelled
        self.set_frame(code)
        rotary = {i for i, axis in enumerate(self.names) if not is_linear(axis)}
        if arguments == [""]:  # whether the rotary axes return to zero depends on the control
            self.lost |= {i for i in rotary if self.position[i]}
            return
        fields = [argument or "0" for argument in (*arguments[:1], *arguments[2:])]
        is_name = re.fullmatch(r"(\"[^\"]*\")?", "".join(arguments[1:2]))
        if len(fields) < 13 or not is_name or not all(re.fullmatch(NUMBER, x) for x in fields):
            self.refuse(code, "expected 14 arguments or more, all numbers but the second")
        retract, status, mode, *numbers = map(float, fields[:13])
        sense = numbers.pop()
        order = [mode % 4 - 1, mode // 4 % 4 - 1, mode // 16 - 1]
        if (
            {*order} != {0, 1, 2}
            or status % 1000 not in {0, 1}
            or retract not in {0, 1, 2}
            or abs(sense) != 1
        ):
            self.refuse(
                code,
                "expected rotation axis by axis, status 0 or 1, retraction 0 to 2, direction ±1",
            )
        self.remark_turned(code)
        frame = transforms.translation(np.array(numbers[:3]) * self.unit_mm)
        for index in map(int, order):
            frame = frame @ rotation(index, numbers[3 + index])
        frame = frame @ transforms.translation(np.array(numbers[6:]) * self.unit_mm)
        frame = frame if additive is None or not status % 2 else additive @ frame
        if retract and self.first:
            self.lost |= {self.index[x] for x in ("Z", "XYZ")[int(retract) - 1] if x in self.index}
        self.swivel(code, frame, sense)
        self.swivelled = frame
