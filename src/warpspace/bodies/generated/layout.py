"""What generated bodies are laid out around: the home position, the working volume, and sizes.

Everything is built where the machine stands at home, in R: linear axes in the middle of their
travel, rotary axes at zero or as near as their travel allows. A machine whose slides are turned
against R is built upright, its frames being turned back (see `slant`).
"""

from dataclasses import dataclass

import numpy as np

from warpspace.bodies.generated.slant import find_slant
from warpspace.kinematics.bodies import body_motions
from warpspace.kinematics.model import Model
from warpspace.machine.description import Axis, Machine
from warpspace.units import Array

UP = np.array([0.0, 0.0, 1.0])
_SHARE_OF_VOLUME, _SMALLEST_MM = 0.2, 12.0
_FLAT = 0.3
"""Of the longest half edge: what a volume is taken to have where no axis moves."""
_ARMS = 0.4
"""Of the length of all arms: half edge of the place before a robot without level axes."""
_STEEP = 0.75
"""Cosine of an angle to a direction below which an axis counts as pointing along it."""


@dataclass(frozen=True)
class Layout:
    """A machine at home.

    Attributes
    ----------
    machine : Machine
    poses : dict of str to ndarray, [4, 4]
        Every frame in R.
    half_mm : ndarray, [3], mm
        Half edges of the working volume along the axes of R.
    unit_mm : float
        Thickness of a wall; every other size of a body is a multiple of it.
    slant : ndarray, [3, 3]
        What everything above is turned by in R: the unit matrix, but for a slanted machine.
    """

    machine: Machine
    poses: dict[str, Array]
    half_mm: Array
    unit_mm: float
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

    def half_travel_mm(self, axis: Axis) -> float:
        """Give half the travel of a linear axis, mm."""
        return (axis.travel[1] - axis.travel[0]) / 2.0


def build_layout(machine: Machine) -> Layout:
    """Place every frame of a machine at home and find its sizes."""
    home = {
        name: np.asarray(
            sum(axis.travel) / 2.0
            if axis.is_linear
            else min(max(0.0, axis.travel[0]), axis.travel[1])
        )
        for name, axis in machine.axes.items()
    }
    poses = {
        name: motion.nominal for name, motion in body_motions(Model(machine), {}, home).items()
    }
    slant = find_slant(machine, poses)
    upright = np.eye(4)
    upright[:3, :3] = slant.T
    poses = {name: upright @ pose for name, pose in poses.items()}
    half = np.zeros(3)
    spanned: set[int] = set()
    for axis in machine.axes.values():
        if axis.is_linear and axis.index not in spanned:
            spanned.add(axis.index)
            reach = (axis.travel[1] - axis.travel[0]) / 2.0
            half += reach * np.abs(poses[axis.name][:3, axis.index])
    lengths = [np.linalg.norm(offset) for offset in machine.fixed_mm.values()]
    lengths += [np.linalg.norm(axis.offset_mm) for axis in machine.axes.values()]
    arms = [np.hypot(*a.offset_mm[:2]) for a in machine.axes.values() if not a.is_linear]
    reach = max(half.max(), 0.8 * sum(arms) if np.count_nonzero(half > 1.0) < 3 else 0.0)
    if reach < 1.0:
        reach = max(200.0, 0.3 * float(max(lengths, default=0.0)))
    filled = np.maximum(half, _FLAT * reach)
    unit = max(_SHARE_OF_VOLUME * 2.0 * float(filled.mean()), _SMALLEST_MM)
    return Layout(machine, poses, _turned(machine, poses, half, filled), unit, slant)


def _turned(machine: Machine, poses: dict[str, Array], half: Array, filled: Array) -> Array:
    """Make room for a volume that an upright rotary axis spans where a level one is missing."""
    flat = [k for k in (0, 1) if half[k] < 1.0]
    upright = [
        axis
        for axis in machine.axes.values()
        if not axis.is_linear and abs(poses[axis.name][2, axis.index]) > _STEEP
    ]
    if not flat or not upright:
        return filled
    arms = sum(float(np.hypot(*axis.offset_mm[:2])) for axis in machine.axes.values())
    wide = float(half[:2].max()) if len(flat) == 1 else max(_ARMS * arms, float(filled[:2].max()))
    room = filled.copy()
    room[flat] = wide
    return room
