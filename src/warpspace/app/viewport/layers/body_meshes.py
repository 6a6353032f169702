"""Bodies of a machine in the drawing: added once, then moved by their vertices."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.tone_map import Rgb
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class DrawnBody:
    """One body as it is to be drawn.

    Attributes
    ----------
    name : str
    vertices_mm : ndarray, [V, 3], mm
    edges_mm : ndarray, [E, 2, 3], mm
    triangles : ndarray, [T, 3]
    colour : tuple of int, (3,)
        sRGB, 0 to 255.
    """

    name: str
    vertices_mm: Array
    edges_mm: Array
    triangles: NDArray[np.int32]
    colour: Rgb


class BodyMeshes:
    """Meshes and edges of bodies, by name.

    Parameters
    ----------
    scene : viser.SceneApi
    root : str
        Scene node they stand below.
    edge_px : float
        Thickness of edges.
    opacity : float or None
        None for bodies that nothing is seen through.
    """

    def __init__(
        self, scene: SceneApi, root: str, edge_px: float, opacity: float | None = None
    ) -> None:
        self._scene, self._root = scene, root
        self._edge_px, self._opacity = edge_px, opacity
        self._parts: dict[str, tuple[Handle, Handle]] = {}
        self._triangles: dict[str, NDArray[np.int32]] = {}

    def draw(self, bodies: Iterable[DrawnBody], edge: Rgb) -> None:
        """Draw these bodies and hide all others; what has not changed is not sent.

        Parameters
        ----------
        bodies : iterable of DrawnBody
        edge : tuple of int, (3,)
            Colour of edges, sRGB.
        """
        drawn = list(bodies)
        for name in self._parts.keys() - {body.name for body in drawn}:
            for part in self._parts[name]:
                part.put(visible=False)
        for body in drawn:
            self._draw_body(body, colour_bytes(edge))

    def _draw_body(self, body: DrawnBody, edge: Any) -> None:
        """Add a body, or move its vertices where they have changed."""
        vertices = body.vertices_mm.astype(np.float32)
        edges = body.edges_mm.astype(np.float32)
        known = self._parts.get(body.name)
        if (
            known is not None
            and known[0].handle.vertices.shape == vertices.shape
            and np.array_equal(self._triangles[body.name], body.triangles)
        ):
            mesh, lines = known
            mesh.put(visible=True, color=body.colour)
            lines.put(visible=True, colors=edge)
            if not np.array_equal(mesh.handle.vertices, vertices):
                mesh.put(vertices=vertices)
                lines.put(points=edges)
            return
        mesh = self._scene.add_mesh_simple(
            f"{self._root}/{body.name}",
            vertices,
            body.triangles.astype(np.uint32),
            color=body.colour,
            opacity=self._opacity,
            flat_shading=True,
            scale=SCENE_PER_MM,
            cast_shadow=False,
            receive_shadow=False,
        )
        lines = self._scene.add_line_segments(
            f"{self._root}/{body.name}_edges",
            edges,
            edge,
            thickness=self._edge_px,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._parts[body.name] = (Handle(mesh), Handle(lines))
        self._triangles[body.name] = body.triangles
