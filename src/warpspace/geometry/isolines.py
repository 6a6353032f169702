"""Lines of equal value on the drawn faces of a grid."""

from collections.abc import Sequence

import contourpy
import numpy as np

from warpspace.geometry.colour import ColourScale
from warpspace.geometry.surfaces import Index
from warpspace.units import Array


def isoline_levels(scale: ColourScale) -> tuple[float, ...]:
    """Give the values that lines are drawn at: the ticks of the scale, its ends left out."""
    return tuple(tick for tick in scale.ticks if scale.low < tick < scale.high)


def isolines(
    face: Index, nodes_mm: Array, values: Array, levels: Sequence[float]
) -> list[tuple[float, Array]]:
    """Find the lines of equal value on a patch of the surface.

    Parameters
    ----------
    face : ndarray of int, [a, b]
        Flat grid indices.
    nodes_mm : ndarray, [N, 3], mm
        All nodes where they are drawn.
    values : ndarray, [N]
    levels : sequence of float
        In the unit of the values.

    Returns
    -------
    list of (float, ndarray), [n, 3], mm
        Level and polyline.

    Notes
    -----
    Marching squares on the values at the nodes, straight within a cell.
    """
    at_nodes = values[face]
    low, high = float(at_nodes.min()), float(at_nodes.max())
    inside = [level for level in levels if low <= level <= high]
    if not inside or low == high:
        return []
    generator = contourpy.contour_generator(z=at_nodes, name="serial")
    corners = nodes_mm[face]
    found: list[tuple[float, Array]] = []
    for level in inside:
        for line in generator.lines(level):
            at = np.asarray(line, dtype=float)
            if len(at) > 1:
                found.append((level, _bilinear(corners, at[:, 1], at[:, 0])))
    return found


def isoline_segments(
    faces: Sequence[Index],
    nodes_mm: Array,
    values: Array,
    levels: Sequence[float],
    lift_mm: Array | None = None,
) -> Array:
    """Find the lines of equal value on all faces, as pieces of line.

    Parameters
    ----------
    faces : sequence of ndarray of int, [a, b]
    nodes_mm : ndarray, [N, 3], mm
    values : ndarray, [N]
    levels : sequence of float
    lift_mm : ndarray, [F, 3], mm, optional
        Per face, how far its lines are moved off it.

    Returns
    -------
    ndarray, [S, 2, 3], mm
    """
    pieces: list[Array] = []
    for number, face in enumerate(faces):
        off = np.zeros(3) if lift_mm is None else lift_mm[number]
        for _, line in isolines(face, nodes_mm, values, levels):
            pieces.append(np.stack([line[:-1], line[1:]], axis=1) + off)
    return np.concatenate(pieces) if pieces else np.zeros((0, 2, 3))


def _bilinear(corners: Array, row: Array, column: Array) -> Array:
    """Interpolate a patch of points at fractional rows and columns, [n, 3]."""
    i = np.clip(np.floor(row).astype(int), 0, corners.shape[0] - 2)
    j = np.clip(np.floor(column).astype(int), 0, corners.shape[1] - 2)
    u, v = (row - i)[:, None], (column - j)[:, None]
    near = (1.0 - v) * corners[i, j] + v * corners[i, j + 1]
    far = (1.0 - v) * corners[i + 1, j] + v * corners[i + 1, j + 1]
    return (1.0 - u) * near + u * far
