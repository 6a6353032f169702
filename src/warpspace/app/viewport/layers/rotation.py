"""The traced points while the table turns: nominal light, actual dark, on their circles."""

from typing import Any

import numpy as np
from viser import SceneApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.evaluation.rotation import points_on_traces
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.units import Array

SIZE = 0.014
"""Diameter of a point, as a part of the longest edge."""


class RotationLayer:
    """A pair of points on every circle of the played axis; nothing while none is played.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._picture = picture
        self._position: dict[str, float] | None = None
        self._clouds: list[Any] = []

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        self._picture = picture
        self._draw()

    def turn(self, position: dict[str, float] | None) -> None:
        """Draw the points at a position of the played axis, degrees; None takes them away."""
        self._position = position
        self._draw()

    def _draw(self) -> None:
        """Place the points."""
        picture, position = self._picture, self._position
        visible = False
        if position is not None and picture.state.shown.traces:
            points = points_on_traces(picture, position)
            visible = len(points[0]) > 0
            if visible:
                self._place(points)
        for cloud in self._clouds:
            cloud.visible = visible

    def _place(self, points: tuple[Array, Array]) -> None:
        """Add the two clouds, or move their points."""
        if self._clouds:
            for cloud, at in zip(self._clouds, points, strict=True):
                cloud.points = at.astype(np.float32)
            return
        colours = palette(self._picture)
        for name, at, rgb in zip(
            ("nominal", "actual"),
            points,
            (colours.trace_nominal, colours.trace_actual),
            strict=True,
        ):
            self._clouds.append(
                self._scene.add_point_cloud(
                    f"/rotation/{name}",
                    at.astype(np.float32),
                    np.array(rgb, dtype=np.uint8),
                    point_size=SIZE * self._picture.size_mm,
                    point_shape="circle",
                    point_shading="flat",
                    precision="float32",
                    scale=SCENE_PER_MM,
                )
            )
