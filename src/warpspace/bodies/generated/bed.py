"""The bed under a machine."""

import numpy as np

from warpspace.bodies.generated.layout import Layout
from warpspace.bodies.generated.parts import Parts
from warpspace.bodies.generated.stack import Stack
from warpspace.bodies.mesh import MIDDLE
from warpspace.bodies.schematic import Shape, box
from warpspace.units import Array


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
    if not np.allclose(layout.slant, np.eye(3)):
        z = top - 1.45 * u
        corners = np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1)])
        parts.add("R", "bed", MIDDLE, _wedge(corners, layout.slant, u))


def _wedge(corners_mm: Array, slant: Array, unit_mm: float) -> Shape:
    """Build what a slanted bed stands on: from its lower side straight down to a level floor."""
    from trimesh import convex

    lower = corners_mm @ slant.T  # in R
    floor = lower.copy()
    floor[:, 2] = lower[:, 2].min() - 0.5 * unit_mm
    return convex.convex_hull(np.concatenate([lower, floor]) @ slant)
