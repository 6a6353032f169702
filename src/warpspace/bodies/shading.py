"""Surfaces of bodies as they are drawn: bevelled, darker in corners, tinted by axis."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from warpspace.bodies.mesh import CREASE_DEG, Body
from warpspace.units import Array

_MOST_TRIANGLES = 20_000  # of a body; a larger one is drawn as it is
_BEVEL, _LARGEST_BEVEL = 0.08, 0.003
"""Width of a bevel relative to the thinnest side of its shape, and to the machine."""
_PER_MM = 32  # places are rounded: fewer bytes of a page once it is compressed
_LONGEST_CORNER = 12  # edges that meet in a corner
_NEAR, _DARKENED = (0.02, 0.06), 0.55
"""Distances to neighbours that darken a surface, relative to the machine; by how much at most."""
_HUES = {
    **dict.fromkeys("XU", (206, 66, 58)),
    **dict.fromkeys("YV", (62, 150, 84)),
    **dict.fromkeys("ZW", (58, 104, 190)),
    "A": (196, 92, 150),
    "B": (170, 146, 50),
    "C": (50, 150, 172),
}
"""Colours of the axes that move a body: X, Y and Z those of the triad."""
_TINTED = 0.16  # share of the hue in the colour of a body


@dataclass(frozen=True, slots=True, eq=False)
class ShadedSurface:
    """Surface of a body in its frame."""

    vertices_mm: Array  # [V, 3]
    normals: Array | None  # [V, 3], smooth over bevels; None for flat triangles
    triangles: NDArray[np.integer]  # [T, 3]
    colours: Array  # [V, 3]; sRGB, 0 to 1


@lru_cache(maxsize=16)
def shade_bodies(bodies: tuple[Body, ...], poses: tuple[bytes, ...]) -> tuple[ShadedSurface, ...]:
    """Shade the bodies of a machine, whose frames have the poses in R, [4, 4] each."""
    matrices = [np.frombuffer(pose).reshape(4, 4) for pose in poses]
    turns, shifts = ([m[:3, k].squeeze() for m in matrices] for k in (slice(3), 3))
    placed = [
        body.vertices_mm @ turn.T + shift
        for body, turn, shift in zip(bodies, turns, shifts, strict=True)
    ]
    everything = np.concatenate(placed)
    floor, size = everything.min(axis=0), float(np.ptp(everything, axis=0).max())
    below = np.array([[-np.inf] * 3, [np.inf, np.inf, floor[2]]])
    surfaces = list[ShadedSurface]()
    boxes, owners = [below], [-1]  # floor, then shapes of all bodies
    for body, points in zip(bodies, placed, strict=True):
        colour = np.array(body.colour) / 255.0
        if body.frame[0] in _HUES:
            colour += _TINTED * (np.array(_HUES[body.frame[0]]) / 255.0 - colour)
        vertices, normals, triangles, shapes = _bevel(body, _LARGEST_BEVEL * size)
        surfaces.append(
            ShadedSurface(vertices, normals, triangles, np.tile(colour, (len(vertices), 1)))
        )
        owners += [len(surfaces) - 1] * len(shapes)
        boxes += [np.stack([points[at].min(axis=0), points[at].max(axis=0)]) for at in shapes]
    for number, (surface, turn, shift) in enumerate(zip(surfaces, turns, shifts, strict=True)):
        if surface.normals is not None:
            points, normals = surface.vertices_mm @ turn.T + shift, surface.normals @ turn.T
            # shapes of one body overlap, with faces in one plane that must look alike
            neighbours = np.array(boxes)[np.array(owners) != number]
            surface.colours[:] *= _brightness(points, normals, neighbours, size)[:, None]
    return tuple(surfaces)


def _brightness(points: Array, normals: Array, boxes: Array, size: float) -> Array:
    """Estimate the brightness of points, [n], from how far boxes, [m, 2, 3], surround them."""
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    covered = np.zeros(len(points))
    for distance, side in product(_NEAR, sides):
        at = points + distance * size * (normals + 0.8 * side)
        inside = (at > boxes[:, None, 0]) & (at < boxes[:, None, 1])  # [m, n, 3]
        covered += inside.all(axis=-1).any(axis=0)
    brightness = 1.0 - _DARKENED * covered / (len(_NEAR) * len(sides))
    # linear over each plane, where the triangles of a polygon would show otherwise
    level = np.sum(points * normals, axis=1, keepdims=True)
    keys = np.round(np.concatenate([1000.0 * normals, level], axis=1))
    plane = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    for number in np.flatnonzero(np.bincount(plane) > 3):
        at = np.flatnonzero(plane == number)
        basis = np.insert((points[at] - points[at].mean(axis=0)) / size, 3, 1.0, axis=1)
        fitted = basis @ np.linalg.lstsq(basis, brightness[at])[0]
        brightness[at] = fitted - max(fitted.max() - 1.0, 0.0)
    return np.maximum(brightness, 1.0 - _DARKENED)


def _bevel(
    body: Body, widest_mm: float
) -> tuple[Array, Array | None, NDArray[np.integer], Sequence[NDArray[np.integer]]]:
    """Bevel the sharp edges of a body; one that is open or very large stays as it is.

    Each smooth group of triangles shrinks from its sharp edges; quadrilaterals along these edges,
    and polygons at the corners, close the gaps. Normals of the groups make the bevels look round.
    Returns vertices, normals, triangles, and the vertices of the body in each of its shapes.
    """
    import trimesh

    mesh = trimesh.Trimesh(body.vertices_mm, body.triangles, process=False)
    if len(body.triangles) > _MOST_TRIANGLES or not mesh.is_watertight:
        return body.vertices_mm, None, body.triangles, ()
    old, faces, count = body.vertices_mm, body.triangles.astype(np.intp), len(body.triangles)
    smooth = mesh.face_adjacency_angles <= np.deg2rad(CREASE_DEG)
    labels = trimesh.graph.connected_component_labels
    group = labels(mesh.face_adjacency[smooth], node_count=count)
    shape_of_face = labels(mesh.face_adjacency, node_count=count)
    key, inverse = np.unique(faces * count + group[:, None], return_inverse=True)
    corner, of_old = inverse.reshape(-1, 3), key // count
    shape = np.empty(len(key), dtype=np.intp)
    shape[corner] = shape_of_face[:, None]
    shapes = [faces[shape_of_face == n].ravel() for n in range(shape_of_face.max() + 1)]
    thinnest = [float(np.ptp(old[at], axis=0).min()) for at in shapes]
    width = np.minimum(_BEVEL * np.array(thinnest), widest_mm)[shape, None]

    # half edges along sharp edges, both of an edge one after the other
    sharp = np.sort(mesh.face_adjacency_edges[~smooth], axis=1) @ [len(old), 1]
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    ends = np.sort(np.stack([faces.ravel(), np.roll(faces, -1, axis=1).ravel()]), axis=0)
    edge = np.array([len(old), 1]) @ ends
    half = np.flatnonzero(np.isin(edge, sharp))
    half = half[np.argsort(edge[half], kind="stable")]
    start, end = start[half], end[half]
    inward = np.cross(mesh.face_normals[half // 3], old[of_old[end]] - old[of_old[start]])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    shrink, normals = np.zeros((len(key), 3)), np.zeros((len(key), 3))
    np.add.at(shrink, np.concatenate([start, end]), np.concatenate([inward, inward]))
    np.add.at(normals, corner, (mesh.face_normals * mesh.area_faces[:, None])[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    square = np.maximum(np.sum(shrink**2, axis=1, keepdims=True), 0.2)
    vertices = old[of_old] + 2.0 * width * shrink / square

    (a, b), (c, d) = (start[::2], end[::2]), (start[1::2], end[1::2])
    parts = [corner, np.stack([b, a, d], 1), np.stack([b, d, c], 1)]
    after = np.arange(len(key))
    after[d], after[b] = a, c
    first, at = np.arange(len(key)), np.arange(len(key))
    for _ in range(_LONGEST_CORNER):
        at = after[at]
        first = np.minimum(first, at)
    root = np.flatnonzero(first == np.arange(len(key)))
    at = after[root]
    for _ in range(_LONGEST_CORNER):
        root, at = root[after[at] != root], at[after[at] != root]
        parts.append(np.stack([root, at, after[at]], 1))
        at = after[at]
    return np.rint(vertices * _PER_MM) / _PER_MM, normals, np.concatenate(parts), shapes
