"""The file of schematic bodies beside a machine: `bodies.glb`.

A mesh is named after the frame it rides on and what it is: ``X_saddle``. Vertices are mm in that
frame, Z up. Edges are found where the surface bends; further lines of a body, for instance the
slots of a table, are a mesh of its name and " lines", every two points a piece (trimesh does not
read which points a line joins).
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warpspace.bodies.gltf import Material, Part, build_gltf
from warpspace.bodies.mesh import MIDDLE, Body, build_body, open_meshes
from warpspace.geometry.srgb import linear_to_srgb
from warpspace.units import Array

BODY_FILE = "bodies.glb"
_WHAT = "file of machine bodies"
_LINES = " lines"


@lru_cache(maxsize=8)
def read_bodies(path: Path) -> tuple[Body, ...]:
    """Read a file of bodies; the result is kept, since every session draws the same.

    Parameters
    ----------
    path : Path

    Returns
    -------
    tuple of Body
        Empty where there is no such file.

    Raises
    ------
    OptionError
        If the file cannot be read.
    """
    if not path.is_file():
        return ()
    scene = open_meshes(path, _WHAT)
    lines = {
        name.removesuffix(_LINES): np.reshape(geometry.vertices, (-1, 2, 3))
        for name, geometry in scene.geometry.items()
        if name.endswith(_LINES)
    }
    return tuple(
        build_body(mesh, name, frame_of(name), _colour(mesh), lines.get(name))
        for name, mesh in scene.geometry.items()
        if hasattr(mesh, "faces")
    )


def write_bodies(
    path: Path, bodies: Sequence[Body], lines_mm: Mapping[str, Array] | None = None
) -> None:
    """Write a file of bodies.

    Parameters
    ----------
    path : Path
    bodies : sequence of Body
        Their edges are not stored: they are found again.
    lines_mm : mapping of str to ndarray, [E, 2, 3], mm, optional
        Name of a body to further lines on it, in its frame.
    """
    parts: list[Part] = []
    for body in bodies:
        material = Material(body.name, body.colour)
        parts.append(Part(body.name, body.vertices_mm, body.triangles, material))
        further = (lines_mm or {}).get(body.name)
        if further is not None:
            pairs = np.arange(2 * len(further)).reshape(-1, 2)
            parts.append(Part(body.name + _LINES, further.reshape(-1, 3), pairs, material))
    path.write_bytes(build_gltf(parts, root="bodies, mm, Z up"))


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
