"""The bent box: coloured surface, grid lines and edges on it, and the nominal box around it."""

import json
from base64 import b64encode
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.browser.page import Page
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.app.viewport.tone_map import Rgb, colour_levels, level_colours, vertex_colours
from warpspace.bodies.gltf import GltfTemplate
from warpspace.geometry.surfaces import box_edges, is_thin
from warpspace.picture.mesh import (
    Pieces,
    edge_pieces,
    grid_pieces,
    isoline_pieces,
    line_mesh,
    map_mesh,
    outline_pieces,
)
from warpspace.units import Array

SURFACE = "/box/surface"
DASH, GAP = 0.022, 0.014
"""Dash and gap of the nominal box, as parts of the longest edge."""
LIGHT_ISOLINE: Rgb = (226, 230, 236)
DARK_ISOLINE: Rgb = (60, 68, 80)


def dashes(points: Array, dash: float, gap: float) -> NDArray[np.float32]:
    """Cut straight lines into dashes."""
    parts: list[Array] = []
    for start, end in points:
        length = float(np.linalg.norm(end - start))
        if length == 0.0:
            continue
        count = max(1, round((length + gap) / (dash + gap)))
        period = (length + gap) / count
        begin = np.arange(count) * period / length
        ends = np.minimum(begin + (period - gap) / length, 1.0)
        at = np.stack([begin, ends], axis=1)[..., None]
        parts.append(start + at * (end - start))
    return np.concatenate(parts).astype(np.float32) if parts else np.zeros((0, 2, 3), np.float32)


def ghost_dashes(picture: LivePicture) -> NDArray[np.float32]:
    """Dash the edges of the nominal box, [S, 2, 3], mm."""
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    edges = np.array(
        [(nominal[edge[0]], nominal[edge[-1]]) for edge in box_edges(picture.grid.shape)]
    )
    longest = picture.size_mm
    return dashes(edges.reshape(-1, 2, 3), DASH * longest, GAP * longest)


def surface_glb(picture: LivePicture) -> bytes:
    """Write the coloured map of a picture, or its lines alone, vertices in mm."""
    mesh = line_mesh(picture) if picture.state.look.surface == "grid" else map_mesh(picture)
    colours = vertex_colours(picture.scale, mesh.values)
    return _template(Identity(mesh.triangles), len(mesh.vertices_mm)).fill(
        mesh.vertices_mm, colours
    )


@lru_cache(maxsize=32)
def _template(triangles: Identity, count: int) -> GltfTemplate:
    return GltfTemplate("surface", triangles.thing, count)


class BoxLayer:
    """Surface, lines and ghost.

    While only errors change, points and colours alone are sent (`browser/mesh.js`); what viser
    holds follows with `rest`.
    """

    def __init__(self, scene: SceneApi, picture: LivePicture, page: Page | None = None) -> None:
        self._nominal: Array | None = None
        self._page = page
        self._full: LivePicture | None = None  # the picture that viser holds
        self._opened: tuple[object, ...] = ()
        self._behind = False
        self._surface = Handle(
            scene.add_glb(
                SURFACE,
                surface_glb(picture),
                scale=SCENE_PER_MM,
                cast_shadow=False,
                receive_shadow=False,
            )
        )
        self._grid, self._edges, self._isolines, self._ghost = (
            add_lines(scene, name, palette(picture).edge, thickness, visible=False)
            for name, thickness in (
                ("/box/grid", 0.7),
                ("/box/edges", 1.8),
                ("/box/isolines", 1.4),
                ("/ghost", 1.5),
            )
        )
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Move vertices, colours and lines."""
        if self._page is None or self._full is None or not only_bent(self._full, picture):
            self._show_all(picture)
            return
        mesh, grid = map_mesh(picture), picture.grid
        scale, shape = picture.scale, Identity(mesh.triangles)
        opened = (shape, scale.diverging, Identity(grid.nominal_mm))
        if opened != self._opened:
            self._opened = opened
            self._page.run_script(_open_script(picture, mesh.vertices_mm))
        points = packed(mesh.vertices_mm.astype("<f4"))
        self._page.run_script(
            f'warpspaceMesh.bend("{points}","{packed(colour_levels(scale, mesh.values))}");'
        )
        self._behind = True

    def rest(self, picture: LivePicture) -> None:
        """Have viser hold what is drawn."""
        if self._behind:
            self._show_all(picture)

    def _show_all(self, picture: LivePicture) -> None:
        self._full, self._behind = picture, False
        colours, look = palette(picture), picture.state.look
        on_map, isolines = look.surface != "grid", look.isolines or look.pass_fail
        self._surface.put(glb_data=surface_glb(picture))
        lines: tuple[tuple[Handle, Rgb, bool, Callable[[LivePicture], Pieces]], ...] = (
            (self._grid, colours.grid, picture.state.shown.grid_lines, grid_pieces),
            (self._edges, colours.edge, True, edge_pieces),
            (self._isolines, isoline_colour(picture), isolines, isoline_pieces),
        )
        for handle, colour, wanted, pieces in lines:
            if on_map and wanted:
                handle.put(points=pieces(picture))
            handle.put(colors=colour_bytes(colour), visible=on_map and wanted)
        if picture.grid.nominal_mm is not self._nominal:
            self._nominal = picture.grid.nominal_mm
            self._ghost.put(points=ghost_dashes(picture))
        self._ghost.put(colors=colour_bytes(colours.ghost), visible=picture.state.shown.ghost)


def only_bent(held: LivePicture, picture: LivePicture) -> bool:
    """Tell whether pictures differ in points and colours of the surface alone."""
    before, after = held.state, picture.state
    return (
        not (picture.slices or held.slices or is_thin(picture.shape))
        and picture.compared is None and held.compared is None
        and picture.grid.nominal_mm is held.grid.nominal_mm
        and after.look == before.look and after.shown == before.shown
        and not after.look.isolines and not after.look.pass_fail
        and after.look.surface in ("surface", "cut")
        and palette(picture) == palette(held)
    )  # fmt: skip


def _open_script(picture: LivePicture, vertices_mm: Array) -> str:
    """Write the script that tells a page which points its lines end at, and the colours."""
    nodes, of = picture.drawn_mm.reshape(-1, 3), picture.topology
    number = np.zeros(len(nodes), "<u4")
    number[of.surface.nodes] = np.arange(len(of.surface.nodes))
    lines: dict[str, tuple[str, str]] = {}
    for name, segments, ends in (
        ("/box/grid", of.grid_segments, grid_pieces(picture)),
        ("/box/edges", of.edge_segments, edge_pieces(picture)),
    ):
        points = number[segments]
        lifts = ends.reshape(-1, 3) - vertices_mm[points.reshape(-1)]
        lines[name] = (packed(points), packed(lifts.astype("<f4")))
    colours = packed(level_colours(diverging=picture.scale.diverging))
    facts = {"count": len(vertices_mm), "palette": colours, "lines": lines}
    return f"warpspaceMesh.open({json.dumps(facts)});"


def packed(values: NDArray[Any]) -> str:
    """Spell numbers as they lie in memory, for a script."""
    return b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def isoline_colour(picture: LivePicture) -> Rgb:
    """Choose a line that is seen on every colour of the scale."""
    return DARK_ISOLINE if picture.scale.diverging else LIGHT_ISOLINE


# --- Wireframe of the side of a comparison that is not drawn --------------------------------------


class OtherSideLayer:
    """Edges and grid lines of the other bent box, every second piece: dotted."""

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._edges = add_lines(scene, "/compare/other", palette(picture).edge, 2.0, visible=False)
        self.show(picture)

    def show(self, picture: LivePicture) -> None:
        """Follow the other side."""
        other = None if picture.compared is None else picture.compared.other_mm
        if other is None or not picture.state.comparison.ghost:
            self._edges.put(visible=False)
            return
        self._edges.put(
            points=outline_pieces(picture, other)[::2],
            colors=colour_bytes(palette(picture).edge),
            visible=True,
        )
