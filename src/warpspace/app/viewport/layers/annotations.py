"""What is marked on the map: corner arrows, the worst point, the path of a test."""

import numpy as np
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.labels import axis_labels, point_labels
from warpspace.app.viewport.layers import NOTHING, SCENE_PER_MM, colour_bytes, polyline_pieces
from warpspace.app.viewport.layers.adding import add_ball, add_lines
from warpspace.app.viewport.marks import build_arrows, corner_arrows, worst_point

RADIUS, HEAD, BALL = 0.0032, 0.034, 0.009
"""Shaft and head of an arrow, and the marker of the worst point, as parts of the longest edge."""


class AnnotationsLayer:
    """Arrows and marker; their numbers are words of the page."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._scene = scene
        self._arrows: Handle | None = None
        self._ball: Handle | None = None
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the picture."""
        self._show_arrows(picture)
        self._show_worst(picture)

    def _show_arrows(self, picture: LivePicture) -> None:
        if not picture.state.look.arrows:
            if self._arrows is not None:
                self._arrows.put(visible=False)
            return
        grid, longest = picture.grid, picture.size_mm
        arrows = corner_arrows(
            grid.shape, grid.nominal_mm, picture.field.error_um, picture.exaggeration
        )
        vertices, triangles = build_arrows(
            arrows.start_mm, arrows.end_mm, RADIUS * longest, HEAD * longest
        )
        colour = palette(picture).edge
        if self._arrows is None or len(self._arrows.handle.vertices) != len(vertices):
            self._arrows = Handle(
                self._scene.add_mesh_simple(
                    "/marks/arrows",
                    vertices.astype(np.float32),
                    triangles.astype(np.uint32),
                    color=colour,
                    scale=SCENE_PER_MM,
                    cast_shadow=False,
                    receive_shadow=False,
                )
            )
        self._arrows.put(vertices=vertices.astype(np.float32), color=colour, visible=True)

    def _show_worst(self, picture: LivePicture) -> None:
        found = worst_point(picture.values, picture.grid.nominal_mm, picture.drawn_mm)
        on = picture.state.look.worst and found.value != 0.0
        if self._ball is None:
            radius = BALL * picture.size_mm
            self._ball = add_ball(self._scene, "/marks/ball", radius, palette(picture).edge)
        self._ball.put(
            position=found.drawn_mm * SCENE_PER_MM, color=palette(picture).edge, visible=on
        )


class LabelsLayer:
    """All words in 3-D, for a page that cannot place them."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        away = 0.03 * picture.size_mm
        middle = picture.grid.bounds_mm.mean(axis=0)
        for number, label in enumerate((*axis_labels(picture), *point_labels(picture))):
            start = middle if label.from_mm is None else label.from_mm
            way = label.at_mm - start
            out = way / max(float(np.linalg.norm(way)), 1e-9)
            scene.add_label(
                f"/words/{number}",
                label.text,
                position=(label.at_mm + (3.0 if label.kind == "axis" else 1.0) * away * out)
                * SCENE_PER_MM,
                font_screen_scale=0.8,
                anchor="center-center",
            )

    def show(self, picture: LivePicture) -> None:
        """Stay; the picture of such a page does not change."""


# --- The path of the standard test that is run ----------------------------------------------------
# Nominal, and actual with the factor of the box.


class BenchLayer:
    """The path of a test."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        colours = palette(picture)
        self._nominal = add_lines(scene, "/test/nominal", colours.trace_nominal, 1.5, visible=False)
        self._actual = add_lines(scene, "/test/actual", colours.trace_actual, 3.0, visible=False)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Draw the path."""
        found = picture.bench
        shown = isinstance(found, BenchPicture) and picture.state.bench.path
        for part in (self._nominal, self._actual):
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
