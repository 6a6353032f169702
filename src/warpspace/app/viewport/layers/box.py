"""The bent box: coloured surface, grid lines and edges on it, and the nominal box around it."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.viewport.drafts import BoxPicture, box_picture, surface_glb
from warpspace.app.viewport.layers import SCENE_PER_MM, colour_bytes
from warpspace.app.viewport.layers.adding import add_lines
from warpspace.app.viewport.tone_map import Rgb
from warpspace.geometry.surfaces import box_edges
from warpspace.units import Array

SURFACE = "/box/surface"
DASH, GAP = 0.022, 0.014
"""Dash and gap of the nominal box, as parts of the longest edge."""
LIGHT_ISOLINE: Rgb = (226, 230, 236)
DARK_ISOLINE: Rgb = (60, 68, 80)


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


def ghost_dashes(picture: LivePicture) -> NDArray[np.float32]:
    """Dash the edges of the nominal box, [S, 2, 3], mm."""
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    edges = np.array(
        [(nominal[edge[0]], nominal[edge[-1]]) for edge in box_edges(picture.grid.shape)]
    )
    longest = picture.grid.longest_edge_mm
    return dashes(edges.reshape(-1, 2, 3), DASH * longest, GAP * longest)


class BoxLayer:
    """Surface, lines and ghost.

    Parameters
    ----------
    scene : viser.SceneApi
    picture : LivePicture
    """

    def __init__(self, scene: SceneApi, picture: LivePicture) -> None:
        self._nominal: Array | None = None
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
        colours = palette(picture)
        self.move(box_picture(picture))
        self._grid.put(colors=colour_bytes(colours.grid))
        self._edges.put(colors=colour_bytes(colours.edge))
        self._isolines.put(colors=colour_bytes(isoline_colour(picture)))
        if picture.grid.nominal_mm is not self._nominal:
            self._nominal = picture.grid.nominal_mm
            self._ghost.put(points=ghost_dashes(picture))
        self._ghost.put(colors=colour_bytes(colours.ghost), visible=picture.state.shown.ghost)

    def move(self, picture: BoxPicture) -> None:
        """Move the map and the lines on it; their colours stay."""
        self._surface.put(glb_data=picture.surface)
        for lines, points in (
            (self._grid, picture.grid),
            (self._edges, picture.edges),
            (self._isolines, picture.isolines),
        ):
            if points is not None:
                lines.put(points=points)
            lines.put(visible=points is not None)


def isoline_colour(picture: LivePicture) -> Rgb:
    """Choose a line that is seen on every colour of the scale."""
    return DARK_ISOLINE if picture.scale.diverging else LIGHT_ISOLINE
