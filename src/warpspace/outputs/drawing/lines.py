"""Lines of a picture: hidden parts are found by the depth buffer."""

from itertools import pairwise

import numpy as np

from warpspace.outputs.drawing.projection import Projection
from warpspace.outputs.drawing.render import Raster
from warpspace.units import Array

STEP_PX = 1.5
SHORTEST_PX = 4.0


def split_visible(
    line_mm: Array, projection: Projection, raster: Raster | None
) -> tuple[list[Array], list[Array]]:
    """Split a polyline into its visible and its hidden parts.

    Parameters
    ----------
    line_mm : ndarray, [n, 3], mm
    projection : Projection
    raster : Raster or None
        The bodies that may hide it; None hides nothing.

    Returns
    -------
    tuple of (list of ndarray, list of ndarray), [m, 2], px
        Visible and hidden polylines.
    """
    spots = projection.project(line_mm)
    if raster is None:
        return [spots], []
    fine_px, fine_depth = _resample(spots, projection.depth_mm(line_mm), STEP_PX)
    surface = raster.depth_at(fine_px, spread=True)
    tolerance = 1.5 / projection.px_per_mm
    visible = _steady(fine_depth <= surface + tolerance, round(SHORTEST_PX / STEP_PX))
    changes = np.flatnonzero(np.diff(visible)) + 1
    seen: list[Array] = []
    hidden: list[Array] = []
    bounds = [0, *changes.tolist(), len(visible)]
    for start, end in pairwise(bounds):
        part = fine_px[start : min(end + 1, len(visible))]
        if len(part) > 1:
            (seen if visible[start] else hidden).append(_thin(part))
    return seen, hidden


def _resample(spots: Array, depth: Array, step: float) -> tuple[Array, Array]:
    """Lay points along a polyline a step apart; every given point stays."""
    lengths = np.hypot(*np.diff(spots, axis=0).T)
    pieces = np.maximum(1, np.ceil(lengths / step)).astype(int)
    # position along the polyline, in numbers of its points
    along = np.concatenate([[0.0], np.cumsum(np.repeat(1.0 / pieces, pieces))])
    known = np.arange(len(spots))
    fine = np.stack([np.interp(along, known, spots[:, axis]) for axis in range(2)], -1)
    return fine, np.interp(along, known, depth)


def _thin(spots: Array) -> Array:
    """Drop the points of a polyline that lie straight between others."""
    if len(spots) < 3:
        return spots
    before, after = spots[1:-1] - spots[:-2], spots[2:] - spots[1:-1]
    turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    bent = turn > 1e-6 * np.hypot(*before.T) * np.hypot(*after.T)
    return spots[np.concatenate([[True], bent, [True]])]


def _steady(visible: np.ndarray, shortest: int) -> np.ndarray:
    """Take away runs too short to be meant (rounding of the depth at silhouettes)."""
    result = visible.copy()
    edges = [0, *(np.flatnonzero(np.diff(visible)) + 1).tolist(), len(visible)]
    for start, end in pairwise(edges):
        inner = start > 0 and end < len(visible)
        if inner and end - start < shortest:
            result[start:end] = not visible[start]
    return result
