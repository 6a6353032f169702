"""The schematic bodies of a machine where they are drawn, bent by its errors."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.field.evaluate import error_values
from warpspace.kinematics.bodies import BodyMotion, body_motions
from warpspace.scene.model import Scene
from warpspace.units import Array

BODY_COLOUR = (186, 193, 204)
BODY_FILE = "bodies.glb"


@dataclass(frozen=True, slots=True)
class DrawnBody:
    """One body of a machine.

    Attributes
    ----------
    name : str
    vertices_mm : ndarray, [V, 3], mm
        In R, where they are drawn.
    triangles : ndarray, [T, 3]
    """

    name: str
    vertices_mm: Array
    triangles: NDArray[np.integer[Any]]


def drawn_bodies(scene: Scene, exaggeration: float) -> tuple[DrawnBody, ...]:
    """Place the bodies of a scene's machine.

    Parameters
    ----------
    scene : Scene
    exaggeration : float
        Display factor of the small motions.

    Returns
    -------
    tuple of DrawnBody
        Empty where the machine has none.
    """
    path = Path(scene.machine.body_dir) / BODY_FILE if scene.machine.body_dir else None
    if path is None or not path.is_file():
        return ()
    import trimesh

    coordinates = {name: np.asarray(value) for name, value in scene.workspace.positions.items()}
    values = error_values(scene.model, scene.errors, coordinates)
    motions = body_motions(scene.model, values, coordinates)
    assets = trimesh.load_scene(path, process=False)
    found: list[DrawnBody] = []
    for node in sorted(assets.graph.nodes_geometry):
        place, geometry = assets.graph[node]
        mesh = assets.geometry[geometry]
        motion = _motion_of(node, motions)
        if motion is None or not isinstance(mesh, trimesh.Trimesh):
            continue
        local = np.asarray(mesh.vertices) @ place[:3, :3].T + place[:3, 3]
        pose = motion.drawn(exaggeration)
        found.append(DrawnBody(node, local @ pose[:3, :3].T + pose[:3, 3], mesh.faces))
    return tuple(found)


def _motion_of(node: str, motions: dict[str, BodyMotion]) -> BodyMotion | None:
    """Find the frame a node rides on: the part of its name before a colon or underscore."""
    return motions.get(node.replace(":", "_").split("_")[0])
