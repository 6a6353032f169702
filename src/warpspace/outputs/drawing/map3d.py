"""A bent volume drawn into a box of a figure: surface, lines, ghost, arrows, axes."""

from collections.abc import Callable, Sequence

import numpy as np

from warpspace.geometry.faces import crease_lines, face_lines
from warpspace.geometry.isolines import isoline_levels, isolines
from warpspace.geometry.surfaces import (
    Index,
    box_edges,
    line_spacing,
    triangulate,
)
from warpspace.geometry.thicken import is_thin
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing.annotations import draw_corners, label_isolines
from warpspace.outputs.drawing.axes3d import draw_axes
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.content import DrawnMap
from warpspace.outputs.drawing.labels import LINE_COST, Occupancy
from warpspace.outputs.drawing.lines import split_visible
from warpspace.outputs.drawing.projection import Projection, Rect, fit_projection
from warpspace.outputs.drawing.render import Body, Raster, render_bodies
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.model import Picture
from warpspace.picture.topology import map_faces
from warpspace.units import Array

INSETS = (112.0, 92.0, 84.0, 46.0)
"""Room for axes and labels around the body: left, bottom, right, top."""
SMALL_INSETS = (70.0, 74.0, 40.0, 40.0)
GHOST_DASHES = (11.0, 7.0)
LONE_LINE_COST = 8.0
"""Labels keep off the line that is all there is of a volume."""
Annotate = Callable[[Canvas, Picture, Projection, Raster | None, Occupancy, Rect | None], None]


def draw_map(
    canvas: Canvas,
    picture: Picture,
    rect: Rect,
    view: str,
    *,
    labels: bool = True,
    projection: Projection | None = None,
    annotate: Annotate | None = draw_corners,
    ghost: bool = True,
    axes: bool = True,
) -> DrawnMap:
    """Draw a bent volume.

    Parameters
    ----------
    canvas : Canvas
    picture : Picture
    rect : tuple of float, (4,), px
        Box of the figure to stay in.
    view : str
    labels : bool, optional
        Whether corner displacements are labelled and axes titled; small maps do without.
    projection : Projection, optional
        Instead of the one that fills the box.
    annotate : callable, optional
        Draws what stands out of the surface; corner displacements by default.
    ghost : bool, optional
        Whether the nominal volume is drawn.
    axes : bool, optional
        Whether axes with numbers are drawn around it.

    Returns
    -------
    DrawnMap
    """
    nodes = picture.drawn_mm.reshape(-1, 3)
    values = picture.values.reshape(-1)
    projection = projection or fit_map(canvas, [picture], rect, view, labels=labels)
    faces = map_faces(picture.shape, cut=view == "iso")
    surface = triangulate(faces)
    raster: Raster | None = None
    if len(surface.triangles):
        body = Body(nodes[surface.nodes], surface.triangles, values[surface.nodes], picture.scale)
        raster = render_bodies([body], projection)
        canvas.image(raster.reduced() if canvas.exact else raster.rgba, raster.rect, zorder=1.0)
    start = len(canvas.rects)
    taken = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    if raster is not None:
        taken.add_mask(raster.rgba[..., 3] > 0, raster.rect)
    _draw_surface_lines(canvas, picture, faces, projection, raster, taken)
    draw_lone_line(canvas, picture, projection, taken)
    if ghost:
        _draw_ghost(canvas, picture, projection, raster, taken)
    if axes:
        draw_axes(canvas, picture.grid.nominal_mm, nodes, projection, taken, titles=labels)
    taken.add_rects(canvas.rects[start:])
    if annotate is not None:
        annotate(canvas, picture, projection, raster, taken, rect if labels else None)
    return DrawnMap(
        projection, picture.scale, picture.values, picture.drawn_mm, picture.exaggeration,
        raster, tuple(canvas.rects[start:]),
    )  # fmt: skip


def fit_map(
    canvas: Canvas,
    pictures: Sequence[Picture],
    rect: Rect,
    view: str,
    *,
    labels: bool = True,
    beside_mm: Array | None = None,
) -> Projection:
    """Choose the projection in which several maps, drawn alike, fill a box.

    Parameters
    ----------
    canvas : Canvas
    pictures : sequence of Picture
    rect : tuple of float, (4,), px
    view : str
    labels : bool, optional
        Whether to leave room for labels.
    beside_mm : ndarray, [n, 3], mm, optional
        Further points to be seen.

    Returns
    -------
    Projection
    """
    insets = [canvas.px(inset) for inset in (INSETS if labels else SMALL_INSETS)]
    width, height = rect[2] - rect[0], rect[3] - rect[1]
    insets = [
        min(inset, 0.24 * side) for inset, side in zip(insets, (width, height) * 2, strict=True)
    ]
    inner = (rect[0] + insets[0], rect[1] + insets[1], rect[2] - insets[2], rect[3] - insets[3])
    points = [map_room_mm(picture) for picture in pictures]
    points += [] if beside_mm is None else [beside_mm]
    return fit_projection(view, np.concatenate(points), inner)


def map_room_mm(picture: Picture) -> Array:
    """Give what of a volume is to be seen, [n, 3], mm: where it is, where it is drawn.

    Around a point also half the length it is sized by: its displacement is chosen for that. Of a
    curved volume also the box about it, which its axes run along.
    """
    points = [picture.grid.nominal_mm.reshape(-1, 3), picture.drawn_mm.reshape(-1, 3)]
    if any(axis and not is_linear(axis) for axis in picture.grid.axes):
        nodes = np.concatenate(points)
        x, y, z = np.stack([nodes.min(axis=0), nodes.max(axis=0)], -1)
        points.append(np.stack(np.meshgrid(x, y, z), -1).reshape(-1, 3))
    if not picture.grid.longest_edge_mm > 0.0:
        around = 0.5 * picture.size_mm * np.array([[-1.0], [1.0]])
        points.append(picture.grid.bounds_mm + around)
    return np.concatenate(points)


def _draw_surface_lines(
    canvas: Canvas,
    picture: Picture,
    faces: list[Index],
    projection: Projection,
    raster: Raster | None,
    taken: Occupancy,
) -> None:
    """Draw grid lines, creases and isolines where the surface does not hide them."""
    if not faces:
        return
    theme, shape = canvas.theme, picture.shape
    nodes, values = picture.drawn_mm.reshape(-1, 3), picture.values.reshape(-1)
    nx, ny, nz = (line_spacing(count) for count in shape)
    grid = _visible(face_lines(faces, shape, (nx, ny, nz)), nodes, projection, raster)
    canvas.lines(grid, width=SIZES.hair, colour=theme.grid, alpha=0.42, zorder=2.0)
    creases = _visible(crease_lines(faces, shape), nodes, projection, raster)
    canvas.lines(creases, width=SIZES.line, colour=theme.grid, zorder=3.0)
    taken.add_lines(creases, LINE_COST)
    diverging = picture.scale.diverging
    levels = isoline_levels(picture.scale)
    by_level: dict[float, list[Array]] = {}
    for face in faces:
        for level, line in isolines(face, nodes, values, levels):
            seen = split_visible(line, projection, raster)[0]
            by_level.setdefault(level, []).extend(seen)
    colour = theme.grid if diverging else theme.isoline
    for level, lines in by_level.items():
        width = SIZES.line if diverging and level == 0.0 else SIZES.thin
        canvas.lines(lines, width=width, colour=colour, alpha=0.95, zorder=2.5)
    taken.add_lines([line for lines in by_level.values() for line in lines], 0.5)
    label_isolines(canvas, by_level, colour, theme.isoline if diverging else theme.grid, taken)


def _visible(
    lines: list[Index], nodes: Array, projection: Projection, raster: Raster | None
) -> list[Array]:
    """Visible parts of lines along grid nodes, px."""
    return [part for line in lines for part in split_visible(nodes[line], projection, raster)[0]]


def draw_lone_line(
    canvas: Canvas, picture: Picture, projection: Projection, taken: Occupancy | None = None
) -> None:
    """Draw a volume without area (one axis, or none that is linear) as a coloured line or point.

    Parameters
    ----------
    canvas : Canvas
    picture : Picture
        Nothing is drawn of a volume with area.
    projection : Projection
    taken : Occupancy, optional
        Is marked with the line.
    """
    if not is_thin(picture.shape):
        return
    spots = projection.project(picture.drawn_mm.reshape(-1, 3))
    values = picture.values.reshape(-1)
    colours = picture.scale.colours(values) / 255.0
    if len(spots) == 1:
        canvas.disc(spots[0], 7.0, colours[0])
        return
    pieces = [spots[i : i + 2] for i in range(len(spots) - 1)]
    middle = picture.scale.colours((values[1:] + values[:-1]) / 2.0) / 255.0
    canvas.lines(pieces, width=7.0, colour=middle, zorder=2.0)
    if taken is not None:
        taken.add_lines([spots], LONE_LINE_COST)
    for spot, colour in zip(spots, colours, strict=True):
        canvas.disc(spot, 4.5, colour)


def _draw_ghost(
    canvas: Canvas,
    picture: Picture,
    projection: Projection,
    raster: Raster | None,
    taken: Occupancy,
) -> None:
    """Draw the nominal volume dashed, faint where the body hides it."""
    nodes = picture.grid.nominal_mm.reshape(-1, 3)
    seen: list[Array] = []
    hidden: list[Array] = []
    for edge in box_edges(picture.shape):
        visible, behind = split_visible(nodes[edge], projection, raster)
        seen += visible
        hidden += behind
    theme = canvas.theme
    canvas.lines(
        hidden, width=SIZES.hair, colour=theme.ghost, alpha=0.6, dashes=GHOST_DASHES, zorder=3.2
    )
    canvas.lines(seen, width=SIZES.line, colour=theme.ghost, dashes=GHOST_DASHES, zorder=3.3)
    taken.add_lines(seen, LINE_COST)
    taken.add_lines(hidden, 0.5 * LINE_COST)
