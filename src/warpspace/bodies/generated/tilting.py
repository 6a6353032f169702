"""What turns the workpiece about a line not upright: cradles, headstocks, oblique tables."""

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts, rod, spread, upright
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE
from warpspace.bodies.schematic import Shape
from warpspace.machine.description import Axis
from warpspace.units import Array


def add_oblique_table(layout: Layout, parts: Parts, stack: Stack, axis: Axis) -> None:
    """Add a table that turns about a line neither level nor upright: a disc square to that line."""
    u = layout.unit_mm
    line = layout.direction(axis) * np.sign(layout.direction(axis)[2] or 1.0)
    radius = float(stack.half_mm.min())
    middle = np.append(stack.centre_mm, stack.bed_mm - 0.75 * radius)
    parts.add(axis.name, "nutator", DARK, rod(middle - 0.3 * u * line, middle, radius))
    parts.add(axis.name, "nutator", DARK, upright(0.5 * radius, (middle[2], stack.bed_mm), middle))
    stack.bed_mm = float(middle[2]) - 0.8 * radius - 0.4 * u


def add_headstock(layout: Layout, parts: Parts, stack: Stack, axis: Axis, parent: str) -> None:
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
        axis.name,
        "chuck",
        METAL,
        rod(at(0.0), at(0.55 * u), radius),
        rod(at(0.55 * u), at(1.0 * u), 0.8 * radius),
    )
    for turn in np.arange(3) * 2.0 * np.pi / 3.0 + np.pi / 2.0:
        jaw = at(-0.09 * u)
        others = [i for i in range(3) if i != k]
        jaw[others] += 0.6 * radius * np.array([np.cos(turn), np.sin(turn)])
        half = np.full(3, 0.2 * u)
        half[k] = 0.09 * u
        parts.add(
            axis.name,
            "chuck",
            METAL,
            spread({i: (jaw[i] - half[i], jaw[i] + half[i]) for i in range(3)}),
        )
    low = min(float(layout.low_mm[2]) - layout.gap_mm, float(line[2]) - 2.0 * u)
    ends = sorted((face + side * 0.9 * u, face + side * 3.6 * u))
    parts.add(
        parent,
        "headstock",
        LIGHT,
        spread(
            {k: (ends[0], ends[1]), m: (line[m] - 1.8 * u, line[m] + 1.8 * u), 2: (low, line[2])}
        ),
        rod(at(0.9 * u), at(3.6 * u), 1.8 * u),
    )
    far = face - side * (2.0 * layout.half_mm[k] + 2.0 * layout.gap_mm)
    stack.centre_mm[k] = (face + side * 3.6 * u + far) / 2.0
    stack.centre_mm[m] = line[m]
    stack.half_mm[k] = abs(face + side * 3.6 * u - far) / 2.0
    stack.half_mm[m] = 1.9 * u
    stack.swept_mm = stack.half_mm.copy()
    stack.bed_mm = low


def add_cradle(layout: Layout, parts: Parts, stack: Stack, axis: Axis, parent: str) -> None:
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
        axis.name,
        "cradle",
        DARK,
        spread(
            {
                k: (middle - inner - 0.6 * u, middle + inner + 0.6 * u),
                m: (stack.centre_mm[m] - depth, stack.centre_mm[m] + depth),
                2: (plate, z),
            }
        ),
    )
    clearance = 0.4 * float(stack.half_mm[m]) + 0.2 * u
    bed = min(plate, pivot - 1.2 * u) - clearance
    for side in (-1.0, 1.0):
        near, far = middle + side * inner, middle + side * (inner + 0.6 * u)
        arm = (min(near, far), max(near, far))
        low, high = min(plate, pivot), max(pivot, z)
        parts.add(
            axis.name,
            "cradle",
            DARK,
            spread({k: arm, m: (line[m] - 1.0 * u, line[m] + 1.0 * u), 2: (low, high)}),
            _lying(k, line, arm, 1.0 * u),
        )
        near, far = middle + side * (inner + 0.7 * u), middle + side * (inner + 1.6 * u)
        tower = (min(near, far), max(near, far))
        parts.add(
            parent,
            "towers",
            MIDDLE,
            spread({k: tower, m: (line[m] - 1.2 * u, line[m] + 1.2 * u), 2: (bed, pivot)}),
            _lying(k, line, tower, 1.2 * u),
        )
    stack.bed_mm = bed
    half = np.array([0.0, 0.0])
    half[k], half[m] = inner + 1.6 * u, max(depth, 1.3 * u)
    stack.half_mm = half
    stack.swept_mm = np.maximum(stack.swept_mm, half)


def _lying(k: int, line: Array, ends: tuple[float, float], radius: float) -> Shape:
    """Build a level cylinder about the line of an axis along x or y."""
    start, end = line.copy(), line.copy()
    start[k], end[k] = ends
    return rod(start, end, radius)
