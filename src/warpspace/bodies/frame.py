"""Bodies between head and bed: rams, carriages, beams, portals, columns, arms.

i is the direction across (along a beam), j the depth, in which each body is placed behind the
previous one: along a level spindle, towards the rear of R for one from above.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from warpspace.bodies.arm import Arm, is_arm
from warpspace.bodies.ends import Head, Mount, WorkpieceSide
from warpspace.bodies.mesh import LIGHT, MIDDLE, Body
from warpspace.bodies.schematic import (
    HomeAxis,
    Parts,
    Range,
    about,
    bar,
    build_layout,
    cylinder,
    mirrored_walls,
    pair,
    rod,
)
from warpspace.kinematics.chain import BASE
from warpspace.machine.definition import TOOL_SHAPES, Axis, Machine, Vector, parse_chain
from warpspace.units import Array

_LYING = 0.7
"""Upward part of a tool axis below which the machine is built as one with a horizontal spindle."""
_ARM = 0.9  # thickness of an arm, in walls
_LONG = 1.5
"""Ratio of travels from which a machine is a gantry on rails instead of a saddle on a wall."""


class _ToolSide:
    """State of the tool side while it is built."""

    i: int  # index of the direction across: 0 or 1
    sign: float  # of the depth along the other one in R
    zero_mm: float  # origin of depths

    def __init__(self, parts: Parts, mount: Mount, stack: WorkpieceSide) -> None:
        self.layout, self.parts, self.mount, self.stack = parts.layout, parts, mount, stack
        self.u, self.spine = parts.layout.unit_mm, mount.point_mm
        self.axes = list(reversed(mount.inner))

    @property
    def j(self) -> int:
        return 1 - self.i

    @property
    def middle(self) -> float:
        return float(self.spine[self.i])

    def centred(self, half: float) -> Range:
        return about(self.middle, half)

    def depth(self, point_mm: Array) -> float:
        return self.sign * (float(point_mm[self.j]) - self.zero_mm)

    def swept(self) -> float:
        depth = self.depth(self.stack.centre_mm) + float(self.stack.swept_mm[self.j])
        return depth + self.layout.gap_mm

    def _in_r(self, j: Range) -> Range:
        low, high = sorted(self.zero_mm + self.sign * depth for depth in j)
        return (low, high)

    def box(self, frame: str, what: str, i: Range, j: Range, z: Range) -> None:
        self.parts.box(frame, what, i, self._in_r(j), z, along=self.i)

    def stand(self, i: Range, j: Range) -> None:
        self.parts.stand(i, self._in_r(j), along=self.i)

    def posts(self, frame: str, what: str, inner: float, j: Range, z: Range, roof: float) -> None:
        thick = 1.1 * self.u
        for post in mirrored_walls(self.middle, inner, thick):
            self.box(frame, what, post, j, z)
        self.box(frame, what, self.centred(inner + thick), j, (z[1], z[1] + roof * self.u))


class _Behind(_ToolSide):
    """Carrier of a level head: headstock, ram, and a column that may travel."""

    def __init__(self, parts: Parts, mount: Mount, stack: WorkpieceSide) -> None:
        super().__init__(parts, mount, stack)
        level = self.layout.poses["t"][:2, 2]
        self.i = int(np.argmin(np.abs(level)))
        self.sign, self.zero_mm = float(np.sign(level[self.j])), float(self.layout.tip_mm[self.j])

    def build(self) -> None:
        u, w, middle = self.u, self.mount.half_mm, float(self.spine[2])
        start, column_at, half, high = self.depth(self.spine), 0.0, w + 0.4 * u, middle + 2.4 * u
        hangs = True  # no vertical slide so far
        axes = self.axes.copy()  # not built yet
        while axes and axes[0].is_linear:
            axis, reach = axes[0], axes[0].reach_mm
            if axis.k == 2:
                z, flange = about(middle, 1.3 * w), about(middle, 1.9 * w)
                i, deep = self.centred(half), (start + 0.5 * u, start + 0.8 * u)
                self.parts.part(axis.name, "headstock", MIDDLE)
                self.box(axis.name, "headstock", i, (start, start + 3.6 * u), z)
                self.box(axis.name, "headstock", self.centred(half + 0.35 * u), deep, flange)
                half, high, column_at = half + 0.1 * u, middle + reach + 2.6 * w, start + 0.8 * u
                hangs = False
            elif axis.k == self.j and hangs:
                j = (start, start + 2.0 * reach + 3.0 * u)
                self.parts.part(axis.name, "ram", LIGHT)
                self.box(axis.name, "ram", self.centred(w), j, about(middle, w))
                start += 0.8 * u
            else:
                break
            axes.pop(0)
        column_at = max(column_at or start + 0.8 * u, self.swept())
        if hangs and not axes:
            j, wide = (start, max(column_at, start) + 1.5 * u), 1.2 * w
            self.parts.part(BASE, "headstock", MIDDLE)
            self.box(BASE, "headstock", self.centred(wide), j, about(middle, wide))
        self._add_column(axes, half, column_at, high)

    def _add_column(self, axes: list[HomeAxis], half: float, at: float, high: float) -> None:
        u, frames = self.u, [*(axis.name for axis in axes), BASE]
        top = self.stack.bed_mm + 0.75 * u * len(axes)
        self.posts(frames[0], "column", half, (at, at + 2.4 * u), (top, high), 0.9)
        span, near, far = half + 1.5 * u, at - 0.2 * u, at + 2.9 * u
        for number, axis in enumerate(axes):
            what, below = "base" if number else "column", frames[number + 1]
            self.box(axis.name, what, self.centred(span), (near, far), (top - 0.55 * u, top))
            rails = (top - 0.75 * u, top - 0.55 * u)
            if axis.is_linear and axis.k == self.i:
                span += axis.reach_mm
                for line in ((at + 0.1 * u, at + 0.5 * u), (far - 0.7 * u, far - 0.3 * u)):
                    self.box(below, "rails", self.centred(span), line, rails)
            else:
                far += axis.reach_mm
                for line in pair(self.middle, 0.7 * span, 0.2 * u):
                    self.box(below, "rails", line, (near, far), rails)
            top -= 0.75 * u
        self.stand(self.centred(span), (near, far))


@dataclass
class _Rear:
    """Rear plane of the bodies so far; the next body is placed behind it."""

    plane: float  # position along j, mm
    low: float  # ends upwards, mm
    high: float
    half: float  # half width across, mm
    # kind of the next body: "plate", "beam", "ledge", "column", "posts", "rails"
    need: str = "plate"
    reach: float = 0.0  # half travel along i (or upwards) that the next body covers, mm


class _Overhead(_ToolSide):
    """Carrier of a head from above."""

    def __init__(self, parts: Parts, mount: Mount, stack: WorkpieceSide) -> None:
        super().__init__(parts, mount, stack)
        level = [axis for axis in mount.inner if axis.slides_level]
        self.i, self.sign, self.zero_mm = self._across(level), 1.0, 0.0
        self.arm_step = _ARM * self.u
        self.front = self.depth(self.spine)

    def _across(self, level: list[HomeAxis]) -> int:
        directions = [axis.k for axis in level]
        if len(level) < 2 or directions[0] == directions[1]:
            return 0
        lengths = [axis.reach_mm for axis in level[:2]]
        if directions[0] == 0:
            return 1 if lengths[0] >= _LONG * lengths[1] else 0
        return directions[1]

    def build(self) -> None:
        top = float(self.spine[2])
        rear: _Rear | None = None
        at = self.spine.copy()
        for place, axis in enumerate(self.axes):
            if not axis.is_linear:
                if rear is not None:
                    at[self.j], top, rear = rear.plane, rear.high, None
                at, top = self._add_turning(axis, at, top)
            elif axis.k == 2:
                rear, top = self._add_vertical(axis, rear, self.axes[place + 1 :], at, top)
            else:
                rear = self._add_level(axis, rear, top)
        if self.axes and not self.axes[-1].is_linear:
            self._add_pedestal(at, top)
        else:
            self._add_base(rear or self._add_cantilever(top))

    def _behind(self, least: float = -np.inf) -> float:
        return max(least, self.depth(self.layout.high_mm) + self.layout.gap_mm, self.swept())

    def _clear_half(self) -> float:
        i, stack = self.i, self.stack
        swept = float(stack.swept_mm[i] + abs(stack.centre_mm[i] - self.middle))
        volume = max(self.layout.high_mm[i] - self.middle, self.middle - self.layout.low_mm[i])
        return max(float(volume), swept) + self.layout.gap_mm

    def _add_vertical(
        self, axis: HomeAxis, rear: _Rear | None, outer_axes: list[HomeAxis], at: Array, top: float
    ) -> tuple[_Rear | None, float]:
        u, w, reach = self.u, self.mount.half_mm, axis.reach_mm
        if rear is None and outer_axes and not outer_axes[0].is_linear:
            arms = sum(not turning.is_linear for turning in outer_axes)
            first = top + reach + 0.2 * u + (arms - 1) * _ARM * u
            self.arm_step = -_ARM * u
            quill = cylinder(0.4 * u, (top, first + reach + 1.6 * u), at)
            self.parts.add(axis.name, "quill", quill)
            return None, first
        if rear is None and any(axis.slides_level for axis in outer_axes):
            high = top + 1.7 * reach + 1.5 * u
            z = (top, high + 0.5 * reach + 0.6 * u)
            self.box(axis.name, "ram", self.centred(w), about(self.front, w), z)
            return _Rear(self.front + w, top + 0.5 * u, high, w + 0.5 * u), top
        if rear is None:
            return self._add_headstock(axis.name, top, reach), top
        if rear.need == "beam":
            self._add_beam(axis.name, rear, "beam")
            ends = max(rear.half + rear.reach, self._clear_half())
            return _Rear(rear.plane + 1.3 * u, rear.low, rear.high, ends, "posts", reach), top
        rear = self._add_carriage(axis.name, rear)
        return _Rear(rear.plane, rear.low - reach, rear.high + reach, rear.half, "column"), top

    def _add_headstock(self, name: str, top: float, reach: float) -> _Rear:
        u, w = self.u, 1.25 * self.mount.half_mm
        column, high = self._behind(self.front + w + 1.2 * u), top + 3.2 * u
        low, plate = top - 0.2 * u, (column - 0.35 * u, column - 0.12 * u)
        self.box(name, "headstock", self.centred(w), (self.front - w, plate[0]), (top, high))
        self.box(name, "headstock", self.centred(1.25 * w), plate, (low, high + 0.8 * u))
        self.parts.add(name, "headstock", cylinder(0.62 * w, (high, high + 1.3 * u), self.spine))
        return _Rear(column, low - reach, high + 0.8 * u + reach, 1.45 * w, "column")

    def _add_level(self, axis: HomeAxis, rear: _Rear | None, top: float) -> _Rear:
        u, reach, name = self.u, axis.reach_mm, axis.name
        across = axis.k == self.i
        if rear is None:
            w, z = 1.2 * self.mount.half_mm, (top, top + 1.6 * u)
            self.box(name, "carriage", self.centred(w), about(self.front, w), z)
            rear = _Rear(self.front + w, *z, w)
        elif rear.need == "ledge" and across:
            return self._add_ledge_saddle(name, rear, reach)
        elif rear.need == "beam" and not across:
            return self._add_bridge(name, rear, reach)
        elif rear.need in ("column", "posts"):
            self._add_column(name, rear, foot=True)
            rear.need, rear.reach = "rails", reach
            return rear
        elif across:
            rear = self._add_carriage(name, rear)
        if not across:
            return self._add_sliding_ram(name, rear, reach)
        return _Rear(rear.plane, rear.low, rear.high, rear.half, "beam", reach)

    def _add_carriage(self, name: str, rear: _Rear) -> _Rear:
        plane = rear.plane + 0.6 * self.u
        z = (rear.low, rear.high)
        self.box(name, "carriage", self.centred(rear.half), (rear.plane, plane), z)
        return _Rear(plane, *z, rear.half)

    def _add_sliding_ram(self, name: str, rear: _Rear, reach: float) -> _Rear:
        u, middle, front = self.u, (rear.low + rear.high) / 2.0, rear.plane + 0.55 * self.u
        lower, upper = max(rear.low, middle - 1.9 * u), middle + 1.5 * u
        rear_end = 2.0 * reach + max(rear.plane + 2.4 * u, self._behind(0.0) + 1.6 * u)
        i, z = self.centred(rear.half), (rear.low, rear.high)
        self.parts.part(name, "saddle", LIGHT)
        self.box(name, "saddle", i, (rear.plane, front), z)
        self.box(name, "saddle", self.centred(0.92 * rear.half), (front, rear_end), (lower, upper))
        return _Rear(rear_end, lower, upper, rear.half, "ledge", reach)

    def _add_ledge_saddle(self, name: str, rear: _Rear, reach: float) -> _Rear:
        u, half, low = self.u, 1.35 * rear.half, rear.low - 1.3 * self.u
        j, rails = (self._behind(0.0), rear.plane - 0.1 * u), rear.low - 0.25 * u
        self.box(name, "saddle", self.centred(half), j, (low, rails))
        for line in pair(self.middle, 0.6 * rear.half, 0.2 * u):
            self.box(name, "saddle", line, j, (rails, rear.low))
        return _Rear(rear.plane, low, rear.high, half + reach, "ledge", reach)

    def _add_beam(self, name: str, rear: _Rear, what: str) -> float:
        u = self.u
        rear.low = max(rear.low, float(self.layout.high_mm[2]) + self.layout.gap_mm)
        rear.high = max(rear.low + 2.6 * u, min(rear.high, rear.low + 3.6 * u))
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        i, front = self.centred(half), rear.plane + 0.18 * u
        self.box(name, what, i, (front, front + 1.5 * u), (rear.low + 0.15 * u, rear.high))
        for z in (rear.low + 0.5 * u, rear.high - 0.5 * u):
            self.box(name, what, i, (rear.plane, front), about(z, 0.16 * u))
        return half

    def _add_bridge(self, name: str, rear: _Rear, reach: float) -> _Rear:
        u, bed = self.u, self.stack.bed_mm
        wall = max(bed + 0.1 * u, float(self.layout.low_mm[2]) - 0.9 * u)
        half, middle = self._add_beam(name, rear, "bridge"), rear.plane + 0.9 * u
        foot, ends = wall + 0.55 * u, about(middle, 1.9 * u + reach)
        for low, high in mirrored_walls(self.middle, half, 1.0 * u):
            self.box(name, "bridge", (low, high), about(middle, 1.1 * u), (foot, rear.high))
            deep = about(middle, 1.9 * u)
            self.box(name, "bridge", (low, high), deep, (wall + 0.12 * u, foot))
            i, rail = (low - 0.12 * u, high + 0.12 * u), (low + 0.3 * u, high - 0.3 * u)
            self.box(BASE, "sides", i, ends, (bed, wall))
            self.box(BASE, "sides", rail, ends, (wall, wall + 0.12 * u))
            self.stand(i, ends)
        return _Rear(rear.plane, rear.low, rear.high, rear.half, "done")

    def _add_cantilever(self, top: float) -> _Rear:
        u, w = self.u, 1.25 * self.mount.half_mm
        column, z = self._behind(self.front + w + 0.5 * u), (top, top + 2.2 * u)
        self.box(BASE, "column", self.centred(w), (self.front - w, column), z)
        return _Rear(column, *z, 1.2 * w, "column")

    def _add_base(self, rear: _Rear) -> None:
        u, bed = self.u, self.stack.bed_mm
        if rear.need in ("done", "rails"):
            return
        if rear.need == "beam":
            half, j = self._add_beam(BASE, rear, "portal"), about(rear.plane + 1.1 * u, 1.4 * u)
            for leg in mirrored_walls(self.middle, half, 1.3 * u):
                self.box(BASE, "portal", leg, j, (bed, rear.high + 0.25 * u))
                self.stand(leg, j)
        elif rear.need == "posts":
            inner, middle = rear.half - 0.3 * u, rear.plane + 1.0 * u
            z = (bed, rear.high + rear.reach + 0.6 * u)
            self.posts(BASE, "portal", inner, about(middle, 0.6 * u), z, 0.7)
            self.stand(self.centred(inner + 1.1 * u), about(middle, 1.2 * u))
        elif rear.need == "ledge":
            self._add_ledge(rear)
        else:
            self._add_column(BASE, rear, foot=False)

    def _add_ledge(self, rear: _Rear) -> None:
        u, bed, rails = self.u, self.stack.bed_mm, rear.low - 0.25 * self.u
        half = max(rear.half + 0.3 * u, 0.6 * float(self.stack.half_mm[self.i]))
        i, (front, rear_end) = self.centred(half), (self._behind(0.0), rear.plane)
        self.box(BASE, "column", i, (front, rear_end), (bed, rails))
        if rear.reach and half > rear.half:
            for j in (front + 0.6 * u, rear_end - 0.9 * u):
                self.box(BASE, "column", i, about(j, 0.2 * u), (rails, rear.low))
        self.stand(i, (front, rear_end))

    def _add_column(self, name: str, rear: _Rear, *, foot: bool) -> None:
        u, bed = self.u, self.stack.bed_mm
        low = bed + (0.9 * u if foot else 0.0)
        rear.plane = max(rear.plane, self._behind(0.0))
        i = self.centred(1.15 * rear.half)
        j = (rear.plane, rear.plane + max(2.0 * u, 1.3 * rear.half))
        self.box(name, "column", i, j, (low, rear.high + 0.3 * u))
        guides = (max(rear.low, low), rear.high)
        if guides[1] > guides[0]:
            for line in pair(self.middle, 0.7 * rear.half, 0.16 * u):
                self.box(name, "column", line, (rear.plane - 0.12 * u, rear.plane), guides)
        if foot:
            j = (j[0] - 0.2 * u, j[1] + 0.4 * u)
            self.box(name, "column", self.centred(1.4 * rear.half), j, (bed + 0.2 * u, low))
            i = self.centred(1.5 * rear.half + float(self.layout.half_mm[self.i]))
            for at in (j[0] + 0.5 * u, j[1] - 0.5 * u):
                self.box(BASE, "rails", i, about(at, 0.18 * u), (bed, bed + 0.2 * u))
        self.stand(i, j)

    def _add_turning(self, axis: HomeAxis, at: Array, top: float) -> tuple[Array, float]:
        u, line = self.u, axis.origin_mm
        if axis.k != 2:
            out, hub = axis.direction, np.array([*at[:2], top + 1.2 * u])
            self.parts.add(axis.name, "hub", rod(hub - 1.4 * u * out, hub + 1.4 * u * out, 1.2 * u))
            return at, top + 2.4 * u
        low, high, wide = top + 0.06 * u, top + _ARM * u, 0.95 * u
        for radius, end in ((wide, at), (1.15 * wide, line)):
            self.parts.add(axis.name, "arm", cylinder(radius, (low, high), end))
        if float(np.hypot(*(line[:2] - at[:2]))) > 0.5 * u:
            start, end = (np.array([*p[:2], top + _ARM * u / 2.0]) for p in (line, at))
            self.parts.add(axis.name, "arm", bar(start, end, wide, 0.42 * _ARM * u))
        # the arm before this one lies below it
        self.parts.add(axis.name, "arm", cylinder(0.75 * wide, (top, low), line))
        return line.copy(), top + self.arm_step

    def _add_pedestal(self, at: Array, top: float) -> None:
        u, bed, below = self.u, self.stack.bed_mm, self.arm_step > 0.0
        under = top if below else top + _ARM * u
        if (np.abs(at[:2] - self.layout.tip_mm[:2]) < self.layout.half_mm[:2] + 1.8 * u).all():
            front = np.array([*at[:2], under])
            at = front.copy()
            at[self.j] = self._behind(0.0) + 1.8 * u
            # a shoulder below would cut the volume
            lift = 0.4 * u if below else (0.4 + _ARM) * u
            shoulder = under + lift + 0.35 * u
            raised = np.array([0.0, 0.0, lift])
            self.parts.add(BASE, "pedestal", bar(front + raised, at + raised, 1.0 * u, 0.35 * u))
            self.parts.add(BASE, "pedestal", cylinder(1.0 * u, (under, shoulder), front))
            under = shoulder
        foot = bed + 0.4 * u
        self.parts.add(BASE, "pedestal", cylinder(1.15 * u, (foot, max(under, foot + 1.0)), at))
        x, y = (about(place, 1.7 * u) for place in at[:2])
        self.parts.box(BASE, "pedestal", x, y, (bed, foot))
        self.parts.stand(x, y)


_Fixed = tuple[tuple[str, Vector], ...]


def generate_bodies(machine: Machine) -> tuple[Body, ...]:
    axes, source = tuple(machine.axes.values()), machine.bodies.get("t")
    fixed = (tuple(sorted(each.items())) for each in (machine.fixed_mm, machine.fixed_deg))
    shape = (source.shape if source else "") or TOOL_SHAPES[0]
    return _generate(str(machine.chain), axes, *fixed, shape)


@lru_cache(maxsize=32)
def _generate(
    chain: str, axes: tuple[Axis, ...], fixed_mm: _Fixed, fixed_deg: _Fixed, tool: str
) -> tuple[Body, ...]:
    by_name = {axis.name: axis for axis in axes}
    machine = Machine(parse_chain(chain), by_name, dict(fixed_mm), fixed_deg=dict(fixed_deg))
    parts = Parts(build_layout(machine))
    if is_arm(parts.layout):
        _build_arm(parts, tool)
        return parts.bodies()
    stack = WorkpieceSide(parts)
    stack.build()
    mount = Head(parts, tool).build()
    lying = abs(parts.layout.poses["t"][2, 2]) < _LYING
    (_Behind if lying else _Overhead)(parts, mount, stack).build()
    _add_bed(parts, stack.bed_mm)
    return parts.bodies()


def _build_arm(parts: Parts, tool: str) -> None:
    bed_mm: float | None = None
    if parts.layout.workpiece:
        stack = WorkpieceSide(parts)
        stack.build()
        bed_mm = stack.bed_mm
    foot_mm = Arm(parts, tool).build(bed_mm)
    if parts.floor:
        _add_bed(parts, foot_mm if bed_mm is None else bed_mm)


def _add_bed(parts: Parts, top: float) -> None:
    from trimesh import convex

    u, slant = parts.layout.unit_mm, parts.layout.slant
    corners = np.concatenate(parts.floor)
    x, y = np.array([corners.min(axis=0) - 0.25 * u, corners.max(axis=0) + 0.25 * u]).T
    low, foot, inset = top - 1.1 * u, top - 1.45 * u, np.array([0.35 * u, -0.35 * u])
    parts.box(BASE, "bed", x, y, (low, top))
    parts.box(BASE, "bed", x + inset, y + inset, (foot, low))
    if not np.allclose(slant, np.eye(3)):
        lower = np.array([(at_x, at_y, foot) for at_x in x for at_y in y]) @ slant.T  # in R
        floor = lower.copy()
        floor[:, 2] = lower[:, 2].min() - 0.5 * u
        parts.add(BASE, "bed", convex.convex_hull(np.concatenate([lower, floor]) @ slant))
