"""The bed under a machine."""

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.mesh import MIDDLE
from warpspace.bodies.schematic import box


def build_bed(layout: Layout, parts: Parts, stack: Stack) -> None:
    """Add the bed: a slab under everything that stands on it, and a plinth a little smaller."""
    u, top = layout.unit_mm, stack.bed_mm
    corners = np.concatenate(parts.floor)
    (x0, y0), (x1, y1) = corners.min(axis=0) - 0.25 * u, corners.max(axis=0) + 0.25 * u
    inset = 0.35 * u
    parts.add(
        "R",
        "bed",
        MIDDLE,
        box((x0, x1), (y0, y1), (top - 1.1 * u, top)),
        box((x0 + inset, x1 - inset), (y0 + inset, y1 - inset), (top - 1.45 * u, top - 1.1 * u)),
    )
