"""Faces of the gridded volume as rectangular patches, and the lines that are drawn on them.

A patch is a 2-D array of flat grid indices; surfaces, grid lines, creases and isolines of a picture
all come from one list of patches, so that they lie on each other.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from warpspace.geometry.surfaces import Index, Shape

MIN_CUT_NODES = 3
"""Nodes an axis needs for an octant to be cut away."""


def outer_faces(shape: Shape) -> list[Index]:
    """List the outer faces of a grid.

    Parameters
    ----------
    shape : tuple of int, (3,)
        Nodes along the three axes; 1 where the volume is flat.

    Returns
    -------
    list of ndarray, [a, b]
        Flat grid indices, (row, column) turning outwards. One face for a flat grid, none for a
        line.
    """
    numbers = np.arange(np.prod(shape)).reshape(shape)
    found: list[Index] = []
    for axis in range(3):
        if min(shape[other] for other in range(3) if other != axis) == 1:
            continue
        ends = (0, 1) if shape[axis] > 1 else (1,)
        found += [_oriented(np.take(numbers, -end, axis=axis), axis, upper=end) for end in ends]
    return found


def cut_faces(shape: Shape, corner: tuple[int, int, int]) -> list[Index]:
    """List the faces of a grid without the octant at one corner.

    Parameters
    ----------
    shape : tuple of int, (3,)
    corner : tuple of int, (3,)
        0 for the lower, 1 for the upper end along each axis.

    Returns
    -------
    list of ndarray, [a, b]
        The outer faces, a quarter missing where the octant was, and the three faces of the cut; the
        uncut faces where an axis has fewer than three nodes.
    """
    if min(shape) < MIN_CUT_NODES:
        return outer_faces(shape)
    numbers = np.arange(np.prod(shape)).reshape(shape)
    middle = [count // 2 for count in shape]
    faces: list[Index] = []
    for axis in range(3):
        first, second = (other for other in range(3) if other != axis)
        gone = [_half(corner[other], middle[other]) for other in (first, second)]
        kept = [_half(1 - corner[other], middle[other]) for other in (first, second)]
        for end in (0, 1):
            face = np.take(numbers, -end, axis=axis)
            whole = end != corner[axis]
            patches = [face] if whole else [face[kept[0], :], face[gone[0], kept[1]]]
            faces += [_oriented(patch, axis, upper=end) for patch in patches]
        inner = np.take(numbers, middle[axis], axis=axis)[gone[0], gone[1]]
        faces.append(_oriented(inner, axis, upper=corner[axis]))
    return faces


def _half(upper: int, middle: int) -> slice:
    """Slice of the half at one end, the middle node included."""
    return slice(middle, None) if upper else slice(None, middle + 1)


def _oriented(face: Index, axis: int, *, upper: int) -> Index:
    """Order a face so that it looks along +axis (upper) or −axis."""
    return face if bool(upper) != (axis == 1) else face.T


def face_axis(face: Index, shape: Shape) -> int:
    """Tell which grid direction does not vary over a patch."""
    ends = np.stack(np.unravel_index(face[[0, -1], [0, -1]], shape), -1)
    other = np.stack(np.unravel_index(face[[0, -1], [-1, 0]], shape), -1)
    still = (ends[0] == ends[1]) & (other[0] == other[1])
    return int(np.argmax(still))


def crease_lines(faces: Sequence[Index], shape: Shape) -> list[Index]:
    """Find the edges where patches of different directions meet, and open borders.

    Parameters
    ----------
    faces : sequence of ndarray, [a, b]
    shape : tuple of int, (3,)

    Returns
    -------
    list of ndarray, [n]
        Polylines of flat grid indices; each edge once.
    """
    met: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    borders = [(face_axis(face, shape), _borders(face)) for face in faces]
    for axis, lines in borders:
        for line in lines:
            for pair in _pairs(line):
                met[pair].append(axis)
    wanted = {pair for pair, axes in met.items() if len(axes) == 1 or len(set(axes)) > 1}
    return _collect((line for _, lines in borders for line in lines), wanted)


def face_lines(faces: Sequence[Index], shape: Shape, every: Shape) -> list[Index]:
    """Find the grid lines on patches, those on creases left out.

    Parameters
    ----------
    faces : sequence of ndarray, [a, b]
    shape : tuple of int, (3,)
    every : tuple of int, (3,)
        Draw every n-th line along each axis.

    Returns
    -------
    list of ndarray, [n]
        Polylines of flat grid indices; each line once.
    """
    creases = {pair for line in crease_lines(faces, shape) for pair in _pairs(line)}
    lines: list[Index] = []
    for face in faces:
        for patch in (face, face.T):
            for row in patch:
                at = np.stack(np.unravel_index(row, shape), -1)
                across = _held_axis(patch, shape)
                if len(row) > 1 and at[0, across] % every[across] == 0:
                    lines.append(row)
    wanted = {pair for line in lines for pair in _pairs(line)} - creases
    return _collect(iter(lines), wanted)


def _held_axis(patch: Index, shape: Shape) -> int:
    """Tell which grid direction changes from row to row."""
    first, last = (np.stack(np.unravel_index(patch[row, 0], shape)) for row in (0, -1))
    return int(np.argmax(first != last))


def _borders(face: Index) -> list[Index]:
    """List the four sides of a patch."""
    return [face[0, :], face[-1, :], face[:, 0], face[:, -1]]


def _pairs(line: Index) -> list[tuple[int, int]]:
    """Segments of a polyline, the lower index first."""
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    return list(zip(low.tolist(), high.tolist(), strict=True))


def _collect(lines: Iterator[Index], wanted: set[tuple[int, int]]) -> list[Index]:
    """Cut polylines to the wanted segments, each drawn once."""
    left = set(wanted)
    found: list[Index] = []
    for line in lines:
        start = None
        for at, pair in enumerate([*_pairs(line), (-1, -1)]):
            if pair in left:
                left.discard(pair)
                start = at if start is None else start
            elif start is not None:
                found.append(line[start : at + 1])
                start = None
    return found
