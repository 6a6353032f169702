"""What carries a head from behind: the headstock and the travelling column of a horizontal machine.

i is the direction across, j that of the spindle; depths count from the tool point to the spindle.
"""

import numpy as np

from warpspace.bodies.generated.head import BASE, Mount, head_axes
from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, spread
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import Range, Shape


class _Behind:
    """The tool side of a horizontal machine, while it is built."""

    def __init__(self, layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
        self.layout, self.parts, self.mount, self.stack = layout, parts, mount, stack
        self.u = layout.unit_mm
        axis = layout.tool_axis[:2]
        self.j = int(np.argmax(np.abs(axis)))
        self.i, self.sign = 1 - self.j, float(np.sign(axis[self.j]))
        self.spine = mount.point_mm
        branch = layout.machine.branch("tool")
        self.axes = list(reversed(branch[: len(branch) - len(head_axes(layout))]))

    def depth(self, near: float, far: float) -> Range:
        """Give a range along j from two depths behind the tool point, mm."""
        ends = sorted(self.layout.tip_mm[self.j] + self.sign * np.array([near, far]))
        return (float(ends[0]), float(ends[1]))

    def around(self, half: float) -> Range:
        """Give a range across about the spindle line, mm."""
        return (float(self.spine[self.i]) - half, float(self.spine[self.i]) + half)

    def b(self, i: Range, j: Range, z: Range) -> Shape:
        """Build a box from ranges across, in depth and upwards, mm."""
        return spread({self.i: i, self.j: j, 2: z})

    def build(self) -> None:
        """Walk from the head to the bed."""
        layout, u, w = self.layout, self.u, self.mount.half_mm
        swept = self.stack.swept_mm[self.j] + self.sign * (
            self.stack.centre_mm[self.j] - layout.tip_mm[self.j]
        )
        start = float(self.sign * (self.spine - layout.tip_mm)[self.j])
        middle = float(self.spine[2])
        frame, high, column_at = self.mount.carrier, middle + 2.4 * u, 0.0
        half = w + 0.4 * u
        standing = ""
        lower: list[str] = []
        for axis in self.axes:
            reach = layout.half_travel_mm(axis) if axis.is_linear else 0.0
            if standing:
                lower.append(axis.name)
            elif axis.is_linear and layout.is_vertical(axis):
                self.parts.add(
                    axis.name,
                    "headstock",
                    MIDDLE,
                    self.b(
                        self.around(half),
                        self.depth(start, start + 3.6 * u),
                        (middle - 1.3 * w, middle + 1.3 * w),
                    ),
                    self.b(
                        self.around(half + 0.35 * u),
                        self.depth(start + 0.5 * u, start + 0.8 * u),
                        (middle - 1.9 * w, middle + 1.9 * w),
                    ),
                )
                half, high, column_at = half + 0.1 * u, middle + reach + 2.6 * w, start + 0.8 * u
                frame = ""
            elif axis.is_linear and layout.along(axis) == self.j and not lower and frame:
                self.parts.add(
                    axis.name,
                    "ram",
                    LIGHT,
                    self.b(
                        self.around(w),
                        self.depth(start, start + 2.0 * reach + 3.0 * u),
                        (middle - w, middle + w),
                    ),
                )
                start += 0.8 * u
            else:
                standing = axis.name
        column_at = max(column_at or start + 0.8 * u, float(swept) + layout.gap_mm)
        if frame and not standing:
            self._add_fixed_head(start, column_at, w, middle)
        bed = self.stack.bed_mm
        levels = [standing, *lower] if standing else []
        foot = bed + 0.75 * u * len(levels)
        self._add_column(standing or BASE, half, column_at, foot, high)
        span, deep = half + 1.5 * u, 2.9 * u
        for number, name in enumerate(levels):
            axis = layout.machine.axes[name]
            reach = layout.half_travel_mm(axis) if axis.is_linear else 0.0
            top = foot - 0.75 * u * number
            self.parts.add(
                name,
                "base" if number else "column",
                DARK if number else LIGHT,
                self.b(
                    self.around(span),
                    self.depth(column_at - 0.2 * u, column_at + deep),
                    (top - 0.55 * u, top),
                ),
            )
            below = levels[number + 1] if number + 1 < len(levels) else BASE
            if axis.is_linear and layout.along(axis) == self.i:
                span += reach
                for at in (column_at + 0.3 * u, column_at + deep - 0.5 * u):
                    self.parts.add(
                        below,
                        "rails",
                        METAL,
                        self.b(
                            self.around(span),
                            self.depth(at - 0.2 * u, at + 0.2 * u),
                            (top - 0.75 * u, top - 0.55 * u),
                        ),
                    )
            else:
                deep += reach
                for side in (-0.7, 0.7):
                    mid = self.around(0.0)[0] + side * span
                    self.parts.add(
                        below,
                        "rails",
                        METAL,
                        self.b(
                            (mid - 0.2 * u, mid + 0.2 * u),
                            self.depth(column_at - 0.2 * u, column_at + deep),
                            (top - 0.75 * u, top - 0.55 * u),
                        ),
                    )
        ranges = {
            self.i: self.around(span),
            self.j: self.depth(column_at - 0.2 * u, column_at + deep),
        }
        self.parts.stand(ranges[0], ranges[1])

    def _add_fixed_head(self, start: float, column_at: float, w: float, middle: float) -> None:
        """Add a head that nothing raises: a box on the column."""
        frame = self.axes[0].name if self.axes and not self.axes[0].is_linear else BASE
        self.parts.add(
            frame,
            "headstock",
            MIDDLE,
            self.b(
                self.around(1.2 * w),
                self.depth(start, max(column_at, start) + 1.5 * self.u),
                (middle - 1.2 * w, middle + 1.2 * w),
            ),
        )

    def _add_column(self, frame: str, half: float, at: float, low: float, high: float) -> None:
        """Add two uprights on either side of the headstock, tied together above."""
        u = self.u
        for side in (-1.0, 1.0):
            ends = sorted(self.around(0.0)[0] + side * (half + edge) for edge in (0.0, 1.1 * u))
            self.parts.add(
                frame,
                "column",
                LIGHT,
                self.b((ends[0], ends[1]), self.depth(at, at + 2.4 * u), (low, high)),
            )
        self.parts.add(
            frame,
            "column",
            LIGHT,
            self.b(
                self.around(half + 1.1 * u), self.depth(at, at + 2.4 * u), (high, high + 0.9 * u)
            ),
        )


def build_behind(layout: Layout, parts: Parts, mount: Mount, stack: Stack) -> None:
    """Build what carries a horizontal head, down to what stands on the bed."""
    _Behind(layout, parts, mount, stack).build()
