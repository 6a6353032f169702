"""Moves of a program, and the modes in which they are expressed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpspace.bench.placing import follow
from warpspace.kinematics.model import Model
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.axes import is_linear
from warpspace.scene.model import Scene
from warpspace.units import Array, Integers

STAND, RAPID, FEED, ARC = range(4)  # kinds of moves; STAND: the same place in another mode
PLANES = "YZ", "ZX", "XY"  # of arcs, by the direction across


@dataclass(frozen=True, eq=False)
class ParsedProgram:
    """Moves of a program, one per row; each begins where the previous one ends."""

    scene: Scene
    axes: tuple[str, ...]  # of its machine, [a]
    line: Integers  # [m], of the file, from 1; 0 for the initial positions
    kind: Integers  # [m]; STAND, RAPID, FEED or ARC
    tcp: NDArray[np.bool_]  # [m]
    across: Integers  # [m]; direction 0 to 2 about which an arc turns
    frame: Integers  # [m]; of the arc, row of `frames`
    length_mm: Array  # [m], of the tool
    turn_rad: Array  # [m]; of an arc, positive counter-clockwise seen against that direction
    centre_mm: NDArray[np.complex128]  # [m]; of an arc, along the two axes of its `PLANES`
    # [m, a], mm and degrees; axis positions. With TCP those of the linear axes bring the scene's
    # tool point to where the tip is while rotary axes are at zero: see `upright`
    end: Array
    frames: Array  # [k, 3, 3]; axes of frames in linear axes: an arc turns in those of its frame
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
        is_turned, letters = len(self.frames) > 1, [name[0] for name in self.axes]
        linear = [letters.index(x) for x in "XYZ"] if is_turned else []
        rotations = self.frames[self.frame[move]]
        if is_turned:
            for places in (start, end, at):
                places[arc[:, None], linear] = np.einsum(
                    "nij,ni->nj", rotations, places[arc[:, None], linear]
                )
        columns = [[letters.index(x) if x in letters else 0 for x in names] for names in PLANES]
        rows, plane = arc[:, None], np.array(columns)[self.across[move]]
        centre = self.centre_mm[move]
        first, last = (places[rows, plane] @ [1.0, 1j] - centre for places in (start, end))
        grown = 1.0 + share * (np.abs(last / first) - 1.0)
        place = centre + first * grown * np.exp(1j * share * self.turn_rad[move])
        at[rows, plane] = np.stack([place.real, place.imag], axis=-1)
        if is_turned:
            at[rows, linear] = np.einsum("nij,nj->ni", rotations, at[rows, linear])
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
