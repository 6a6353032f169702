"""The schematic machine: bodies in quiet greys, and the tool point in the deformed grid."""

from collections.abc import Mapping

import numpy as np
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import drawn_bodies, tool_point
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.app.viewport.layers.adding import add_ball
from warpspace.app.viewport.layers.body_meshes import BodyMeshes, DrawnBody
from warpspace.app.viewport.tone_map import Rgb
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
        self._bodies = BodyMeshes(scene, "/machine", edge_px=0.9)
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
