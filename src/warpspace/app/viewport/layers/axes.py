"""Axes of the machine in mm beside the nominal box: lines and ticks, without their words."""

import numpy as np
from viser import SceneApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.labels import AWAY, TICK, axes
from warpspace.app.viewport.layers import colour_bytes
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.geometry.surfaces import is_thin
from warpspace.units import Array


def axes_room_mm(picture: LivePicture) -> Array:
    """Give points around the nominal box that leave room for axes and traces, [n, 3], mm."""
    low, high = picture.grid.bounds_mm
    away = (AWAY + TICK) * picture.size_mm
    x, y, z = (low[0] - away, high[0] + away), (low[1] - away, high[1]), (low[2], high[2])
    box = np.stack(np.meshgrid(x, y, z), axis=-1).reshape(-1, 3)
    if not is_thin(picture.shape):
        return box
    # what there is to see of a machine with one linear axis or none are its traces
    traces = [
        line.reshape(-1, 3) for of in picture.traces for line in (of.nominal_mm, of.actual_mm)
    ]
    return np.concatenate([box, *traces])


class AxesLayer:
    """Lines and ticks; laid out anew when the nominal box changes."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._nominal: Array | None = None
        self._lines = add_lines(scene, "/axes/lines", palette(picture).axis, 1.2)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the nominal box and the switch."""
        visible = picture.state.shown.axes and not picture.state.machine.shown
        if picture.grid.nominal_mm is not self._nominal:
            self._nominal = picture.grid.nominal_mm
            tick = TICK * picture.size_mm
            lines = [axis.ends_mm for axis in axes(picture)]
            lines += [
                np.stack([at, at + tick * axis.out])
                for axis in axes(picture)
                for _, at in axis.ticks
            ]
            self._lines.put(points=np.stack(lines).astype(np.float32))
        self._lines.put(visible=visible, colors=colour_bytes(palette(picture).axis))
