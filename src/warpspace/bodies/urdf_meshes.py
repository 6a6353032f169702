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
            mesh = _shape(visual.geometry, where, folder, notes, files)
            if mesh is None:
                continue
            placed = np.eye(4) if visual.origin is None else np.array(visual.origin, dtype=float)
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
        return creation.box(extents=np.abs(np.asarray(geometry.box.size, dtype=float)))
    if geometry.cylinder is not None:
        return creation.cylinder(
            radius=abs(geometry.cylinder.radius), height=abs(geometry.cylinder.length), sections=48
        )
    if geometry.sphere is not None:
        return creation.icosphere(subdivisions=2, radius=abs(geometry.sphere.radius))
    if geometry.mesh is None:
        return None
    return _mesh(geometry.mesh, where, folder, notes, files)


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
        bare.apply_transform(np.diag([*np.broadcast_to(given.scale, 3), 1.0]))
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
