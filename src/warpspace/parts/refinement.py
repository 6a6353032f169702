"""Evaluation points of a workpiece: its mesh, refined where its triangles are large or bend.

Best fits and statistics weight each vertex by its share of the surface area. Triangles are halved
at their longest edge until the shares represent the surface and errors are linear along all edges,
so that results do not depend on the tessellation.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.machine.limits import MAX_REFINED_VERTICES
from warpspace.parts.workpiece import (
    Workpiece,
    evaluate_points,
    measure_triangles,
    place_workpiece,
    subtract_best_fit,
)
from warpspace.scene.model import Scene
from warpspace.units import Array

SURFACE_POINTS = 2500  # vertices of an evenly refined surface, at least
BEND_SHARE, BEND_UM = 0.02, 0.01  # of the placed RMS; errors that bend less are linear
CHECKED = 0.382  # place on an edge: in the middle, as at the ends, a periodic error may vanish


def sample_vertices(mesh: Workpiece, count: int) -> tuple[Array, Array]:
    """Choose vertices that represent the surface, [n, 3], and their shares of its area, [n].

    All vertices of a mesh that has up to `count`; else as many, evenly over the area.
    """
    if len(mesh.vertices_mm) <= count:
        return mesh.vertices_mm, mesh.shares
    place = np.cumsum(mesh.shares)
    rows = np.searchsorted(place, place[-1] * (np.arange(count) + 0.5) / count)
    return mesh.vertices_mm[rows], np.full(count, 1.0 / count)


def refine(
    mesh: Workpiece, scene: Scene, place: Sequence[float] | None = None
) -> tuple[Workpiece, float]:
    """Refine a mesh, in its frame, for the evaluation at a place.

    Returns
    -------
    mesh : Workpiece
        The vertices of the given one come first.
    interpolation_um : float
        Largest deviation of errors on edges from the interpolation of their ends.
    """
    even_mm2 = float(mesh.sizes[0].sum()) / SURFACE_POINTS
    if mesh.sizes[1].max() <= even_mm2 / 16.0:
        return mesh, 0.0
    room = max(MAX_REFINED_VERTICES, len(mesh.vertices_mm) // 4)
    at = place_workpiece(mesh, scene, place).place

    def compute_size(corner: Array) -> Array:  # area · length²; of an even triangle even_mm2²
        number = np.arange(corner.size // 3, dtype=np.int32).reshape(-1, 3)
        area, square = measure_triangles(corner.reshape(-1, 3), number)
        return area * square

    def evaluate_errors(point_mm: Array) -> Array:
        points = replace(mesh, vertices_mm=point_mm)
        return evaluate_points(scene, place_workpiece(points, scene, at).vertices_mm).error_um

    def compute_bend(corner: Array) -> Array:
        begin, end = corner[:, 0], corner[:, 1]
        points = np.concatenate([begin, end, begin + CHECKED * (end - begin)])
        first, last, within = evaluate_errors(points).reshape(3, -1, 3)
        return np.linalg.norm(within - first - CHECKED * (last - first), axis=1)

    fine, _ = _divide(mesh, even_mm2, compute_size, even_mm2**2, room)
    room -= len(fine.vertices_mm) - len(mesh.vertices_mm)
    points, shares = sample_vertices(fine, SURFACE_POINTS)
    placed = subtract_best_fit(points, evaluate_errors(points), shares)
    rms_um = float(np.sqrt(shares @ np.sum(placed * placed, axis=1)))
    tolerance_um = max(BEND_UM, BEND_SHARE * rms_um)
    return _divide(fine, even_mm2 / 16.0, compute_bend, tolerance_um, room)


def _divide(
    mesh: Workpiece, short_mm2: float, measure: Callable[[Array], Array], limit: float, room: int
) -> tuple[Workpiece, float]:
    """Halve triangles whose measure exceeds a limit; return the largest measure that remains.

    `measure` is evaluated for corners of triangles, [n, 3, 3], their longest edge first, unless the
    square of that is below `short_mm2`. At most `room` vertices are added.
    """
    vertices: Array = mesh.vertices_mm
    triangles: NDArray[Any] = mesh.triangles
    source: NDArray[Any] = np.arange(len(triangles)) if mesh.source is None else mesh.source
    rows: NDArray[Any] = np.flatnonzero(mesh.sizes[1] > short_mm2)
    largest = 0.0
    while rows.size and room > 0:
        number = _longest_edge_first(vertices, triangles[rows])
        value = measure(vertices[number])
        chosen: NDArray[Any] = np.argsort(-value)[: min(room, np.count_nonzero(value > limit))]
        largest = max(largest, float(np.delete(value, chosen).max(initial=0.0)))
        count, rows = len(vertices), rows[chosen]
        vertices, first, second = _halve(vertices, number[chosen])
        triangles = np.concatenate([triangles, second])
        triangles[rows] = first
        halves = np.arange(len(source), len(triangles))
        source = np.concatenate([source, source[rows]])
        rows = np.concatenate([rows, halves])
        rows = rows[measure_triangles(vertices, triangles[rows])[1] > short_mm2]
        room -= len(vertices) - count
    fine = replace(mesh, vertices_mm=vertices, triangles=triangles)
    return replace(fine, original=mesh.original or mesh, source=source), largest


def _longest_edge_first(vertices: Array, triangles: NDArray[Any]) -> NDArray[Any]:
    corner = vertices[triangles]
    edge = np.roll(corner, -1, axis=1) - corner
    longest = np.einsum("tex,tex->te", edge, edge).argmax(axis=1)
    return np.take_along_axis(triangles, (longest[:, None] + np.arange(3)) % 3, axis=1)


def _halve(vertices: Array, triangles: NDArray[Any]) -> tuple[Array, NDArray[Any], NDArray[Any]]:
    """Halve triangles at their first edge: return all vertices, and the first and other halves."""
    first, last, apex = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    # neighbours that share their longest edge share its middle
    edges = np.sort(np.stack([first, last], axis=1), axis=1)
    ends, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = (inverse.reshape(-1) + len(vertices)).astype(np.int32)
    added = np.concatenate([vertices, vertices[ends].mean(axis=1)])
    return added, np.stack([first, middle, apex], axis=1), np.stack([middle, last, apex], axis=1)
