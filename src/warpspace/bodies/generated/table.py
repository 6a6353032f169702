"""What carries the workpiece: tables, cradles, saddles and headstocks, stacked upon the bed."""

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, spread, upright
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.generated.tilting import add_cradle, add_headstock, add_oblique_table
from warpspace.bodies.mesh import DARK, METAL
from warpspace.bodies.schematic import box, cylinder
from warpspace.machine.description import Axis
from warpspace.units import Array

BASE = "R"
_SLOTS, _ABOVE_MM = 8, 0.3
_STEEP = 0.9


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
            add_oblique_table(layout, parts, stack, axis)
        elif place == 0:
            add_headstock(layout, parts, stack, axis, parent)
        else:
            add_cradle(layout, parts, stack, axis, parent)
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
            axis.name,
            "lift",
            DARK,
            upright(
                0.45 * float(stack.half_mm.min()), (z - 1.2 * u - 2.0 * reach, z - 1.2 * u), mid
            ),
        )
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
        axis.name,
        "table",
        METAL,
        cylinder(radius, (z - 0.45 * u, z), where, inner=0.12 * radius),
        cylinder(0.82 * radius, (z - 0.75 * u, z - 0.45 * u), where, inner=0.12 * radius),
    )
    slots: list[Array] = []
    for turn in np.arange(_SLOTS) * 2.0 * np.pi / _SLOTS:
        out, across = (
            np.array([np.cos(turn), np.sin(turn)]),
            np.array([-np.sin(turn), np.cos(turn)]),
        )
        for side in (-0.025, 0.025):
            ends = [at[:2] + radius * (r * out + side * across) for r in (0.2, 0.995)]
            slots.append(np.array([[*end, z + _ABOVE_MM] for end in ends]))
    parts.add_lines(axis.name, "table", np.array(slots))
    stack.bed_mm, stack.half_mm = z - 0.75 * u, np.full(2, radius)
    stack.swept_mm = np.full(2, radius)
