"""The bent box: coloured surface, grid lines and edges on it, and the nominal box around it."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.glb import build_glb
from warpspace.app.layers import SCENE_PER_MM, colour_bytes, palette
from warpspace.app.live import Frame
from warpspace.app.mapmesh import (
    edge_pieces,
    grid_pieces,
    isoline_pieces,
    line_mesh,
    map_mesh,
)
from warpspace.app.tonemap import Rgb, vertex_colours
from warpspace.geometry.surfaces import box_edges
from warpspace.units import Array

SURFACE = "/box/surface"
DASH, GAP = 0.022, 0.014
"""Dash and gap of the nominal box, as parts of the longest edge."""
LIGHT_ISOLINE: Rgb = (226, 230, 236)
DARK_ISOLINE: Rgb = (60, 68, 80)


def surface_glb(frame: Frame) -> bytes:
    """Write the coloured map of a frame, or its lines alone, vertices in mm."""
    mesh = line_mesh(frame) if frame.state.look.surface == "grid" else map_mesh(frame)
    return build_glb(mesh.vertices_mm, mesh.triangles, vertex_colours(frame.scale, mesh.values))


def dashes(points: Array, dash: float, gap: float) -> NDArray[np.float32]:
    """Cut straight lines into dashes.

    Parameters
    ----------
    points : ndarray, [L, 2, 3]
        Ends of the lines.
    dash, gap : float
        Lengths, fitted so that each line begins and ends with a dash.

    Returns
    -------
    ndarray of float32, [S, 2, 3]
    """
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


def ghost_dashes(frame: Frame) -> NDArray[np.float32]:
    """Dash the edges of the nominal box, [S, 2, 3], mm."""
    nominal = frame.grid.nominal_mm.reshape(-1, 3)
    edges = np.array(
        [(nominal[edge[0]], nominal[edge[-1]]) for edge in box_edges(frame.grid.shape)]
    )
    longest = frame.grid.longest_edge_mm
    return dashes(edges.reshape(-1, 2, 3), DASH * longest, GAP * longest)


class BoxLayer:
    """Surface, lines and ghost.

    Parameters
    ----------
    scene : viser.SceneApi
    frame : Frame
    """

    def __init__(self, scene: SceneApi, frame: Frame) -> None:
        colours = palette(frame)
        self._nominal: Array | None = frame.grid.nominal_mm
        self._surface = scene.add_glb(
            SURFACE, surface_glb(frame), scale=SCENE_PER_MM, cast_shadow=False, receive_shadow=False
        )
        self._grid = scene.add_line_segments(
            "/box/grid",
            grid_pieces(frame),
            colour_bytes(colours.grid),
            thickness=0.7,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._edges = scene.add_line_segments(
            "/box/edges",
            edge_pieces(frame),
            colour_bytes(colours.edge),
            thickness=1.8,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._isolines = scene.add_line_segments(
            "/box/isolines",
            np.zeros((1, 2, 3), np.float32),
            colour_bytes(isoline_colour(frame)),
            thickness=1.4,
            thickness_units="screen",
            scale=SCENE_PER_MM,
            visible=False,
        )
        self._ghost = scene.add_line_segments(
            "/ghost",
            ghost_dashes(frame),
            colour_bytes(colours.ghost),
            thickness=1.5,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )

        self.show(frame)

    def show(self, frame: Frame) -> None:
        """Move vertices, colours and lines."""
        colours, shown, look = palette(frame), frame.state.shown, frame.state.look
        lines_only = look.surface == "grid"
        self._surface.glb_data = surface_glb(frame)
        self._show_lines(frame, lines_only=lines_only)
        self._isolines.visible = look.isolines and not lines_only
        if self._isolines.visible:
            self._isolines.points = isoline_pieces(frame)
            self._isolines.colors = colour_bytes(isoline_colour(frame))
        self._ghost.visible = shown.ghost
        if frame.grid.nominal_mm is not self._nominal:
            self._nominal = frame.grid.nominal_mm
            self._ghost.points = ghost_dashes(frame)
        self._ghost.colors = colour_bytes(colours.ghost)

    def _show_lines(self, frame: Frame, *, lines_only: bool) -> None:
        """Draw grid lines and edges on the map, unless they are the map."""
        colours = palette(frame)
        self._edges.visible = not lines_only
        self._grid.visible = frame.state.shown.grid_lines and not lines_only
        if self._grid.visible:
            self._grid.points = grid_pieces(frame)
            self._grid.colors = colour_bytes(colours.grid)
        if self._edges.visible:
            self._edges.points = edge_pieces(frame)
            self._edges.colors = colour_bytes(colours.edge)


def isoline_colour(frame: Frame) -> Rgb:
    """Choose a line that is seen on every colour of the scale."""
    return DARK_ISOLINE if frame.scale.diverging else LIGHT_ISOLINE
