"""Drawing of the deformed box: coloured surface, grid lines and edges, and the nominal box."""

import json
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.page import Page
from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.drawing.colours import (
    COLOURS,
    Rgb,
    colour,
    colour_levels,
    inverse_tone_map,
    level_colours,
)
from warpspace.app.drawing.shapes import UNLIT, Nodes, SceneNode, Shapes, dashes, lines
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.leaf import Identity
from warpspace.bodies.gltf import GltfNode, build_gltf
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.surfaces import box_edges, is_thin
from warpspace.picture import map_mesh
from warpspace.units import Array

SURFACE = "/box/surface"
FADED = 0.85  # share of grey in a faded colour
DASH, GAP = 0.022, 0.014
"""Dash and gap of the nominal box, relative to its longest edge."""
LIMIT_NODES = ("/limit/line", "/limit/hatching")
LIMIT: Rgb = (179, 38, 30)  # as the mark of the colour bar
COINCIDENT = 1e-3  # largest displacement, likewise relative, at which the boxes coincide
ISOLINES: tuple[Rgb, Rgb] = ((226, 230, 236), (60, 68, 80))
"""Contrast with all colours of a sequential scale, and of a diverging one."""


def ghost_dashes(picture: LivePicture) -> Array:
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    edges = [(nominal[edge[0]], nominal[edge[-1]]) for edge in box_edges(picture.grid.shape)]
    return dashes(np.array(edges).reshape(-1, 2, 3), DASH * picture.size_mm, GAP * picture.size_mm)


def surface(picture: LivePicture) -> SceneNode:
    has_lines, without_part = picture.state.look.surface == "grid", picture.state.part.is_empty
    # grid lines would hide a part
    build = partial(map_mesh.line_mesh, grid=without_part) if has_lines else map_mesh.map_mesh
    mesh = build(picture)
    return coloured_shape(mesh.vertices_mm, mesh.triangles, mesh.values, picture.scale, mesh.faded)


def coloured_shape(
    points: Array,
    indices: NDArray[Any],
    values: Array,
    scale: ColourScale,
    faded: NDArray[np.bool_] | None = None,
) -> SceneNode:
    """Draw a surface or lines, points in mm, coloured by the values at the points.

    Faded colours are close to the grey of the nominal box.
    """
    colours = level_colours(diverging=scale.diverging)[colour_levels(scale, values)]
    if faded is not None:
        grey = inverse_tone_map(np.array(COLOURS["ghost"][0], dtype=np.uint8))
        colours[faded] = FADED * grey + (1.0 - FADED) * colours[faded]
    data = build_gltf([GltfNode("surface", points, indices, colours=colours)])
    return SceneNode("add_glb", UNLIT, {"glb_data": data})


def box(picture: LivePicture) -> Shapes:
    look, options = picture.state.look, picture.state.shown
    if picture.is_rotary:
        return {}
    shapes: dict[str, SceneNode | None] = {SURFACE: surface(picture)}
    if look.surface != "grid":
        shapes["/box/edges"] = lines(map_mesh.edge_pieces(picture), colour(picture, "edge"), 1.8)
        if options.grid_lines:
            shapes["/box/grid"] = lines(map_mesh.grid_pieces(picture), colour(picture, "grid"), 0.7)
        if look.isolines or look.pass_fail:
            rgb = ISOLINES[picture.scale.diverging]
            shapes["/box/isolines"] = lines(map_mesh.isoline_pieces(picture), rgb, 1.4)
    if _has_ghost(picture):
        shapes["/ghost"] = lines(ghost_dashes(picture), colour(picture, "ghost"), 1.5)
    return shapes


def limit_shapes(picture: LivePicture) -> Shapes:
    """Draw the line at the limit, and the hatching of the surface above it."""
    limit = picture.hatch_um
    if limit is None or picture.state.look.surface == "grid" or picture.is_rotary:
        return {}
    line, hatching = map_mesh.limit_pieces(picture, limit)
    drawn = lines(line, LIMIT, 2.6), lines(hatching, LIMIT, 1.0)
    return dict(zip(LIMIT_NODES, drawn, strict=True))


def _has_ghost(picture: LivePicture) -> bool:
    """Check if the nominal box is drawn: not where it coincides with the actual one."""
    drawn, nominal = (at.reshape(-1, 3) for at in (picture.drawn_mm, picture.grid.nominal_mm))
    worst = picture.worst_node  # mostly suffices
    return picture.state.shown.ghost and any(
        float(np.abs(drawn[nodes] - nominal[nodes]).max()) > COINCIDENT * picture.size_mm
        for nodes in (slice(worst, worst + 1), slice(None))
    )


class BoxLayer:
    """The box in the drawing.

    While only errors change, only points and colours are sent (`browser/mesh.js`); the
    nodes of viser are updated, and the limit is drawn, by `synchronise`.
    """

    def __init__(self, scene: SceneApi, page: Page, picture: LivePicture) -> None:
        self._page, self._nodes = page, Nodes(scene)
        self._opened: tuple[object, ...] = ()
        self._show_all(picture)

    def show(self, picture: LivePicture) -> None:
        if not only_bent(self._full, picture):
            self._show_all(picture, settled=False)
            return
        self._nodes.hide(LIMIT_NODES)
        mesh, scale = map_mesh.map_mesh(picture), picture.scale
        opened = Identity(mesh.triangles), scale.diverging, Identity(picture.grid.nominal_mm)
        if opened != self._opened:
            self._opened = opened
            colours = packed(level_colours(diverging=scale.diverging))
            facts = {"palette": colours, **line_facts(picture, mesh.vertices_mm)}
            self._page.run_script(f"warpspaceMesh.open({json.dumps(facts)});")
        points = packed(mesh.vertices_mm.astype("<f4"))
        self._page.run_script(
            f'warpspaceMesh.bend("{points}","{packed(colour_levels(scale, mesh.values))}");'
        )
        self._behind = True

    def synchronise(self, picture: LivePicture) -> None:
        if self._behind:
            self._show_all(picture)

    def _show_all(self, picture: LivePicture, *, settled: bool = True) -> None:
        # of viser's nodes; the limit is too slow to follow a drag
        self._full, self._behind = picture, not settled and picture.hatch_um is not None
        self._nodes.draw({**box(picture), **(limit_shapes(picture) if settled else {})})


def only_bent(drawn: LivePicture, picture: LivePicture) -> bool:
    """Return whether pictures differ in points and colours of the surface only."""
    before, after = drawn.state, picture.state
    return (
        not (picture.slices or drawn.slices or is_thin(picture.shape))
        and picture.compared is None and drawn.compared is None
        and picture.grid.nominal_mm is drawn.grid.nominal_mm
        and after.look == before.look and after.shown == before.shown
        and _has_ghost(drawn) is _has_ghost(picture)
        and not after.look.isolines and not after.look.pass_fail and picture.faded is None
        and after.look.surface in ("surface", "cut") and not picture.is_rotary
    )  # fmt: skip


def rise_script(picture: LivePicture, views: Sequence[CameraMemory]) -> str:
    """Build the script in which a box grows from true scale, `rise` of `mesh.js`.

    Meanwhile the camera moves from the first view to the second.
    """
    flight = json.dumps([asdict(view) for view in views])
    if not only_bent(picture, picture):
        return f"warpspaceMesh.rise({flight});"
    drawn, flat = (map_mesh.map_mesh(of) for of in (picture, replace(picture, exaggeration=1.0)))
    lines = line_facts(picture, drawn.vertices_mm)["lines"]
    nominal = packed(flat.vertices_mm.astype("<f4"))
    return f'warpspaceMesh.rise({flight},"{nominal}",{json.dumps(lines)});'


def line_facts(picture: LivePicture, vertices_mm: Array) -> dict[str, object]:
    """Return the end points of the lines of a box, and their lifts, for `mesh.js`."""
    of = map_mesh.map_parts(picture)[0].drawn_of
    number = np.zeros(of.surface.nodes.max() + 1, "<u4")
    number[of.surface.nodes] = np.arange(len(of.surface.nodes))
    lines: dict[str, tuple[str, str]] = {}
    for name, segments, ends in (
        ("/box/grid", of.grid_segments, map_mesh.grid_pieces(picture)),
        ("/box/edges", of.edge_segments, map_mesh.edge_pieces(picture)),
    ):
        points = number[segments]
        lifts = ends.reshape(-1, 3) - vertices_mm[points.reshape(-1)]
        lines[name] = (packed(points), packed(lifts.astype("<f4")))
    return {"count": len(vertices_mm), "lines": lines}


def packed(values: NDArray[Any]) -> str:
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")
