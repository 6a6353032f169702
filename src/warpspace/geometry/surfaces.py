"""Surface, lines and corners of the gridded volume as indices into its nodes.

Indices do not change when the grid is bent, so a picture is updated by moving nodes only.
A face is a patch, a 2-D array of flat grid indices: surfaces, grid lines, creases and isolines of a
picture come from one list of patches, so that they coincide.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.colour import ColourScale
from warpspace.machine.limits import EXAGGERATION
from warpspace.units import MM_PER_UM, Array

Index = NDArray[np.intp]
Shape = tuple[int, int, int]
_CELLS = 12


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles on the outside of a grid."""

    nodes: Index  # [M]; flat grid index of each vertex
    triangles: Index  # [T, 3]; vertex numbers, counter-clockwise seen from outside


def outer_faces(shape: Shape) -> list[Index]:
    """List the outer faces of a grid as flat node indices [a, b], (row, column) turning outwards.

    One face for a flat grid (a count of 1), none for a line.
    """
    numbers = np.arange(np.prod(shape)).reshape(shape)
    faces: list[Index] = []
    for axis in range(3):
        if min(shape[other] for other in range(3) if other != axis) == 1:
            continue
        ends = (0, 1) if shape[axis] > 1 else (1,)
        faces += [oriented(np.take(numbers, -end, axis=axis), axis, upper=end) for end in ends]
    return faces


def oriented(face: Index, axis: int, *, upper: int) -> Index:
    """Order a face so that it looks along +axis (upper) or −axis."""
    # the other two axes in ascending order turn right-handed about +axis, except about y
    return face if bool(upper) != (axis == 1) else face.T


def outer_surface(shape: Shape) -> Surface:
    return triangulate(outer_faces(shape))


def triangulate(faces: list[Index]) -> Surface:
    """Triangulate patches [a, b] of nodes that turn outwards into one surface."""
    triangles: list[Index] = [np.zeros((0, 3), dtype=np.intp)]
    for face in faces:
        a, b, c, d = face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
        triangles += [np.stack(vertices, -1).reshape(-1, 3) for vertices in ((a, b, c), (a, c, d))]
    nodes, numbered = np.unique(np.concatenate(triangles), return_inverse=True)
    return Surface(nodes, numbered.reshape(-1, 3))


def box_edges(shape: Shape) -> list[Index]:
    """List the edges of the grid as polylines of flat node indices; twelve for a full volume."""
    spacing = max(shape)
    return grid_lines(shape, (spacing, spacing, spacing))


def grid_lines(shape: Shape, spacing: tuple[int, int, int]) -> list[Index]:
    """List every n-th line of each axis on the faces of the grid, first and last included."""
    numbers = np.arange(np.prod(shape)).reshape(shape)
    lines: list[Index] = []
    for axis in range(3):
        if shape[axis] == 1:
            continue
        across = [other for other in range(3) if other != axis]
        drawn = [sorted({*range(0, shape[at], spacing[at]), shape[at] - 1}) for at in across]
        for i, j in product(*drawn):
            if i in (0, shape[across[0]] - 1) or j in (0, shape[across[1]] - 1):
                lines.append(np.moveaxis(numbers, axis, -1)[i, j])
    return lines


def line_spacing(shape: Shape) -> Shape:
    """Choose how many nodes apart grid lines are drawn, so that at most twelve cells remain."""
    x, y, z = (max(1, -(-(nodes - 1) // _CELLS)) for nodes in shape)
    return x, y, z


def segments(lines: list[Index]) -> Index:
    """Cut polylines into segments, [S, 2] node indices."""
    pairs = [np.stack([line[:-1], line[1:]], -1) for line in lines]
    return np.concatenate(pairs) if pairs else np.zeros((0, 2), dtype=np.intp)


@lru_cache(maxsize=16)
def corners(shape: Shape) -> Index:
    """Flat grid indices of the corners, [8] for a full volume."""
    numbers = np.arange(np.prod(shape)).reshape(shape)
    ends = [sorted({0, count - 1}) for count in shape]
    return np.array([numbers[at] for at in product(*ends)])


# A line becomes a bar, a point a cube.
#
# Fixed axes get two nodes instead of one, half a thickness to either side, so that a bar has
# surface, grid lines and edges like any other volume.

THICKNESS = 0.016  # of a bar or a cube, as a part of the length that the picture is sized by


def is_thin(shape: Shape) -> bool:
    """Check whether a grid is a line or a point, without area."""
    return shape.count(1) >= 2


def thicken(points_mm: Array, thickness_mm: float) -> Array:
    """Thicken a line or a point of nodes, [nx, ny, nz, 3], mm: two nodes for one."""
    shape = points_mm.shape[:3]
    flat_axes = [axis for axis in range(3) if shape[axis] == 1]
    run = np.abs(points_mm[-1, -1, -1] - points_mm[0, 0, 0])
    directions = list(np.eye(3))
    if len(flat_axes) < len(shape):
        # a turned machine may have its line along another direction than its axis is named for
        along = directions.pop(int(np.argmax(run)))
        directions.insert(next(axis for axis in range(3) if shape[axis] > 1), along)
    thick = points_mm
    for axis in flat_axes:
        shift = 0.5 * thickness_mm * directions[axis]
        thick = np.concatenate([thick - shift, thick + shift], axis=axis)
    return thick


def spread(values: NDArray[Any]) -> NDArray[Any]:
    """Repeat values at the nodes, [nx, ny, nz, ...], of a line or a point, as `thicken` does."""
    flat_axes = [axis for axis in range(3) if values.shape[axis] == 1]
    for axis in flat_axes if is_thin(values.shape[:3]) else ():
        values = np.repeat(values, 2, axis=axis)
    return values


def spread_nodes(shape: Shape) -> NDArray[np.intp]:
    """Return the flat index of the grid node of each drawn node, [M]."""
    return spread(np.arange(np.prod(shape), dtype=np.intp).reshape(shape)).reshape(-1)


TARGET_FRACTION = 0.1
"""Target of auto: the largest displacement, as a fraction of the longest edge of the volume."""
NEUTRAL_EXAGGERATION = 1000.0  # of auto, without displacements
_ROUND = (1.0, 2.0, 5.0, 10.0)


def deform(nominal_mm: Array, error_um: Array, exaggeration: float) -> Array:
    """Displace points, [..., 3], mm, by their exaggerated error, [..., 3], µm."""
    return nominal_mm + (exaggeration * MM_PER_UM) * error_um


def auto_exaggeration(largest_um: float, longest_edge_mm: float) -> float:
    largest_mm = largest_um * MM_PER_UM  # zero also where an error is too small to be divided by
    if not largest_mm > 0.0 or not longest_edge_mm > 0.0:
        return NEUTRAL_EXAGGERATION
    exaggeration = TARGET_FRACTION * longest_edge_mm / largest_mm
    exaggeration = min(max(exaggeration, 1.0), EXAGGERATION[1])
    decade = 10.0 ** math.floor(math.log10(exaggeration))
    return min(
        (step * decade for step in _ROUND), key=lambda value: abs(math.log(value / exaggeration))
    )


def round_down(value: float) -> float:
    """Return the largest 1, 2 or 5 × 10ⁿ that is not above a positive value (scale bars)."""
    decade = 10.0 ** math.floor(math.log10(value))
    return max(step * decade for step in _ROUND if step * decade <= value * (1.0 + 1e-9))


MIN_CUT_NODES = 3  # nodes an axis needs for an octant to be cut away


def cut_faces(shape: Shape, corner: tuple[int, int, int]) -> list[Index]:
    """List the faces of a grid without the octant at one corner: 0 lower, 1 upper end of each axis.

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
        opposite = [_half(1 - corner[other], middle[other]) for other in (first, second)]
        for end in (0, 1):
            face = np.take(numbers, -end, axis=axis)
            is_uncut = end != corner[axis]
            patches = [face] if is_uncut else [face[opposite[0], :], face[gone[0], opposite[1]]]
            faces += [oriented(patch, axis, upper=end) for patch in patches]
        inner = np.take(numbers, middle[axis], axis=axis)[gone[0], gone[1]]
        faces.append(oriented(inner, axis, upper=corner[axis]))
    return faces


def _half(upper: int, middle: int) -> slice:
    return slice(middle, None) if upper else slice(None, middle + 1)


def face_axis(face: Index, shape: Shape) -> int:
    at = np.stack(np.unravel_index(face, shape))  # [3, a, b]
    return int(np.argmax((at == at[:, :1, :1]).all(axis=(1, 2))))


def crease_lines(faces: Sequence[Index], shape: Shape) -> list[Index]:
    """Find the edges where patches meet at an angle, and open borders: node indices, each once."""
    met: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    borders = [
        (face_axis(face, shape), [face[0, :], face[-1, :], face[:, 0], face[:, -1]])
        for face in faces
    ]
    for axis, lines in borders:
        for line in lines:
            for pair in _pairs(line):
                met[pair].append(axis)
    creases = {pair for pair, axes in met.items() if len(axes) == 1 or len(set(axes)) > 1}
    return _collect((line for _, lines in borders for line in lines), creases)


def face_lines(faces: Sequence[Index], shape: Shape, spacing: Shape) -> list[Index]:
    """Find every n-th grid line of each axis on patches, except those on creases."""
    creases = {pair for line in crease_lines(faces, shape) for pair in _pairs(line)}
    lines: list[Index] = []
    for face in faces:
        for patch in (face, face.T):
            at = np.stack(np.unravel_index(patch, shape))  # [3, a, b]
            across = int(np.argmax(at[:, 0, 0] != at[:, -1, 0]))
            if patch.shape[1] > 1:
                lines.extend(patch[at[across, :, 0] % spacing[across] == 0])
    pairs = {pair for line in lines for pair in _pairs(line)} - creases
    return _collect(iter(lines), pairs)


def _pairs(line: Index) -> list[tuple[int, int]]:
    low, high = np.minimum(line[:-1], line[1:]), np.maximum(line[:-1], line[1:])
    return list(zip(low.tolist(), high.tolist(), strict=True))


def _collect(lines: Iterator[Index], pairs: set[tuple[int, int]]) -> list[Index]:
    remaining = set(pairs)
    polylines: list[Index] = []
    for line in lines:
        start = None
        for at, pair in enumerate([*_pairs(line), (-1, -1)]):
            if pair in remaining:
                remaining.discard(pair)
                start = at if start is None else start
            elif start is not None:
                polylines.append(line[start : at + 1])
                start = None
    return polylines


def isoline_levels(scale: ColourScale) -> tuple[float, ...]:
    """Return the values of isolines: the ticks of the scale without its ends."""
    return tuple(tick for tick in scale.ticks if scale.low < tick < scale.high)


def isolines(
    face: Index, nodes_mm: Array, values: Array, levels: Sequence[float]
) -> list[tuple[float, Array]]:
    """Find the lines of equal value on a patch, [a, b]: level and polyline, [n, 3], mm, of each.

    Marching squares on the values, [N], at all nodes, [N, 3], mm, straight within a cell.
    """
    at_nodes = values[face]
    low, high = float(at_nodes.min()), float(at_nodes.max())
    inside = [level for level in levels if low <= level <= high]
    if not inside or low == high:
        return []
    import contourpy

    generator = contourpy.contour_generator(z=at_nodes, name="serial")
    corners = nodes_mm[face]
    polylines: list[tuple[float, Array]] = []
    for level in inside:
        for line in generator.lines(level):
            at = np.asarray(line, dtype=float)
            if len(at) > 1:
                polylines.append((level, _bilinear(corners, at[:, 1], at[:, 0])))
    return polylines


def level_lines(
    field: Array, step: float, triangles: Index, at_nodes: Array
) -> tuple[Array, Index]:
    """Find the lines on which a field, [N], is a multiple of a step.

    Returns quantities, known at the nodes, [N, k], at the ends of each piece of line, [S, 2, k],
    and the triangle of each piece, [S]. All are linear within a triangle.
    """
    ordered = np.take_along_axis(triangles, np.argsort(field[triangles], axis=1), axis=1)
    low, middle, high = (field[ordered] / step).T
    first = np.ceil(low)
    counts = np.maximum(np.floor(high) - first + 1.0, 0.0).astype(np.intp)
    of = np.repeat(np.arange(len(triangles)), counts)
    level = first[of] + np.arange(len(of)) - (np.cumsum(counts) - counts)[of]
    lowest, between, highest = ordered[of].T
    is_lower = level < middle[of]
    sides = (
        (lowest, highest),
        (
            np.where(is_lower, lowest, between),
            np.where(is_lower, between, highest),
        ),
    )
    ends: list[Array] = []
    for start, end in sides:
        span = (field[end] - field[start]) / step
        share = (level - field[start] / step) / np.where(span > 0.0, span, np.inf)
        ends.append(at_nodes[start] + share[:, None] * (at_nodes[end] - at_nodes[start]))
    return np.stack(ends, axis=1), of


def above_limit(
    nodes_mm: Array, above: Array, triangles: Index, spacing_mm: float
) -> tuple[tuple[Array, Index], tuple[Array, Index]]:
    """Find the line on which values, [N], are zero, and hatch the surface where they are positive.

    Returns ends of pieces, [S, 2, 3], mm, and their triangles, [S]: of the line, of the hatching.
    """
    reach = 2.0 * float(np.abs(above).max(initial=1.0))  # of which only zero is a multiple
    line = level_lines(above, reach, triangles, nodes_mm)
    hatched = np.flatnonzero((above[triangles] > 0.0).any(axis=1))
    at_nodes = np.concatenate([nodes_mm, above[:, None]], axis=1)
    ends, of = level_lines(nodes_mm.sum(axis=1), spacing_mm, triangles[hatched], at_nodes)
    positive = (ends[..., 3] > 0.0).any(axis=1)
    ends, of = ends[positive], hatched[of[positive]]
    start, end = ends[:, 0, 3], ends[:, 1, 3]
    crossing = start / np.where(start == end, 1.0, start - end)
    shares = np.stack([np.where(start < 0.0, crossing, 0.0), np.where(end < 0.0, crossing, 1.0)], 1)
    shares = np.clip(shares, 0.0, 1.0)[..., None]
    hatching = ends[:, :1, :3] + shares * (ends[:, 1:, :3] - ends[:, :1, :3])
    return line, (hatching, of)


def _bilinear(corners: Array, row: Array, column: Array) -> Array:
    i = np.clip(np.floor(row).astype(int), 0, corners.shape[0] - 2)
    j = np.clip(np.floor(column).astype(int), 0, corners.shape[1] - 2)
    u, v = (row - i)[:, None], (column - j)[:, None]
    near = (1.0 - v) * corners[i, j] + v * corners[i, j + 1]
    far = (1.0 - v) * corners[i + 1, j] + v * corners[i + 1, j + 1]
    return (1.0 - u) * near + u * far
