"""What is written on the map: corner arrows and the worst point."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_ball, add_lines
from warpspace.app.viewport.marks import (
    CornerArrows,
    WorstPoint,
    build_arrows,
    corner_arrows,
    spell_micrometres,
    worst_point,
)
from warpspace.units import MICROMETRE, spell_short

RADIUS, HEAD, BALL = 0.0032, 0.034, 0.009
"""Shaft and head of an arrow, and the marker of the worst point, as parts of the longest edge."""
CORNERS = 8


def _spell_value(value: float, unit: str) -> str:
    if unit == MICROMETRE:
        return f"max {spell_micrometres(value)}"
    return f"max {value:.1f} {unit}".replace("-", "−")


class AnnotationsLayer:
    """Arrows, marker and their numbers."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._arrows: Handle | None = None
        self._corner_labels = [
            self._label(f"/marks/corner{n}", "bottom-center") for n in range(CORNERS)
        ]
        self._ball: Handle | None = None
        self._worst = self._label("/marks/max", "bottom-center")
        self.show(picture)

    def _label(self, name: str, anchor: Any) -> Handle:
        return Handle(
            self._scene.add_label(
                name, "", visible=False, font_screen_scale=0.8, anchor=anchor, depth_test=True
            )
        )

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        worst = worst_point(picture.values, picture.grid.nominal_mm, picture.drawn_mm)
        self._show_arrows(picture, worst)
        self._show_worst(picture, worst)

    def _show_arrows(self, picture: LivePicture, worst: WorstPoint) -> None:
        if not picture.state.look.arrows:
            for part in (*self._corner_labels, *([self._arrows] if self._arrows else ())):
                part.put(visible=False)
            return
        arrows = corner_arrows(
            picture.grid.shape,
            picture.grid.nominal_mm,
            picture.field.error_um,
            picture.exaggeration,
            picture.size_mm,
        )
        for label in self._corner_labels[len(arrows.norm_um) :]:
            label.put(visible=False)
        longest = picture.size_mm
        vertices, triangles = build_arrows(
            arrows.start_mm, arrows.end_mm, RADIUS * longest, HEAD * longest
        )
        if self._arrows is None or len(self._arrows.handle.vertices) != len(vertices):
            self._arrows = Handle(
                self._scene.add_mesh_simple(
                    "/marks/arrows",
                    vertices.astype(np.float32),
                    triangles.astype(np.uint32),
                    color=palette(picture).edge,
                    scale=SCENE_PER_MM,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        self._arrows.put(
            vertices=vertices.astype(np.float32), color=palette(picture).edge, visible=True
        )
        marked = carries_worst(picture, arrows, worst)
        for label, text, at, hidden in zip(
            self._corner_labels, arrows.texts, arrows.label_mm, marked, strict=False
        ):
            label.put(text=text, position=at * SCENE_PER_MM, visible=not hidden)

    def _show_worst(self, picture: LivePicture, found: WorstPoint) -> None:
        on = picture.state.look.worst and found.value != 0.0
        self._worst.put(visible=on)
        if self._ball is not None:
            self._ball.put(visible=on)
        if not on:
            return
        longest = picture.size_mm
        if self._ball is None:
            self._ball = add_ball(self._scene, "/marks/ball", BALL * longest, palette(picture).edge)
        self._ball.put(position=found.drawn_mm * SCENE_PER_MM, color=palette(picture).edge)
        middle = picture.grid.bounds_mm.mean(axis=0)
        outwards = np.sign(np.round(found.nominal_mm - middle, 9)) * (1.0, 1.0, 0.0)
        self._worst.put(
            text=_spell_value(found.value, picture.scale.unit),
            position=(found.drawn_mm + 0.03 * longest * outwards) * SCENE_PER_MM,
        )


def carries_worst(
    picture: LivePicture, arrows: CornerArrows, worst: WorstPoint
) -> NDArray[np.bool_]:
    """Tell which corners carry the mark of the largest error, which says the same number."""
    look = picture.state.look
    if not look.worst or look.tilts or picture.state.component != "norm":
        return np.zeros(len(arrows.norm_um), dtype=bool)
    return np.all(np.isclose(arrows.start_mm, worst.nominal_mm), axis=1)


# --- The path of the standard test that is run ----------------------------------------------------
# Nominal, and actual with the factor of the box.


class BenchLayer:
    """The path of a test and its name."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        colours = palette(picture)
        self._nominal = add_lines(scene, "/test/nominal", colours.trace_nominal, 1.5, visible=False)
        self._actual = add_lines(scene, "/test/actual", colours.trace_actual, 3.0, visible=False)
        self._name = Handle(
            scene.add_label(
                "/test/name", "", visible=False, font_screen_scale=0.8, anchor="bottom-center"
            )
        )
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw the path."""
        found = picture.bench
        shown = isinstance(found, BenchPicture) and picture.state.bench.path
        for part in (self._nominal, self._actual, self._name):
            part.put(visible=shown)
        if not isinstance(found, BenchPicture) or not shown:
            return
        lines = found.lines_mm(picture.exaggeration)
        colours = palette(picture)
        nominal = polyline_pieces([one for one, _ in lines])
        actual = polyline_pieces([other for _, other in lines])
        self._nominal.put(
            points=nominal if len(nominal) else NOTHING, colors=colour_bytes(colours.trace_nominal)
        )
        self._actual.put(
            points=actual if len(actual) else NOTHING, colors=colour_bytes(colours.trace_actual)
        )
        ends = np.concatenate([other for _, other in lines])
        factor = spell_short(picture.exaggeration)
        self._name.put(
            text=f"{found.prepared.test.name}: max {spell_micrometres(found.largest_um)},"
            f" drawn {factor} ×",
            position=ends[np.argmax(ends[:, 2])] * SCENE_PER_MM,
        )
