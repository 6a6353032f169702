"""A part as the machine makes it: a mesh in the workpiece frame, moved by the relative error.

The error of a point is that of the tool against the workpiece, in the workpiece frame w, where the
linear axes bring the tool to the point and the rotary axes stand as they do in the scene. The part
as cut is the nominal one plus that error. Geometry only: no forces, heat, wear or servo.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.options import Grammar
from warpspace.bench.placing import ball_point, follow, within_travel
from warpspace.bodies.mesh import CREASE_DEG, OF_PART, open_meshes, parse_meshes
from warpspace.bodies.own_meshes import check_format, join_meshes
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import ErrorBasis, build_basis
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.limits import MAX_LENGTH_MM
from warpspace.scene.files import parse_number
from warpspace.scene.model import Scene, evaluate
from warpspace.units import Array

POINTS_AT_ONCE, TRIANGLES_AT_ONCE = 50_000, 200_000  # what lies between needs memory, too


class Corners(NamedTuple):
    """Vertices once for each smooth face that they belong to, so that creases stay sharp."""

    corner_of: NDArray[np.int32]  # [W], number of the vertex of each corner
    triangles: NDArray[np.int32]  # [T, 3], numbers of corners
    normals: Array  # [W, 3], unit vectors; zero where all triangles are slivers
    creases: NDArray[np.int32]  # [S, 2], corners at the ends of the edges where smooth faces meet


@dataclass(frozen=True, eq=False)
class PartMesh:
    """A closed surface, vertices merged, its triangles counter-clockwise seen from outside."""

    name: str
    vertices_mm: Array  # [V, 3]
    triangles: NDArray[np.int32]  # [T, 3]
    warnings: tuple[str, ...] = ()  # open, inverted, crooked: shown and said

    def pieces(self) -> "Iterator[PartMesh]":
        """Give some triangles at a time: what is computed of them needs memory, too."""
        for first in range(0, len(self.triangles), TRIANGLES_AT_ONCE):
            some = self.triangles[first : first + TRIANGLES_AT_ONCE]
            yield PartMesh(self.name, self.vertices_mm, some)

    @cached_property
    def areas_mm2(self) -> Array:
        """Area times unit normal of the triangles, [T, 3], outwards."""
        first, second, third = (
            np.take(self.vertices_mm, self.triangles[:, at], axis=0) for at in range(3)
        )
        return np.cross(second - first, third - first) / 2.0

    @cached_property
    def normals(self) -> Array:
        """Unit normals of the triangles, [T, 3], outwards; zero for slivers without area."""
        length = np.linalg.norm(self.areas_mm2, axis=1, keepdims=True)
        return self.areas_mm2 / np.where(length > 0.0, length, 1.0)

    @cached_property
    def neighbours(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Edges where two triangles meet, [e] each: 3 × triangle + corner they begin at."""
        edge = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], -1).reshape(-1, 2)
        low, high = edge.min(axis=1).astype(np.int64), edge.max(axis=1)
        order = np.argsort(low * len(self.vertices_mm) + high, kind="stable")
        one, other = order[:-1], order[1:]
        is_same = (low[one] == low[other]) & (high[one] == high[other])
        return one[is_same], other[is_same]

    @cached_property
    def corners(self) -> Corners:
        """Vertices split at creases above `CREASE_DEG`."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        count = len(self.triangles)
        one, other = self.neighbours
        cosine = np.sum(self.normals[one // 3] * self.normals[other // 3], axis=1)
        joined = cosine > np.cos(np.deg2rad(CREASE_DEG))
        sharp, one, other = one[~joined], one[joined], other[joined]
        # an edge begins at its corner of the triangle and ends at the following one
        begin, end = other, other // 3 * 3 + (other % 3 + 1) % 3
        turned = self.triangles.reshape(-1)[one] != self.triangles.reshape(-1)[other]
        rows = np.concatenate([one, one // 3 * 3 + (one % 3 + 1) % 3])
        columns = [np.where(turned, end, begin), np.where(turned, begin, end)]
        columns = np.concatenate(columns)
        links = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(3 * count, 3 * count))
        found, label = connected_components(links, directed=False)
        vertex = np.empty(found, dtype=np.int32)
        vertex[label] = self.triangles.reshape(-1)
        area = np.repeat(self.areas_mm2, 3, axis=0)
        normals = np.stack([np.bincount(label, area[:, at], found) for at in range(3)], -1)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return Corners(
            vertex,
            label.reshape(-1, 3).astype(np.int32),
            normals / np.where(length > 0.0, length, 1.0),
            label[np.stack([sharp, sharp // 3 * 3 + (sharp % 3 + 1) % 3], -1)].astype(np.int32),
        )


def load_part(path: str | Path, unit: str | None = None) -> PartMesh:
    """Read a mesh from a file: .stl, .obj, .ply in mm, .glb in m unless a unit is given."""
    path = Path(path)
    found = open_meshes(path, check_format(path, unit), OF_PART)
    return _build(join_meshes(found, path, unit), path)


def parse_part(data: bytes, name: str, unit: str | None = None) -> PartMesh:
    """Read a mesh from the bytes of a file of this name."""
    path = Path(name)
    found = parse_meshes(data, path, check_format(path, unit), OF_PART)
    return _build(join_meshes(found, path, unit), path)


def _build(mesh: Any, path: Path) -> PartMesh:
    vertices, triangles = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int32)
    if len(vertices) > len(triangles) or len(loose := _loose_edges(triangles)):
        vertices, numbers = _merge(vertices)
        triangles = numbers[triangles]
        loose = _loose_edges(triangles)
    is_flat = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if is_flat.all():
        raise OptionError(f"{path}: all of its triangles are points or lines")
    if is_flat.any():
        triangles = triangles[~is_flat]
    part = PartMesh(path.stem, vertices, triangles)
    if len(loose):
        said = (
            f"{path}: the surface is not closed, or its triangles do not agree on the outside"
            f" ({len(loose):,} edges); it is taken as it is"
        )
        return replace(part, warnings=(said,))
    volume = 0.0
    for some in part.pieces():
        lever = np.take(vertices, some.triangles[:, 0], axis=0) - vertices[0]
        volume += float(np.einsum("ij,ij", lever, some.areas_mm2))
    if volume >= 0.0:
        return part
    said = f"{path}: its triangles face inwards; they are turned outwards"
    return PartMesh(path.stem, vertices, triangles[:, ::-1].copy(), (said,))


def _loose_edges(triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """List edges that are not passed as often in one direction as in the other."""
    end = np.roll(triangles, 1, axis=1)
    edge = np.minimum(triangles, end) * (np.int64(triangles.max()) + 1)
    edge += np.maximum(triangles, end)
    mixed = edge.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    if mixed[triangles < end].sum() == mixed[triangles > end].sum():  # sums of hashes
        return edge[:0, 0]
    found, numbers = np.unique(edge, return_inverse=True)
    balance = np.bincount(numbers.reshape(-1), np.sign(end - triangles).reshape(-1))
    return found[balance != 0.0]


def _merge(vertices: Array) -> tuple[Array, NDArray[np.int32]]:
    """Give each place once, and its number for each vertex."""
    order = np.lexsort(vertices.T)
    is_first = np.append(True, np.diff(vertices[order], axis=0).any(axis=1))
    numbers = np.empty(len(order), np.int32)
    numbers[order] = np.cumsum(is_first) - 1
    return vertices[order[is_first]], numbers


PLACE_HELP = (
    "Where the part is clamped, in the workpiece frame: shift in mm and turns in degrees about the"
    " fixed x, y, z in that order"
)
PLACE_UNSET = "that of the scene, or the middle of the working volume"


def read_place(text: str, _scene: Scene | None) -> tuple[float, ...]:
    """Read a place as it is typed: ``X,Y,Z`` or ``X,Y,Z,A,B,C``."""
    try:
        found = tuple(parse_number(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) not in (3, 6) or not all(abs(value) <= MAX_LENGTH_MM for value in found):
        raise ValueError("expected three numbers in mm, or six with degrees, such as 0,0,50,0,0,90")
    return found


Place: TypeAlias = Annotated[tuple[float, ...] | None, Grammar("X,Y,Z[,A,B,C]", read_place)]


def find_place(mesh: PartMesh, scene: Scene, place: Sequence[float] | None) -> tuple[float, ...]:
    """Give all six numbers of a place, mm and degrees; see `place_part`."""
    place = scene.part.place if place is None else place
    if place is not None:
        return (*place, 0.0, 0.0, 0.0)[:6]
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    box = (mesh.vertices_mm.min(axis=0) + mesh.vertices_mm.max(axis=0)) / 2.0
    return (*(ball_point(scene.model, stand) - box).tolist(), 0.0, 0.0, 0.0)


def place_part(mesh: PartMesh, scene: Scene, place: Sequence[float] | None) -> PartMesh:
    """Put a part into the workpiece frame.

    Parameters
    ----------
    mesh : PartMesh
    scene : Scene
    place : sequence of float, (3,) or (6,), or None
        Shift in mm and turns in degrees about the fixed x, y, z in that order; None puts it
        where the scene says, or the middle of its box into the middle of the working volume.
    """
    at = find_place(mesh, scene, place)
    pose = transforms.placed(at[:3], at[3:])
    return replace(mesh, vertices_mm=transforms.apply(pose, mesh.vertices_mm))


@dataclass(frozen=True, eq=False)
class Made:
    """Points of the workpiece frame as the machine makes them."""

    point_mm: Array  # [n, 3], nominal, w
    coordinates: dict[str, Array]  # [n] or one for all: where the axes stand
    error_um: Array  # [n, 3], w, actual − nominal
    outside: NDArray[np.bool_]  # [n], beyond the travel of a linear axis; errors are continued


def make_points(scene: Scene, point_mm: Array) -> Made:
    """Find where the axes stand at points of w, [n, 3], mm, and what error they have there."""
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    coordinates: dict[str, list[Array]] = {name: [] for name in scene.machine.axes}
    error, inside = list[Array](), list[NDArray[np.bool_]]()
    for some in np.array_split(point_mm, -(-len(point_mm) // POINTS_AT_ONCE) or 1):
        here = follow(scene.model, stand, some)
        error.append(evaluate(scene, at=here, loop=Loop.RELATIVE, frame="workpiece").error_um)
        inside.append(np.broadcast_to(within_travel(scene.machine, here), len(some)))
        for name, at in coordinates.items():
            at.append(here[name])
    joined = {name: np.concatenate(at) if at[0].ndim else at[0] for name, at in coordinates.items()}
    return Made(point_mm, joined, np.concatenate(error), ~np.concatenate(inside))


def point_basis(
    scene: Scene, made: Made, keys: Sequence[str] | None = None, rows: Any = slice(None)
) -> ErrorBasis:
    """Give the response of points to each parameter, [K, n, 3], in w: what a slider moves."""
    keys = scene.parameter_keys if keys is None else keys
    at = {name: of[rows] if np.ndim(of) else of for name, of in made.coordinates.items()}
    point = transforms.apply(branch_pose(scene.model, "workpiece", at), made.point_mm[rows])
    view = scene.view(Loop.RELATIVE, "workpiece")
    return build_basis(scene.model, scene.errors, keys, at, view, point)


def fit_out(point_mm: Array, error_um: Array) -> Array:
    """Give errors, [..., n, 3], µm, less the rigid motion of the points, [n, 3], that fits best."""
    arm = point_mm - point_mm.mean(axis=0)
    shift = error_um.mean(axis=-2, keepdims=True)
    inertia = np.sum(arm * arm) * np.eye(3) - arm.T @ arm
    moment = np.cross(arm, error_um).sum(axis=-2)
    # points on a line do not tell the turn about it: the smallest one counts
    turn = moment @ np.linalg.pinv(inertia, rcond=1e-12, hermitian=True)
    return error_um - shift - np.cross(turn[..., None, :], arm)


@dataclass(frozen=True)
class Deviation:
    """How long errors are, each point counting once."""

    mean_um: float
    rms_um: float
    p95_um: float
    max_um: float
    max_at_mm: tuple[float, float, float]  # nominal, w


def deviation_of(point_mm: Array, error_um: Array) -> Deviation:
    length = np.sqrt(np.einsum("ij,ij->i", error_um, error_um))
    worst = int(np.argmax(length))
    x, y, z = point_mm[worst].tolist()
    return Deviation(
        mean_um=float(length.mean()),
        rms_um=float(np.sqrt(np.mean(length * length))),
        p95_um=float(np.percentile(length, 95.0)),
        max_um=float(length[worst]),
        max_at_mm=(x, y, z),
    )
