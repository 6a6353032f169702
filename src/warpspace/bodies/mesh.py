"""A body of a machine as a mesh, and the way trimesh opens files of meshes."""

import io
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError
from warpspace.units import Array

LIGHT, MIDDLE, DARK, METAL = (206, 210, 216), (178, 184, 192), (104, 112, 124), (150, 157, 167)
"""Quiet colours of bodies, since colour means error."""
CREASE_DEG = 30.0
"""Angle from flat above which an edge is drawn."""
LIMIT_MB = 50
"""Size of a file up to which it is read."""


@dataclass(frozen=True, slots=True)
class Body:
    """One body of a machine, in the frame it rides on.

    Attributes
    ----------
    name : str
        What it is, for instance ``X_saddle``.
    frame : str
        Frame it rides on: R, an axis, S, t or w.
    colour : tuple of int, (3,)
        sRGB; greys, since colour means error.
    vertices_mm : ndarray, [V, 3], mm
    triangles : ndarray, [T, 3]
        Counter-clockwise seen from outside.
    edges_mm : ndarray, [E, 2, 3], mm
        Ends of the edges worth drawing.
    """

    name: str
    frame: str
    colour: tuple[int, int, int]
    vertices_mm: Array
    triangles: NDArray[np.int32]
    edges_mm: Array


def build_body(
    mesh: Any, name: str, frame: str, colour: tuple[int, int, int], lines_mm: Array | None = None
) -> Body:
    """Turn a mesh of trimesh, vertices in mm, into a body; its edges are where it bends.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    name, frame : str
    colour : tuple of int, (3,)
    lines_mm : ndarray, [E, 2, 3], mm, optional
        Further edges.

    Returns
    -------
    Body
    """
    edges = crease_edges(mesh)
    return Body(
        name,
        frame,
        colour,
        np.array(mesh.vertices, dtype=float),
        np.array(mesh.faces, dtype=np.int32),
        edges if lines_mm is None else np.concatenate([edges, lines_mm]),
    )


def crease_edges(mesh: Any) -> Array:
    """Find the edges at which a mesh bends sharply.

    Parameters
    ----------
    mesh : trimesh.Trimesh

    Returns
    -------
    ndarray, [E, 2, 3]
        Ends of the edges whose two triangles meet at more than 30° from flat.
    """
    sharp = mesh.face_adjacency_angles > np.deg2rad(CREASE_DEG)
    return np.asarray(mesh.vertices[mesh.face_adjacency_edges[sharp]], dtype=float)


def _check_geometry(scene: Any) -> None:
    """Refuse what trimesh takes as it comes: points in a plane, vertices that are not there."""
    for mesh in scene.geometry.values():
        if np.shape(getattr(mesh, "vertices", ()))[1:] != (3,):
            raise ValueError("it has points without three coordinates")
        faces = np.asarray(getattr(mesh, "faces", ()))
        if faces.size and not (int(faces.min()) >= 0 and int(faces.max()) < len(mesh.vertices)):
            raise ValueError("a triangle names a vertex that is not there")


def open_meshes(path: Path, what: str) -> Any:
    """Open a file of meshes with trimesh; nothing in it is changed or merged.

    Parameters
    ----------
    path : Path
        Its ending tells the format. Files that it refers to (textures, materials) are not opened.
    what : str
        What it should be, for messages.

    Returns
    -------
    trimesh.Scene

    Raises
    ------
    OptionError
        If there is no such file, or it is empty, too large, damaged or of another kind.
    """
    try:
        size = path.stat().st_size
        if size > LIMIT_MB * 1_000_000:
            raise OptionError(
                f"{path}: {size / 1e6:.0f} MB; a {what} may have up to {LIMIT_MB} MB. "
                "Reduce its triangles before"
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise OptionError(f"{path}: there is no such file") from None
    except OSError as error:
        raise OptionError(f"{path}: cannot be read ({error.strerror})") from None
    if not data:
        raise OptionError(f"{path}: the file is empty; expected a {what}")
    import trimesh

    # it logs what it makes of a damaged file, traceback included; the message says it
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        with np.errstate(all="ignore"):
            found = trimesh.load_scene(
                io.BytesIO(data), file_type=path.suffix[1:].lower(), process=False
            )
            _check_geometry(found)
            return found
    except Exception as error:  # noqa: BLE001  # trimesh raises whatever a damaged file leads to
        reason = str(error) or type(error).__name__
        raise OptionError(f"{path}: no {what} that can be read ({reason})") from None
