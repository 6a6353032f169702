"""Surface, lines and corners of the gridded volume as indices into its nodes.

Indices do not change when the grid is bent, so a picture is updated by moving nodes only.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]
Shape = tuple[int, int, int]
_CELLS = 12


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles on the outside of a grid.

    Attributes
    ----------
    nodes : ndarray, [M]
        Flat grid index of each vertex.
    triangles : ndarray, [T, 3]
        Vertex numbers, counter-clockwise seen from outside.
    """

    nodes: Index
    triangles: Index


def _face_nodes(shape: Shape, axis: int, end: int) -> Index:
    """Flat grid indices of one face as a 2-D array, ordered to face outwards."""
    numbers = np.arange(np.prod(shape)).reshape(shape)
    face = np.take(numbers, end, axis=axis)
    # the remaining two axes in ascending order turn right-handed about +axis, except about y
    outwards = (end != 0) != (axis == 1)
    return face if outwards else face.T


def _faces(shape: Shape) -> list[Index]:
    """All faces of the grid that span an area; a flat grid has one."""
    found: list[Index] = []
    for axis in range(3):
        rest = [shape[other] for other in range(3) if other != axis]
        if min(rest) > 1:
            ends = (0, -1) if shape[axis] > 1 else (-1,)
            found += [_face_nodes(shape, axis, end) for end in ends]
    return found


def outer_surface(shape: Shape) -> Surface:
    """Triangulate the outside of a grid.

    Parameters
    ----------
    shape : tuple of int, (3,)
        Nodes along the three axes; 1 where the volume is flat.

    Returns
    -------
    Surface
        Vertices shared between neighbouring faces.
    """
    return triangulate(_faces(shape))


def triangulate(faces: list[Index]) -> Surface:
    """Triangulate rectangular patches of nodes into one surface with shared vertices.

    Parameters
    ----------
    faces : list of ndarray, [a, b]
        Flat grid indices of each patch, ordered so that (row, column) turns outwards.

    Returns
    -------
    Surface
    """
    if not faces:
        return Surface(np.zeros(0, dtype=np.intp), np.zeros((0, 3), dtype=np.intp))
    triangles: list[Index] = []
    for face in faces:
        a, b, c, d = face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
        triangles += [
            np.stack([a, b, c], -1).reshape(-1, 3),
            np.stack([a, c, d], -1).reshape(-1, 3),
        ]
    nodes, numbered = np.unique(np.concatenate(triangles), return_inverse=True)
    return Surface(nodes, numbered.reshape(-1, 3))


def cut_octant(shape: Shape, corner: tuple[int, int, int]) -> Surface:
    """Triangulate the outside of a grid without the octant at one corner.

    Parameters
    ----------
    shape : tuple of int, (3,)
        At least three nodes along each axis.
    corner : tuple of int, (3,)
        0 for the lower, 1 for the upper end along each axis.

    Returns
    -------
    Surface
        Outer faces with a quarter missing where the octant was, and the three faces of the cut.
    """
    numbers = np.arange(np.prod(shape)).reshape(shape)
    middle = [count // 2 for count in shape]
    faces: list[Index] = []
    for axis in range(3):
        for end in (0, 1):
            face = np.take(numbers, -end, axis=axis)
            if end != corner[axis]:
                faces.append(_oriented(face, axis, upper=bool(end)))
            else:
                faces += [
                    _oriented(patch, axis, upper=bool(end))
                    for patch in _without_quarter(face, axis, corner, middle)
                ]
        inner = np.take(numbers, middle[axis], axis=axis)
        quarter = inner[_quarter(axis, corner, middle)]
        faces.append(_oriented(quarter, axis, upper=bool(corner[axis])))
    return triangulate(faces)


def _quarter(axis: int, corner: tuple[int, int, int], middle: list[int]) -> tuple[slice, ...]:
    """Slices of the quarter of a face that belongs to the cut octant."""
    rest = [other for other in range(3) if other != axis]
    return tuple(_half(corner[other], middle[other]) for other in rest)


def _half(upper: int, middle: int) -> slice:
    """Slice of the half at one end, the middle node included."""
    return slice(middle, None) if upper else slice(None, middle + 1)


def _without_quarter(
    face: Index, axis: int, corner: tuple[int, int, int], middle: list[int]
) -> list[Index]:
    """Split a face into the two patches that remain without the quarter of the octant."""
    first, second = (other for other in range(3) if other != axis)
    kept = _half(1 - corner[first], middle[first])
    cut = _half(corner[first], middle[first])
    return [face[kept, :], face[cut, _half(1 - corner[second], middle[second])]]


def _oriented(face: Index, axis: int, *, upper: bool) -> Index:
    """Order a face so that it looks along +axis (upper) or −axis."""
    return face if upper != (axis == 1) else face.T


def box_edges(shape: Shape) -> list[Index]:
    """List the edges of the grid as polylines.

    Parameters
    ----------
    shape : tuple of int, (3,)

    Returns
    -------
    list of ndarray, [n]
        Flat grid indices along each edge; twelve for a full volume.
    """
    whole = max(shape)
    return grid_lines(shape, (whole, whole, whole))


def grid_lines(shape: Shape, every: tuple[int, int, int]) -> list[Index]:
    """List the lines on the faces of the grid as polylines.

    Parameters
    ----------
    shape : tuple of int, (3,)
    every : tuple of int, (3,)
        Draw every n-th line along each axis; first and last are always drawn.

    Returns
    -------
    list of ndarray, [n]
        Flat grid indices; each line once.
    """
    numbers = np.arange(np.prod(shape)).reshape(shape)
    lines: list[Index] = []
    for axis in range(3):
        if shape[axis] == 1:
            continue
        first, second = (other for other in range(3) if other != axis)
        for i, j in product(_kept(shape[first], every[first]), _kept(shape[second], every[second])):
            on_face = i in (0, shape[first] - 1) or j in (0, shape[second] - 1)
            if on_face:
                lines.append(np.moveaxis(numbers, axis, -1)[i, j])
    return lines


def _kept(count: int, every: int) -> list[int]:
    """Numbers of the lines that are drawn along an axis."""
    return sorted({*range(0, count, every), count - 1})


def line_spacing(nodes: int) -> int:
    """Choose how many nodes apart grid lines are drawn, so that at most twelve cells remain."""
    return max(1, -(-(nodes - 1) // _CELLS))


def segments(lines: list[Index]) -> Index:
    """Cut polylines into segments, [S, 2] node indices."""
    pairs = [np.stack([line[:-1], line[1:]], -1) for line in lines]
    return np.concatenate(pairs) if pairs else np.zeros((0, 2), dtype=np.intp)


def corners(shape: Shape) -> Index:
    """Flat grid indices of the corners, [8] for a full volume."""
    numbers = np.arange(np.prod(shape)).reshape(shape)
    ends = [sorted({0, count - 1}) for count in shape]
    return np.array([numbers[at] for at in product(*ends)])
