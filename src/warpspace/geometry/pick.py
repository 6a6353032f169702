"""Picking: where a ray from the eye meets a surface or passes a line."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.units import Array

_PARALLEL = 1e-12


@dataclass(frozen=True, slots=True)
class Hit:
    """Where a ray meets a surface.

    Attributes
    ----------
    vertices : ndarray, [3]
        Vertex numbers of the triangle.
    weights : ndarray, [3]
        Barycentric weights of the point in it; they interpolate anything given per vertex.
    distance : float
        Along the ray, in lengths of its direction.
    """

    vertices: NDArray[np.intp]
    weights: Array
    distance: float


def pick_surface(
    origin: Array, direction: Array, vertices: Array, triangles: NDArray[np.intp]
) -> Hit | None:
    """Find the first triangle that a ray meets (Möller and Trumbore, all triangles at once).

    Parameters
    ----------
    origin, direction : ndarray, [3]
        The ray, in the units of the vertices.
    vertices : ndarray, [M, 3]
    triangles : ndarray, [T, 3]
        Vertex numbers.

    Returns
    -------
    Hit or None
        None where the ray misses.
    """
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    first, second = b - a, c - a
    across = np.cross(direction, second)
    determinant = np.sum(first * across, axis=-1)
    safe = np.where(np.abs(determinant) < _PARALLEL, np.inf, determinant)
    from_a = origin - a
    u = np.sum(from_a * across, axis=-1) / safe
    turned = np.cross(from_a, first)
    v = np.sum(direction * turned, axis=-1) / safe
    distance = np.sum(second * turned, axis=-1) / safe
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0) & np.isfinite(safe)
    if not inside.any():
        return None
    at = int(np.argmin(np.where(inside, distance, np.inf)))
    weights = np.array([1.0 - u[at] - v[at], u[at], v[at]])
    return Hit(triangles[at], weights, float(distance[at]))


def pick_point(
    origin: Array, direction: Array, points: Array, tolerance: float
) -> tuple[int, float] | None:
    """Find the point that a ray passes most closely, seen from its origin.

    Parameters
    ----------
    origin, direction : ndarray, [3]
        The ray.
    points : ndarray, [M, 3]
    tolerance : float
        Largest angle between the ray and the line of sight to the point, rad.

    Returns
    -------
    tuple of (int, float) or None
        Number of the point and its distance along the ray; None where none is near.
    """
    if len(points) == 0:
        return None
    unit = direction / np.linalg.norm(direction)
    sight = points - origin
    along = sight @ unit
    aside = np.linalg.norm(sight - along[:, None] * unit, axis=-1)
    angle = np.where(along > 0.0, np.arctan2(aside, np.maximum(along, _PARALLEL)), np.inf)
    nearest = int(np.argmin(angle))
    return (nearest, float(along[nearest])) if angle[nearest] <= tolerance else None
