"""Schematic bodies from simple closed shapes, built by trimesh: read from a file, or generated."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.bodies.mesh import DARK, LIGHT, METAL, MIDDLE, Body, build_body, open_meshes
from warpspace.geometry.colour import linear_to_srgb
from warpspace.kinematics.chain import body_motions
from warpspace.kinematics.model import Model
from warpspace.machine.definition import Axis, Machine
from warpspace.units import Array

BODY_FILE = "bodies.glb"
_WHAT = "file of machine bodies"
LINES = " lines"


@lru_cache(maxsize=8)
def read_bodies(path: Path) -> tuple[Body, ...]:
    """Read a file of bodies, cached for all sessions."""
    if not path.is_file():
        return ()
    scene = open_meshes(path, _WHAT, has_materials=True)
    lines = {
        name.removesuffix(LINES): np.array(geometry.vertices).reshape(-1, 2, 3)
        for name, geometry in scene.geometry.items()
        if name.endswith(LINES)
    }
    return tuple(
        build_body(mesh, name, frame_of(name), _colour(mesh), lines.get(name))
        for name, mesh in scene.geometry.items()
        if hasattr(mesh, "faces")
    )


def frame_of(name: str) -> str:
    return name.partition("_")[0]


def _colour(mesh: Any) -> tuple[int, int, int]:
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return MIDDLE
    linear = np.asarray(material.main_color[:3]) / 255.0
    red, green, blue = (int(value) for value in np.rint(linear_to_srgb(linear) * 255.0))
    return red, green, blue


SIDES = 28  # flat sides by which a circle is drawn
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
    radius: float,
    ends: Range,
    at: Sequence[float] | Array = (0.0, 0.0),
    axis: str = "z",
    inner: float = 0.0,
) -> Shape:
    """Build a cylinder, or a ring, about a line parallel to an axis; at names the other two."""
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
    place = np.insert(np.asarray(at, dtype=float)[:2], "xyz".index(axis), sum(ends) / 2)
    mesh.apply_translation(place)
    return mesh


def cone(lower: float, upper: float, ends: Range) -> Shape:
    """Build a frustum about z with two radii between two heights, mm."""
    from trimesh import creation

    outline = np.array([(0.0, ends[0]), (lower, ends[0]), (upper, ends[1]), (0.0, ends[1])])
    return creation.revolve(outline, sections=SIDES)


def about(middle: float, half: float) -> Range:
    return (float(middle) - half, float(middle) + half)


def pair(middle: float, apart: float, half: float) -> tuple[Range, Range]:
    """Return two mirrored ranges, such as two rails, by distance and half width."""
    return about(middle - apart, half), about(middle + apart, half)


def mirrored_walls(middle: float, inner: float, thick: float) -> tuple[Range, Range]:
    """Return two mirrored ranges, such as two walls, by their inner faces."""
    return pair(middle, inner + thick / 2.0, thick / 2.0)


def block(centre: Sequence[float] | Array, half: Sequence[float] | Array) -> Shape:
    """Build a box about a centre, half edges along the axes of R, mm."""
    x, y, z = (about(middle, width) for middle, width in zip(centre, half, strict=True))
    return box(x, y, z)


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


# All bodies are built with the machine at home, in R: linear axes in the middle of their travel,
# rotary axes at zero or as near as their travel allows. A machine whose slides are rotated against
# R, as on the slant bed of a lathe, is built upright along its slides, rotated, and set on a wedge.

_SHARE_OF_VOLUME, _SMALLEST_MM = 0.2, 12.0
_FLAT = 0.3  # assumed half edge without an axis, as a share of the longest
_ARMS = 0.4  # of the length of all arms: half edge of the place before a robot without level axes
_STEEP = 0.75  # cosine of an angle to a direction below which an axis counts as pointing along it
_ALIGNED, _SQUARE = 0.9994, 0.02
"""Cosines of two angles: 2 degrees to an axis of R, and one degree off a right angle."""


@dataclass(frozen=True)
class HomeAxis:
    """An axis at home, in R."""

    name: str
    is_linear: bool
    direction: Array  # [3]; unit vector along or about which it moves
    origin_mm: Array  # [3]; of its frame
    k: int  # index of the nearest axis of R: 2 for up or down
    reach_mm: float  # half its travel; 0 for a rotary axis

    @property
    def slides_level(self) -> bool:
        return self.is_linear and self.k != 2


@dataclass(frozen=True)
class MachineLayout:
    """A machine at home."""

    poses: dict[str, Array]  # [4, 4]; every frame in R
    tool: tuple[HomeAxis, ...]  # axes of each branch, from the frame outwards
    workpiece: tuple[HomeAxis, ...]
    tip_mm: Array  # [3]; tool point: the middle of the working volume
    # [3]; half edges of the working volume along the axes of R, its lower and its upper corner
    half_mm: Array
    low_mm: Array
    high_mm: Array
    unit_mm: float  # thickness of a wall; every other size of a body is a multiple of it
    gap_mm: float  # clear space kept around the working volume
    length_mm: float  # of the tool, down from the spindle nose
    # [3, 3]; rotation of all of the above in R: identity except for a slanted machine
    slant: Array


def build_layout(machine: Machine) -> MachineLayout:
    axes = tuple(machine.axes.values())
    home = {
        axis.name: np.asarray(
            sum(axis.travel) / 2.0
            if axis.is_linear
            else min(max(0.0, axis.travel[0]), axis.travel[1])
        )
        for axis in axes
    }
    motions = body_motions(Model(machine), {}, home)
    slant = _find_slant(machine, {name: motion.nominal for name, motion in motions.items()})
    upright = np.eye(4)
    upright[:3, :3] = slant.T
    poses = {name: upright @ motion.nominal for name, motion in motions.items()}
    home_axes = {axis.name: _home_axis(axis, poses[axis.name]) for axis in axes}
    half = np.zeros(3)
    first = {axis.index: axis for axis in reversed(axes) if axis.is_linear}
    for axis in first.values():
        half += home_axes[axis.name].reach_mm * np.abs(home_axes[axis.name].direction)
    lengths = [np.linalg.norm(offset) for offset in machine.fixed_mm.values()]
    lengths += [np.linalg.norm(axis.offset_mm) for axis in axes]
    arms = [np.hypot(*axis.offset_mm[:2]) for axis in axes if not axis.is_linear]
    reach = max(half.max(), 0.8 * sum(arms) if np.count_nonzero(half > 1.0) < 3 else 0.0)
    if reach < 1.0:
        reach = max(200.0, 0.3 * float(max(lengths, default=0.0)))
    filled = np.maximum(half, _FLAT * reach)
    unit = max(_SHARE_OF_VOLUME * 2.0 * float(filled.mean()), _SMALLEST_MM)
    flat = [k for k in (0, 1) if half[k] < 1.0]
    if flat and any(not way.is_linear and way.k == 2 for way in home_axes.values()):
        radius = _ARMS * sum(float(np.hypot(*axis.offset_mm[:2])) for axis in axes)
        filled[flat] = half[:2].max() if len(flat) == 1 else max(radius, filled[:2].max())
    tip = poses["t"][:3, 3]
    tool = tuple(home_axes[axis.name] for axis in machine.branch("tool"))
    workpiece = tuple(home_axes[axis.name] for axis in machine.branch("workpiece"))
    low, high = tip - filled, tip + filled
    length = -float(machine.fixed_mm.get("t", (0.0, 0.0, 0.0))[2])
    return MachineLayout(
        poses, tool, workpiece, tip, filled, low, high, unit, 0.2 * unit, length, slant
    )


def _home_axis(axis: Axis, pose: Array) -> HomeAxis:
    direction = pose[:3, axis.index]
    k = 2 if abs(direction[2]) > _STEEP else int(np.argmax(np.abs(direction[:2])))
    reach = (axis.travel[1] - axis.travel[0]) / 2.0 if axis.is_linear else 0.0
    return HomeAxis(axis.name, axis.is_linear, direction, pose[:3, 3], k, reach)


def _find_slant(machine: Machine, poses: Mapping[str, Array]) -> Array:
    linear = [poses[axis.name][:3, axis.index] for axis in machine.axes.values() if axis.is_linear]
    if all(np.abs(way).max() > _ALIGNED for way in linear):
        return np.eye(3)
    triad: list[Array] = []
    for direction in linear:
        cosines = [abs(float(direction @ known)) for known in triad]
        if any(_SQUARE < cosine < 1.0 - _SQUARE for cosine in cosines):
            return np.eye(3)
        if not any(cosine > 0.5 for cosine in cosines):
            triad.append(direction)
    turned = _nearest(_completed(triad), np.array(linear))
    turning = [axis for axis in machine.branch("workpiece") if not axis.is_linear]
    about = [turned.T @ poses[axis.name][:3, axis.index] for axis in turning]
    return turned if all(np.abs(way).max() > _ALIGNED for way in about) else np.eye(3)


def _completed(triad: list[Array]) -> Array:
    vectors = list(triad)
    for axis in np.eye(3)[np.argsort(np.abs(np.sum(np.square(triad), axis=0)))]:
        if len(vectors) < 3:
            remainder = axis - sum((float(axis @ known) * known for known in vectors), np.zeros(3))
            if np.linalg.norm(remainder) > 0.5:
                vectors.append(remainder / np.linalg.norm(remainder))
    left_vectors, _, right_vectors = np.linalg.svd(np.array(vectors).T)
    return left_vectors @ right_vectors


def _nearest(triad: Array, linear: Array) -> Array:
    def rank(turned: Array) -> tuple[float, float]:
        level = np.abs(linear @ turned[:, 2]) < 0.5
        return round(float(np.trace(turned)), 6), float(level.sum())

    candidates = (
        triad[:, order] * signs
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    )
    return max((turned for turned in candidates if np.linalg.det(turned) > 0.0), key=rank)


Colour = tuple[int, int, int]
_BODIES = {
    LIGHT: "arm bridge column fork headstock link portal wedge",
    MIDDLE: "bed head neck pedestal ram sides towers",
    DARK: "base beam carriage cradle gripper hub joint lift nozzle nutator probe rotor saddle"
    " swivel tool turntable wheel",
    METAL: "chuck flange quill rails spindle table",
}
COLOURS = {body: colour for colour, bodies in _BODIES.items() for body in bodies.split()}


@dataclass
class _BodyShapes:
    frame: str
    colour: Colour
    shapes: list[Shape] = field(default_factory=list[Shape])
    lines_mm: list[Array] = field(default_factory=list[Array])  # [2, 3] each, in R at home


@dataclass
class Parts:
    """Shapes in R at home, by body."""

    layout: MachineLayout
    # [2, 2], mm; rectangles, lower and upper corner, that the bed carries
    floor: list[Array] = field(default_factory=list[Array])
    _parts: dict[str, _BodyShapes] = field(default_factory=dict[str, _BodyShapes])

    def part(self, frame: str, what: str, colour: Colour | None = None) -> _BodyShapes:
        """Return a body of a frame; its colour is that of its first call."""
        new = _BodyShapes(frame, colour or COLOURS[what])
        return self._parts.setdefault(f"{frame}_{what}", new)

    def add(self, frame: str, what: str, *shapes: Shape, lines_mm: Iterable[Array] = ()) -> None:
        """Add shapes and lines, [2, 3], to the body of a frame."""
        part = self.part(frame, what)
        part.shapes.extend(shapes)
        part.lines_mm.extend(lines_mm)

    def box(self, frame: str, what: str, i: Range, j: Range, z: Range, *, along: int = 0) -> None:
        """Add a box: range i is along axis 0 (x) or 1 (y) of R, j along the other, in mm."""
        x, y = (j, i) if along else (i, j)
        self.add(frame, what, box(x, y, z))

    def stand(self, i: Range, j: Range, *, along: int = 0) -> None:
        """Add a rectangle that the bed carries, its ranges as those of a box."""
        corners = np.array([i, j]).T
        self.floor.append(corners[:, ::-1] if along else corners)

    def bodies(self) -> tuple[Body, ...]:
        from trimesh import util

        built: list[Body] = []
        for name, part in self._parts.items():
            mesh = util.concatenate(part.shapes)
            inverse = np.linalg.inv(self.layout.poses[part.frame])
            mesh.apply_transform(inverse)
            lines_mm = None
            if part.lines_mm:
                lines_mm = np.array(part.lines_mm) @ inverse[:3, :3].T + inverse[:3, 3]
            built.append(build_body(mesh, name, part.frame, part.colour, lines_mm))
        return tuple(built)
