"""A user's own mesh as a body of a machine: STL, OBJ, PLY or GLB."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.bodies.mesh import MIDDLE, Body, build_body, open_meshes
from warpspace.exceptions import OptionError

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of length a mesh may be in, in mm."""
UP_AXES = ("y", "z")
FORMATS = {".stl": ("mm", "z"), ".obj": ("mm", "z"), ".ply": ("mm", "z"), ".glb": ("m", "y")}
"""Endings that are read, with the unit and the upward axis taken where none is given."""
SMALL_MM, LARGE_MM = 10.0, 100_000.0
"""A body whose longest edge lies beyond is probably in another unit."""


@dataclass(frozen=True, slots=True)
class LoadedMesh:
    """A body read from a user's file.

    Attributes
    ----------
    body : Body
    warnings : tuple of str
        What the user should know; the body can be drawn all the same.
    """

    body: Body
    warnings: tuple[str, ...] = ()


def load_mesh(
    path: str | Path,
    frame: str,
    *,
    unit: str | None = None,
    up: str | None = None,
    colour: tuple[int, int, int] = MIDDLE,
) -> LoadedMesh:
    """Read a user's mesh as a body.

    Parameters
    ----------
    path : str or Path
        All meshes of the file become one body, named after the file.
    frame : str
        Frame it rides on and is described in: R, an axis, S, t or w.
    unit : str, optional
        "mm", "cm", "m" or "in". By default mm, but metres for GLB as glTF prescribes.
    up : str, optional
        "z", or "y" for a file whose y axis becomes the z axis of the frame. By default z, but y for
        GLB as glTF prescribes.
    colour : tuple of int, (3,), optional
        sRGB. Colours of the file are not taken: colour means error.

    Returns
    -------
    LoadedMesh

    Raises
    ------
    OptionError
        If the file is missing, empty, damaged, too large, of another kind or without triangles, if
        a vertex is not finite, if the size suggests another unit and none is given, or if `unit`
        or `up` is none of those known.
    """
    path = Path(path)
    standard = FORMATS.get(path.suffix.lower())
    if standard is None:
        raise OptionError(f"{path}: unknown ending; expected one of {', '.join(FORMATS)}")
    for given, known in ((unit, tuple(UNITS_MM)), (up, UP_AXES)):
        if given is not None and given not in known:
            raise OptionError(f"{path}: {given!r}; expected one of {', '.join(known)}")
    try:
        changed = path.stat().st_mtime_ns
    except OSError:
        changed = 0
    return _read(path, changed, frame, unit, up, colour)


@lru_cache(maxsize=16)
def _read(
    path: Path,
    changed: int,  # noqa: ARG001  # a file written anew is read anew
    frame: str,
    unit: str | None,
    up: str | None,
    colour: tuple[int, int, int],
) -> LoadedMesh:
    """Read a file whose options have been checked."""
    standard_unit, standard_up = FORMATS[path.suffix.lower()]
    mesh = open_meshes(path, f"{path.suffix[1:].upper()} file").to_mesh()
    if not len(mesh.faces):
        raise OptionError(f"{path}: there are no triangles in it")
    if not np.isfinite(mesh.vertices[mesh.faces]).all():
        raise OptionError(f"{path}: a vertex is not finite")
    mesh.apply_scale(UNITS_MM[unit or standard_unit])
    if (up or standard_up) == "y":
        mesh.apply_transform([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    if unit is None:
        _check_size(path, float(np.ptp(mesh.vertices, axis=0).max()), standard_unit)
    mesh.update_faces(mesh.nondegenerate_faces())
    if not len(mesh.faces):
        raise OptionError(f"{path}: all of its triangles are points or lines")
    with np.errstate(all="ignore"):  # a flat surface has no volume, and no centre of it
        open_edges = _clean(mesh)
        body = build_body(mesh, path.stem, frame, colour)
    if not open_edges:
        return LoadedMesh(body)
    warning = f"{path}: the surface is not closed ({open_edges} open edges); it is drawn as it is"
    return LoadedMesh(body, (warning,))


def _check_size(path: Path, longest_mm: float, unit: str) -> None:
    """Stop at a size that suggests that the file is in another unit than its format's."""
    for far, other in (
        (longest_mm < SMALL_MM, "m" if unit == "mm" else "another unit"),
        (longest_mm > LARGE_MM, "mm" if unit == "m" else "another unit"),
    ):
        if far:
            raise OptionError(
                f"{path}: taken as {unit}, its longest edge is {longest_mm:.4g} mm. It is probably "
                f"in {other}; give its unit ({', '.join(UNITS_MM)})"
            )


def _clean(mesh: Any) -> int:
    """Join vertices where triangles do not share any, turn the outside out, count open edges."""
    from trimesh.grouping import group_rows

    if not mesh.is_watertight:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if mesh.is_watertight:
        if mesh.volume < 0.0:
            mesh.invert()
        return 0
    joined = len(group_rows(mesh.edges_sorted, require_count=2))
    return len(mesh.edges_unique) - joined
