"""Schematic bodies from simple closed shapes, built by trimesh: read from a file, or generated.

All sizes are mm. A body is described where it stands with every axis at zero, in R, and then moved
into the frame it rides on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE, Body, build_body, open_meshes
from warpspace.geometry.colour import linear_to_srgb
from warpspace.units import Array

BODY_FILE = "bodies.glb"
_WHAT = "file of machine bodies"
LINES = " lines"


@lru_cache(maxsize=8)
def read_bodies(path: Path) -> tuple[Body, ...]:
    """Read a file of bodies; the result is kept, since every session draws the same."""
    if not path.is_file():
        return ()
    scene = open_meshes(path, _WHAT)
    lines = {
        name.removesuffix(LINES): np.reshape(geometry.vertices, (-1, 2, 3))
        for name, geometry in scene.geometry.items()
        if name.endswith(LINES)
    }
    return tuple(
        build_body(mesh, name, frame_of(name), _colour(mesh), lines.get(name))
        for name, mesh in scene.geometry.items()
        if hasattr(mesh, "faces")
    )


def frame_of(name: str) -> str:
    """Frame that a body rides on, from its name."""
    return name.partition("_")[0]


def _colour(mesh: Any) -> tuple[int, int, int]:
    """Colour of the material of a mesh, sRGB; a grey where it has none."""
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return MIDDLE
    linear = np.asarray(material.main_color[:3]) / 255.0
    red, green, blue = (int(value) for value in np.rint(linear_to_srgb(linear) * 255.0))
    return red, green, blue


SIDES = 40  # flat sides by which a circle is drawn
Range = tuple[float, float]
Shape = Any  # A closed mesh of trimesh


def box(x: Range, y: Range, z: Range) -> Shape:
    """Build a box between two positions along each axis, mm."""
    from trimesh import creation

    ends = np.array([x, y, z], dtype=float)
    mesh = creation.box(extents=np.ptp(ends, axis=1))
    mesh.apply_translation(ends.mean(axis=1))
    return mesh


def cylinder(
    radius: float, ends: Range, at: Range = (0.0, 0.0), axis: str = "z", inner: float = 0.0
) -> Shape:
    """Build a cylinder, or a ring, about a line parallel to an axis."""
    from trimesh import creation, transformations

    height = ends[1] - ends[0]
    mesh = (
        creation.annulus(r_min=inner, r_max=radius, height=height, sections=SIDES)
        if inner
        else creation.cylinder(radius=radius, height=height, sections=SIDES)
    )
    if axis != "z":
        about, angle = ([0, 1, 0], np.pi / 2) if axis == "x" else ([1, 0, 0], np.pi / 2)
        mesh.apply_transform(transformations.rotation_matrix(angle, about))
    mesh.apply_translation(np.insert(np.asarray(at, dtype=float), "xyz".index(axis), sum(ends) / 2))
    return mesh


def cone(lower: float, upper: float, ends: Range) -> Shape:
    """Build a frustum about z with two radii between two heights, mm."""
    from trimesh import creation

    outline = np.array([(0.0, ends[0]), (lower, ends[0]), (upper, ends[1]), (0.0, ends[1])])
    return creation.revolve(outline, sections=SIDES)


ROD_SIDES = 32
Colour = tuple[int, int, int]
_BODIES = {
    LIGHT: "arm bridge column fork headstock portal wedge",
    MIDDLE: "bed head neck pedestal ram sides towers",
    DARK: "base beam carriage cradle gripper hub lift nozzle nutator probe rotor saddle swivel tool"
    " turntable wheel",
    METAL: "chuck quill rails spindle table",
}
COLOURS = {body: colour for colour, bodies in _BODIES.items() for body in bodies.split()}


@dataclass
class _Part:
    frame: str
    colour: Colour
    shapes: list[Shape] = field(default_factory=list[Shape])
    lines_mm: list[Array] = field(default_factory=list[Array])  # [E, 2, 3], in R at home


@dataclass
class Parts:
    """Shapes in R at home, by the body they belong to."""

    poses: dict[str, Array]  # [4, 4]; frames in R at home
    # [2, 2], mm; rectangles, lower and upper corner, that the bed has to carry
    floor: list[Array] = field(default_factory=list[Array])
    _parts: dict[str, _Part] = field(default_factory=dict[str, _Part])

    def _part(self, frame: str, what: str, colour: Colour | None = None) -> _Part:
        """Give a body of a frame; what it is called says its colour, unless the first call does."""
        return self._parts.setdefault(f"{frame}_{what}", _Part(frame, colour or COLOURS[what]))

    def add(self, frame: str, what: str, *shapes: Shape) -> None:
        """Add shapes to the body of a frame."""
        self._part(frame, what).shapes.extend(shapes)

    def box(
        self,
        frame: str,
        what: str,
        i: Range,
        j: Range,
        z: Range,
        *,
        along: int = 0,
        colour: Colour | None = None,
    ) -> None:
        """Add a box: range i is along axis 0 (x) or 1 (y) of R, j along the other, in mm."""
        x, y = (j, i) if along else (i, j)
        self._part(frame, what, colour).shapes.append(box(x, y, z))

    def add_lines(self, frame: str, what: str, lines_mm: Array) -> None:
        """Add lines to a body, [E, 2, 3], mm in R at home."""
        self._part(frame, what).lines_mm.append(lines_mm)

    def stand(self, i: Range, j: Range, *, along: int = 0) -> None:
        """Note a rectangle that the bed has to carry, its ranges as those of a box."""
        corners = np.array([i, j]).T
        self.floor.append(corners[:, ::-1] if along else corners)

    def bodies(self) -> tuple[Body, ...]:
        """Join the shapes of each body, in its own frame."""
        from trimesh import util

        found: list[Body] = []
        for name, part in self._parts.items():
            mesh = util.concatenate(part.shapes)
            inverse = np.linalg.inv(self.poses[part.frame])
            mesh.apply_transform(inverse)
            own = None
            if part.lines_mm:
                own = np.concatenate(part.lines_mm) @ inverse[:3, :3].T + inverse[:3, 3]
            found.append(build_body(mesh, name, part.frame, part.colour, own))
        return tuple(found)


# --- ranges -------------------------------------------------------------------------------------


def about(middle: float, half: float) -> Range:
    """Give a range about its middle."""
    return (float(middle) - half, float(middle) + half)


def pair(middle: float, apart: float, half: float) -> tuple[Range, Range]:
    """Give two mirrored ranges, such as two rails: how far from the middle, and how wide."""
    return about(middle - apart, half), about(middle + apart, half)


def beside(middle: float, inner: float, thick: float) -> tuple[Range, Range]:
    """Give two mirrored ranges, such as two walls, by the inner faces."""
    return pair(middle, inner + thick / 2.0, thick / 2.0)


# --- shapes -------------------------------------------------------------------------------------


def block(centre: Sequence[float] | Array, half: Sequence[float] | Array) -> Shape:
    """Build a box about a centre, half edges along the axes of R, mm."""
    x, y, z = (about(middle, width) for middle, width in zip(centre, half, strict=True))
    return box(x, y, z)


def rod(start: Array, end: Array, radius: float, end_radius: float | None = None) -> Shape:
    """Build a cylinder, or a frustum, between two points of R, mm."""
    from trimesh import creation, geometry

    if end_radius is None:
        return creation.cylinder(radius=radius, segment=np.array([start, end]), sections=ROD_SIDES)
    length = float(np.linalg.norm(end - start))
    outline = np.array([(0.0, 0.0), (radius, 0.0), (end_radius, length), (0.0, length)])
    mesh = creation.revolve(outline, sections=ROD_SIDES)
    matrix: Any = geometry.align_vectors([0, 0, 1], (end - start) / length)
    matrix[:3, 3] = start
    mesh.apply_transform(matrix)
    return mesh


def upright(radius: float, ends: Range, at: Array, inner: float = 0.0) -> Shape:
    """Build a vertical cylinder, or a ring, mm."""
    return cylinder(radius, ends, (float(at[0]), float(at[1])), inner=inner)


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
