"""What carries a head from above: ram, carriages, beam, bridge, column or arms.

The walk goes from the head to the bed. `_Rear` is the upright plane that the bodies so far end
with; the next body is put behind it. i is the direction across (along a beam), j the depth.
"""

from dataclasses import dataclass

import numpy as np

from warpspace.bodies.generated.head import BASE, Mount, head_axes
from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, capped, rod, spread, upright
from warpspace.bodies.generated.table import Stack
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import Range
from warpspace.machine.description import Axis
from warpspace.units import Array

_ARM = 0.9
"""Thickness of an arm, in walls."""
_LONG = 1.5
"""Ratio of travels from which a machine is a gantry on rails instead of a saddle on a wall."""


@dataclass
class _Rear:
    """Where the bodies so far end.

    Attributes
    ----------
    plane : float
        Position along j, mm.
    low, high : float
        Ends upwards, mm.
    half : float
        Half width across, mm.
    need : str
        What has to come next: "plate", "beam", "ledge", "column", "posts", "rails".
    reach : float
        Half travel along i (or upwards) that the next body has to cover, mm.
    """

    plane: float
    low: float
    high: float
    half: float
    need: str = "plate"
    reach: float = 0.0


class _Overhead:
    """The frame of a machine with a spindle from above, while it is built."""

    def __init__(self, layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
        self.layout, self.parts, self.stack, self.mount = layout, parts, stack, mount
        self.u = layout.unit_mm
        self.arm_step = _ARM * self.u
        carried = len(head_axes(layout))
        branch = layout.machine.branch("tool")
        self.axes = list(reversed(branch[: len(branch) - carried]))
        level = [a for a in reversed(self.axes) if a.is_linear and not layout.is_vertical(a)]
        self.i = self._across(level)
        self.j = 1 - self.i
        self.spine = mount.point_mm
        self.low, self.high = layout.low_mm, layout.high_mm

    def _across(self, level: list[Axis]) -> int:
        """Choose the direction of the beam from the level axes, from the bed to the tool."""
        ways = [self.layout.along(axis) for axis in level]
        if len(level) < 2 or ways[0] == ways[1]:
            return 0
        lengths = [self.layout.half_travel_mm(axis) for axis in level[:2]]
        if ways[0] == 0:
            return 1 if lengths[0] >= _LONG * lengths[1] else 0
        return ways[1]

    def b(self, i: Range, j: Range, z: Range):  # noqa: ANN201
        """Build a box from ranges across, in depth and upwards, mm."""
        return spread({self.i: i, self.j: j, 2: z})

    def around(self, half: float) -> Range:
        """Give a range across about the spindle line, mm."""
        return (float(self.spine[self.i]) - half, float(self.spine[self.i]) + half)

    def build(self) -> None:
        """Walk from the head to the bed."""
        u, top = self.u, float(self.spine[2])
        rear: _Rear | None = None
        at, last = self.spine.copy(), None
        for place, axis in enumerate(self.axes):
            rest = self.axes[place + 1 :]
            if not axis.is_linear:
                if rear is not None:
                    at[self.j], top, rear = rear.plane, rear.high, None
                at, top = self._add_turning(axis, at, top)
            elif self.layout.is_vertical(axis):
                rear, top = self._add_vertical(axis, rear, rest, at, top)
            else:
                rear = self._add_level(axis, rear, top)
            last = axis
        if last is not None and not last.is_linear:
            self._add_pedestal(at, top)
            return
        if rear is None:
            rear = self._add_cantilever(top)
        self._add_base(rear)

    # --- axes -------------------------------------------------------------------------------------

    def _add_vertical(
        self, axis: Axis, rear: _Rear | None, rest: list[Axis], at: Array, top: float
    ) -> tuple[_Rear | None, float]:
        """Add a quill, a ram, a headstock or a beam that rises."""
        u, reach = self.u, self.layout.half_travel_mm(axis)
        name, w = axis.name, self.mount.half_mm
        if rear is None and rest and not rest[0].is_linear:
            arms = sum(not turning.is_linear for turning in rest)
            first = top + reach + 0.2 * u + (arms - 1) * _ARM * u
            self.arm_step = -_ARM * u
            self.parts.add(name, "quill", METAL, upright(0.4 * u, (top, first + reach + 1.6 * u), at))
            return None, first
        if rear is None and any(a.is_linear and not self.layout.is_vertical(a) for a in rest):
            low, high = top + 0.5 * u, top + 1.7 * reach + 1.5 * u
            front = float(self.spine[self.j])
            self.parts.add(
                name, "ram", MIDDLE,
                self.b(self.around(w), (front - w, front + w), (top, high + 0.5 * reach + 0.6 * u)),
            )  # fmt: skip
            return _Rear(front + w, low, high, w + 0.5 * u), top
        if rear is None:
            return self._add_headstock(axis, top, reach), top
        if rear.need == "beam":
            self._add_beam(name, rear, "beam", DARK)
            ends = max(rear.half + rear.reach, self._clear_half())
            return _Rear(rear.plane + 1.3 * u, rear.low, rear.high, ends, "posts", reach), top
        self.parts.add(
            name, "carriage", DARK,
            self.b(self.around(rear.half), (rear.plane, rear.plane + 0.6 * u), (rear.low, rear.high)),
        )  # fmt: skip
        return _Rear(
            rear.plane + 0.6 * u, rear.low - reach, rear.high + reach, rear.half, "column"
        ), top

    def _add_headstock(self, axis: Axis, top: float, reach: float) -> _Rear:
        """Add the overhanging headstock of a C-frame."""
        u, w = self.u, 1.25 * self.mount.half_mm
        front = float(self.spine[self.j])
        column = self._behind(front + w + 1.2 * u)
        high = top + 3.2 * u
        self.parts.add(
            axis.name, "headstock", LIGHT,
            self.b(self.around(w), (front - w, column - 0.35 * u), (top, high)),
            self.b(self.around(1.25 * w), (column - 0.35 * u, column - 0.12 * u), (top - 0.2 * u, high + 0.8 * u)),
        )  # fmt: skip
        motor = self.spine.copy()
        self.parts.add(axis.name, "headstock", LIGHT, upright(0.62 * w, (high, high + 1.3 * u), motor))
        return _Rear(column, top - 0.2 * u - reach, high + 0.8 * u + reach, 1.45 * w, "column")

    def _add_level(self, axis: Axis, rear: _Rear | None, top: float) -> _Rear:
        """Add a carriage, a saddle or a bridge of a level axis."""
        u, reach, name = self.u, self.layout.half_travel_mm(axis), axis.name
        across = self.layout.along(axis) == self.i
        if rear is None:
            front, w = float(self.spine[self.j]), 1.2 * self.mount.half_mm
            self.parts.add(
                name, "carriage", DARK,
                self.b(self.around(w), (front - w, front + w), (top, top + 1.6 * u)),
            )  # fmt: skip
            rear = _Rear(front + w, top, top + 1.6 * u, w)
            if not across:
                return self._add_sliding_ram(name, rear, reach)
            return _Rear(rear.plane, rear.low, rear.high, rear.half, "beam", reach)
        if rear.need == "ledge" and across:
            return self._add_ledge_saddle(name, rear, reach)
        if rear.need == "beam" and not across:
            return self._add_bridge(name, rear, reach)
        if rear.need in ("column", "posts"):
            self._add_column(name, rear, foot=True)
            rear.need, rear.reach = "rails", reach
            return rear
        if across:
            self.parts.add(
                name, "carriage", DARK,
                self.b(self.around(rear.half), (rear.plane, rear.plane + 0.6 * u), (rear.low, rear.high)),
            )  # fmt: skip
            return _Rear(rear.plane + 0.6 * u, rear.low, rear.high, rear.half, "beam", reach)
        return self._add_sliding_ram(name, rear, reach)

    def _add_sliding_ram(self, name: str, rear: _Rear, reach: float) -> _Rear:
        """Add a body that slides in depth upon a ledge, with a plate before it."""
        u = self.u
        middle = (rear.low + rear.high) / 2.0
        under = max(rear.low, middle - 1.9 * u)
        back = max(rear.plane + 2.0 * reach + 2.4 * u, self._behind(0.0) + 2.0 * reach + 1.6 * u)
        self.parts.add(
            name, "saddle", LIGHT,
            self.b(self.around(rear.half), (rear.plane, rear.plane + 0.55 * u), (rear.low, rear.high)),
            self.b(self.around(0.92 * rear.half), (rear.plane + 0.55 * u, back), (under, middle + 1.5 * u)),
        )  # fmt: skip
        return _Rear(back, under, middle + 1.5 * u, rear.half, "ledge", reach)

    def _add_ledge_saddle(self, name: str, rear: _Rear, reach: float) -> _Rear:
        """Add the saddle across that a sliding ram rests on."""
        u, front = self.u, self._behind(0.0)
        self.parts.add(
            name, "saddle", DARK,
            self.b(self.around(1.35 * rear.half), (front, rear.plane - 0.1 * u), (rear.low - 1.3 * u, rear.low - 0.25 * u)),
            *(
                self.b(
                    (self.around(0.0)[0] + s * 0.6 * rear.half - 0.2 * u, self.around(0.0)[0] + s * 0.6 * rear.half + 0.2 * u),
                    (front, rear.plane - 0.1 * u), (rear.low - 0.25 * u, rear.low),
                )
                for s in (-1.0, 1.0)
            ),
        )  # fmt: skip
        return _Rear(
            rear.plane, rear.low - 1.3 * u, rear.high, 1.35 * rear.half + reach, "ledge", reach
        )

    def _add_beam(self, name: str, rear: _Rear, what: str, colour: tuple[int, int, int]) -> None:
        """Add a beam across behind a carriage, with its two rails."""
        u = self.u
        rear.low = max(rear.low, float(self.high[2]) + self.layout.gap_mm)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        i, front = self.around(half), rear.plane + 0.18 * u
        high = max(rear.low + 2.6 * u, min(rear.high, rear.low + 3.6 * u))
        self.parts.add(name, what, colour, self.b(i, (front, front + 1.5 * u), (rear.low + 0.15 * u, high)))
        for z in (rear.low + 0.5 * u, high - 0.5 * u):
            self.parts.add(name, what, colour, self.b(i, (rear.plane, front), (z - 0.16 * u, z + 0.16 * u)))
        rear.high = high

    def _add_bridge(self, name: str, rear: _Rear, reach: float) -> _Rear:
        """Add a bridge: a beam and the two legs that run on the sides of the bed."""
        u, bed = self.u, self._rail_mm()
        self._add_beam(name, rear, "bridge", LIGHT)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        middle = rear.plane + 0.9 * u
        for side in (-1.0, 1.0):
            near = self.around(0.0)[0] + side * half
            leg = sorted((near, near + side * 1.0 * u))
            self.parts.add(
                name, "bridge", LIGHT,
                self.b((leg[0], leg[1]), (middle - 1.1 * u, middle + 1.1 * u), (bed + 0.55 * u, rear.high)),
                self.b((leg[0], leg[1]), (middle - 1.9 * u, middle + 1.9 * u), (bed + 0.12 * u, bed + 0.55 * u)),
            )  # fmt: skip
            ends = (middle - 1.9 * u - reach, middle + 1.9 * u + reach)
            wall = (leg[0] - 0.12 * u, leg[1] + 0.12 * u)
            self.parts.add(BASE, "sides", MIDDLE, self.b(wall, ends, (self.stack.bed_mm, bed)))
            rail = (leg[0] + 0.3 * u, leg[1] - 0.3 * u)
            self.parts.add(BASE, "sides", MIDDLE, self.b(rail, ends, (bed, bed + 0.12 * u)))
            self._stand(wall, ends)
        return _Rear(rear.plane, rear.low, rear.high, rear.half, "done")

    # --- rotary axes before linear ones ---------------------------------------------------------

    def _add_turning(self, axis: Axis, at: Array, top: float) -> tuple[Array, float]:
        """Add an arm from an upright axis to what it carries, or a hub of any other axis."""
        u, line = self.u, self.layout.origin(axis)
        if not self.layout.is_vertical(axis):
            out = self.layout.direction(axis)
            hub = np.array([at[0], at[1], top + 1.2 * u])
            self.parts.add(axis.name, "hub", DARK, rod(hub - 1.4 * u * out, hub + 1.4 * u * out, 1.2 * u))
            return at, top + 2.4 * u
        thick, span = _ARM * u, float(np.hypot(*(line[:2] - at[:2])))
        ends = (top + 0.06 * u, top + thick)
        wide = 0.95 * u
        self.parts.add(axis.name, "arm", LIGHT, upright(wide, ends, at), upright(1.15 * wide, ends, line))
        if span > 0.5 * u:
            start = np.array([line[0], line[1], top + thick / 2.0])
            end = np.array([at[0], at[1], top + thick / 2.0])
            self.parts.add(axis.name, "arm", LIGHT, _slab(start, end, wide, 0.42 * thick))
        # the arm before this one lies below it
        self.parts.add(axis.name, "arm", LIGHT, upright(0.75 * wide, (top, top + 0.06 * u), line))
        return line.copy(), top + self.arm_step

    def _add_pedestal(self, at: Array, top: float) -> None:
        """Add the pedestal that the first arm turns on."""
        u, bed = self.u, self.stack.bed_mm
        under = top + _ARM * u if self.arm_step < 0.0 else top
        if (np.abs(at[:2] - self.layout.tip_mm[:2]) < self.layout.half_mm[:2] + 1.8 * u).all():
            back = np.array([*at[:2], under])
            back[self.j] = self._behind(0.0) + 1.8 * u
            front = np.array([*at[:2], under])
            lift = np.array([0.0, 0.0, 0.4 * u if self.arm_step > 0.0 else -0.4 * u])
            if self.arm_step < 0.0:  # a shoulder below would cut the volume
                lift = -lift + np.array([0.0, 0.0, _ARM * u])
            self.parts.add(
                BASE, "pedestal", MIDDLE, _slab(front + lift, back + lift, 1.0 * u, 0.35 * u),
                upright(1.0 * u, (float(under), float(under + lift[2] + 0.35 * u)), front),
            )  # fmt: skip
            at, under = back, float(under + lift[2] + 0.35 * u)
        self.parts.add(
            BASE, "pedestal", MIDDLE,
            upright(1.15 * u, capped(bed + 0.4 * u, under), at),
            spread({k: (float(at[k]) - 1.7 * u, float(at[k]) + 1.7 * u) for k in (0, 1)} | {2: (bed, bed + 0.4 * u)}),
        )  # fmt: skip
        self.parts.stand(*((float(v) - 1.7 * u, float(v) + 1.7 * u) for v in at[:2]))

    # --- the bed side ---------------------------------------------------------------------------

    def _add_cantilever(self, top: float) -> _Rear:
        """Add the fixed arm that holds a head on a column."""
        u, w = self.u, 1.25 * self.mount.half_mm
        front = float(self.spine[self.j])
        column = self._behind(front + w + 0.5 * u)
        self.parts.add(
            BASE, "column", LIGHT, self.b(self.around(w), (front - w, column), (top, top + 2.2 * u))
        )
        return _Rear(column, top, top + 2.2 * u, 1.2 * w, "column")

    def _add_base(self, rear: _Rear) -> None:
        """Add what stands on the bed."""
        u, bed = self.u, self.stack.bed_mm
        if rear.need == "done":
            return
        if rear.need == "rails":
            return
        if rear.need == "beam":
            self._add_portal(rear)
        elif rear.need == "posts":
            self._add_posts(rear)
        elif rear.need == "ledge":
            front, back = self._behind(0.0), rear.plane
            half = max(rear.half + 0.3 * u, 0.6 * float(self.stack.half_mm[self.i]))
            i = self.around(half)
            self.parts.add(BASE, "column", LIGHT, self.b(i, (front, back), (bed, rear.low - 0.25 * u)))
            if rear.reach and half > rear.half:
                for j in (front + 0.6 * u, back - 0.9 * u):
                    self.parts.add(BASE, "column", LIGHT, self.b(i, (j - 0.2 * u, j + 0.2 * u), (rear.low - 0.25 * u, rear.low)))
            self._stand(i, (front, back))
        else:
            self._add_column(BASE, rear, foot=False)

    def _add_portal(self, rear: _Rear) -> None:
        """Add a fixed portal: a beam on two uprights."""
        u, bed = self.u, self.stack.bed_mm
        self._add_beam(BASE, rear, "portal", LIGHT)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        front = rear.plane + 0.1 * u
        for side in (-1.0, 1.0):
            near = self.around(0.0)[0] + side * half
            leg = sorted((near, near + side * 1.3 * u))
            j = (front - 0.4 * u, front + 2.4 * u)
            self.parts.add(BASE, "portal", LIGHT, self.b((leg[0], leg[1]), j, (bed, rear.high + 0.25 * u)))
            self._stand((leg[0], leg[1]), j)

    def _add_posts(self, rear: _Rear) -> None:
        """Add two uprights that a beam rises on, tied together above."""
        u, bed = self.u, self.stack.bed_mm
        high = rear.high + rear.reach + 0.6 * u
        half = rear.half + 0.3 * u
        j = (rear.plane + 0.4 * u, rear.plane + 1.6 * u)
        for side in (-1.0, 1.0):
            near = self.around(0.0)[0] + side * (half - 0.6 * u)
            post = sorted((near, near + side * 1.1 * u))
            self.parts.add(BASE, "portal", LIGHT, self.b((post[0], post[1]), j, (bed, high)))
            self._stand((post[0], post[1]), (j[0] - 0.6 * u, j[1] + 0.6 * u))
        i = self.around(half + 0.5 * u)
        self.parts.add(BASE, "portal", LIGHT, self.b(i, j, (high, high + 0.7 * u)))

    def _add_column(self, name: str, rear: _Rear, *, foot: bool) -> None:
        """Add a column with the two guides on its face."""
        u, bed = self.u, self.stack.bed_mm
        low = bed + (0.9 * u if foot else 0.0)
        rear.plane = max(rear.plane, self._behind(0.0))
        i, j = self.around(1.15 * rear.half), (rear.plane, rear.plane + max(2.0 * u, 1.3 * rear.half))
        self.parts.add(name, "column", LIGHT, self.b(i, j, (low, rear.high + 0.3 * u)))
        for side in (-0.7, 0.7):
            middle = self.around(0.0)[0] + side * rear.half
            guide = (middle - 0.16 * u, middle + 0.16 * u)
            ends = (max(rear.low, low), rear.high)
            if ends[1] > ends[0]:
                self.parts.add(name, "column", LIGHT, self.b(guide, (rear.plane - 0.12 * u, rear.plane), ends))
        if foot:
            wide = self.around(1.4 * rear.half)
            deep = (j[0] - 0.2 * u, j[1] + 0.4 * u)
            self.parts.add(name, "column", LIGHT, self.b(wide, deep, (bed + 0.2 * u, low)))
            reach = 1.5 * rear.half + float(self.layout.half_mm[self.i])
            for at in (deep[0] + 0.5 * u, deep[1] - 0.5 * u):
                self.parts.add(BASE, "rails", METAL, self.b(self.around(reach), (at - 0.18 * u, at + 0.18 * u), (bed, bed + 0.2 * u)))
            self._stand(self.around(reach), deep)
        else:
            self._stand(i, j)

    # --- room -----------------------------------------------------------------------------------

    def _behind(self, least: float) -> float:
        """Give a position in depth behind the volume and all that the stack sweeps, mm."""
        gap = self.layout.gap_mm
        swept = float(self.stack.centre_mm[self.j] + self.stack.swept_mm[self.j])
        return max(least, float(self.high[self.j]) + gap, swept + gap)

    def _clear_half(self) -> float:
        """Give a half width across beside the volume and all that the stack sweeps, mm."""
        spine = float(self.spine[self.i])
        swept = float(self.stack.swept_mm[self.i] + abs(self.stack.centre_mm[self.i] - spine))
        own = max(float(self.high[self.i]) - spine, spine - float(self.low[self.i]))
        return max(own, swept) + self.layout.gap_mm

    def _rail_mm(self) -> float:
        """Give the height at which a bridge runs: about that of the table, mm."""
        return max(self.stack.bed_mm + 0.1 * self.u, float(self.low[2]) - 0.9 * self.u)

    def _stand(self, i: Range, j: Range) -> None:
        """Note what the bed has to carry."""
        ranges = {self.i: i, self.j: j}
        self.parts.stand(ranges[0], ranges[1])


def _slab(start: Array, end: Array, half_width: float, half_height: float):  # noqa: ANN202
    """Build a level bar between two points, mm."""
    from trimesh import creation, transformations

    across = end - start
    length = float(np.hypot(across[0], across[1]))
    mesh = creation.box(extents=[length, 1.7 * half_width, 2.0 * half_height])
    turn = np.arctan2(across[1], across[0])
    mesh.apply_transform(transformations.rotation_matrix(turn, [0, 0, 1]))
    mesh.apply_translation((start + end) / 2.0)
    return mesh


def build_overhead(layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
    """Build what carries a head from above, down to what stands on the bed."""
    _Overhead(layout, parts, mount, stack).build()
