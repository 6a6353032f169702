"""The schematic machine: bodies in quiet greys, and the tool point in the deformed grid."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import drawn_bodies, nominal_bodies, tool_point
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_ball
from warpspace.app.viewport.tone_map import Rgb
from warpspace.units import Array

# --- Bodies of a machine in the drawing: added once, then moved by their vertices -----------------


@dataclass(frozen=True, slots=True)
class DrawnBody:
    """One body as it is to be drawn."""

    name: str
    vertices_mm: Array  # [V, 3]
    edges_mm: Array  # [E, 2, 3]
    triangles: NDArray[np.int32]  # [T, 3]
    colour: Rgb  # sRGB, 0 to 255


class BodyMeshes:
    """Meshes and edges of bodies, by name."""

    def __init__(
        self, scene: SceneApi, root: str, edge_px: float, opacity: float | None = None
    ) -> None:
        self._scene, self._root = scene, root
        self._edge_px, self._opacity = edge_px, opacity
        self._parts: dict[str, tuple[Handle, Handle]] = {}
        self._triangles: dict[str, NDArray[np.int32]] = {}

    def draw(self, bodies: Iterable[DrawnBody], edge: Rgb) -> None:
        """Draw these bodies and hide all others; what has not changed is not sent."""
        drawn = list(bodies)
        for name in self._parts.keys() - {body.name for body in drawn}:
            for part in self._parts[name]:
                part.put(visible=False)
        for body in drawn:
            self._draw_body(body, colour_bytes(edge))

    def _draw_body(self, body: DrawnBody, edge: Any) -> None:
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


EDGE: Rgb = (70, 78, 90)
DARK_EDGE: Rgb = (150, 158, 170)
BALL = 0.010  # marker of the tool point, as a part of the longest edge


class MachineLayer:
    """Bodies of the machine, moved by its positions and bent by its errors.

    While an axis is turned its table is drawn also where the machine is not.
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._bodies = BodyMeshes(scene, "/machine", edge_px=0.9)
        self._ball: Handle | None = None
        self._turned: Mapping[str, float] = {}
        self._picture = picture
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        self._picture = picture
        self._draw()

    def turn(self, turned: Mapping[str, float]) -> None:
        """Stand with some axes at other positions, degrees; none for those of the state."""
        self._turned = dict(turned)
        self._draw()

    def _draw(self) -> None:
        picture, look = self._picture, self._picture.state.machine
        if self._ball is not None:
            self._ball.put(visible=look.shown)
        placed = drawn_bodies(picture, self._turned) if look.shown or self._turned else ()
        bodies = [
            DrawnBody(
                part.body.name,
                part.vertices_mm,
                part.edges_mm,
                part.body.triangles,
                part.body.colour,
            )
            for part in placed
        ]
        self._bodies.draw(bodies, DARK_EDGE if picture.state.shown.dark else EDGE)
        if look.shown:
            self._draw_tool_point(picture)

    def _draw_tool_point(self, picture: LivePicture) -> None:
        found = tool_point(picture)
        longest = picture.size_mm
        if self._ball is None:
            self._ball = add_ball(
                self._scene, "/machine/tool_point", BALL * longest, palette(picture).edge
            )
        self._ball.put(position=found.drawn_mm * SCENE_PER_MM)


# --- The machine as a ghost around its working volume: it tells what the box is a part of ---------

OPACITY = 0.045
GHOST, DARK_GHOST = (120, 132, 150), (150, 160, 176)
GHOST_EDGE: Rgb = (226, 230, 235)
DARK_GHOST_EDGE: Rgb = (48, 54, 63)


class GhostMachineLayer:
    """Bodies of the nominal machine, nearly transparent; not beside the machine itself."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._bodies = BodyMeshes(scene, "/ghost_machine", edge_px=0.8, opacity=OPACITY)
        self._drawn_for: tuple[object, ...] = ()
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the machine and its axes; errors do not move a ghost."""
        state = picture.state
        on = state.machine.ghost and not state.machine.shown
        drawn_for = (
            Identity(state.scene),
            state.seen,
            state.shown.dark,
            Identity(state.machine.linear_mm),
            Identity(state.positions),
        )
        if not on:
            self._bodies.draw((), GHOST_EDGE)
            self._drawn_for = ()
        elif drawn_for != self._drawn_for:
            self._drawn_for = drawn_for
            dark = state.shown.dark
            colour = DARK_GHOST if dark else GHOST
            bodies = [
                DrawnBody(
                    part.body.name,
                    part.nominal_mm,
                    part.nominal_edges_mm,
                    part.body.triangles,
                    colour,
                )
                for part in nominal_bodies(picture)
            ]
            self._bodies.draw(bodies, DARK_GHOST_EDGE if dark else GHOST_EDGE)
