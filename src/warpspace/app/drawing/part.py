"""The part in the box: as cut, coloured, with lines of the nominal one, and what moves it."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from viser import SceneApi
from viser import transforms as quaternions

from warpspace.app.browser.page import Page
from warpspace.app.drawing.box import packed
from warpspace.app.drawing.colours import (
    Floats,
    colour,
    colour_levels,
    level_colours,
    level_line_colours,
)
from warpspace.app.drawing.shapes import (
    SCENE_PER_MM,
    UNLIT,
    Nodes,
    Shape,
    Shapes,
    dots,
    lines,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.part import (
    AT_LINE,
    Clamped,
    PartPicture,
    PathPicture,
    place_of,
)
from warpspace.app.state.leaf import Identity
from warpspace.bodies.gltf import GltfTemplate
from warpspace.geometry.colour import ColourScale
from warpspace.kinematics import transforms
from warpspace.units import Array

SURFACE, EDGES, GIZMO = "/part/surface", "/part/edges", "/part/gizmo"
OUTSIDE = (194, 24, 91)  # points that the machine does not reach
MOST_OUTSIDE, OUTSIDE_SIZE, LINE_SIZE = 4000, 0.006, 0.015
GIZMO_SIZE = 0.3  # as a part of the longest edge of the box


class PartLayer:
    """The part as it is drawn; while only errors change, points and colours alone are sent."""

    def __init__(self, scene: SceneApi, page: Page, moved: Callable[[str], None]) -> None:
        self._scene, self._page, self._moved = scene, page, moved
        self._nodes, self._paths, self._gizmo = Nodes(scene), Nodes(scene), None
        self._has_path = False
        self._part: PartPicture | None = None
        self._held: object = None  # what viser and the page hold but for points and colours
        self._behind = False

    def show(self, picture: LivePicture) -> None:
        part, path = picture.part, picture.path
        if path is not None or self._has_path:
            self._has_path = path is not None
            self._paths.draw(path_shapes(picture, path) if path else {})
        if part is None and self._held is None:
            return
        held = part and (
            Identity(part.clamped), _scale(picture, part).diverging, picture.state.shown,
            picture.size_mm, picture.state.part.moved,
        )  # fmt: skip
        if part is None or held != self._held:
            self._held = held
            self._show_all(picture)
            return
        points, levels = _drawn(picture, part)
        self._run(f'bend("{packed(points)}","{packed(levels)}","{SURFACE}")')
        self._behind = True

    def rest(self, picture: LivePicture) -> None:
        """Have viser hold what is drawn."""
        if self._behind:
            self._show_all(picture)

    def _run(self, call: str) -> None:
        self._page.run_script(f"warpspaceMesh.{call};")

    def _show_all(self, picture: LivePicture) -> None:
        self._behind, self._part = False, (part := picture.part)
        self._show_gizmo(picture, part)
        if part is None:
            self._nodes.draw({})
            return
        points, levels = _drawn(picture, part)
        palette = level_colours(diverging=_scale(picture, part).diverging)
        self._nodes.draw(shapes(picture, part, points, palette[levels]))
        edges = packed(part.clamped.edges.astype("<u4"))
        lifts = packed(np.zeros((2 * len(part.clamped.edges), 3), "<f4"))
        facts = {"surface": SURFACE, "count": len(points), "palette": packed(palette),
                 "lines": {EDGES: (edges, lifts)}}  # fmt: skip
        self._run(f"open({json.dumps(facts)})")

    # --- what moves it ---------------------------------------------------------------------------

    def _show_gizmo(self, picture: LivePicture, part: PartPicture | None) -> None:
        if part is None or not picture.state.part.moved:
            if self._gizmo is not None:
                self._gizmo.visible = False
            return
        if self._gizmo is None:
            size = GIZMO_SIZE * picture.size_mm * SCENE_PER_MM
            self._gizmo = gizmo = self._scene.add_transform_controls(
                GIZMO, scale=size, depth_test=False, disable_sliders=True
            )

            @gizmo.on_update
            def _(event: Any) -> None:
                if event.phase == "end":
                    self._take()

        at = transforms.apply(part.clamped.pose, part.clamped.middle_mm)
        self._gizmo.position = at * SCENE_PER_MM
        turn = part.clamped.pose[:3, :3]
        self._gizmo.wxyz = quaternions.SO3.from_matrix(turn).wxyz
        self._gizmo.visible = True

    def _take(self) -> None:
        """Clamp the part where it has been moved to; viser calls it in a thread of its own."""
        part, gizmo = self._part, self._gizmo
        if part is None or gizmo is None:
            return
        turn: Array = quaternions.SO3(np.asarray(gizmo.wxyz)).as_matrix().astype(float)
        at = np.asarray(gizmo.position) / SCENE_PER_MM
        drawn = transforms.rigid(turn, at) @ transforms.translation(-part.clamped.middle_mm)
        place = place_of(transforms.inverse(part.clamped.points.pose) @ drawn)
        self._moved(",".join(map(repr, place)))


def _values(picture: LivePicture, part: PartPicture) -> Array:
    return part.values(picture.component, normal=picture.state.part.normal)


def _scale(picture: LivePicture, part: PartPicture) -> ColourScale:
    return picture.scale_of(_values(picture, part), normal=picture.state.part.normal)


def _drawn(picture: LivePicture, part: PartPicture) -> tuple[Array, Any]:
    drawn = part.drawn_mm(picture.exaggeration).astype("<f4", copy=False)
    levels = colour_levels(_scale(picture, part), _values(picture, part))
    return drawn[part.clamped.mesh.corners.corner_of], levels


def shapes(picture: LivePicture, part: PartPicture, points: Array, colours: Floats) -> Shapes:
    """Draw a part as cut, its creases, those of the nominal one, and what is out of reach."""
    clamped = part.clamped
    nominal = clamped.points.nominal_mm[clamped.mesh.corners.corner_of[clamped.edges]]
    away = clamped.points.nominal_mm[clamped.points.outside]
    found: dict[str, Shape | None] = {
        SURFACE: Shape("add_glb", UNLIT, {"glb_data": _template(Identity(clamped))
                                          .fill(points, colours)}),
        EDGES: lines(points[clamped.edges], colour(picture, "edge"), 1.4),
        "/part/outside": dots(away[:: 1 + len(away) // MOST_OUTSIDE],
                              OUTSIDE_SIZE * picture.size_mm, OUTSIDE),
    }  # fmt: skip
    if picture.state.shown.ghost:
        ghost = colour(picture, "ghost")
        found["/part/nominal"] = lines(nominal, ghost, 1.2)
        if picture.state.part.moved:  # goes with what is dragged, before the part follows
            found[f"{GIZMO}/nominal"] = lines(_own(clamped, nominal), ghost, 1.2)
    return found


def path_shapes(picture: LivePicture, path: PathPicture) -> Shapes:
    """Draw the path of a program, nominal and actual, and the end of the line that is asked for."""
    drawn, values = path.drawn_mm(picture.exaggeration), path.component_um(picture.component)
    pieces = np.stack([path.ends - 1, path.ends], axis=1)
    scale = picture.scale_of(values)
    table = level_line_colours(diverging=scale.diverging)
    actual = lines(drawn[pieces], OUTSIDE, 3.0)
    if actual is not None:
        coloured = {**actual.follows, "colors": table[colour_levels(scale, values)[pieces]]}
        actual = replace(actual, follows=coloured)
    nominal = lines(path.points.nominal_mm[pieces], colour(picture, "trace_nominal"), 1.2)
    asked = picture.state.forms.get(AT_LINE, "")
    (at,) = (path.line == int(asked if asked.isdecimal() else 0)).nonzero()
    return {
        "/program/nominal": nominal, "/program/actual": actual,
        "/program/line": dots(drawn[at[-1:]], LINE_SIZE * picture.size_mm, OUTSIDE),
    }  # fmt: skip


def _own(clamped: Clamped, points_mm: Array) -> Array:
    """Give points seen from the middle of the part, along its own axes."""
    return transforms.apply(transforms.inverse(clamped.pose), points_mm) - clamped.middle_mm


@lru_cache(maxsize=4)
def _template(clamped: Identity) -> GltfTemplate:
    found = clamped.thing.mesh.corners
    return GltfTemplate("part", found.triangles, len(found.corner_of))
