"""The meshes that a machine's description names, placed in the frames they ride on."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from warpspace.bodies.user_mesh import LoadedMesh, load_mesh
from warpspace.exceptions import OptionError
from warpspace.kinematics.transforms import apply, placed
from warpspace.machine.body_source import BodySource
from warpspace.machine.description import Machine


def own_meshes(machine: Machine) -> dict[str, LoadedMesh]:
    """Read the meshes that a machine's description names.

    Parameters
    ----------
    machine : Machine

    Returns
    -------
    dict of str to LoadedMesh
        By frame, with what the user should know. A mesh once read is kept: a page that is open
        does not fail when its file is taken away.

    Raises
    ------
    OptionError
        If a mesh cannot be read; the message names its frame and its file.
    """
    return {
        frame: _read(frame, source)
        for frame, source in machine.bodies.items()
        if source.file and source.path
    }


@lru_cache(maxsize=64)
def _read(frame: str, source: BodySource) -> LoadedMesh:
    """Read one mesh and place it in its frame."""
    try:
        loaded = load_mesh(source.path, frame, unit=source.unit or None)
    except OptionError as error:
        raise OptionError(f"bodies.{frame}: {error}") from None
    pose = placed(source.offset_mm, source.rotation_deg)
    body = loaded.body
    name = body.name if body.name.startswith(f"{frame}_") else f"{frame}_{body.name}"
    moved = replace(
        body,
        name=name,
        vertices_mm=np.ascontiguousarray(apply(pose, body.vertices_mm)),
        edges_mm=np.ascontiguousarray(apply(pose, body.edges_mm)),
    )
    return LoadedMesh(moved, tuple(f"bodies.{frame}: {warning}" for warning in loaded.warnings))


def check_meshes(machine: Machine) -> tuple[str, ...]:
    """Read all meshes of a machine and give the warnings about them.

    Raises
    ------
    OptionError
        If a mesh cannot be read.
    """
    return tuple(text for loaded in own_meshes(machine).values() for text in loaded.warnings)
