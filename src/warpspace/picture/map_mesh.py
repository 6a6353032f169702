"""The coloured map of a picture as triangles and pieces of line: whole, cut open, or in slices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.surfaces import (
    THICKNESS,
    Index,
    is_thin,
    isoline_levels,
    isolines,
    spread,
    spread_nodes,
    thicken,
)
from warpspace.picture.model import Picture, Topology, topology
from warpspace.units import Array

LIFT = 0.0012  # how far grid lines are lifted off the surface, as a part of the longest edge
EDGE_LIFT, ISOLINE_LIFT = 1.5, 1.25  # edges and isolines, in multiples of that
Pieces = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class MapMesh:
    """What is drawn of a map, mm in R."""

    vertices_mm: Array  # [M, 3]
    triangles: NDArray[np.intp]  # [T, 3] or [S, 2]
    values: Array  # [M]; what is coloured, in the unit of the picture's scale
    faded: NDArray[np.bool_] | None  # [M]; where colours fade; None for nowhere


@dataclass(frozen=True, slots=True)
class MapPatch:
    """One grid of a map: the volume, or a slice."""

    drawn_mm: Array
    values: Array
    drawn_of: Topology
    lifts: tuple[float, ...]
    ways: Array  # direction of each axis of the grid, +1 or −1: an axis may run against its name
    faded: NDArray[np.bool_] | None = None

    def pieces(self, segments: Index, outwards: Pieces, times: float) -> list[Pieces]:
        """Give pieces of line off the surface, on each side that is seen, [S, 2, 3] each, mm."""
        ends = self.drawn_mm.reshape(-1, 3).take(segments, axis=0).astype(np.float32)
        return [
            ends + (outwards * (lift * times * self.ways)).astype(np.float32) for lift in self.lifts
        ]


def map_parts(picture: Picture) -> list[MapPatch]:
    """List the grids that the map of a picture consists of; a slice is seen from both sides."""
    lift = LIFT * picture.size_mm
    lifts = (lift, -lift) if picture.slices else (lift,)
    parts: list[MapPatch] = []
    for one in picture.slices or (picture,):
        drawn_mm, values = thick_nodes(one, one.drawn_mm), spread(one.values)
        faded = None if one.faded is None else spread(one.faded)
        drawn_of = topology(values.shape, cut=one.cut)
        parts.append(MapPatch(drawn_mm, values, drawn_of, lifts, one.grid.directions, faded))
    return parts


def thick_nodes(picture: Picture, nodes_mm: Array) -> Array:
    """Give nodes of a picture's grid as they are drawn, [mx, my, mz, 3], mm: a line as a bar."""
    thin = is_thin(picture.shape)
    return thicken(nodes_mm, THICKNESS * picture.size_mm) if thin else nodes_mm


def solid_map(picture: Picture) -> tuple[Array, Index, Index]:
    """Give what a ray can meet of a map: points, triangles, and the grid node of each point."""
    thick = thick_nodes(picture, picture.drawn_mm)
    surface = topology(thick.shape[:3], cut=picture.cut).surface
    nodes = spread_nodes(picture.shape)[surface.nodes]
    return thick.reshape(-1, 3)[surface.nodes], surface.triangles, nodes


def outline_pieces(picture: Picture, nodes_mm: Array) -> Pieces:
    """Look up the edges of a picture's grid with its nodes elsewhere, [S, 2, 3], mm."""
    thick = thick_nodes(picture, nodes_mm)
    of = topology(thick.shape[:3], cut=picture.cut)
    return thick.reshape(-1, 3)[of.edge_segments].astype(np.float32)


def map_mesh(picture: Picture) -> MapMesh:
    surfaces = [(part, part.drawn_of.surface) for part in map_parts(picture)]
    return _collect([(part, surface.nodes, surface.triangles) for part, surface in surfaces])


def line_mesh(picture: Picture, *, grid: bool = True) -> MapMesh:
    """Give the lines of a map alone: those of its grid too, or only its edges."""
    found: list[tuple[MapPatch, Index, Index]] = []
    for part in map_parts(picture):
        segments = part.drawn_of.edge_segments
        if grid:
            segments = np.concatenate([part.drawn_of.grid_segments, segments])
        used, numbered = np.unique(segments, return_inverse=True)
        found.append((part, used, numbered.reshape(-1, 2)))
    return _collect(found)


def _collect(found: list[tuple[MapPatch, Index, Index]]) -> MapMesh:
    vertices = [part.drawn_mm.reshape(-1, 3).take(used, axis=0) for part, used, _ in found]
    values = [part.values.reshape(-1).take(used) for part, used, _ in found]
    faded = [part.faded.reshape(-1)[at] for part, at, _ in found if part.faded is not None]
    where = np.concatenate(faded) if faded else None  # all parts have it, or none
    if len(found) == 1:
        return MapMesh(vertices[0], found[0][2], values[0], where)
    first = np.cumsum([0, *map(len, vertices)])
    cells = [cells + at for (_, _, cells), at in zip(found, first, strict=False)]
    return MapMesh(np.concatenate(vertices), np.concatenate(cells), np.concatenate(values), where)


def grid_pieces(picture: Picture) -> Pieces:
    """Collect the grid lines on a map, [S, 2, 3], mm."""
    found: list[Pieces] = []
    for part in map_parts(picture):
        found += part.pieces(part.drawn_of.grid_segments, part.drawn_of.grid_outwards, 1.0)
    return _joined(found)


def edge_pieces(picture: Picture) -> Pieces:
    """Collect the edges of a map, [S, 2, 3], mm."""
    return _joined(
        [
            part.pieces(part.drawn_of.edge_segments, part.drawn_of.edge_outwards, EDGE_LIFT)[0]
            for part in map_parts(picture)
        ]
    )


def isoline_pieces(picture: Picture) -> Pieces:
    """Collect the lines of equal value on a map, at the ticks of its scale, [S, 2, 3], mm."""
    levels = isoline_levels(picture.scale)
    found: list[Pieces] = []
    for part in map_parts(picture):
        nodes, values = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1)
        normals = part.drawn_of.normals * part.ways
        found += [
            (np.stack([line[:-1], line[1:]], axis=1) + off).astype(np.float32)
            for lift in part.lifts
            for face, off in zip(part.drawn_of.faces, ISOLINE_LIFT * lift * normals, strict=True)
            for _, line in isolines(face, nodes, values, levels)
        ]
    return _joined(found)


def _joined(parts: list[Pieces]) -> Pieces:
    kept = [part for part in parts if len(part)]
    if not kept:
        return np.zeros((1, 2, 3), np.float32)
    return kept[0] if len(kept) == 1 else np.concatenate(kept)


# Where they stand, so that few of them say what each line means.

LEAST_LENGTH = 0.2  # shortest line that carries its value, as a part of the longest edge
ALONG_SLICE = 0.3
"""Where along its line the value stands on a slice: in the middle another slice crosses it."""
MOST_LABELS = 60


@dataclass(frozen=True, slots=True)
class IsolineLabel:
    """The value of one line."""

    value: float  # in the unit of the picture's scale
    at_mm: Array  # [3]; on the line, where it is drawn
    outward: Array  # [3]; direction that the face with the line looks to; of a slice one of the two
    length_mm: float  # of the line


def isoline_labels(picture: Picture) -> list[IsolineLabel]:
    """Choose where the lines of equal value carry their value: one on each face or slice."""
    levels = isoline_levels(picture.scale)
    found: list[IsolineLabel] = []
    for part in map_parts(picture):
        nodes, values = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1)
        normals = part.drawn_of.normals * part.ways
        for face, normal in zip(part.drawn_of.faces, normals, strict=True):
            longest: dict[float, IsolineLabel] = {}
            for value, line in isolines(face, nodes, values, levels):
                at, length = _part_way(line, ALONG_SLICE if picture.slices else 0.5)
                if length > (longest[value].length_mm if value in longest else 0.0):
                    longest[value] = IsolineLabel(value, at, normal, length)
            found += longest.values()
    least = LEAST_LENGTH * picture.size_mm
    kept = [label for label in found if label.length_mm >= least]
    return sorted(kept, key=lambda label: -label.length_mm)[:MOST_LABELS]


def _part_way(line: Array, share: float) -> tuple[Array, float]:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = share * along[-1]
    return np.array([np.interp(at, along, line[:, k]) for k in range(3)]), float(along[-1])
