"""The coloured map of a picture as triangles and pieces of line: whole, cut open, or in slices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.surfaces import (
    THICKNESS,
    Index,
    above_limit,
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
    """Mesh of a map, mm in R."""

    vertices_mm: Array  # [M, 3]
    triangles: NDArray[np.intp]  # [T, 3] or [S, 2]
    values: Array  # [M]; in the unit of the picture's scale
    faded: NDArray[np.bool_] | None  # [M]; where colours fade; None for nowhere


@dataclass(frozen=True, slots=True)
class MapPatch:
    """One grid of a map: the volume, or a slice."""

    drawn_mm: Array
    values: Array
    drawn_of: Topology
    lifts: tuple[float, ...]
    directions: Array  # of the axes of the grid, +1 or −1: an axis may run against its name
    faded: NDArray[np.bool_] | None = None

    def pieces(self, segments: Index, outwards: Pieces, times: float) -> list[Pieces]:
        """Lift pieces of line off the surface, on each visible side, [S, 2, 3] each, mm."""
        ends = self.drawn_mm.reshape(-1, 3).take(segments, axis=0).astype(np.float32)
        return [
            ends + (outwards * (lift * times * self.directions)).astype(np.float32)
            for lift in self.lifts
        ]


def map_parts(picture: Picture) -> list[MapPatch]:
    """List the grids of a map: the volume, or its slices, which are visible from both sides."""
    lift = LIFT * picture.size_mm
    lifts = (lift, -lift) if picture.slices else (lift,)
    parts: list[MapPatch] = []
    for section in picture.slices or (picture,):
        drawn_mm, values = thick_nodes(section, section.drawn_mm), spread(section.values)
        faded = None if section.faded is None else spread(section.faded)
        drawn_of = topology(values.shape, cut=section.cut)
        parts.append(MapPatch(drawn_mm, values, drawn_of, lifts, section.grid.directions, faded))
    return parts


def thick_nodes(picture: Picture, nodes_mm: Array) -> Array:
    """Return the nodes of a grid for drawing, [mx, my, mz, 3], mm: a line becomes a bar."""
    thin = is_thin(picture.shape)
    return thicken(nodes_mm, THICKNESS * picture.size_mm) if thin else nodes_mm


def solid_map(picture: Picture) -> tuple[Array, Index, Index]:
    """Build the surface that a ray can hit: points, triangles, and the grid node of each point."""
    thick = thick_nodes(picture, picture.drawn_mm)
    surface = topology(thick.shape[:3], cut=picture.cut).surface
    nodes = spread_nodes(picture.shape)[surface.nodes]
    return thick.reshape(-1, 3)[surface.nodes], surface.triangles, nodes


def outline_pieces(picture: Picture, nodes_mm: Array) -> Pieces:
    """Collect the edges of a picture's grid with its nodes at other points, [S, 2, 3], mm."""
    thick = thick_nodes(picture, nodes_mm)
    edges = topology(thick.shape[:3], cut=picture.cut).edge_segments
    return thick.reshape(-1, 3)[edges].astype(np.float32)


def map_mesh(picture: Picture) -> MapMesh:
    surfaces = [(part, part.drawn_of.surface) for part in map_parts(picture)]
    return _collect([(part, surface.nodes, surface.triangles) for part, surface in surfaces])


def line_mesh(picture: Picture, *, grid: bool = True) -> MapMesh:
    """Build the lines of a map without its surface: grid and edges, or the edges only."""
    patches: list[tuple[MapPatch, Index, Index]] = []
    for part in map_parts(picture):
        segments = part.drawn_of.edge_segments
        if grid:
            segments = np.concatenate([part.drawn_of.grid_segments, segments])
        used, numbered = np.unique(segments, return_inverse=True)
        patches.append((part, used, numbered.reshape(-1, 2)))
    return _collect(patches)


def _collect(patches: list[tuple[MapPatch, Index, Index]]) -> MapMesh:
    vertices = [part.drawn_mm.reshape(-1, 3).take(used, axis=0) for part, used, _ in patches]
    values = [part.values.reshape(-1).take(used) for part, used, _ in patches]
    faded = [part.faded.reshape(-1)[at] for part, at, _ in patches if part.faded is not None]
    fading = np.concatenate(faded) if faded else None  # all patches have it, or none
    if len(patches) == 1:  # the same triangles for every picture of a grid
        return MapMesh(vertices[0], patches[0][2], values[0], fading)
    first = np.cumsum([0, *map(len, vertices)])
    cells = [cells + at for (_, _, cells), at in zip(patches, first, strict=False)]
    return MapMesh(np.concatenate(vertices), np.concatenate(cells), np.concatenate(values), fading)


def grid_pieces(picture: Picture) -> Pieces:
    """Collect the grid lines on a map, [S, 2, 3], mm."""
    lines: list[Pieces] = []
    for part in map_parts(picture):
        lines += part.pieces(part.drawn_of.grid_segments, part.drawn_of.grid_outwards, 1.0)
    return _joined(lines)


def edge_pieces(picture: Picture) -> Pieces:
    """Collect the edges of a map, [S, 2, 3], mm."""
    lines: list[Pieces] = []
    for part in map_parts(picture):
        lines += part.pieces(part.drawn_of.edge_segments, part.drawn_of.edge_outwards, EDGE_LIFT)[
            :1
        ]
    return _joined(lines)


def isoline_pieces(picture: Picture) -> Pieces:
    """Collect the lines of equal value on a map, at the ticks of its scale, [S, 2, 3], mm."""
    levels = isoline_levels(picture.scale)
    lines: list[Pieces] = []
    for part in map_parts(picture):
        nodes, values = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1)
        normals = part.drawn_of.normals * part.directions
        lines += [
            (np.stack([line[:-1], line[1:]], axis=1) + off).astype(np.float32)
            for lift in part.lifts
            for face, off in zip(part.drawn_of.faces, ISOLINE_LIFT * lift * normals, strict=True)
            for _, line in isolines(face, nodes, values, levels)
        ]
    return _joined(lines)


HATCH = 0.05  # distance of the hatching along a line parallel to an edge, relative to the longest


def limit_pieces(picture: Picture, limit: float) -> tuple[Pieces, Pieces]:
    """Collect the line at a limit of the values, and the hatching above it, [S, 2, 3] each, mm."""
    lines: tuple[list[Pieces], list[Pieces]] = ([], [])
    for part in map_parts(picture):
        nodes_mm, above = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1) - limit
        surface, patches = part.drawn_of.surface, part.drawn_of.faces
        counts = [2 * (face.shape[0] - 1) * (face.shape[1] - 1) for face in patches]
        normals = np.repeat(part.drawn_of.normals * part.directions, counts, axis=0)
        triangles = surface.nodes[surface.triangles]
        drawn = above_limit(nodes_mm, above, triangles, HATCH * picture.size_mm)
        for pieces, (ends, of) in zip(lines, drawn, strict=True):
            lifts = (ISOLINE_LIFT * lift * normals[of][:, None] for lift in part.lifts)
            pieces += [(ends + off).astype(np.float32) for off in lifts]
    return np.concatenate(lines[0]), np.concatenate(lines[1])


def _joined(parts: list[Pieces]) -> Pieces:
    nonempty = [part for part in parts if len(part)]
    if not nonempty:
        return np.zeros((1, 2, 3), np.float32)
    return nonempty[0] if len(nonempty) == 1 else np.concatenate(nonempty)


LEAST_LENGTH = 0.2  # shortest line that carries its value, as a part of the longest edge
ALONG_SLICE = 0.3
"""Position of the value along its line on a slice: in the middle another slice crosses it."""
MOST_LABELS = 60


@dataclass(frozen=True, slots=True)
class IsolineLabel:
    """The value of one line."""

    value: float  # in the unit of the picture's scale
    at_mm: Array  # [3]; on the line, where it is drawn
    outward: Array  # [3]; normal of the face with the line; of a slice one of the two
    length_mm: float  # of the line


def isoline_labels(picture: Picture) -> list[IsolineLabel]:
    """Place the values of isolines: one for each level on each face or slice."""
    levels = isoline_levels(picture.scale)
    lines: list[IsolineLabel] = []
    for part in map_parts(picture):
        nodes, values = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1)
        normals = part.drawn_of.normals * part.directions
        for face, normal in zip(part.drawn_of.faces, normals, strict=True):
            longest: dict[float, IsolineLabel] = {}
            for value, line in isolines(face, nodes, values, levels):
                at, length = _part_way(line, ALONG_SLICE if picture.slices else 0.5)
                if length > (longest[value].length_mm if value in longest else 0.0):
                    longest[value] = IsolineLabel(value, at, normal, length)
            lines += longest.values()
    least = LEAST_LENGTH * picture.size_mm
    long_enough = [label for label in lines if label.length_mm >= least]
    return sorted(long_enough, key=lambda label: -label.length_mm)[:MOST_LABELS]


def _part_way(line: Array, share: float) -> tuple[Array, float]:
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = share * along[-1]
    return np.array([np.interp(at, along, line[:, k]) for k in range(3)]), float(along[-1])
