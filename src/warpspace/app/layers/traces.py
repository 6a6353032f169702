"""Traces of the rotary axes: nominal light, actual strong, with the exaggeration of the box."""

import numpy as np
from viser import SceneApi

from warpspace.app.layers import SCENE_PER_MM, colour_bytes, palette, polyline_pieces
from warpspace.app.live import Frame


class TracesLayer:
    """Circles and arcs of the scene's trace points.

    Parameters
    ----------
    scene : viser.SceneApi
    frame : Frame
    """

    def __init__(self, scene: SceneApi, frame: Frame) -> None:
        colours = palette(frame)
        self._group = None
        empty = np.zeros((1, 2, 3), np.float32)
        self._nominal = scene.add_line_segments(
            "/traces/nominal",
            empty,
            colour_bytes(colours.trace_nominal),
            thickness=1.5,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._actual = scene.add_line_segments(
            "/traces/actual",
            empty,
            colour_bytes(colours.trace_actual),
            thickness=2.0,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self.show(frame)

    def show(self, frame: Frame) -> None:
        """Move the traces."""
        visible = frame.state.shown.traces and bool(frame.traces)
        self._nominal.visible = self._actual.visible = visible
        colours = palette(frame)
        self._nominal.colors = colour_bytes(colours.trace_nominal)
        self._actual.colors = colour_bytes(colours.trace_actual)
        if not visible:
            return
        group = frame.traces[0].group
        if group is not self._group:
            self._group = group
            self._nominal.points = polyline_pieces([lines.nominal_mm for lines in frame.traces])
        self._actual.points = polyline_pieces([lines.actual_mm for lines in frame.traces])
