"""What the links of a robot look like, put together into one mesh for each frame of a machine."""

from pathlib import Path
from typing import Any

import numpy as np

from warpspace.bodies.mesh import LIMIT_MB
from warpspace.units import Array

ENDINGS = (".stl", ".obj", ".ply", ".glb", ".dae")
PARENTS = 3
"""Folders above that of the robot's file in which ``package://`` is looked for."""
MM_PER_M = 1000.0
LARGEST_M = 1e6
"""Of a shape, its place and its scale; also keeps NaN out."""


def frame_meshes(
    robot: Any, frame_of: dict[str, tuple[str, Array]], folder: Path
) -> tuple[dict[str, Any], list[str], list[Path]]:
    """Put the visual shapes of links together.

    Parameters
    ----------
    robot : yourdfpy.urdf.Robot
    frame_of : dict of str to (str, ndarray)
        By link: the frame it rides on, and its pose in it, [4, 4], mm.
    folder : Path
        That of the robot's file.

    Returns
    -------
    meshes : dict of str to trimesh.Trimesh
        By frame, vertices in mm in that frame.
    notes : list of str
        Shapes that cannot be read.
    files : list of Path
        What was read.
    """
    from trimesh import util

    parts: dict[str, list[Any]] = {}
    notes: list[str] = []
    files: list[Path] = []
    for link in robot.links:
        if link.name not in frame_of:
            continue
        frame, pose = frame_of[link.name]
        for visual in link.visuals:
            where = f"link {link.name!r}"
            placed = np.eye(4) if visual.origin is None else np.array(visual.origin, dtype=float)
            if not (np.abs(placed) < LARGEST_M).all():
                notes.append(f"{where}: the place of its shape is no finite number; left out")
                continue
            mesh = _shape(visual.geometry, where, folder, notes, files)
            if mesh is None:
                continue
            mesh.apply_transform(placed)
            mesh.apply_scale(MM_PER_M)
            mesh.apply_transform(pose)
            if not np.isfinite(mesh.vertices).all():
                notes.append(f"{where}: its shape holds numbers that are not finite; left out")
                continue
            parts.setdefault(frame, []).append(mesh)
    return {frame: util.concatenate(own) for frame, own in parts.items()}, notes, files


def _shape(geometry: Any, where: str, folder: Path, notes: list[str], files: list[Path]) -> Any:
    """Build one shape, metres; None where it cannot be, which is noted."""
    from trimesh import creation

    if geometry is None:
        return None
    if geometry.box is not None:
        sizes = _sizes(geometry.box.size, 3, f"{where}: its box", notes)
        return None if sizes is None else creation.box(extents=sizes)
    if geometry.cylinder is not None:
        given = (geometry.cylinder.radius, geometry.cylinder.length)
        sizes = _sizes(given, 2, f"{where}: its cylinder", notes)
        if sizes is None:
            return None
        return creation.cylinder(radius=sizes[0], height=sizes[1], sections=48)
    if geometry.sphere is not None:
        sizes = _sizes([geometry.sphere.radius], 1, f"{where}: its sphere", notes)
        return None if sizes is None else creation.icosphere(subdivisions=2, radius=sizes[0])
    if geometry.mesh is None:
        return None
    return _mesh(geometry.mesh, where, folder, notes, files)


def _sizes(given: Any, count: int, what: str, notes: list[str]) -> Array | None:
    """Read the sizes of a shape, [count], metres; None where they are none, which is noted."""
    try:
        sizes = np.abs(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        sizes = np.empty(0)
    if sizes.shape == (count,) and (sizes < LARGEST_M).all():
        return sizes
    notes.append(f"{what} has no size that can be read; left out")
    return None


def _mesh(given: Any, where: str, folder: Path, notes: list[str], files: list[Path]) -> Any:
    """Read one mesh file, metres."""
    import trimesh

    name = str(given.filename or "")
    path = _find(name, folder)
    if path is None:
        notes.append(f"{where}: mesh {name!r} is missing; left out")
        return None
    if path.suffix.lower() not in ENDINGS:
        notes.append(f"{where}: mesh {name!r}; expected one of {', '.join(ENDINGS)}; left out")
        return None
    if path.stat().st_size > LIMIT_MB * 1_000_000:
        notes.append(f"{where}: mesh {name!r} is larger than {LIMIT_MB} MB; left out")
        return None
    try:
        mesh = trimesh.load(path, force="mesh", skip_materials=True)
    except Exception as error:  # noqa: BLE001 - every format fails in ways of its own
        reason = str(error).replace("\n", " ")[:100]
        notes.append(f"{where}: mesh {name!r} cannot be read ({reason}); left out")
        return None
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        notes.append(f"{where}: mesh {name!r} is empty; left out")
        return None
    files.append(path)
    bare = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
    if given.scale is not None:
        scale = np.asarray(given.scale, dtype=float)
        if scale.shape not in ((), (1,), (3,)) or not (np.abs(scale) < LARGEST_M).all():
            notes.append(f"{where}: mesh {name!r} has no scale that can be read; left out")
            return None
        bare.apply_transform(np.diag([*np.broadcast_to(scale, 3), 1.0]))
    return bare


def _find(name: str, folder: Path) -> Path | None:
    """Find the file that a robot names: beside its own, or in its package."""
    bare = name.removeprefix("file://")
    places = [folder / bare]
    if name.startswith("package://"):
        inside = name.removeprefix("package://")
        package, _, rest = inside.partition("/")
        roots = [folder, *list(folder.resolve().parents)[:PARENTS]]
        places = [root / part for root in roots for part in (inside, rest)]
        places += [root / rest for root in roots if root.name == package]
    for place in places:
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):
            continue
    return None
