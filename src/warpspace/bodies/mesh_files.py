"""Mesh files of users: bodies of machines, and links of robots."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.bodies.mesh import MIDDLE, Body, build_body, open_meshes
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.kinematics.transforms import apply, placed
from warpspace.machine.definition import BodySource, Machine
from warpspace.machine.limits import MAX_FEATURE_TRIANGLES, MAX_TRIANGLES, MAX_URDF_TRIANGLES
from warpspace.units import Array

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of length of meshes, mm."""
FORMATS = {".stl": ("mm", "z"), ".obj": ("mm", "z"), ".ply": ("mm", "z"), ".glb": ("m", "y")}
"""Endings with their default unit and upward axis."""
IMPORTED = FORMATS | {".3mf": ("mm", "z"), ".step": ("m", "z"), ".stp": ("m", "z")}
"""Endings that are read; files that are not written state their unit."""
FARTHEST = 1e9  # largest coordinate of a vertex, in the unit of the file
UNITS_3MF_MM = {
    "micron": 1e-3,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "meter": 1000.0,
    "inch": 25.4,
    "foot": 304.8,
}
SMALL_MM, LARGE_MM = 10.0, 100_000.0
"""Longest edges beyond suggest another unit."""
MAX_SHELL_PAIRS = 20_000_000  # of a shell and a cavity that are examined


def load_mesh(path: str | Path, frame: str, unit: str | None = None) -> Body:
    """Read a body from a mesh file; it can be drawn despite warnings."""
    path = Path(path)
    mesh, warnings = read_mesh(path, unit)
    mesh.update_faces(mesh.nondegenerate_faces())
    if not len(mesh.faces):
        raise OptionError(f"{path}: all of its triangles are points or lines")
    return replace(build_body(mesh, path.stem, frame, MIDDLE), warnings=warnings)


def read_mesh(
    path: Path, unit: str | None, max_triangles: int = MAX_TRIANGLES, data: bytes | None = None
) -> tuple[Any, tuple[str, ...]]:
    """Read a file as one mesh of trimesh, in mm with z upwards, and its warnings.

    Vertices are merged, degenerate triangles removed, closed surfaces face outwards.
    """
    from trimesh import graph, grouping

    ending = path.suffix.lower()
    if ending not in IMPORTED:
        raise OptionError(f"{path}: unknown ending; expected one of {', '.join(IMPORTED)}")
    if unit and ending not in FORMATS:
        raise OptionError(f"{path}: unit {unit!r}; expected none, the file states it")
    has_unit, (standard, up) = unit is not None or ending not in FORMATS, IMPORTED[ending]
    unit = unit or standard
    if unit not in UNITS_MM:
        raise OptionError(f"{path}: {unit!r}; expected one of {', '.join(UNITS_MM)}")
    scene = open_meshes(path, f"{path.suffix[1:].upper()} file", max_triangles, data)
    nodes, notes = scene.graph.nodes_geometry, scene.metadata["notes"]
    mm_per_unit = UNITS_MM[unit]
    if ending == ".3mf":
        name = str(scene.metadata["units"]).removesuffix("s")
        if name not in UNITS_3MF_MM:
            raise OptionError(f"{path}: unit {name!r}; expected one of {', '.join(UNITS_3MF_MM)}")
        mm_per_unit = UNITS_3MF_MM[name]
    pose, name = scene.graph[nodes[0]] if len(nodes) == 1 else (None, None)
    is_one = hasattr(scene.geometry.get(name), "faces")  # a large one is not copied
    with np.errstate(all="ignore"):
        mesh = scene.geometry[name].apply_transform(pose) if is_one else scene.to_mesh()
    if not np.isfinite(mesh.vertices).all():
        raise OptionError(f"{path}: a vertex is not finite")
    farthest = float(np.abs(mesh.vertices).max(initial=0.0))
    if farthest > FARTHEST:
        raise OptionError(f"{path}: a vertex is at {farthest:.3g}; expected at most {FARTHEST:g}")
    is_closed = len(mesh.vertices) <= len(mesh.faces) and _is_closed(mesh.faces)
    if not is_closed:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    corner = mesh.faces.reshape(-1, 3).T
    mesh.update_faces(np.all([corner[at] != corner[at - 1] for at in range(3)], axis=0))
    if not len(mesh.faces):
        raise OptionError(f"{path}: there are no triangles in it")
    mesh.apply_scale(mm_per_unit)
    if up == "y":
        mesh.apply_transform([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    longest = float(np.ptp(mesh.vertices, axis=0).max())
    if not (has_unit or SMALL_MM <= longest <= LARGE_MM):
        is_usual = longest < 1.0 if unit == "mm" else longest > LARGE_MM
        other = {"mm": "m", "m": "mm"}[unit] if is_usual else "another unit"
        raise OptionError(
            f"{path}: in {unit}, its longest edge is {longest:.4g} mm. It is probably in"
            f" {other}; give its unit ({', '.join(UNITS_MM)})"
        )
    if not (is_closed or _is_closed(mesh.faces)):
        warning = f"{path}: the surface is not closed, or its triangles do not agree on the outside"
        count = len(grouping.group_rows(mesh.edges_sorted, require_count=1))
        return mesh, (*notes, f"{warning} ({count:,} open edges); used as is")
    x, y, z = np.ascontiguousarray((mesh.vertices - mesh.vertices[0]).T)
    a, b, c = mesh.faces.T
    across = (y[b] - y[a]) * (z[c] - z[a]) - (z[b] - z[a]) * (y[c] - y[a])
    across *= x[a] + x[b] + x[c]  # six times the volume
    if across.sum() < 0.0:
        mesh.invert()
        return mesh, (*notes, f"{path}: its triangles faced inwards and were inverted")
    if len(mesh.faces) > MAX_FEATURE_TRIANGLES:
        return mesh, (*notes,)
    shell = graph.connected_component_labels(mesh.edges, node_count=len(x))
    volume, low, high = np.bincount(shell[a], across), *np.full((2, shell.max() + 1, 3), np.inf)
    np.minimum.at(low, shell, mesh.vertices)
    np.minimum.at(high, shell, -mesh.vertices)
    cavities, n_pairs = np.flatnonzero(volume < 0.0), 0
    for outer in np.argsort(-volume)[: int(np.sum(volume > 0.0))]:  # a cavity is within another one
        is_within = (low[outer] <= low[cavities]) & (high[outer] <= high[cavities])
        is_inside = is_within.all(axis=1) & (volume[outer] > -volume[cavities])
        n_pairs += len(cavities)
        cavities = cavities[~is_inside]
        if not len(cavities) or n_pairs > MAX_SHELL_PAIRS:
            break
    if len(cavities) and n_pairs > MAX_SHELL_PAIRS:
        return mesh, (*notes, f"{path}: not checked whether shells face inwards (too many shells)")
    if len(cavities):
        return mesh, (*notes, f"{path}: some of its shells face inwards; used as is")
    return mesh, (*notes,)


def _is_closed(faces: NDArray[np.int64]) -> bool:
    """Check that each edge occurs equally often in both directions."""
    random = np.random.default_rng(0)
    weights = random.integers(2**64, size=(2, faces.max(initial=0) + 1), dtype=np.uint64)
    begin, end = ([weight[corner] for corner in faces.T] for weight in weights)
    # a random number per direction; only opposite ones cancel
    sums = [int(np.sum(begin[at] * end[at - 1] - end[at] * begin[at - 1])) for at in range(3)]
    return sum(sums) % 2**64 == 0


def machine_meshes(machine: Machine) -> dict[str, Body]:
    return {
        frame: _read(frame, source)
        for frame, source in machine.bodies.items()
        if source.file and source.path
    }


@lru_cache(maxsize=64)
def _read(frame: str, source: BodySource) -> Body:
    try:
        body = load_mesh(source.path, frame, source.unit or None)
    except OptionError as error:
        raise OptionError(f"bodies.{frame}: {error}") from None
    pose = placed(source.offset_mm, source.rotation_deg)
    name = body.name if body.name.startswith(f"{frame}_") else f"{frame}_{body.name}"
    return replace(
        body,
        name=name,
        vertices_mm=np.ascontiguousarray(apply(pose, body.vertices_mm)),
        edges_mm=np.ascontiguousarray(apply(pose, body.edges_mm)),
        warnings=tuple(f"bodies.{frame}: {warning}" for warning in body.warnings),
    )


def check_meshes(machine: Machine) -> tuple[str, ...]:
    return tuple(text for body in machine_meshes(machine).values() for text in body.warnings)


MM_PER_M = 1000.0
LARGEST_M = 1e6  # of a shape, its place and its scale; also keeps NaN out


def frame_meshes(
    robot: Any, frame_of: dict[str, tuple[str, Array]], folder: Path, root: Path | None = None
) -> tuple[dict[str, Any], list[str], list[Path]]:
    from trimesh import util

    parts: dict[str, list[Any]] = {}
    notes: list[str] = []
    meshes: dict[Path, Any] = {}
    triangles = 0
    for link in robot.links:
        if link.name not in frame_of:
            continue
        frame, pose = frame_of[link.name]
        for visual in link.visuals:
            try:
                mesh = _shape(visual, pose, (folder, root or folder), meshes)
            except WarpspaceError as error:
                notes.append(f"link {link.name!r}: {error}")
                continue
            if mesh is None:
                continue
            triangles += len(mesh.faces)
            if triangles > MAX_URDF_TRIANGLES:
                raise OptionError(
                    f"{folder}: the shapes of the robot have more than {MAX_URDF_TRIANGLES:,}"
                    " triangles, the most expected"
                )
            parts.setdefault(frame, []).append(mesh)
    for mesh in meshes.values():
        notes += [] if isinstance(mesh, str) else mesh.metadata["notes"]
    return {frame: util.concatenate(own) for frame, own in parts.items()}, notes, list(meshes)


def _shape(visual: Any, pose: Array, folders: tuple[Path, Path], meshes: dict[Path, Any]) -> Any:
    from trimesh import creation

    placed = np.eye(4) if visual.origin is None else np.array(visual.origin, dtype=float)
    if not (np.abs(placed) < LARGEST_M).all():
        raise WarpspaceError("the place of its shape is no finite number; left out")
    geometry = visual.geometry
    if geometry is None:
        return None
    if geometry.box is not None:
        mesh = creation.box(extents=_sizes(geometry.box.size, 3, "box"))
    elif geometry.cylinder is not None:
        dimensions = (geometry.cylinder.radius, geometry.cylinder.length)
        radius, height = _sizes(dimensions, 2, "cylinder")
        mesh = creation.cylinder(radius=radius, height=height, sections=48)
    elif geometry.sphere is not None:
        (radius,) = _sizes([geometry.sphere.radius], 1, "sphere")
        mesh = creation.icosphere(subdivisions=2, radius=radius)
    elif geometry.mesh is not None:
        mesh = _mesh(geometry.mesh, folders, meshes)
    else:
        return None
    mesh.apply_transform(placed)
    mesh.apply_scale(MM_PER_M)
    mesh.apply_transform(pose)
    return mesh


def _sizes(dimensions: Any, count: int, what: str) -> Array:
    try:
        sizes = np.abs(np.asarray(dimensions, dtype=float))
    except (TypeError, ValueError):
        sizes = np.empty(0)
    if sizes.shape != (count,) or not (sizes < LARGEST_M).all():
        raise WarpspaceError(f"its {what} has no size that can be read; left out")
    return sizes


def _mesh(geometry: Any, folders: tuple[Path, Path], meshes: dict[Path, Any]) -> Any:
    import trimesh

    name = str(geometry.filename or "")
    path = _find(name, *folders)
    if path is None:
        raise WarpspaceError(f"mesh {name!r} is missing; left out")
    if not path.resolve().is_relative_to(folders[1].resolve()):
        raise WarpspaceError(
            f"mesh {name!r} leads out of {folders[1]}; left out (--mesh-root FOLDER)"
        )
    if path not in meshes:
        try:
            scene = open_meshes(path, "mesh")
            with np.errstate(all="ignore"):
                loaded = scene.to_mesh()
            loaded.metadata["notes"] = scene.metadata["notes"]
            meshes[path] = loaded if len(loaded.faces) else "it is empty"
            if not np.isfinite(loaded.vertices).all():
                meshes[path] = "a vertex is not finite"
        except OptionError as error:
            meshes[path] = str(error)
    mesh = meshes[path]
    if isinstance(mesh, str):
        raise WarpspaceError(f"mesh {name!r}: {mesh}; left out")
    bare = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
    if geometry.scale is not None:
        scale = np.asarray(geometry.scale, dtype=float)
        if scale.shape not in ((), (1,), (3,)) or not (np.abs(scale) < LARGEST_M).all():
            raise WarpspaceError(f"mesh {name!r} has no scale that can be read; left out")
        bare.apply_transform(np.diag([*np.broadcast_to(scale, 3), 1.0]))
    return bare


def _find(name: str, folder: Path, root: Path) -> Path | None:
    places = [folder / name.removeprefix("file://")]
    if name.startswith("package://"):
        inside = name.removeprefix("package://")
        in_package = inside.partition("/")[2]
        above = [part for part in folder.resolve().parents if part.is_relative_to(root.resolve())]
        places = [place / part for place in (folder, *above, root) for part in (inside, in_package)]
    for place in places:
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):
            continue
    return None
