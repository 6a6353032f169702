"""Arrows as triangles, so that they have the same size and look in every renderer."""

import numpy as np
from numpy.typing import NDArray

from warpspace.units import Array

SIDES = 10
_HEAD_PART = 0.7
"""Longest head, as a part of the arrow."""


def _across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to each other and to unit vectors, [n, 3] each."""
    helper = np.eye(3)[np.argmin(np.abs(direction), axis=-1)]
    sideways: Array = np.cross(direction, helper)
    first: Array = sideways / np.linalg.norm(sideways, axis=-1, keepdims=True)
    second: Array = np.cross(direction, first)
    return first, second


def build_arrows(
    start_mm: Array, end_mm: Array, radius_mm: float, head_mm: float
) -> tuple[Array, NDArray[np.intp]]:
    """Build arrows with a round shaft and a conical head.

    Parameters
    ----------
    start_mm, end_mm : ndarray, [n, 3], mm
    radius_mm : float, mm
        Of the shaft; the head is three times as wide.
    head_mm : float, mm
        Length of the head; short arrows get a smaller one of the same shape.

    Returns
    -------
    vertices_mm : ndarray, [n·(3·10 + 2), 3], mm
        An arrow without length shrinks to a point.
    triangles : ndarray, [T, 3]
        Counter-clockwise seen from outside; the same for every place of the arrows.
    """
    vector = end_mm - start_mm
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = np.where(
        length > 0.0, vector / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0)
    )
    first, second = _across(direction)
    head = np.minimum(head_mm, _HEAD_PART * length)
    size = head / head_mm
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = (
        np.cos(turn)[:, None] * first[:, None, :] + np.sin(turn)[:, None] * second[:, None, :]
    ) * (radius_mm * size)[:, None, :]
    neck = (end_mm - head * direction)[:, None, :]
    rings = [start_mm[:, None, :] + ring, neck + ring, neck + 3.0 * ring]
    vertices = np.concatenate([*rings, start_mm[:, None, :], end_mm[:, None, :]], axis=1)
    one = _triangles()
    count = 3 * SIDES + 2
    offsets = count * np.arange(len(start_mm))[:, None, None]
    return vertices.reshape(-1, 3), (one + offsets).reshape(-1, 3)


def _triangles() -> NDArray[np.intp]:
    """Triangles of one arrow."""
    here = np.arange(SIDES)
    there = (here + 1) % SIDES
    foot, tip = 3 * SIDES, 3 * SIDES + 1
    parts = [np.stack([np.full(SIDES, foot), there, here], -1)]
    for low in (0, SIDES):
        high = low + SIDES
        parts.append(np.stack([low + here, low + there, high + there], -1))
        parts.append(np.stack([low + here, high + there, high + here], -1))
    parts.append(np.stack([2 * SIDES + here, 2 * SIDES + there, np.full(SIDES, tip)], -1))
    return np.concatenate(parts)
