"""Collecting the shapes of generated bodies, and the shapes that schematic.py does not have."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpspace.bodies.mesh import Body, build_body
from warpspace.bodies.schematic import Range, Shape, box, cylinder
from warpspace.units import Array

SIDES = 32
Colour = tuple[int, int, int]


@dataclass
class Parts:
    """Shapes in R at home, by the body they belong to.

    Attributes
    ----------
    poses : dict of str to ndarray, [4, 4]
        Frames in R at home.
    floor : list of ndarray, [2, 2], mm
        Rectangles, lower and upper corner, that the bed has to carry.
    """

    poses: dict[str, Array]
    floor: list[Array] = field(default_factory=list[Array])
    _shapes: dict[str, list[Shape]] = field(default_factory=dict[str, list[Shape]])
    _frames: dict[str, tuple[str, Colour]] = field(default_factory=dict[str, tuple[str, Colour]])
    _lines: dict[str, list[Array]] = field(default_factory=dict[str, list[Array]])

    def add(self, frame: str, what: str, colour: Colour, *shapes: Shape) -> None:
        """Add shapes to the body of a frame; the first call gives its colour."""
        name = f"{frame}_{what}"
        self._frames.setdefault(name, (frame, colour))
        self._shapes.setdefault(name, []).extend(shapes)

    def add_lines(self, frame: str, what: str, lines_mm: Array) -> None:
        """Add lines to a body, [E, 2, 3], mm in R at home."""
        self._lines.setdefault(f"{frame}_{what}", []).append(lines_mm)

    def stand(self, x: Range, y: Range) -> None:
        """Note a rectangle that the bed has to carry."""
        self.floor.append(np.array([(x[0], y[0]), (x[1], y[1])]))

    def bodies(self) -> tuple[Body, ...]:
        """Join the shapes of each body, in its own frame."""
        from trimesh import util

        found: list[Body] = []
        for name, shapes in self._shapes.items():
            frame, colour = self._frames[name]
            mesh = util.concatenate(shapes)
            inverse = np.linalg.inv(self.poses[frame])
            mesh.apply_transform(inverse)
            lines = self._lines.get(name)
            own = None
            if lines:
                own = np.concatenate(lines) @ inverse[:3, :3].T + inverse[:3, 3]
            found.append(build_body(mesh, name, frame, colour, own))
        return tuple(found)


def block(centre: Sequence[float] | Array, half: Sequence[float] | Array) -> Shape:
    """Build a box about a centre, half edges along the axes of R, mm."""
    low, high = np.subtract(centre, half), np.add(centre, half)
    return box((low[0], high[0]), (low[1], high[1]), (low[2], high[2]))


def spread(indexed: dict[int, Range]) -> Shape:
    """Build a box from a range, mm, per index of an axis of R."""
    return box(indexed[0], indexed[1], indexed[2])


def rod(start: Array, end: Array, radius: float, end_radius: float | None = None) -> Shape:
    """Build a cylinder, or a frustum, between two points of R, mm."""
    from trimesh import creation, geometry

    if end_radius is None:
        return creation.cylinder(radius=radius, segment=np.array([start, end]), sections=SIDES)
    length = float(np.linalg.norm(end - start))
    outline = np.array([(0.0, 0.0), (radius, 0.0), (end_radius, length), (0.0, length)])
    mesh = creation.revolve(outline, sections=SIDES)
    matrix: Any = geometry.align_vectors([0, 0, 1], (end - start) / length)
    matrix[:3, 3] = start
    mesh.apply_transform(matrix)
    return mesh


def upright(radius: float, ends: Range, at: Array) -> Shape:
    """Build a vertical cylinder, mm."""
    return cylinder(radius, ends, (float(at[0]), float(at[1])))


def capped(low: float, high: float) -> Range:
    """Give a range that is never empty, mm."""
    return (low, max(high, low + 1.0))


def bar(start: Array, end: Array, half_width: float, half_height: float) -> Shape:
    """Build a level bar between two points of R, mm."""
    from trimesh import creation, transformations

    across = end - start
    length = float(np.hypot(across[0], across[1]))
    mesh = creation.box(extents=[length, 1.7 * half_width, 2.0 * half_height])
    turn = np.arctan2(across[1], across[0])
    mesh.apply_transform(transformations.rotation_matrix(turn, [0, 0, 1]))
    mesh.apply_translation((start + end) / 2.0)
    return mesh
