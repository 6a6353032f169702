"""What carries the workpiece: tables, cradles, saddles and headstocks, stacked upon the bed."""

from dataclasses import dataclass

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, rod, spread, upright
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import box, cylinder
from warpspace.machine.description import Axis
from warpspace.units import Array

BASE = "R"
_SLOTS, _ABOVE_MM = 8, 0.3
_STEEP = 0.9


@dataclass
class Stack:
    """The stack of bodies under the workpiece while it is built from the top downwards.

    Attributes
    ----------
    centre_mm : ndarray, [2], mm
        Its middle in plan view.
    half_mm : ndarray, [2], mm
        Half edges of its lowest body so far.
    bed_mm : float
        Height of its lower side so far; in the end the top of the bed, mm.
    swept_mm : ndarray, [2], mm
        Half edges of what the moving stack sweeps.
    """

    centre_mm: Array
    half_mm: Array
    bed_mm: float
    swept_mm: Array

    def plan(self, grow: float = 1.0) -> tuple[tuple[float, float], tuple[float, float]]:
        """Give its ranges along x and y, mm."""
        low, high = self.centre_mm - grow * self.half_mm, self.centre_mm + grow * self.half_mm
        return (low[0], high[0]), (low[1], high[1])


def build_table(layout: Layout, parts: Parts) -> Stack:
    """Build the workpiece side from its outermost axis down to the bed.

    Returns
    -------
    Stack
        Where the bed begins, and what space the tool side has to leave.
    """
    branch = list(reversed(layout.machine.branch("workpiece")))
    stack = _top(layout, branch)
    for place, axis in enumerate(branch):
        parent = branch[place + 1].name if place + 1 < len(branch) else BASE
        if axis.is_linear:
            _add_slide(layout, parts, stack, axis, outermost=place == 0)
        elif layout.is_vertical(axis):
            _add_turntable(layout, parts, stack, axis, outermost=place == 0)
        elif abs(layout.direction(axis)).max() < _STEEP:
            _add_oblique_table(layout, parts, stack, axis)
        elif place == 0:
            _add_headstock(layout, parts, stack, axis, parent)
        else:
            _add_cradle(layout, parts, stack, axis, parent)
    if not branch:
        x, y = stack.plan()
        z = stack.bed_mm
        parts.add(BASE, "table", METAL, box(x, y, (z - 0.5 * layout.unit_mm, z)))
        parts.add_lines(BASE, "table", _slots(x, y, z))
        stack.bed_mm -= 0.5 * layout.unit_mm
    travel = np.zeros(2)
    for axis in branch:
        if axis.is_linear and not layout.is_vertical(axis):
            travel[layout.along(axis)] += layout.half_travel_mm(axis)
    stack.swept_mm = stack.swept_mm + travel
    if branch and branch[-1].is_linear and not layout.is_vertical(branch[-1]):
        _add_rails(layout, parts, stack, branch[-1])
    x, y = stack.plan()
    parts.stand(x, y)
    return stack


def _top(layout: Layout, branch: list[Axis]) -> Stack:
    """Find where the workpiece stands: below the volume, at the origin of w where that is there."""
    u = layout.unit_mm
    below = float(layout.low_mm[2]) - layout.gap_mm
    origin = float(layout.poses["w"][2, 3])
    top = origin if below - 4.0 * u < origin < below else below
    turning = [a for a in branch if not a.is_linear and layout.is_vertical(a)]
    centre = layout.origin(turning[0])[:2] if turning else layout.tip_mm[:2]
    half = 1.08 * layout.half_mm[:2]
    return Stack(centre.copy(), half, top, half.copy())


def _slots(x: tuple[float, float], y: tuple[float, float], top: float) -> Array:
    """Give T-slots along x as pairs of lines a little above a table, [E, 2, 3], mm."""
    z, width = top + _ABOVE_MM, (y[1] - y[0]) / 60.0
    rows = np.linspace(y[0], y[1], 6)[1:-1]
    return np.array([[(x[0], r + s, z), (x[1], r + s, z)] for r in rows for s in (-width, width)])


def _add_slide(layout: Layout, parts: Parts, stack: Stack, axis: Axis, *, outermost: bool) -> None:
    """Add the body of a linear axis: a table, a saddle or a lift."""
    u, z = layout.unit_mm, stack.bed_mm
    if outermost:
        x, y = stack.plan()
        parts.add(axis.name, "table", METAL, box(x, y, (z - 0.55 * u, z)))
        parts.add_lines(axis.name, "table", _slots(x, y, z))
        z -= 0.55 * u
        stack.half_mm = stack.half_mm * (0.86, 0.86)
    if layout.is_vertical(axis):
        reach = layout.half_travel_mm(axis)
        x, y = stack.plan(0.8)
        parts.add(axis.name, "lift", DARK, box(x, y, (z - 1.2 * u, z)))
        mid = np.append(stack.centre_mm, 0.0)
        parts.add(
            axis.name, "lift", DARK,
            upright(0.45 * float(stack.half_mm.min()), (z - 1.2 * u - 2.0 * reach, z - 1.2 * u), mid),
        )  # fmt: skip
        stack.bed_mm = z - 1.3 * u - reach
        stack.half_mm = 0.75 * stack.half_mm
        return
    if not outermost:
        x, y = stack.plan()
        parts.add(axis.name, "saddle", DARK, box(x, y, (z - 0.6 * u, z)))
        z -= 0.6 * u
    foot = 0.25 * u
    k = layout.along(axis)
    m = 1 - k
    for side in (-0.7, 0.7):
        middle = stack.centre_mm[m] + side * stack.half_mm[m]
        ranges = {
            k: (stack.centre_mm[k] - stack.half_mm[k], stack.centre_mm[k] + stack.half_mm[k]),
            m: (middle - 0.22 * u, middle + 0.22 * u),
            2: (z - foot, z),
        }
        parts.add(axis.name, "table" if outermost else "saddle", METAL, spread(ranges))
    stack.bed_mm = z - foot
    stack.half_mm[k] += 0.6 * layout.half_travel_mm(axis)


def _add_rails(layout: Layout, parts: Parts, stack: Stack, axis: Axis) -> None:
    """Add the rails on the bed that the lowest linear axis runs on."""
    u, z = layout.unit_mm, stack.bed_mm
    k = layout.along(axis)
    m = 1 - k
    stack.half_mm[k] += 0.4 * layout.half_travel_mm(axis)
    ends = (stack.centre_mm[k] - stack.half_mm[k], stack.centre_mm[k] + stack.half_mm[k])
    for side in (-0.7, 0.7):
        middle = stack.centre_mm[m] + side * stack.half_mm[m]
        ranges = {k: ends, m: (middle - 0.14 * u, middle + 0.14 * u), 2: (z - 0.2 * u, z)}
        parts.add(BASE, "rails", METAL, spread(ranges))
    stack.bed_mm = z - 0.2 * u


def _add_turntable(
    layout: Layout, parts: Parts, stack: Stack, axis: Axis, *, outermost: bool
) -> None:
    """Add a round table, with radial slots and one mark where it carries the workpiece itself."""
    u, z = layout.unit_mm, stack.bed_mm
    if not outermost:
        radius = 0.85 * float(stack.half_mm.max())
        at = layout.origin(axis)
        parts.add(axis.name, "turntable", DARK, upright(radius, (z - 0.6 * u, z), at))
        stack.bed_mm, stack.half_mm = z - 0.6 * u, np.full(2, radius)
        return
    radius = max(0.92 * float(layout.half_mm[:2].min()), 1.3 * u)
    at = layout.origin(axis)
    where = (float(at[0]), float(at[1]))
    parts.add(
        axis.name, "table", METAL,
        cylinder(radius, (z - 0.45 * u, z), where, inner=0.12 * radius),
        cylinder(0.82 * radius, (z - 0.75 * u, z - 0.45 * u), where, inner=0.12 * radius),
    )  # fmt: skip
    slots: list[Array] = []
    for turn in np.arange(_SLOTS) * 2.0 * np.pi / _SLOTS:
        out, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        for side in (-0.025, 0.025):
            ends = [at[:2] + radius * (r * out + side * across) for r in (0.2, 0.995)]
            slots.append(np.array([[*end, z + _ABOVE_MM] for end in ends]))
    parts.add_lines(axis.name, "table", np.array(slots))
    stack.bed_mm, stack.half_mm = z - 0.75 * u, np.full(2, radius)
    stack.swept_mm = np.full(2, radius)


def _add_oblique_table(layout: Layout, parts: Parts, stack: Stack, axis: Axis) -> None:
    """Add a table that turns about a line neither level nor upright: a disc square to that line."""
    u = layout.unit_mm
    line = layout.direction(axis) * np.sign(layout.direction(axis)[2] or 1.0)
    radius = float(stack.half_mm.min())
    middle = np.append(stack.centre_mm, stack.bed_mm - 0.75 * radius)
    parts.add(axis.name, "nutator", DARK, rod(middle - 0.3 * u * line, middle, radius))
    parts.add(axis.name, "nutator", DARK, upright(0.5 * radius, (middle[2], stack.bed_mm), middle))
    stack.bed_mm = float(middle[2]) - 0.8 * radius - 0.4 * u


def _add_headstock(
    layout: Layout, parts: Parts, stack: Stack, axis: Axis, parent: str
) -> None:
    """Add a chuck at one end of the volume, and on the frame before it the headstock behind it."""
    u, k = layout.unit_mm, layout.along(axis)
    m = 1 - k
    side = 1.0 if layout.origin(axis)[k] > layout.tip_mm[k] + 0.5 * layout.half_mm[k] else -1.0
    face = layout.tip_mm[k] + side * (layout.half_mm[k] + layout.gap_mm)
    line = layout.origin(axis).copy()
    radius = 1.5 * u

    def at(along: float) -> Array:
        point = line.copy()
        point[k] = face + side * along
        return point

    parts.add(
        axis.name, "chuck", METAL,
        rod(at(0.0), at(0.55 * u), radius), rod(at(0.55 * u), at(1.0 * u), 0.8 * radius),
    )  # fmt: skip
    for turn in np.arange(3) * 2.0 * np.pi / 3.0 + np.pi / 2.0:
        jaw = at(-0.09 * u)
        others = [i for i in range(3) if i != k]
        jaw[others] += 0.6 * radius * np.array([np.cos(turn), np.sin(turn)])
        half = np.full(3, 0.2 * u)
        half[k] = 0.09 * u
        parts.add(
            axis.name, "chuck", METAL,
            spread({i: (jaw[i] - half[i], jaw[i] + half[i]) for i in range(3)}),
        )  # fmt: skip
    low = min(float(layout.low_mm[2]) - layout.gap_mm, float(line[2]) - 2.0 * u)
    ends = sorted((face + side * 0.9 * u, face + side * 3.6 * u))
    parts.add(
        parent, "headstock", LIGHT,
        spread({k: (ends[0], ends[1]), m: (line[m] - 1.8 * u, line[m] + 1.8 * u), 2: (low, line[2])}),
        rod(at(0.9 * u), at(3.6 * u), 1.8 * u),
    )  # fmt: skip
    far = face - side * (2.0 * layout.half_mm[k] + 2.0 * layout.gap_mm)
    stack.centre_mm[k] = (face + side * 3.6 * u + far) / 2.0
    stack.centre_mm[m] = line[m]
    stack.half_mm[k] = abs(face + side * 3.6 * u - far) / 2.0
    stack.half_mm[m] = 1.9 * u
    stack.swept_mm = stack.half_mm.copy()
    stack.bed_mm = low


def _add_cradle(layout: Layout, parts: Parts, stack: Stack, axis: Axis, parent: str) -> None:
    """Add a cradle that tilts what is above, and on the frame before it two bearing towers."""
    u, k = layout.unit_mm, layout.along(axis)
    m, z, line = 1 - k, stack.bed_mm, layout.origin(axis)
    middle = float(stack.centre_mm[k])
    away = abs(float(layout.tip_mm[k]) - middle)
    inner = max(float(stack.half_mm[k]) + 0.3 * u, away + float(layout.half_mm[k]) + layout.gap_mm)
    depth = max(0.72 * float(stack.half_mm[m]), 1.0 * u)
    plate = z - 0.65 * u
    pivot = float(line[2])
    parts.add(
        axis.name, "cradle", DARK,
        spread({
            k: (middle - inner - 0.6 * u, middle + inner + 0.6 * u),
            m: (stack.centre_mm[m] - depth, stack.centre_mm[m] + depth), 2: (plate, z),
        }),
    )  # fmt: skip
    clearance = 0.4 * float(stack.half_mm[m]) + 0.2 * u
    bed = min(plate, pivot - 1.2 * u) - clearance
    for side in (-1.0, 1.0):
        near, far = middle + side * inner, middle + side * (inner + 0.6 * u)
        arm = (min(near, far), max(near, far))
        low, high = min(plate, pivot), max(pivot, z)
        parts.add(
            axis.name, "cradle", DARK,
            spread({k: arm, m: (line[m] - 1.0 * u, line[m] + 1.0 * u), 2: (low, high)}),
            _lying(k, line, arm, 1.0 * u),
        )  # fmt: skip
        near, far = middle + side * (inner + 0.7 * u), middle + side * (inner + 1.6 * u)
        tower = (min(near, far), max(near, far))
        parts.add(
            parent, "towers", MIDDLE,
            spread({k: tower, m: (line[m] - 1.2 * u, line[m] + 1.2 * u), 2: (bed, pivot)}),
            _lying(k, line, tower, 1.2 * u),
        )  # fmt: skip
    stack.bed_mm = bed
    half = np.array([0.0, 0.0])
    half[k], half[m] = inner + 1.6 * u, max(depth, 1.3 * u)
    stack.half_mm = half
    stack.swept_mm = np.maximum(stack.swept_mm, half)


def _lying(k: int, line: Array, ends: tuple[float, float], radius: float):  # noqa: ANN202
    """Build a level cylinder about the line of an axis along x or y."""
    start, end = line.copy(), line.copy()
    start[k], end[k] = ends
    return rod(start, end, radius)
