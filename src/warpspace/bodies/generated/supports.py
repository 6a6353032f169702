"""What a head from above hangs on: beams, bridges, portals, posts, columns, and the room they keep.

`Rear` is the upright plane that the bodies so far end with; the next body is put behind it. i is
the direction across (along a beam), j the depth.
"""

from dataclasses import dataclass

from warpspace.bodies.generated.head import BASE, Mount, head_axes
from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, spread
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.mesh import LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import Range, Shape
from warpspace.machine.description import Axis

ARM = 0.9
"""Thickness of an arm, in walls."""
_LONG = 1.5
"""Ratio of travels from which a machine is a gantry on rails instead of a saddle on a wall."""


@dataclass
class Rear:
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


class Supports:
    """A frame while it is built: what all of its bodies are placed by, and those beside the bed."""

    def __init__(self, layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
        self.layout, self.parts, self.stack, self.mount = layout, parts, stack, mount
        self.u = layout.unit_mm
        self.arm_step = ARM * self.u
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

    def b(self, i: Range, j: Range, z: Range) -> Shape:
        """Build a box from ranges across, in depth and upwards, mm."""
        return spread({self.i: i, self.j: j, 2: z})

    def around(self, half: float) -> Range:
        """Give a range across about the spindle line, mm."""
        return (float(self.spine[self.i]) - half, float(self.spine[self.i]) + half)

    def _add_beam(self, name: str, rear: Rear, what: str, colour: tuple[int, int, int]) -> None:
        """Add a beam across behind a carriage, with its two rails."""
        u = self.u
        rear.low = max(rear.low, float(self.high[2]) + self.layout.gap_mm)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        i, front = self.around(half), rear.plane + 0.18 * u
        high = max(rear.low + 2.6 * u, min(rear.high, rear.low + 3.6 * u))
        self.parts.add(
            name, what, colour, self.b(i, (front, front + 1.5 * u), (rear.low + 0.15 * u, high))
        )
        for z in (rear.low + 0.5 * u, high - 0.5 * u):
            self.parts.add(
                name, what, colour, self.b(i, (rear.plane, front), (z - 0.16 * u, z + 0.16 * u))
            )
        rear.high = high

    def _add_bridge(self, name: str, rear: Rear, reach: float) -> Rear:
        """Add a bridge: a beam and the two legs that run on the sides of the bed."""
        u, bed = self.u, self._rail_mm()
        self._add_beam(name, rear, "bridge", LIGHT)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        middle = rear.plane + 0.9 * u
        for side in (-1.0, 1.0):
            near = self.around(0.0)[0] + side * half
            leg = sorted((near, near + side * 1.0 * u))
            self.parts.add(
                name,
                "bridge",
                LIGHT,
                self.b(
                    (leg[0], leg[1]),
                    (middle - 1.1 * u, middle + 1.1 * u),
                    (bed + 0.55 * u, rear.high),
                ),
                self.b(
                    (leg[0], leg[1]),
                    (middle - 1.9 * u, middle + 1.9 * u),
                    (bed + 0.12 * u, bed + 0.55 * u),
                ),
            )
            ends = (middle - 1.9 * u - reach, middle + 1.9 * u + reach)
            wall = (leg[0] - 0.12 * u, leg[1] + 0.12 * u)
            self.parts.add(BASE, "sides", MIDDLE, self.b(wall, ends, (self.stack.bed_mm, bed)))
            rail = (leg[0] + 0.3 * u, leg[1] - 0.3 * u)
            self.parts.add(BASE, "sides", MIDDLE, self.b(rail, ends, (bed, bed + 0.12 * u)))
            self._stand(wall, ends)
        return Rear(rear.plane, rear.low, rear.high, rear.half, "done")

    def _add_cantilever(self, top: float) -> Rear:
        """Add the fixed arm that holds a head on a column."""
        u, w = self.u, 1.25 * self.mount.half_mm
        front = float(self.spine[self.j])
        column = self._behind(front + w + 0.5 * u)
        self.parts.add(
            BASE, "column", LIGHT, self.b(self.around(w), (front - w, column), (top, top + 2.2 * u))
        )
        return Rear(column, top, top + 2.2 * u, 1.2 * w, "column")

    def _add_base(self, rear: Rear) -> None:
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
            self.parts.add(
                BASE, "column", LIGHT, self.b(i, (front, back), (bed, rear.low - 0.25 * u))
            )
            if rear.reach and half > rear.half:
                for j in (front + 0.6 * u, back - 0.9 * u):
                    self.parts.add(
                        BASE,
                        "column",
                        LIGHT,
                        self.b(i, (j - 0.2 * u, j + 0.2 * u), (rear.low - 0.25 * u, rear.low)),
                    )
            self._stand(i, (front, back))
        else:
            self._add_column(BASE, rear, foot=False)

    def _add_portal(self, rear: Rear) -> None:
        """Add a fixed portal: a beam on two uprights."""
        u, bed = self.u, self.stack.bed_mm
        self._add_beam(BASE, rear, "portal", LIGHT)
        half = max(rear.half + rear.reach + 0.3 * u, self._clear_half() + 0.2 * u)
        front = rear.plane + 0.1 * u
        for side in (-1.0, 1.0):
            near = self.around(0.0)[0] + side * half
            leg = sorted((near, near + side * 1.3 * u))
            j = (front - 0.4 * u, front + 2.4 * u)
            self.parts.add(
                BASE, "portal", LIGHT, self.b((leg[0], leg[1]), j, (bed, rear.high + 0.25 * u))
            )
            self._stand((leg[0], leg[1]), j)

    def _add_posts(self, rear: Rear) -> None:
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

    def _add_column(self, name: str, rear: Rear, *, foot: bool) -> None:
        """Add a column with the two guides on its face."""
        u, bed = self.u, self.stack.bed_mm
        low = bed + (0.9 * u if foot else 0.0)
        rear.plane = max(rear.plane, self._behind(0.0))
        i, j = (
            self.around(1.15 * rear.half),
            (rear.plane, rear.plane + max(2.0 * u, 1.3 * rear.half)),
        )
        self.parts.add(name, "column", LIGHT, self.b(i, j, (low, rear.high + 0.3 * u)))
        for side in (-0.7, 0.7):
            middle = self.around(0.0)[0] + side * rear.half
            guide = (middle - 0.16 * u, middle + 0.16 * u)
            ends = (max(rear.low, low), rear.high)
            if ends[1] > ends[0]:
                self.parts.add(
                    name, "column", LIGHT, self.b(guide, (rear.plane - 0.12 * u, rear.plane), ends)
                )
        if foot:
            wide = self.around(1.4 * rear.half)
            deep = (j[0] - 0.2 * u, j[1] + 0.4 * u)
            self.parts.add(name, "column", LIGHT, self.b(wide, deep, (bed + 0.2 * u, low)))
            reach = 1.5 * rear.half + float(self.layout.half_mm[self.i])
            for at in (deep[0] + 0.5 * u, deep[1] - 0.5 * u):
                self.parts.add(
                    BASE,
                    "rails",
                    METAL,
                    self.b(
                        self.around(reach), (at - 0.18 * u, at + 0.18 * u), (bed, bed + 0.2 * u)
                    ),
                )
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
