"""The part in the box as cut, with lines of the nominal one, what moves it, and paths of tools."""

import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from viser import SceneApi
from viser import transforms as quaternions

from warpspace.app.browser.incoming import index_of
from warpspace.app.browser.page import Page
from warpspace.app.drawing.around import ACCENT, ASKED
from warpspace.app.drawing.box import packed
from warpspace.app.drawing.colours import colour, colour_levels, level_colours
from warpspace.app.drawing.shapes import SCENE_PER_MM, UNLIT, Nodes, Shape, Shapes, dots, lines
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.part import AT_LINE, PartPicture, place_of
from warpspace.app.state.leaf import Identity
from warpspace.bodies.gltf import GltfTemplate
from warpspace.formats.source import MAX_LINES
from warpspace.kinematics import transforms
from warpspace.units import Array

SURFACE, EDGES, GIZMO = "/part/surface", "/part/edges", "/part/gizmo"
MOST_OUTSIDE, OUTSIDE_SIZE = 4000, 0.006  # points beyond the travel that are marked
GIZMO_SIZE = 0.3  # as a part of the longest edge of the box


class PartLayer:
    """The part as it is drawn; while only errors change, points and colours alone are sent."""

    def __init__(self, scene: SceneApi, page: Page, moved: Callable[[str], None]) -> None:
        self._scene, self._page, self._moved = scene, page, moved
        self._nodes, self._paths, self._gizmo = Nodes(scene), Nodes(scene), None
        self._part: PartPicture | None = None
        self._held: object = None  # what viser and the page hold but for points and colours
        self._behind = False

    def show(self, picture: LivePicture) -> None:
        self._paths.draw(path_shapes(picture))
        part, state = picture.part, picture.state
        held = part and (Identity(part.points), picture.coloured(part)[1].diverging, state.shown,
                         picture.size_mm, state.part.moved)  # fmt: skip
        if held != self._held:
            self._held = held
            self._show_all(picture)
        elif part is not None:
            points, levels = _drawn(picture, part)
            self._page.run_script(
                f'warpspaceMesh.bend("{packed(points)}","{packed(levels)}","{SURFACE}");'
            )
            self._behind = True

    def rest(self, picture: LivePicture) -> None:
        """Have viser hold what is drawn."""
        if self._behind:
            self._show_all(picture)

    def _show_all(self, picture: LivePicture) -> None:
        self._behind, self._part = False, (part := picture.part)
        self._show_gizmo(picture)
        if part is None:
            self._nodes.draw({})
            return
        points, levels = _drawn(picture, part)
        palette = level_colours(diverging=picture.coloured(part)[1].diverging)
        ends = part.mesh.corners.creases
        self._nodes.draw(part_shapes(picture, part, points, palette[levels]))
        lifts = packed(np.zeros((ends.size, 3), "<f4"))
        facts = {"surface": SURFACE, "count": len(points), "palette": packed(palette),
                 "lines": {EDGES: (packed(ends.astype("<u4")), lifts)}}  # fmt: skip
        self._page.run_script(f"warpspaceMesh.open({json.dumps(facts)});")

    # --- what moves it: arrows and arcs of viser, and lines of the part that go with them ---------

    def _show_gizmo(self, picture: LivePicture) -> None:
        part, gizmo = self._part, self._gizmo
        is_shown = part is not None and picture.state.part.moved
        if is_shown and gizmo is None:
            size = GIZMO_SIZE * picture.size_mm * SCENE_PER_MM
            self._gizmo = gizmo = self._scene.add_transform_controls(
                GIZMO, scale=size, depth_test=False, disable_sliders=True
            )
            gizmo.on_update(self._drag)
        if gizmo is not None:
            gizmo.visible = is_shown
        if gizmo is not None and part is not None:
            pose = part.pose
            gizmo.position = transforms.apply(pose, part.middle_mm) * SCENE_PER_MM
            gizmo.wxyz = quaternions.SO3.from_matrix(pose[:3, :3]).wxyz

    def _drag(self, event: Any) -> None:
        """Clamp the part where it is let go; viser calls it in a thread of its own."""
        part = self._part
        if event.phase == "end" and part is not None:
            turn: Any = quaternions.SO3(event.target.wxyz).as_matrix()
            at = transforms.rigid(turn, event.target.position / SCENE_PER_MM)
            drawn = at @ transforms.translation(-part.middle_mm)
            self._moved(",".join(map(repr, place_of(part, drawn))))


def _drawn(picture: LivePicture, part: PartPicture) -> tuple[Array, Any]:
    corners, (values, scale) = part.mesh.corners, picture.coloured(part)
    drawn = part.drawn_mm(picture.exaggeration).astype("<f4", copy=False)
    return drawn[corners.corner_of], colour_levels(scale, values)


def part_shapes(picture: LivePicture, part: PartPicture, points: Array, colours: Any) -> Shapes:
    """Draw a part as cut, its creases, those of the nominal one, and what is out of reach."""
    corners, ghost = part.mesh.corners, colour(picture, "ghost")
    ends = corners.corner_of[corners.creases]
    nominal, away = part.points.nominal_mm, part.points.nominal_mm[part.points.outside]
    surface = _template(Identity(corners)).fill(points, colours)
    found = {
        SURFACE: Shape("add_glb", UNLIT, {"glb_data": surface}),
        EDGES: lines(points[corners.creases], colour(picture, "edge"), 1.4),
        "/part/outside": dots(away[:: 1 + len(away) // MOST_OUTSIDE],
                              OUTSIDE_SIZE * picture.size_mm, ACCENT),
    }  # fmt: skip
    if picture.state.shown.ghost:
        found["/part/nominal"] = lines(nominal[ends], ghost, 1.2)
    if picture.state.part.moved:
        own = transforms.apply(transforms.inverse(part.pose), nominal) - part.middle_mm
        found[f"{GIZMO}/nominal"] = lines(own[ends], ghost, 1.2)
    return found


@lru_cache(maxsize=4)
def _template(corners: Identity) -> GltfTemplate:
    return GltfTemplate("part", corners.thing.triangles, len(corners.thing.corner_of))


def path_shapes(picture: LivePicture) -> Shapes:
    """Draw the path of a program, nominal and actual, and the end of the line that is asked for."""
    path = picture.path
    if path is None:
        return {}
    drawn, (values, scale) = path.drawn_mm(picture.exaggeration), picture.coloured(path)
    pieces = np.stack([path.ends - 1, path.ends], axis=1)
    linear = np.clip(level_colours(diverging=scale.diverging), 0.0, 1.0)  # viser wants lines so
    table, levels = (255.0 * linear).astype(np.uint8), colour_levels(scale, values)
    stays = {"thickness": 3.0, "thickness_units": "screen", "scale": SCENE_PER_MM}
    follows = {"points": drawn[pieces].astype(np.float32), "colors": table[levels[pieces]]}
    at = np.flatnonzero(path.line == index_of(picture.state.forms.get(AT_LINE, ""), MAX_LINES))
    return {
        "/program/nominal": lines(
            path.points.nominal_mm[pieces], colour(picture, "trace_nominal"), 1.2
        ),
        "/program/actual": Shape("add_line_segments", stays, follows) if len(pieces) else None,
        "/program/line": dots(drawn[at[-1:]], ASKED * picture.size_mm, ACCENT),
    }
