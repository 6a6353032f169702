"""What carries a head from above: ram, headstock, carriages, saddles, arms, walked to the bed."""

import numpy as np

from warpspace.bodies.generated.head import BASE, Mount
from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, bar, capped, rod, spread, upright
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.generated.supports import ARM, Rear, Supports
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.machine.description import Axis
from warpspace.units import Array


class _Overhead(Supports):
    """The frame of a machine with a spindle from above, while it is built."""

    def build(self) -> None:
        """Walk from the head to the bed."""
        top = float(self.spine[2])
        rear: Rear | None = None
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
        self, axis: Axis, rear: Rear | None, rest: list[Axis], at: Array, top: float
    ) -> tuple[Rear | None, float]:
        """Add a quill, a ram, a headstock or a beam that rises."""
        u, reach = self.u, self.layout.half_travel_mm(axis)
        name, w = axis.name, self.mount.half_mm
        if rear is None and rest and not rest[0].is_linear:
            arms = sum(not turning.is_linear for turning in rest)
            first = top + reach + 0.2 * u + (arms - 1) * ARM * u
            self.arm_step = -ARM * u
            self.parts.add(
                name, "quill", METAL, upright(0.4 * u, (top, first + reach + 1.6 * u), at)
            )
            return None, first
        if rear is None and any(a.is_linear and not self.layout.is_vertical(a) for a in rest):
            low, high = top + 0.5 * u, top + 1.7 * reach + 1.5 * u
            front = float(self.spine[self.j])
            self.parts.add(
                name,
                "ram",
                MIDDLE,
                self.b(self.around(w), (front - w, front + w), (top, high + 0.5 * reach + 0.6 * u)),
            )
            return Rear(front + w, low, high, w + 0.5 * u), top
        if rear is None:
            return self._add_headstock(axis, top, reach), top
        if rear.need == "beam":
            self._add_beam(name, rear, "beam", DARK)
            ends = max(rear.half + rear.reach, self._clear_half())
            return Rear(rear.plane + 1.3 * u, rear.low, rear.high, ends, "posts", reach), top
        self.parts.add(
            name,
            "carriage",
            DARK,
            self.b(
                self.around(rear.half), (rear.plane, rear.plane + 0.6 * u), (rear.low, rear.high)
            ),
        )
        return Rear(
            rear.plane + 0.6 * u, rear.low - reach, rear.high + reach, rear.half, "column"
        ), top

    def _add_headstock(self, axis: Axis, top: float, reach: float) -> Rear:
        """Add the overhanging headstock of a C-frame."""
        u, w = self.u, 1.25 * self.mount.half_mm
        front = float(self.spine[self.j])
        column = self._behind(front + w + 1.2 * u)
        high = top + 3.2 * u
        self.parts.add(
            axis.name,
            "headstock",
            LIGHT,
            self.b(self.around(w), (front - w, column - 0.35 * u), (top, high)),
            self.b(
                self.around(1.25 * w),
                (column - 0.35 * u, column - 0.12 * u),
                (top - 0.2 * u, high + 0.8 * u),
            ),
        )
        motor = self.spine.copy()
        self.parts.add(
            axis.name, "headstock", LIGHT, upright(0.62 * w, (high, high + 1.3 * u), motor)
        )
        return Rear(column, top - 0.2 * u - reach, high + 0.8 * u + reach, 1.45 * w, "column")

    def _add_level(self, axis: Axis, rear: Rear | None, top: float) -> Rear:
        """Add a carriage, a saddle or a bridge of a level axis."""
        u, reach, name = self.u, self.layout.half_travel_mm(axis), axis.name
        across = self.layout.along(axis) == self.i
        if rear is None:
            front, w = float(self.spine[self.j]), 1.2 * self.mount.half_mm
            self.parts.add(
                name,
                "carriage",
                DARK,
                self.b(self.around(w), (front - w, front + w), (top, top + 1.6 * u)),
            )
            rear = Rear(front + w, top, top + 1.6 * u, w)
            if not across:
                return self._add_sliding_ram(name, rear, reach)
            return Rear(rear.plane, rear.low, rear.high, rear.half, "beam", reach)
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
                name,
                "carriage",
                DARK,
                self.b(
                    self.around(rear.half),
                    (rear.plane, rear.plane + 0.6 * u),
                    (rear.low, rear.high),
                ),
            )
            return Rear(rear.plane + 0.6 * u, rear.low, rear.high, rear.half, "beam", reach)
        return self._add_sliding_ram(name, rear, reach)

    def _add_sliding_ram(self, name: str, rear: Rear, reach: float) -> Rear:
        """Add a body that slides in depth upon a ledge, with a plate before it."""
        u = self.u
        middle = (rear.low + rear.high) / 2.0
        under = max(rear.low, middle - 1.9 * u)
        back = max(rear.plane + 2.0 * reach + 2.4 * u, self._behind(0.0) + 2.0 * reach + 1.6 * u)
        self.parts.add(
            name,
            "saddle",
            LIGHT,
            self.b(
                self.around(rear.half), (rear.plane, rear.plane + 0.55 * u), (rear.low, rear.high)
            ),
            self.b(
                self.around(0.92 * rear.half),
                (rear.plane + 0.55 * u, back),
                (under, middle + 1.5 * u),
            ),
        )
        return Rear(back, under, middle + 1.5 * u, rear.half, "ledge", reach)

    def _add_ledge_saddle(self, name: str, rear: Rear, reach: float) -> Rear:
        """Add the saddle across that a sliding ram rests on."""
        u, front, middle = self.u, self._behind(0.0), self.around(0.0)[0]
        self.parts.add(
            name,
            "saddle",
            DARK,
            self.b(
                self.around(1.35 * rear.half),
                (front, rear.plane - 0.1 * u),
                (rear.low - 1.3 * u, rear.low - 0.25 * u),
            ),
            *(
                self.b(
                    (
                        middle + s * 0.6 * rear.half - 0.2 * u,
                        middle + s * 0.6 * rear.half + 0.2 * u,
                    ),
                    (front, rear.plane - 0.1 * u),
                    (rear.low - 0.25 * u, rear.low),
                )
                for s in (-1.0, 1.0)
            ),
        )
        return Rear(
            rear.plane, rear.low - 1.3 * u, rear.high, 1.35 * rear.half + reach, "ledge", reach
        )

    # --- rotary axes before linear ones ---------------------------------------------------------

    def _add_turning(self, axis: Axis, at: Array, top: float) -> tuple[Array, float]:
        """Add an arm from an upright axis to what it carries, or a hub of any other axis."""
        u, line = self.u, self.layout.origin(axis)
        if not self.layout.is_vertical(axis):
            out = self.layout.direction(axis)
            hub = np.array([at[0], at[1], top + 1.2 * u])
            self.parts.add(
                axis.name, "hub", DARK, rod(hub - 1.4 * u * out, hub + 1.4 * u * out, 1.2 * u)
            )
            return at, top + 2.4 * u
        thick, span = ARM * u, float(np.hypot(*(line[:2] - at[:2])))
        ends = (top + 0.06 * u, top + thick)
        wide = 0.95 * u
        self.parts.add(
            axis.name, "arm", LIGHT, upright(wide, ends, at), upright(1.15 * wide, ends, line)
        )
        if span > 0.5 * u:
            start = np.array([line[0], line[1], top + thick / 2.0])
            end = np.array([at[0], at[1], top + thick / 2.0])
            self.parts.add(axis.name, "arm", LIGHT, bar(start, end, wide, 0.42 * thick))
        # the arm before this one lies below it
        self.parts.add(axis.name, "arm", LIGHT, upright(0.75 * wide, (top, top + 0.06 * u), line))
        return line.copy(), top + self.arm_step

    def _add_pedestal(self, at: Array, top: float) -> None:
        """Add the pedestal that the first arm turns on."""
        u, bed = self.u, self.stack.bed_mm
        under = top + ARM * u if self.arm_step < 0.0 else top
        if (np.abs(at[:2] - self.layout.tip_mm[:2]) < self.layout.half_mm[:2] + 1.8 * u).all():
            back = np.array([*at[:2], under])
            back[self.j] = self._behind(0.0) + 1.8 * u
            front = np.array([*at[:2], under])
            lift = np.array([0.0, 0.0, 0.4 * u if self.arm_step > 0.0 else -0.4 * u])
            if self.arm_step < 0.0:  # a shoulder below would cut the volume
                lift = -lift + np.array([0.0, 0.0, ARM * u])
            self.parts.add(
                BASE,
                "pedestal",
                MIDDLE,
                bar(front + lift, back + lift, 1.0 * u, 0.35 * u),
                upright(1.0 * u, (float(under), float(under + lift[2] + 0.35 * u)), front),
            )
            at, under = back, float(under + lift[2] + 0.35 * u)
        self.parts.add(
            BASE,
            "pedestal",
            MIDDLE,
            upright(1.15 * u, capped(bed + 0.4 * u, under), at),
            spread(
                {k: (float(at[k]) - 1.7 * u, float(at[k]) + 1.7 * u) for k in (0, 1)}
                | {2: (bed, bed + 0.4 * u)}
            ),
        )
        self.parts.stand(*((float(v) - 1.7 * u, float(v) + 1.7 * u) for v in at[:2]))


def build_overhead(layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
    """Build what carries a head from above, down to what stands on the bed."""
    _Overhead(layout, parts, mount, stack).build()
