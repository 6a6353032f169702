"""The schematic machine: bodies in quiet greys, and the tool point in the deformed grid."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_ball
from warpspace.app.viewport.tone_map import Rgb
from warpspace.picture.bodies import PlacedBody
from warpspace.picture.marks import spell_micrometres

EDGE: Rgb = (70, 78, 90)
DARK_EDGE: Rgb = (150, 158, 170)
BALL = 0.010
"""Marker of the tool point, as a part of the longest edge."""


class MachineLayer:
    """Bodies of the machine, moved by its positions and bent by its errors.

    While an axis is turned its table is drawn also where the machine is not.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._bodies: dict[str, tuple[Handle, Handle]] = {}
        self._shapes: dict[str, NDArray[np.int32]] = {}
        self._ball: Handle | None = None
        self._label = Handle(
            scene.add_label(
                "/machine/label", "", visible=False, font_screen_scale=0.8, anchor="center-left"
            )
        )
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
        """Place everything."""
        picture, look = self._picture, self._picture.state.machine
        self._label.put(visible=look.shown)
        if self._ball is not None:
            self._ball.put(visible=look.shown)
        placed = drawn_bodies(picture, self._turned) if look.shown or self._turned else ()
        for name in set(self._bodies) - {part.body.name for part in placed}:
            for part in self._bodies[name]:
                part.put(visible=False)
        edge = colour_bytes(DARK_EDGE if picture.state.shown.dark else EDGE)
        for part in placed:
            self._draw_body(part, edge)
        if look.shown:
            self._draw_tool_point(picture)

    def _draw_body(self, part: PlacedBody, edge: Any) -> None:
        """Add a body, or move its vertices where they have changed."""
        name = part.body.name
        vertices = part.vertices_mm.astype(np.float32)
        edges = part.edges_mm.astype(np.float32)
        known = self._bodies.get(name)
        triangles = part.body.triangles
        if (
            known is not None
            and known[0].handle.vertices.shape == vertices.shape
            and np.array_equal(self._shapes[name], triangles)
        ):
            mesh, lines = known
            mesh.put(visible=True)
            lines.put(visible=True)
            if not np.array_equal(mesh.handle.vertices, vertices):
                mesh.put(vertices=vertices)
                lines.put(points=edges)
            lines.put(colors=edge)
            return
        mesh = self._scene.add_mesh_simple(
            f"/machine/{name}",
            vertices,
            triangles.astype(np.uint32),
            color=part.body.colour,
            flat_shading=True,
            scale=SCENE_PER_MM,
            cast_shadow=False,
            receive_shadow=False,
        )
        lines = self._scene.add_line_segments(
            f"/machine/{name}_edges",
            edges,
            edge,
            thickness=0.9,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._bodies[name] = (Handle(mesh), Handle(lines))
        self._shapes[name] = triangles

    def _draw_tool_point(self, picture: LivePicture) -> None:
        """Mark the tool point where the deformed grid has it."""
        found = tool_point(picture)
        longest = picture.size_mm
        if self._ball is None:
            self._ball = add_ball(
                self._scene, "/machine/tool_point", BALL * longest, palette(picture).edge
            )
        self._ball.put(position=found.drawn_mm * SCENE_PER_MM)
        length = float(np.linalg.norm(found.error_um))
        self._label.put(
            text=f"tool point, |E| {spell_micrometres(length)}",
            position=(found.drawn_mm + 0.03 * longest * np.eye(3)[0]) * SCENE_PER_MM,
        )
