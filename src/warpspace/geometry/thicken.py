"""A volume without area as a body that can be seen: a line becomes a bar, a point a cube.

The axes that stand still get two nodes instead of one, half a thickness to either side; a bar then
has surface, grid lines and edges like any other volume.
"""

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.surfaces import Shape
from warpspace.units import Array

THICKNESS = 0.016
"""Of a bar or a cube, as a part of the length that the picture is sized by."""


def is_thin(shape: Shape) -> bool:
    """Tell whether a grid is a line or a point, so that it has no area."""
    return shape.count(1) >= 2


def thicken(points_mm: Array, thickness_mm: float) -> Array:
    """Give a line or a point of nodes a thickness.

    Parameters
    ----------
    points_mm : ndarray, [nx, ny, nz, 3], mm
        At most one of the counts is above 1.
    thickness_mm : float, mm

    Returns
    -------
    ndarray, [mx, my, mz, 3], mm
        Two nodes wherever there was one.
    """
    shape = points_mm.shape[:3]
    still = [axis for axis in range(3) if shape[axis] == 1]
    run = np.abs(points_mm[-1, -1, -1] - points_mm[0, 0, 0])
    ways = list(np.eye(3))
    if len(still) < len(shape):
        # a turned machine may have its line along another direction than its axis is named for
        along = ways.pop(int(np.argmax(run)))
        ways.insert(next(axis for axis in range(3) if shape[axis] > 1), along)
    thick = points_mm
    for axis in still:
        shift = 0.5 * thickness_mm * ways[axis]
        thick = np.concatenate([thick - shift, thick + shift], axis=axis)
    return thick


def spread(values: Array) -> Array:
    """Repeat what is known at the nodes of a line or a point, [nx, ny, nz, ...], as `thicken`."""
    for axis in range(3):
        if values.shape[axis] == 1:
            values = np.repeat(values, 2, axis=axis)
    return values


def spread_nodes(shape: Shape) -> NDArray[np.intp]:
    """Give the flat index of the grid node that each node of a thickened grid belongs to, [M]."""
    numbers = np.arange(np.prod(shape), dtype=np.intp).reshape(shape)
    for axis in range(3):
        if shape[axis] == 1:
            numbers = np.repeat(numbers, 2, axis=axis)
    return numbers.reshape(-1)
