"""Triangles and points that a ray from a camera meets first."""

import numpy as np
from numpy.typing import NDArray

from warpspace.units import Array

PARALLEL = 1e-12


def pick_surface(
    origin: Array, direction: Array, vertices: Array, triangles: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array, float] | None:
    """Find the first of the triangles, [T, 3], on a ray; None where the ray misses.

    Origin and direction, [3], are in the units of the vertices, [M, 3]. Return the vertex numbers
    of the triangle, [3], the barycentric weights of the point in it, [3], and its distance along
    the ray, in lengths of the direction.
    """
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    edges = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=-1)
    edges[np.abs(np.linalg.det(edges)) < PARALLEL] = np.nan
    u, v, distance = np.linalg.solve(edges, (origin - a)[..., None])[..., 0].T
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    if not inside.any():
        return None
    at = int(np.argmin(np.where(inside, distance, np.inf)))
    return triangles[at], np.array([1.0 - u[at] - v[at], u[at], v[at]]), float(distance[at])


def pick_point(
    origin: Array, direction: Array, points: Array, tolerance: float
) -> tuple[int, float] | None:
    """Find the point, [M, 3], with the smallest angle to a ray.

    Return its index and its distance along the ray; None where the angle exceeds a tolerance, rad.
    """
    if len(points) == 0:
        return None
    unit, sight = direction / np.linalg.norm(direction), points - origin
    along = sight @ unit
    offset = np.linalg.norm(sight - along[:, None] * unit, axis=-1)
    angle = np.where(along > 0.0, np.arctan2(offset, np.maximum(along, PARALLEL)), np.inf)
    nearest = int(np.argmin(angle))
    return (nearest, float(along[nearest])) if angle[nearest] <= tolerance else None
