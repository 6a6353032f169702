"""The point that was asked about, its displacement, axis and lever of the chosen contribution."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.analysis.contributions import Contribution
from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.budget import Answer, answer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.app.viewport.layers.box import dashes
from warpspace.units import Array

ACCENT = (194, 24, 91)  # colour of everything that answers "why?"; it is in no colour map
RADIUS = 0.011  # of the marker, as a part of the longest edge
AXIS_HALF = 0.32  # half the length of the drawn axis, as a part of the longest edge
DASH = 0.02


class AskedPointLayer:
    """Marker, displacement, axis and lever."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._marker = Handle(
            scene.add_icosphere(
                "/why/marker",
                radius=1.0,
                color=ACCENT,
                subdivisions=2,
                cast_shadow=False,
                receive_shadow=False,
                visible=False,
            )
        )
        self._lines = {
            name: add_lines(scene, f"/why/{name}", ACCENT, thickness, visible=False)
            for name, thickness in (("vector", 3.0), ("axis", 3.5), ("lever", 2.0))
        }
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the point and the chosen contribution."""
        picked = picture.state.picked
        different = picture.compared is not None and picture.compared.shown == "difference"
        if picked is None or different:
            self._hide(self._marker, *self._lines.values())
            return
        found = answer(picture.drawn_state, picked, picture.exaggeration)
        size = picture.size_mm
        self._marker.put(
            position=found.drawn_mm * SCENE_PER_MM,
            scale=RADIUS * size * SCENE_PER_MM,
            visible=True,
        )
        nominal = found.explanation.nominal_mm + found.shift_mm
        self._line("vector", np.stack([nominal, found.drawn_mm])[None])
        chosen = [p for p in found.explanation.contributions if p.key == picture.state.lever]
        if chosen:
            self._show_lever(found, chosen[0], size)
        else:
            self._hide(*(self._lines[k] for k in ("axis", "lever")))

    def _show_lever(self, found: Answer, part: Contribution, size: float) -> None:
        origin = part.origin_mm + found.shift_mm
        point = found.explanation.nominal_mm + found.shift_mm
        half = AXIS_HALF * size * part.direction
        self._line("axis", np.stack([origin - half, origin + half])[None])
        self._line("lever", dashes(np.stack([origin, point])[None], DASH * size, 0.6 * DASH * size))

    def _line(self, name: str, points: "Array | NDArray[np.float32]") -> None:
        """Show a line, [S, 2, 3], mm."""
        self._lines[name].put(
            points=points.astype(np.float32) if len(points) else NOTHING, visible=True
        )

    def _hide(self, *parts: Handle) -> None:
        for part in parts:
            part.put(visible=False)
