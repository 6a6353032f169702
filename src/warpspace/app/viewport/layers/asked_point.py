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
from warpspace.machine.axes import parameter
from warpspace.picture.words import spell_axes, spell_in_r
from warpspace.units import Array

ACCENT = (194, 24, 91)  # colour of everything that answers "why?"; it is in no colour map
RADIUS = 0.011  # of the marker, as a part of the longest edge
AXIS_HALF = 0.32  # half the length of the drawn axis, as a part of the longest edge
DASH = 0.02
LABEL_AT = 0.25
"""Place of the lever's label between point and frame: it is seen where the picture is not."""


class AskedPointLayer:
    """Marker, displacement, axis, lever and their labels."""

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
        self._labels = {
            name: Handle(
                scene.add_label(f"/why/label-{name}", "", visible=False, anchor="bottom-center")
            )
            for name in ("point", "axis", "lever")
        }
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the point and the chosen contribution."""
        picked = picture.state.picked
        different = picture.compared is not None and picture.compared.shown == "difference"
        if picked is None or different:
            self._hide(self._marker, *self._lines.values(), *self._labels.values())
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
        length = float(np.linalg.norm(found.drawn_um))
        self._label(
            "point",
            f"{length:.1f} µm\n{spell_axes(found.at)}\n{spell_in_r(nominal)}",
            found.drawn_mm + 1.8 * RADIUS * size * np.eye(3)[2],
        )
        chosen = [p for p in found.explanation.contributions if p.key == picture.state.lever]
        if chosen:
            self._show_lever(found, chosen[0], size)
        else:
            self._hide(*(self._lines[k] for k in ("axis", "lever")))
            self._hide(*(self._labels[k] for k in ("axis", "lever")))

    def _show_lever(self, found: Answer, part: Contribution, size: float) -> None:
        row = parameter(part.key)
        origin = part.origin_mm + found.shift_mm
        point = found.explanation.nominal_mm + found.shift_mm
        half = AXIS_HALF * size * part.direction
        self._line("axis", np.stack([origin - half, origin + half])[None])
        way = "about" if row.is_rotation else "along"
        self._label("axis", f"{part.key} {way} this axis", origin + half)
        self._line("lever", dashes(np.stack([origin, point])[None], DASH * size, 0.6 * DASH * size))
        length = float(np.linalg.norm(part.lever_mm))
        self._label("lever", f"lever {length:.0f} mm", point + LABEL_AT * (origin - point))

    def _line(self, name: str, points: "Array | NDArray[np.float32]") -> None:
        """Show a line, [S, 2, 3], mm."""
        self._lines[name].put(
            points=points.astype(np.float32) if len(points) else NOTHING, visible=True
        )

    def _label(self, name: str, text: str, at: Array) -> None:
        """Show a label at a point, mm."""
        self._labels[name].put(text=text, position=at * SCENE_PER_MM, visible=True)

    def _hide(self, *parts: Handle) -> None:
        for part in parts:
            part.put(visible=False)
