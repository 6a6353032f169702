"""What a calibration leaves, as arrows at the readings, exaggerated."""

import numpy as np
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.viewport.layers import SCENE_PER_MM
from warpspace.app.viewport.marks import build_arrows
from warpspace.geometry.surfaces import round_down
from warpspace.units import Array

COLOURS = {True: (138, 143, 152), False: (47, 116, 192)}
"""Before the calibration, and after; those of the chart."""
RADIUS, HEAD, LONGEST = 0.0025, 0.025, 0.2
"""Of an arrow, as parts of the longest edge of the box."""
MOST = 400


class ResidualsLayer:
    """Arrows that are added when there is something to show, and taken away."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._arrows: Handle | None = None
        self._shape: tuple[int, bool] = (0, False)

    def show(self, foot_mm: Array, vector_mm: Array, size_mm: float, *, before: bool) -> float:
        """Draw residuals; the longest is a fifth of the box or a little less."""
        every = max(1, -(-len(foot_mm) // MOST))
        foot, vector = foot_mm[::every], vector_mm[::every]
        longest = float(np.linalg.norm(vector, axis=-1).max(initial=0.0))
        if longest <= 0.0:
            self.hide()
            return 0.0
        factor = round_down(LONGEST * size_mm / longest)
        vertices, triangles = build_arrows(
            foot, foot + factor * vector, RADIUS * size_mm, HEAD * size_mm
        )
        if self._arrows is None or self._shape != (len(vertices), before):
            self.hide()
            self._shape = (len(vertices), before)
            self._arrows = Handle(
                self._scene.add_mesh_simple(
                    "/calibration/residuals",
                    vertices.astype(np.float32),
                    triangles.astype(np.uint32),
                    color=COLOURS[before],
                    scale=SCENE_PER_MM,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        self._arrows.put(vertices=vertices.astype(np.float32))
        return factor

    def hide(self) -> None:
        """Take the arrows away."""
        if self._arrows is not None:
            self._arrows.handle.remove()
            self._arrows = None
