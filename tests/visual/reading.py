"""Reading a figure back: from pixels to numbers, with a ruler and the colour bar."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from trimesh import Trimesh

from warpspace.geometry.colour import ColourScale, colour_table
from warpspace.geometry.surfaces import crease_lines, triangulate
from warpspace.outputs.drawing.off_screen import Raster
from warpspace.outputs.drawing.sheet import DrawnMap
from warpspace.picture.model import map_faces
from warpspace.units import Array

SLOPE_TOLERANCE = 0.005
DEPTH_TOLERANCE_MM = 1.0
LEAST_FACING = 0.25
"""Cosine between the viewer and the surface below which it is seen too much from the side."""
EDGE_PX = 3.0
"""Nodes nearer to an edge than this, px of the raster, are not read: two faces meet there."""


@dataclass(frozen=True)
class Reading:
    read: Array
    known: Array
    depth_mm: Array

    @property
    def slope(self) -> float:
        known = self.known - self.known.mean()
        return float((known @ (self.read - self.read.mean())) / (known @ known))

    def agrees(self) -> bool:
        offset = abs(float((self.read - self.known).mean())) / float(np.ptp(self.known))
        return (
            abs(self.slope - 1.0) <= SLOPE_TOLERANCE
            and offset <= SLOPE_TOLERANCE
            and float(np.abs(self.depth_mm).max()) <= DEPTH_TOLERANCE_MM
        )


def invert_colours(rgb: Array, scale: ColourScale, diverging: bool | None = None) -> Array:
    """Find the values of colours, by the nearest point on the polyline of the colour map."""
    diverging = scale.diverging if diverging is None else diverging
    table = colour_table(diverging=diverging).astype(float)
    start, step = table[:-1], np.diff(table, axis=0)
    length = np.maximum((step**2).sum(axis=-1), 1e-9)
    along = np.clip(((rgb[:, None] - start) * step).sum(axis=-1) / length, 0.0, 1.0)
    distance = ((start + along[..., None] * step - rgb[:, None]) ** 2).sum(axis=-1)
    nearest = distance.argmin(axis=1)
    share = (nearest + along[np.arange(len(rgb)), nearest]) / (len(table) - 1)
    return scale.low + share * (scale.high - scale.low)


def read_map(
    drawn: DrawnMap,
    expected_mm: Array,
    known: Array,
    view: str = "iso",
    *,
    diverging: bool | None = None,
) -> Reading:
    """Read a drawn map at the nodes that the model says are visible."""
    assert drawn.raster is not None
    raster, projection = drawn.raster, drawn.projection
    shape = known.shape
    expected = expected_mm.reshape(-1, 3)
    faces = map_faces(shape, cut=view == "iso")
    surface = triangulate(faces)
    facing = np.zeros(len(expected), dtype=bool)
    body = Trimesh(expected[surface.nodes], surface.triangles, process=False)
    towards = body.vertex_normals @ projection.towards
    # a slice has no outside: it is seen from both
    facing[surface.nodes] = (np.abs(towards) if min(shape) == 1 else towards) > LEAST_FACING
    facing[np.concatenate(crease_lines(faces, shape))] = False
    nodes = np.flatnonzero(facing)
    spots, depth = projection.project(expected[nodes]), projection.depth_mm(expected[nodes])
    # hidden behind another part of the body: judged by the drawn depth, loosely
    seen = (raster.depth_at(spots) >= depth - 25.0) & _inside(raster, spots, projection.px_per_mm)
    nodes, spots, depth = nodes[seen], spots[seen], depth[seen]
    left, _, _, top = raster.rect
    column = np.floor((spots[:, 0] - left) * raster.sampling).astype(int)
    row = np.floor((top - spots[:, 1]) * raster.sampling).astype(int)
    rgb = raster.rgba[row, column, :3].astype(float)
    return Reading(
        invert_colours(rgb, drawn.picture.scale, diverging),
        known.reshape(-1)[nodes],
        raster.depth_at(spots) - depth,
    )


def _inside(raster: Raster, spots: Array, px_per_mm: float) -> np.ndarray:
    """Keep points whose surroundings are one smooth piece of surface."""
    reach = EDGE_PX / raster.sampling
    around = product((-reach, 0.0, reach), repeat=2)
    stacked = np.stack([raster.depth_at(spots + np.array(step)) for step in around])
    drawn = np.isfinite(stacked).all(axis=0)
    steep = np.ptp(np.where(drawn, stacked, 0.0), axis=0)
    return drawn & (steep < 4.0 * 2.0 * reach / px_per_mm)
