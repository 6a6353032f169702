"""What generated bodies are laid out around: the home position, the working volume, and sizes.

Everything is built where the machine stands at home, in R: linear axes in the middle of their
travel, rotary axes at zero or as near as their travel allows. A machine whose slides are turned
against R, as on the slant bed of a lathe, is built upright along its own slides, turned as they
are, and stands on a wedge.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from warpspace.kinematics.chain import body_motions
from warpspace.kinematics.model import Model
from warpspace.machine.description import Axis, Machine
from warpspace.units import Array

UP = np.array([0.0, 0.0, 1.0])
_SHARE_OF_VOLUME, _SMALLEST_MM = 0.2, 12.0
_FLAT = 0.3  # of the longest half edge: what a volume is taken to have where no axis moves
_ARMS = 0.4  # of the length of all arms: half edge of the place before a robot without level axes
_STEEP = 0.75  # cosine of an angle to a direction below which an axis counts as pointing along it
_ALIGNED, _SQUARE = 0.9994, 0.02
"""Cosines of two angles: 2 degrees to an axis of R, and one degree off a right angle."""


@dataclass(frozen=True)
class Layout:
    """A machine at home."""

    machine: Machine
    poses: dict[str, Array]  # [4, 4]; every frame in R
    half_mm: Array  # [3]; half edges of the working volume along the axes of R
    unit_mm: float  # thickness of a wall; every other size of a body is a multiple of it
    # [3, 3]; what everything above is turned by in R: the unit matrix, but for a slanted machine
    slant: Array

    @property
    def tip_mm(self) -> Array:
        """Tool point, [3], mm: the middle of the working volume."""
        return self.poses["t"][:3, 3]

    @property
    def gap_mm(self) -> float:
        """Clear space kept around the working volume, mm."""
        return 0.2 * self.unit_mm

    @property
    def low_mm(self) -> Array:
        """Lower corner of the working volume, [3], mm."""
        return self.tip_mm - self.half_mm

    @property
    def high_mm(self) -> Array:
        """Upper corner of the working volume, [3], mm."""
        return self.tip_mm + self.half_mm

    @property
    def tool_axis(self) -> Array:
        """Direction from the tool point to the spindle, [3]."""
        return self.poses["t"][:3, 2]

    def direction(self, axis: Axis) -> Array:
        """Give the unit vector along or about which an axis moves, [3], in R."""
        return self.poses[axis.name][:3, axis.index]

    def origin(self, axis: Axis) -> Array:
        """Give the origin of the frame of an axis, [3], mm in R."""
        return self.poses[axis.name][:3, 3]

    def along(self, axis: Axis) -> int:
        """Give the index of the axis of R nearest to an axis: 2 where it is vertical."""
        return 2 if self.is_vertical(axis) else int(np.argmax(np.abs(self.direction(axis)[:2])))

    def is_vertical(self, axis: Axis) -> bool:
        """Tell whether an axis points up or down at home."""
        return abs(float(self.direction(axis) @ UP)) > _STEEP

    def slides_level(self, axis: Axis) -> bool:
        """Tell whether an axis is linear and level."""
        return axis.is_linear and not self.is_vertical(axis)


def half_travel(axis: Axis) -> float:
    """Give half the travel of an axis, mm; 0 for a rotary one."""
    return (axis.travel[1] - axis.travel[0]) / 2.0 if axis.is_linear else 0.0


def build_layout(machine: Machine) -> Layout:
    """Place every frame of a machine at home and find its sizes."""
    axes = tuple(machine.axes.values())
    home = {
        axis.name: np.asarray(
            sum(axis.travel) / 2.0
            if axis.is_linear
            else min(max(0.0, axis.travel[0]), axis.travel[1])
        )
        for axis in axes
    }
    motions = body_motions(Model(machine), {}, home)
    slant = _find_slant(machine, {name: motion.nominal for name, motion in motions.items()})
    upright = np.eye(4)
    upright[:3, :3] = slant.T
    poses = {name: upright @ motion.nominal for name, motion in motions.items()}
    half = np.zeros(3)
    first = {axis.index: axis for axis in reversed(axes) if axis.is_linear}
    for axis in first.values():
        half += half_travel(axis) * np.abs(poses[axis.name][:3, axis.index])
    lengths = [np.linalg.norm(offset) for offset in machine.fixed_mm.values()]
    lengths += [np.linalg.norm(axis.offset_mm) for axis in axes]
    arms = [np.hypot(*axis.offset_mm[:2]) for axis in axes if not axis.is_linear]
    reach = max(half.max(), 0.8 * sum(arms) if np.count_nonzero(half > 1.0) < 3 else 0.0)
    if reach < 1.0:
        reach = max(200.0, 0.3 * float(max(lengths, default=0.0)))
    filled = np.maximum(half, _FLAT * reach)
    unit = max(_SHARE_OF_VOLUME * 2.0 * float(filled.mean()), _SMALLEST_MM)
    return Layout(machine, poses, _turned(machine, poses, half, filled), unit, slant)


def _turned(machine: Machine, poses: dict[str, Array], half: Array, filled: Array) -> Array:
    flat = [k for k in (0, 1) if half[k] < 1.0]
    turns_upright = any(
        not axis.is_linear and abs(poses[axis.name][2, axis.index]) > _STEEP
        for axis in machine.axes.values()
    )
    if not flat or not turns_upright:
        return filled
    arms = sum(float(np.hypot(*axis.offset_mm[:2])) for axis in machine.axes.values())
    wide = float(half[:2].max()) if len(flat) == 1 else max(_ARMS * arms, float(filled[:2].max()))
    room = filled.copy()
    room[flat] = wide
    return room


# --- slides turned against R ------------------------------------------------------------------


def _find_slant(machine: Machine, poses: Mapping[str, Array]) -> Array:
    """Find how the slides of a machine are turned against the axes of R."""
    linear = [poses[axis.name][:3, axis.index] for axis in machine.axes.values() if axis.is_linear]
    if all(np.abs(way).max() > _ALIGNED for way in linear):
        return np.eye(3)
    triad: list[Array] = []
    for way in linear:
        cosines = [abs(float(way @ known)) for known in triad]
        if any(_SQUARE < cosine < 1.0 - _SQUARE for cosine in cosines):
            return np.eye(3)
        if not any(cosine > 0.5 for cosine in cosines):
            triad.append(way)
    turned = _nearest(_completed(triad), np.array(linear))
    turning = [axis for axis in machine.branch("workpiece") if not axis.is_linear]
    about = [turned.T @ poses[axis.name][:3, axis.index] for axis in turning]
    return turned if all(np.abs(way).max() > _ALIGNED for way in about) else np.eye(3)


def _completed(triad: list[Array]) -> Array:
    found = list(triad)
    for axis in np.eye(3)[np.argsort(np.abs(np.sum(np.square(triad), axis=0)))]:
        if len(found) < 3:
            rest = axis - sum((float(axis @ known) * known for known in found), np.zeros(3))
            if np.linalg.norm(rest) > 0.5:
                found.append(rest / np.linalg.norm(rest))
    left, _, right = np.linalg.svd(np.array(found).T)
    return left @ right


def _nearest(triad: Array, linear: Array) -> Array:
    """Order and point three directions so that they are turned least, [3, 3], as columns."""

    def rank(turned: Array) -> tuple[float, float]:
        level = np.abs(linear @ turned[:, 2]) < 0.5
        return round(float(np.trace(turned)), 6), float(level.sum())

    every = (
        triad[:, order] * signs
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    )
    return max((turned for turned in every if np.linalg.det(turned) > 0.0), key=rank)
