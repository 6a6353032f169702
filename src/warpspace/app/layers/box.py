"""The bent box: coloured surface, grid lines and edges on it, and the nominal box around it."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.glb import build_glb
from warpspace.app.layers import SCENE_PER_MM, colour_bytes, palette, pieces
from warpspace.app.live import Frame
from warpspace.app.tonemap import vertex_colours
from warpspace.geometry.surfaces import box_edges
from warpspace.units import Array

SURFACE = "/box/surface"
LIFT = 0.0012
"""How far lines are lifted off the surface, as a part of the longest edge."""
DASH, GAP = 0.022, 0.014
"""Dash and gap of the nominal box, as parts of the longest edge."""


def surface_glb(frame: Frame) -> bytes:
    """Write the coloured surface of a frame, vertices in mm."""
    surface = frame.topology.surface
    values = frame.values.reshape(-1)[surface.nodes]
    vertices = frame.drawn_mm.reshape(-1, 3)[surface.nodes]
    return build_glb(vertices, surface.triangles, vertex_colours(frame.scale, values))


def lifted_mm(frame: Frame, times: float = 1.0) -> Array:
    """Give the displaced nodes a little outside the surface, [N, 3], mm."""
    lift = LIFT * frame.grid.longest_edge_mm * times
    return frame.drawn_mm.reshape(-1, 3) + lift * frame.topology.outwards


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
            pieces(lifted_mm(frame), frame.topology.grid_segments),
            colour_bytes(colours.grid),
            thickness=0.7,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._edges = scene.add_line_segments(
            "/box/edges",
            pieces(lifted_mm(frame, 1.5), frame.topology.edge_segments),
            colour_bytes(colours.edge),
            thickness=1.8,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )
        self._ghost = scene.add_line_segments(
            "/ghost",
            ghost_dashes(frame),
            colour_bytes(colours.ghost),
            thickness=1.5,
            thickness_units="screen",
            scale=SCENE_PER_MM,
        )

    def show(self, frame: Frame) -> None:
        """Move vertices, colours and lines."""
        colours, shown = palette(frame), frame.state.shown
        self._surface.glb_data = surface_glb(frame)
        self._grid.visible = shown.grid_lines
        if shown.grid_lines:
            self._grid.points = pieces(lifted_mm(frame), frame.topology.grid_segments)
        self._edges.points = pieces(lifted_mm(frame, 1.5), frame.topology.edge_segments)
        self._ghost.visible = shown.ghost
        if frame.grid.nominal_mm is not self._nominal:
            self._nominal = frame.grid.nominal_mm
            self._ghost.points = ghost_dashes(frame)
        for handle, rgb in (
            (self._grid, colours.grid),
            (self._edges, colours.edge),
            (self._ghost, colours.ghost),
        ):
            handle.colors = colour_bytes(rgb)
