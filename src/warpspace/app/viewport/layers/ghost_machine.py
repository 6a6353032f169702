"""The machine as a ghost around its working volume: it tells what the box is a part of."""

from typing import Any

import numpy as np
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import nominal_bodies
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.tone_map import Rgb

OPACITY = 0.12
GHOST, DARK_GHOST = (120, 132, 150), (150, 160, 176)
EDGE: Rgb = (190, 196, 206)
DARK_EDGE: Rgb = (78, 85, 96)


class GhostMachineLayer:
    """Bodies of the nominal machine, nearly transparent; not beside the machine itself.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._parts: list[Handle] = []
        self._drawn_for: tuple[object, ...] = ()
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the machine and its axes; errors do not move a ghost."""
        state = picture.state
        on = state.machine.ghost and not state.machine.shown
        drawn_for = (
            Identity(state.scene),
            state.loop,
            state.shown.dark,
            Identity(state.machine.linear_mm),
            Identity(state.positions),
        )
        if on and drawn_for != self._drawn_for:
            self._drawn_for = drawn_for
            self._draw(picture)
        for part in self._parts:
            part.put(visible=on)

    def _draw(self, picture: LivePicture) -> None:
        """Build the bodies anew."""
        for part in self._parts:
            part.handle.remove()
        dark = picture.state.shown.dark
        edge = colour_bytes(DARK_EDGE if dark else EDGE)
        self._parts = []
        for number, part in enumerate(nominal_bodies(picture)):
            mesh: Any = self._scene.add_mesh_simple(
                f"/ghost_machine/body{number}",
                part.nominal_mm.astype(np.float32),
                part.body.triangles.astype(np.uint32),
                color=DARK_GHOST if dark else GHOST,
                opacity=OPACITY,
                flat_shading=True,
                scale=SCENE_PER_MM,
                cast_shadow=False,
                receive_shadow=False,
            )
            lines: Any = self._scene.add_line_segments(
                f"/ghost_machine/edges{number}",
                part.nominal_edges_mm.astype(np.float32),
                edge,
                thickness=0.8,
                thickness_units="screen",
                scale=SCENE_PER_MM,
            )
            self._parts += [Handle(mesh), Handle(lines)]
