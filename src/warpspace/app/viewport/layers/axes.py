"""Axes of the machine frame in mm beside the nominal box."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.geometry.colour import tick_values
from warpspace.geometry.surfaces import is_thin
from warpspace.units import Array

AWAY = 0.13
"""Distance of the axes from the nominal box, as a part of the longest edge: the bend has room."""
TICK = 0.022
LABEL_ROOM = 0.05
MAX_TICKS = 6


def axis_frames(low: Array, high: Array, away: float) -> list[tuple[Array, Array]]:
    """Place the three axes: a point on each (its own coordinate zero) and the way its ticks point.

    X runs along the front, Y along the right, Z up the left of the front.
    """
    return [
        (np.array([0.0, low[1] - away, low[2]]), np.array([0.0, -1.0, 0.0])),
        (np.array([high[0] + away, 0.0, low[2]]), np.array([1.0, 0.0, 0.0])),
        (np.array([low[0] - away, low[1], 0.0]), np.array([-1.0, 0.0, 0.0])),
    ]


def axes_room_mm(picture: LivePicture) -> Array:
    """Give points around the nominal box that leave room for axes and their numbers, [n, 3], mm."""
    low, high = picture.grid.bounds_mm
    away = (AWAY + LABEL_ROOM) * picture.size_mm
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
    """Lines, ticks and numbers; laid out anew when the nominal box changes."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._labels: list[Handle] = []
        self._box: Array | None = None
        self._lines = add_lines(scene, "/axes/lines", palette(picture).axis, 1.2)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the nominal box and the switch."""
        box = picture.grid.bounds_mm
        # their numbers would cover the machine
        visible = picture.state.shown.axes and not picture.state.machine.shown
        if box is not self._box:
            if self._box is None or not np.array_equal(box, self._box):
                self._lay_out(box, picture.size_mm)
            self._box = box
        self._lines.put(visible=visible, colors=colour_bytes(palette(picture).axis))
        for label in self._labels:
            label.put(visible=visible)

    def _lay_out(self, box: Array, longest: float) -> None:
        for label in self._labels:
            label.handle.remove()
        self._labels = []
        low, high = box
        lines: list[NDArray[np.float64]] = []
        for index, (foot, out) in enumerate(axis_frames(low, high, AWAY * longest)):
            along = np.eye(3)[index]
            lines.append(np.stack([foot + low[index] * along, foot + high[index] * along]))
            ticks = tick_values(low[index], high[index], MAX_TICKS)
            for value in ticks:
                at = foot + value * along
                lines.append(np.stack([at, at + TICK * longest * out]))
                self._label(f"{value:g}".replace("-", "−"), at + 2.4 * TICK * longest * out, 0.8)
            # between two numbers, and further out: on a small page these stand close together
            between = np.mean(ticks[len(ticks) // 2 :][:2])
            title = foot + between * along + 7.0 * TICK * longest * out
            self._label(f"{'xyz'[index]} in R [mm]", title, 0.85)
        self._lines.put(points=np.stack(lines).astype(np.float32))

    def _label(self, text: str, at: Array, size: float) -> None:
        """Add one label at a point in mm."""
        self._labels.append(
            Handle(
                self._scene.add_label(
                    f"/axes/label{len(self._labels)}",
                    text,
                    position=at * SCENE_PER_MM,
                    font_screen_scale=size,
                    anchor="center-center",
                )
            )
        )
