"""What is drawn of a grid, as indices into its nodes: whole surface, or without an octant."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry import surfaces
from warpspace.geometry.faces import crease_lines, cut_faces, face_axis, face_lines, outer_faces
from warpspace.units import Array

Floats = NDArray[np.float32]

CUT_CORNER = (1, 0, 1)
"""The octant that is cut away: the one nearest to the operator, right in front and above."""


def map_faces(shape: surfaces.Shape, *, cut: bool = False) -> list[surfaces.Index]:
    """List the patches of the surface that is drawn, whole or without the octant cut away."""
    return cut_faces(shape, CUT_CORNER) if cut else outer_faces(shape)


@dataclass(frozen=True, slots=True)
class Topology:
    """Indices of what is drawn of a grid; they do not change when it is bent.

    Attributes
    ----------
    surface : Surface
    grid_segments, edge_segments : ndarray, [S, 2]
        Flat node indices of the ends of each piece of line.
    grid_outwards, edge_outwards : ndarray of float32, [S, 2, 3]
        At the ends of the pieces of line, the sum of the outward directions of the faces that the
        node lies on.
    faces : tuple of ndarray, [a, b]
        Rectangular patches of nodes that the surface consists of.
    normals : ndarray, [F, 3]
        Outward direction of each patch.
    """

    surface: surfaces.Surface
    grid_segments: surfaces.Index
    edge_segments: surfaces.Index
    grid_outwards: Floats
    edge_outwards: Floats
    faces: tuple[surfaces.Index, ...]
    normals: Array


@lru_cache(maxsize=32)
def topology(shape: surfaces.Shape, *, cut: bool = False) -> Topology:
    """Work out what is drawn of a grid of a shape.

    Parameters
    ----------
    shape : tuple of int, (3,)
    cut : bool, optional
        Whether the octant towards the operator is cut away.

    Returns
    -------
    Topology
    """
    faces = map_faces(shape, cut=cut)
    normals = np.array([_normal(face, shape) for face in faces]).reshape(-1, 3)
    outwards = np.zeros((int(np.prod(shape)), 3))
    for axis in range(3):
        for sign in (-1.0, 1.0):
            on = [f for f, n in zip(faces, normals, strict=True) if n[axis] == sign]
            if on:
                outwards[np.unique(np.concatenate([f.ravel() for f in on])), axis] += sign
    every = tuple(map(surfaces.line_spacing, shape))
    lines = face_lines(faces, shape, (every[0], every[1], every[2]))
    grid, edges = surfaces.segments(lines), surfaces.segments(crease_lines(faces, shape))
    return Topology(
        surfaces.triangulate(faces),
        grid,
        edges,
        outwards[grid].astype(np.float32),
        outwards[edges].astype(np.float32),
        tuple(faces),
        normals,
    )


def _normal(face: surfaces.Index, shape: surfaces.Shape) -> Array:
    """Outward direction of a patch in the directions of the grid, [3]."""
    corner, down, right = (
        np.array(np.unravel_index(index, shape), dtype=float)
        for index in (face[0, 0], face[-1, 0], face[0, -1])
    )
    normal = np.zeros(3)
    normal[face_axis(face, shape)] = 1.0
    return normal * np.sign(np.cross(down - corner, right - corner) @ normal)
