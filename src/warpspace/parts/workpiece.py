"""Workpieces: meshes in the workpiece frame, and their vertices as the machine produces them.

The error of a point is that of the tool against the workpiece, in the workpiece frame w, where the
linear axes bring the tool to the point and the rotary axes are at their positions of the scene. The
actual part is the nominal one plus that error. Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.description import Analysis
from warpspace.analysis.options import File, Grammar, option
from warpspace.analysis.uncertainty.propagation import FieldUncertainty, combine, scene_uncertainty
from warpspace.bench.placing import follow, within_travel
from warpspace.bodies.mesh import CREASE_DEG
from warpspace.bodies.mesh_files import read_mesh
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorBasis, build_basis
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_LENGTH_MM, MAX_PART_TRIANGLES
from warpspace.scene.model import Scene, evaluate
from warpspace.scene.text_files import parse_number
from warpspace.units import Array, Integers

# limits of the memory of intermediate arrays
POINTS_AT_ONCE, PAIRS_AT_ONCE, TRIANGLES_AT_ONCE = 50_000, 500_000, 200_000
TOUCH_SHARE = 1e-5  # share of the largest coordinate up to which triangles only touch
GROUP_SIZE, MAX_PAIRS = 100, 2e8  # triangles of a group that is not split; pairs examined


class Corners(NamedTuple):
    """Vertices once for each smooth face that they belong to, so that creases stay sharp."""

    corner_of: NDArray[np.int32]  # [W], number of the vertex of each corner
    triangles: NDArray[np.int32]  # [T, 3], numbers of corners
    normals: Array  # [W, 3], unit vectors; zero where all triangles are slivers
    creases: NDArray[np.int32]  # [S, 2], corners at the ends of the edges where smooth faces meet


@dataclass(frozen=True, eq=False)
class Workpiece:
    """A closed surface, vertices merged, its triangles counter-clockwise seen from outside."""

    name: str
    vertices_mm: Array  # [V, 3]
    triangles: NDArray[np.int32]  # [T, 3]
    unit: str | None = None  # of the numbers in its file; None for that of the format
    warnings: tuple[str, ...] = ()  # open, inverted or self-intersecting surface
    place: tuple[float, ...] = (0.0,) * 6  # where it is clamped, mm and degrees
    original: "Workpiece | None" = None  # of a refined mesh, in its own frame
    source: NDArray[np.intp] | None = None  # [T], triangles of the original

    @cached_property
    def sizes(self) -> tuple[Array, Array]:
        """Areas of triangles, mm², and their longest edges squared, [T]."""
        parts = range(0, len(self.triangles), TRIANGLES_AT_ONCE)
        rows = (self.triangles[first : first + TRIANGLES_AT_ONCE] for first in parts)
        area, square = zip(
            *(measure_triangles(self.vertices_mm, part) for part in rows), strict=True
        )
        return np.concatenate(area), np.concatenate(square)

    @cached_property
    def shares(self) -> Array:
        """Share of each vertex in the surface area, [V]: a third of that of its triangles."""
        area, share = self.sizes[0], np.zeros(len(self.vertices_mm))
        for corner in self.triangles.T:
            share += np.bincount(corner, area, len(share))
        return share / share.sum()

    @cached_property
    def middle_mm(self) -> Array:
        """Middle of the box around it, [3]."""
        return (self.vertices_mm.min(axis=0) + self.vertices_mm.max(axis=0)) / 2.0

    @cached_property
    def surface(self) -> Any:
        """Mesh of trimesh, with normals and adjacency."""
        from trimesh import Trimesh

        return Trimesh(self.vertices_mm, self.triangles, process=False)

    @cached_property
    def corners(self) -> Corners:
        """Vertices split at creases above `CREASE_DEG`."""
        from trimesh import Trimesh, graph

        surface, vertex = self.surface, self.triangles.reshape(-1)
        faces, ends = surface.face_adjacency, surface.face_adjacency_edges
        # which corner of each of its two triangles is at each end of an edge, [e, 2 ends, 2]
        is_there = self.triangles[faces][:, None] == ends[:, :, None, None]
        corner = 3 * faces[:, None] + is_there.argmax(axis=-1)
        is_sharp = surface.face_adjacency_angles > np.deg2rad(CREASE_DEG)
        joined = corner[~is_sharp].reshape(-1, 2)
        label = graph.connected_component_labels(joined, node_count=len(vertex))
        corner_of = np.empty(label.max() + 1, np.int32)
        corner_of[label] = vertex
        split = Trimesh(self.vertices_mm[corner_of], label.reshape(-1, 3), process=False)
        triangles = label.reshape(-1, 3).astype(np.int32)
        creases = label[corner[is_sharp][..., 0]].astype(np.int32)
        return Corners(corner_of, triangles, split.vertex_normals, creases)


def measure_triangles(vertices_mm: Array, triangles: NDArray[np.int32]) -> tuple[Array, Array]:
    """Compute the areas of triangles, mm², and their longest edges squared, [T]."""
    first, second, third = (np.take(vertices_mm, corner, axis=0) for corner in triangles.T)
    edge, other = second - first, third - second
    pairs = (edge, edge), (other, other), (edge, other)
    a, b, product = (np.einsum("tx,tx->t", *pair) for pair in pairs)
    longest = np.maximum(np.maximum(a, b), a + b + 2.0 * product)
    return np.sqrt(np.maximum(a * b - product * product, 0.0)) / 2.0, longest


def load_workpiece(
    path: str | Path, unit: str | None = None, data: bytes | None = None
) -> Workpiece:
    """Read a mesh from a file, or from its bytes: in mm, .glb in m, unless a unit is given."""
    path = Path(path)
    mesh, warnings = read_mesh(path, unit, max_triangles=MAX_PART_TRIANGLES, data=data)
    part = Workpiece(path.stem, np.asarray(mesh.vertices), mesh.faces.astype(np.int32), unit)
    surface = "its surface passes through itself"
    count = count_crossings(part)
    if count is None:
        checked = f"{path}: not checked whether {surface}"
        warnings += (f"{checked} (too many triangles, in total or in one place)",)
    elif count:
        warnings += (f"{path}: {surface} ({count:,} pairs of triangles); used as is",)
    return replace(part, warnings=warnings)


def count_crossings(part: Workpiece) -> int | None:
    """Count pairs of triangles that intersect along a line, without those that share a vertex.

    None where there are too many to examine.
    """
    triangles = part.triangles
    if len(triangles) > MAX_FEATURE_TRIANGLES:
        return None
    corner, normal = part.vertices_mm[triangles], part.surface.face_normals
    slack = TOUCH_SHARE * np.abs(corner).max()
    low, high = (np.ascontiguousarray(end(corner, axis=1).T) for end in (np.min, np.max))
    groups, crossings, n_pairs = [np.arange(len(triangles))], list[Integers](), 0
    while groups:
        group = groups.pop()
        first, last = low[:, group], high[:, group]  # [3, n]
        if len(group) > GROUP_SIZE:  # split where it saves most pairs
            cut = (first + last).mean(axis=1, keepdims=True) / 2.0
            is_above = last > cut + slack / 2.0
            is_below = (first < cut - slack / 2.0) | ~is_above  # what touches is on one side
            pairs = is_above.sum(axis=1) ** 2 + is_below.sum(axis=1) ** 2
            along = pairs.argmin()
            if pairs[along] < 0.8 * len(group) ** 2:
                groups += [group[is_above[along]], group[is_below[along]]]
                continue
        for rows in np.array_split(np.arange(len(group)), 1 + len(group) ** 2 // PAIRS_AT_ONCE):
            is_near = rows[:, None] > np.arange(len(group))
            for begin, end in zip(first, last, strict=True):
                is_near &= begin[rows, None] + slack < end
                is_near &= begin + slack < end[rows, None]
            row, column = np.nonzero(is_near)
            pair = group[np.stack([rows[row], column])]
            n_pairs += is_near.size + 8 * pair.shape[1]
            for _ in pair:  # each has corners on both sides of the other's plane
                arm = corner[pair[0]] - corner[pair[1], :1]
                away = np.einsum("nex,nx->en", arm, normal[pair[1]])
                is_across = (away.max(axis=0) > slack) & (away.min(axis=0) < -slack)
                pair = pair[::-1, is_across]
            crossings.append(pair[0] * len(triangles) + pair[1])
            n_pairs += 200 * pair.shape[1]
            if n_pairs > MAX_PAIRS:
                return None
    pair = np.stack(np.divmod(np.unique(np.concatenate(crossings)), len(triangles)))
    first, second = triangles[pair]
    pair = pair[:, (first[:, :, None] != second[:, None]).all(axis=(1, 2))]
    line = np.cross(*normal[pair])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    orders = pair, pair[::-1]
    ends = [_line_span(corner[a], corner[b], normal[b], line) for a, b in orders]
    return int(np.sum(np.min(ends, axis=0)[1] - np.max(ends, axis=0)[0] > slack))


def _line_span(corner: Array, other: Array, normal: Array, line: Array) -> tuple[Array, Array]:
    """Compute the ends of triangles along the lines where their planes meet those of others."""
    arm = corner - other[:, :1]
    away, at = (np.einsum("nex,nx->ne", arm, direction) for direction in (normal, line))
    at += np.einsum("nx,nx->n", other[:, 0], line)[:, None]
    ahead, to = np.roll(away, -1, axis=1), np.roll(at, -1, axis=1)
    passes = (away < 0.0) != (ahead < 0.0)  # edges through the plane of the other, two of three
    place = at + (to - at) * away / np.where(passes, away - ahead, 1.0)
    return np.where(passes, place, np.inf).min(axis=1), np.where(passes, place, -np.inf).max(axis=1)


def read_place(text: str, _scene: Scene | None) -> tuple[float, ...]:
    """Parse a place: ``X,Y,Z`` or ``X,Y,Z,A,B,C``."""
    try:
        place = tuple(parse_number(part) for part in text.split(","))
    except ValueError:
        place = ()
    if len(place) not in (3, 6) or not all(abs(number) <= MAX_LENGTH_MM for number in place):
        raise ValueError("expected three numbers in mm, or six with degrees, such as 0,0,50,0,0,90")
    return place


Place: TypeAlias = Annotated[tuple[float, ...] | None, Grammar("X,Y,Z[,A,B,C]", read_place)]
REPORT_PLACE_HELP = (
    "Where parts of inspection reports were clamped, in the workpiece frame, mm and degrees"
)


def place_part(scene: Scene, place: Sequence[float] | None) -> Scene:
    """Return a scene whose part is clamped at a place; the same scene without one."""
    if place is None:
        return scene
    return replace(scene, part=replace(scene.part, place=(*place, 0.0, 0.0, 0.0)[:6]))


@dataclass(frozen=True, kw_only=True)
class WorkpieceAnalysis(Analysis):
    """An analysis of a workpiece where it is clamped."""

    file: File = option(
        None,
        "Mesh, .stl, .obj, .ply, .glb, .3mf or .step",
        positional=True,
        unset="that of the scene",
    )
    place: Place = option(
        None,
        "Where the part is clamped, in the workpiece frame: shift in mm and turns in degrees about"
        " the fixed x, y, z in that order",
        unset="that of the scene, or the middle of the working volume",
    )
    unit: Literal["mm", "cm", "m", "in"] | None = option(
        None, "Unit of the mesh", unset="mm, of .glb m, of .3mf and .step theirs"
    )
    mesh: Workpiece | None = None  # instead of a file

    def load_mesh(self, scene: Scene) -> Workpiece:
        """Read the mesh of the analysis, else that of the scene."""
        if self.mesh is not None:
            return self.mesh
        path = self.file or scene.part.path("file")
        if path is None:
            raise OptionError("{file} is missing; expected a mesh, or a scene whose [part] has one")
        return load_workpiece(path, self.unit or (None if self.file else scene.part.unit or None))


def place_workpiece(
    mesh: Workpiece, scene: Scene, place: Sequence[float] | None = None
) -> Workpiece:
    """Place a workpiece: at a given place, else at that of the scene, else in the middle."""
    at = scene.part.place if place is None else (*place, 0.0, 0.0, 0.0)[:6]
    if at is None:
        stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
        at = (*(relative_point(scene.model, stand) - mesh.middle_mm).tolist(), 0.0, 0.0, 0.0)
    pose = transforms.placed(at[:3], at[3:])
    return replace(mesh, vertices_mm=transforms.apply(pose, mesh.vertices_mm), place=at)


@dataclass(frozen=True, eq=False)
class ActualPoints:
    """Points of the workpiece frame and their errors."""

    point_mm: Array  # [n, 3], nominal, w
    coordinates: dict[str, Array]  # [n] or one for all: axis positions
    error_um: Array  # [n, 3], w, actual − nominal
    outside: NDArray[np.bool_]  # [n], beyond the travel of a linear axis; errors are continued


def evaluate_points(scene: Scene, point_mm: Array) -> ActualPoints:
    """Compute axis positions and errors at points of w, [n, 3], mm."""
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    at, error = follow(scene.model, stand, point_mm), np.empty(point_mm.shape)
    for first in range(0, len(point_mm), POINTS_AT_ONCE):
        rows = slice(first, first + POINTS_AT_ONCE)
        axes = {name: of[rows] if np.ndim(of) else of for name, of in at.items()}
        error[rows] = evaluate(scene, at=axes, loop=Loop.RELATIVE, frame="workpiece").error_um
    outside = ~np.broadcast_to(within_travel(scene.machine, at), len(point_mm))
    return ActualPoints(point_mm, at, error, outside)


def point_basis(
    scene: Scene, made: ActualPoints, keys: Sequence[str] | None = None, rows: Any = slice(None)
) -> ErrorBasis:
    """Compute the response of points to each parameter, [K, n, 3], in w."""
    keys = scene.parameter_keys if keys is None else keys
    at = {name: of[rows] if np.ndim(of) else of for name, of in made.coordinates.items()}
    point = transforms.apply(branch_pose(scene.model, "workpiece", at), made.point_mm[rows])
    view = scene.view(Loop.RELATIVE, "workpiece")
    return build_basis(scene.model, scene.errors, keys, at, view, point)


def point_uncertainty(
    scene: Scene, made: ActualPoints, shares: Array | None = None
) -> FieldUncertainty | None:
    """Return the uncertainty of errors at points; None where the scene states none."""
    uncertainty = scene_uncertainty(scene, Loop.RELATIVE)
    if uncertainty is None:
        return None
    point = transforms.apply(branch_pose(scene.model, "workpiece", made.coordinates), made.point_mm)
    view = scene.view(Loop.RELATIVE, "workpiece")
    basis = uncertainty.respond(scene.model, made.coordinates, view, point)
    return combine(uncertainty, basis.position, made.error_um, shares)


def subtract_best_fit(point_mm: Array, error_um: Array, shares: Array | None = None) -> Array:
    """Subtract from errors, [..., n, 3], µm, the best-fit rigid motion of points, [n, 3].

    `shares`, [n], are the weights of the points, their sum is 1; equal ones by default.
    """
    if shares is None:
        shares = np.full(len(point_mm), 1.0 / len(point_mm))
    arm = point_mm - shares @ point_mm
    weighted = arm * shares[:, None]
    shift = (shares @ error_um)[..., None, :]
    inertia = np.sum(arm * weighted) * np.eye(3) - arm.T @ weighted
    # a cross product of each pair takes five times longer
    product = np.swapaxes(error_um, -1, -2) @ weighted
    moment = (product - np.swapaxes(product, -1, -2))[..., [2, 0, 1], [1, 2, 0]]
    # points on a line leave the rotation about it undetermined: the smallest one is taken
    turn = moment @ np.linalg.pinv(inertia, rcond=1e-12, hermitian=True)
    return error_um - shift + arm @ transforms.skew(turn)
