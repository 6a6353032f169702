"""A bent volume drawn into a box of a figure: surface, lines, ghost, arrows, axes."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from warpspace.geometry.surfaces import (
    Index,
    box_edges,
    crease_lines,
    face_lines,
    is_thin,
    isoline_levels,
    isolines,
    line_spacing,
    triangulate,
)
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.labels import LINE_COST, Occupancy, draw_corners, label_isolines
from warpspace.outputs.drawing.render import (
    Body,
    Projection,
    Raster,
    Rect,
    fit_projection,
    render_bodies,
    split_visible,
)
from warpspace.outputs.drawing.sheet import DrawnMap
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.marks import tick_values
from warpspace.picture.model import Picture, map_faces
from warpspace.units import Array, spell_short

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
    """Draw a bent volume."""
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
    """Choose the projection in which several maps, drawn alike, fill a box."""
    insets = [canvas.px(inset) for inset in (INSETS if labels else SMALL_INSETS)]
    width, height = rect[2] - rect[0], rect[3] - rect[1]
    insets = [
        min(inset, 0.24 * side) for inset, side in zip(insets, (width, height) * 2, strict=True)
    ]
    inner = (rect[0] + insets[0], rect[1] + insets[1], rect[2] - insets[2], rect[3] - insets[3])
    points = [map_room_mm(picture) for picture in pictures]
    points += [] if beside_mm is None else [beside_mm]
    return fit_projection(view, np.concatenate(points), inner)


def draw_maps_alike(
    canvas: Canvas,
    pictures: Sequence[Picture],
    names: Sequence[str],
    cells: Sequence[Rect],
    view: str,
) -> tuple[DrawnMap, ...]:
    """Draw maps in one projection, each with its name above, into cells of one size."""
    head = canvas.px(30.0)
    rooms = [(left, bottom, right, top - head) for left, bottom, right, top in cells]
    shared = fit_map(canvas, pictures, rooms[0], view)
    maps: list[DrawnMap] = []
    for picture, name, room in zip(pictures, names, rooms, strict=True):
        projection = shared.moved(np.array(room[:2]) - np.array(rooms[0][:2]))
        maps.append(draw_map(canvas, picture, room, view, projection=projection))
        text, size = canvas.fit(name, room[2] - room[0] - 2.0 * head, SIZES.heading, "bold")
        high = room[3] + head - canvas.px(4.0)
        canvas.text(room[0] + head, high, text, size=size, weight="bold", va="top")
    return tuple(maps)


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
    return [part for line in lines for part in split_visible(nodes[line], projection, raster)[0]]


def draw_lone_line(
    canvas: Canvas, picture: Picture, projection: Projection, taken: Occupancy | None = None
) -> None:
    """Draw a volume without area (one axis, or none that is linear) as a coloured line or point."""
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


GAP = 16.0
"""Between the body and an axis line."""
TICK = 7.0
SHORTEST = 40.0
"""Axes seen nearly end-on, shorter than this in the picture, are left out."""


def draw_axes(
    canvas: Canvas,
    nominal_mm: Array,
    drawn_mm: Array,
    projection: Projection,
    taken: Occupancy,
    *,
    titles: bool = True,
) -> None:
    """Draw the axes of the machine frame beside the silhouette of the nominal volume."""
    flat = nominal_mm.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    spots = projection.project(np.concatenate([flat, drawn_mm.reshape(-1, 3)]))
    for axis in range(3):
        ends = _silhouette_edge(axis, low, high, projection)
        if ends is None or np.hypot(*np.diff(projection.project(ends), axis=0)[0]) < canvas.px(
            SHORTEST
        ):
            continue
        _draw_axis(canvas, axis, ends, projection, spots, taken, titles=titles)


def _silhouette_edge(axis: int, low: Array, high: Array, projection: Projection) -> Array | None:
    if high[axis] - low[axis] <= 0.0:
        return None
    rest = [other for other in range(3) if other != axis]
    edges: list[Array] = []
    for first in (low[rest[0]], high[rest[0]]):
        for second in (low[rest[1]], high[rest[1]]):
            ends = np.stack([low, high])
            ends[:, rest[0]], ends[:, rest[1]] = first, second
            edges.append(ends)
    spots = projection.project(np.array(edges))
    centre = projection.project((low + high) / 2.0)
    along = spots[0, 1] - spots[0, 0]
    length = float(np.hypot(*along))
    if length < 1e-6:
        return None
    normal = np.array([-along[1], along[0]]) / length
    offsets = (spots.mean(axis=1) - centre) @ normal
    outer = np.flatnonzero(np.abs(offsets) >= np.abs(offsets).max() - 1e-6)
    upright = abs(along[1]) > 2.0 * abs(along[0])
    key = spots.mean(axis=1)[:, 0 if upright else 1]
    return edges[min(outer, key=lambda at: (round(float(key[at]), 3), at))]


def _draw_axis(
    canvas: Canvas,
    axis: int,
    ends_mm: Array,
    projection: Projection,
    spots: Array,
    taken: Occupancy,
    *,
    titles: bool,
) -> None:
    start, end = projection.project(ends_mm)
    along = (end - start) / np.hypot(*(end - start))
    normal = np.array([along[1], -along[0]])
    upright = abs(along[1]) > 2.0 * abs(along[0])
    if (normal[0] > 0.0) if upright else (normal[1] > 0.0):
        normal = -normal
    # clear of what sticks out beyond the nominal edge, beside the length of the axis
    beside = (spots - start) @ along
    near = spots[(beside > 0.0) & (beside < np.hypot(*(end - start)))]
    sticking = float(((near - start) @ normal).max(initial=0.0))
    base = normal * (max(sticking, 0.0) + canvas.px(GAP))
    theme = canvas.theme
    line = np.stack([start + base, end + base])
    canvas.line(line, width=SIZES.thin, colour=theme.muted, zorder=2.0)
    taken.add_lines([line], LINE_COST)
    low, high = float(ends_mm[0, axis]), float(ends_mm[1, axis])
    reach = 0.0
    for value in tick_values(low, high, float(np.hypot(*(end - start))) / canvas.px(78.0)):
        at = start + base + (value - low) / (high - low) * (end - start)
        canvas.line(
            [tuple(at), tuple(at + canvas.px(TICK) * normal)],
            width=SIZES.thin, colour=theme.muted, zorder=2.0,
        )  # fmt: skip
        text = spell_short(value)
        size = canvas.text_size(text, SIZES.small)
        away = canvas.px(TICK + 5.0) + _half_extent(size, normal)
        centre = at + away * normal
        reach = max(reach, away + _half_extent(size, normal))
        canvas.text(
            float(centre[0]),
            float(centre[1]),
            text,
            size=SIZES.small,
            colour=theme.muted,
            ha="center",
            va="center_baseline",
        )
    if titles:
        angle = math.degrees(math.atan2(along[1], along[0]))
        angle = (angle + 90.0) % 180.0 - 90.0 if abs(abs(angle) - 90.0) > 1e-6 else 90.0
        height = canvas.text_size("X", SIZES.text)[1]
        middle = (start + end) / 2.0 + base + (reach + canvas.px(6.0) + 0.7 * height) * normal
        canvas.text(
            float(middle[0]),
            float(middle[1]),
            f"{'XYZ'[axis]} [mm]",
            ha="center",
            va="center_baseline",
            rotation=angle,
        )


def _half_extent(size: tuple[float, float], normal: Array) -> float:
    return 0.5 * (size[0] * abs(float(normal[0])) + size[1] * abs(float(normal[1])))
