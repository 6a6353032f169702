"""The part in the box as cut, with lines of the nominal one, what moves it, and paths of tools."""

from collections.abc import Callable
from typing import Any

import numpy as np
from viser import SceneApi
from viser import transforms as quaternions

from warpspace.app.browser.incoming import index_of
from warpspace.app.drawing.around import ACCENT, ASKED
from warpspace.app.drawing.box import coloured_shape
from warpspace.app.drawing.colours import colour, colour_levels, level_colours
from warpspace.app.drawing.shapes import SCENE_PER_MM, Shape, Shapes, dots, lines
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.part import AT_LINE, middle_mm, moved_place
from warpspace.formats.source import MAX_LINES
from warpspace.kinematics import transforms

GIZMO = "/part/gizmo"
MOST_OUTSIDE, OUTSIDE_SIZE = 4000, 0.006  # points beyond the travel that are marked
GIZMO_SIZE = 0.3  # as a part of the longest edge of the box


def part_shapes(picture: LivePicture) -> Shapes:
    """Draw the part as cut, its creases, those of the nominal one, and what is out of reach."""
    part, ghost, state = picture.part, colour(picture, "ghost"), picture.state
    if part is None:
        return {}
    corners, drawn = part.of.corners, part.drawn_mm(picture.exaggeration)
    values, scale = picture.coloured(part)
    ends, away = part.at[corners.creases], part.nominal_mm[part.made.outside]
    away = away[:: 1 + len(away) // MOST_OUTSIDE]
    return {
        "/part/surface": coloured_shape(drawn[part.at], corners.triangles, values, scale),
        "/part/edges": lines(drawn[ends], colour(picture, "edge"), 1.4),
        "/part/outside": dots(away, OUTSIDE_SIZE * picture.size_mm, ACCENT),
        "/part/nominal": lines(part.nominal_mm[ends], ghost, 1.2) if state.shown.ghost else None,
        f"{GIZMO}/nominal": lines((part.made.point_mm - middle_mm(part))[ends], ghost, 1.2)
        if state.part.moved else None,
    }  # fmt: skip


def path_shapes(picture: LivePicture) -> Shapes:
    """Draw the path of a program, nominal and actual, and the end of the line that is asked for."""
    path = picture.path
    if path is None:
        return {}
    drawn, (values, scale) = path.drawn_mm(picture.exaggeration), picture.coloured(path)
    linear = np.clip(level_colours(diverging=scale.diverging), 0.0, 1.0)  # viser wants lines so
    levels = (255.0 * linear).astype(np.uint8)[colour_levels(scale, values)]
    stays = {"thickness": 3.0, "thickness_units": "screen", "scale": SCENE_PER_MM}
    follows = {"points": drawn[path.at], "colors": levels}
    asked = index_of(picture.state.forms.get(AT_LINE, ""), MAX_LINES)
    nominal = lines(path.nominal_mm[path.at], colour(picture, "trace_nominal"), 1.2)
    return {
        "/program/nominal": nominal,
        "/program/actual": Shape("add_line_segments", stays, follows) if nominal else None,
        "/program/line": dots(drawn[path.of.line == asked][-1:], ASKED * picture.size_mm, ACCENT),
    }


class PartGizmo:
    """Arrows and arcs that move the part; lines of the nominal one go with them."""

    def __init__(self, scene: SceneApi, picture: LivePicture, moved: Callable[[str], None]) -> None:
        self._scene, self._moved = scene, moved
        self._gizmo: Any = None
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        self._part = part = picture.part if picture.state.part.moved else None
        if part is None:
            if self._gizmo is not None:
                self._gizmo.visible = False
            return
        if self._gizmo is None:
            size = GIZMO_SIZE * picture.size_mm * SCENE_PER_MM
            self._gizmo = self._scene.add_transform_controls(
                GIZMO, scale=size, depth_test=False, disable_sliders=True
            )
            self._gizmo.on_update(self._drag)
        self._gizmo.visible = True
        self._gizmo.position = transforms.apply(part.pose, middle_mm(part)) * SCENE_PER_MM
        self._gizmo.wxyz = quaternions.SO3.from_matrix(part.pose[:3, :3]).wxyz

    def _drag(self, event: Any) -> None:
        """Clamp the part where it is let go; viser calls it in a thread of its own."""
        part = self._part
        if event.phase == "end" and part is not None:
            turn: Any = quaternions.SO3(event.target.wxyz).as_matrix()
            drawn = transforms.rigid(turn, event.target.position / SCENE_PER_MM)
            place = moved_place(part, transforms.inverse(part.pose) @ drawn)
            self._moved(",".join(map(repr, place)))
