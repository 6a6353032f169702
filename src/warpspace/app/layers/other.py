"""Wireframe of the side of a comparison that is not drawn."""

from typing import Any

import numpy as np
from viser import SceneApi

from warpspace.app.layers import SCENE_PER_MM, colour_bytes, palette, pieces
from warpspace.app.live import Frame

_NOTHING = np.zeros((1, 2, 3), np.float32)


class OtherLayer:
    """Edges and grid lines of the other bent box, every second piece, so that it reads as dotted.

    Parameters
    ----------
    scene : viser.SceneApi
    frame : Frame
    """

    def __init__(self, scene: SceneApi, frame: Frame) -> None:
        self._edges: Any = scene.add_line_segments(
            "/compare/other",
            _NOTHING,
            colour_bytes(palette(frame).edge),
            thickness=2.0,
            thickness_units="screen",
            scale=SCENE_PER_MM,
            visible=False,
        )
        self.show(frame)

    def show(self, frame: Frame) -> None:
        """Follow the other side."""
        found = frame.compared
        visible = found is not None and found.other_mm is not None and frame.state.comparison.ghost
        self._edges.visible = visible
        if not visible or found is None or found.other_mm is None:
            return
        self._edges.colors = colour_bytes(palette(frame).edge)
        self._edges.points = pieces(found.other_mm, frame.topology.edge_segments)[::2]
