"""A bent volume drawn into a box of a figure: surface, lines, ghost, arrows, axes, labels."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from warpspace.geometry import surfaces
from warpspace.geometry.colour import tick_values
from warpspace.machine.axes import is_linear
from warpspace.outputs.drawing.canvas import (
    LEADER_FROM,
    LINE_COST,
    Canvas,
    Occupancy,
    Points,
    write_label,
)
from warpspace.outputs.drawing.off_screen import (
    Projection,
    Raster,
    Rect,
    RenderedBody,
    fit_projection,
    render_bodies,
    split_visible,
)
from warpspace.outputs.drawing.settings import SIZES
from warpspace.outputs.drawing.sheet import DrawnMap
from warpspace.picture.map_mesh import HATCH
from warpspace.picture.model import Picture, map_faces
from warpspace.units import MICROMETRE, Array, spell_fixed, spell_short


@dataclass(frozen=True, slots=True)
class Stage:
    """A volume on its canvas, while it is drawn."""

    canvas: Canvas
    picture: Picture
    projection: Projection
    raster: Raster | None  # the drawn body; None without a surface
    occupancy: Occupancy
    frame: Rect | None  # limits of the labels; None without labels

    def split(self, lines_mm: Iterable[Array]) -> tuple[list[Array], list[Array]]:
        """Split polylines into visible parts and parts hidden by the body, px."""
        return split_visible(lines_mm, self.projection, self.raster)

    def label(self, text: str, anchors: Points) -> None:
        if self.frame is None:
            return
        canvas, colour = self.canvas, self.canvas.theme.accent
        placed = write_label(
            canvas, text, anchors, self.frame, self.occupancy, weight="bold", colour=colour
        )
        if placed and placed.distance > canvas.px(LEADER_FROM) and len(anchors) > 1:
            placed.draw_leader(canvas, colour, 3.9)


def draw_split(
    canvas: Canvas,
    lines_mm: Iterable[Array],
    projection: Projection,
    raster: Raster | None,
    *,
    alpha: tuple[float, float],
    **style: Any,
) -> None:
    """Draw the visible parts of polylines thin, the hidden ones as hair lines."""
    parts = split_visible(lines_mm, projection, raster)
    for lines, width, opacity in zip(parts, (SIZES.thin, SIZES.hair), alpha, strict=True):
        canvas.lines(lines, width=width, alpha=opacity, **style)


ARROW_COST = 12.0
_SHARES = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8)
_CANDIDATE_LINES = 3


def label_isolines(
    stage: Stage, by_level: Mapping[float, Sequence[Array]], colour: str, halo: str
) -> None:
    """Write each level once, along a long visible piece of its line."""
    canvas, occupancy = stage.canvas, stage.occupancy
    for level, lines in by_level.items():
        text = spell_short(level)
        size = canvas.text_size(text, SIZES.small)
        best, least = None, math.inf
        longest = sorted(lines, key=_length, reverse=True)[:_CANDIDATE_LINES]
        long_enough = (line for line in longest if _length(line) >= 4.0 * size[0])
        for line, share in product(long_enough, _SHARES):
            x, y, angle = _label_position(line, share, size)
            box = (x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2)
            cost = occupancy.at(box)
            if cost < least - 0.05:
                best, least = (x, y, angle), cost
        if best is None:
            continue
        x, y, angle = best
        rect = canvas.text(
            x, y, text, size=SIZES.small, colour=colour, halo=halo, ha="center",
            va="center_baseline", rotation=angle, zorder=3.1,
        )  # fmt: skip
        occupancy.add_rects([rect])


def _length(line: Array) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _label_position(
    line: Array, share: float, size: tuple[float, float]
) -> tuple[float, float, float]:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    spots = share * along[-1] + np.array([-0.5, 0.0, 0.5]) * size[0]
    x, y = (np.interp(spots, along, line[:, axis]) for axis in range(2))
    angle = (float(np.degrees(np.arctan2(y[2] - y[0], x[2] - x[0]))) + 90.0) % 180.0 - 90.0
    lift = 0.85 * size[1]
    tilt = np.radians(angle)
    return float(x[1] - lift * np.sin(tilt)), float(y[1] + lift * np.cos(tilt)), angle


def draw_corners(stage: Stage) -> None:
    canvas, picture, projection = stage.canvas, stage.picture, stage.projection
    nominal, drawn = picture.grid.nominal_mm.reshape(-1, 3), picture.drawn_mm.reshape(-1, 3)
    length = np.linalg.norm(picture.field.error_um.reshape(-1, 3), axis=-1)
    worst = int(np.argmax(length))
    corners = surfaces.corners(picture.shape).tolist()
    depth = projection.depth_mm(nominal[corners])
    front = float(depth.min()) + 0.02 * float(np.ptp(depth)) + 1.0
    labels: list[tuple[str, Array, Array]] = []
    for corner, deep in zip(corners, depth, strict=True):
        ends = np.stack([nominal[corner], drawn[corner]])
        tail, tip = projection.project(ends)
        near = bool(deep <= front) or _is_seen(stage, ends)
        opacity = 1.0 if near else 0.4
        canvas.arrow(tail, tip, alpha=opacity, zorder=4.0 if near else 3.4)
        if np.hypot(*(tip - tail)) > 0.1:
            canvas.disc(tail, 4.0, canvas.theme.accent, alpha=opacity)
            stage.occupancy.add_lines([np.stack([tail, tip])], ARROW_COST)
        if near:
            labels.append((_amount(length[corner], largest=corner == worst), tail, tip))
    if worst not in corners and _is_seen(stage, drawn[worst][None]):
        spot = projection.project(drawn[worst])
        canvas.ring(spot, 7.0)
        labels.append((_amount(length[worst], largest=True), spot, spot))
    for text, tail, tip in labels:
        stage.label(text, [tip, tail, (tip + tail) / 2.0])


def _amount(length_um: float, *, largest: bool) -> str:
    tail = " max" if largest and length_um > 0.0 else ""
    return f"{spell_fixed(float(length_um))} {MICROMETRE}{tail}"


def _is_seen(stage: Stage, points_mm: Array) -> bool:
    projection = stage.projection
    if stage.raster is None:
        return True
    surface = stage.raster.depth_at(projection.project(points_mm), spread=True)
    return bool(np.any(projection.depth_mm(points_mm) <= surface + 2.0 / projection.px_per_mm))


INSETS = (112.0, 92.0, 84.0, 46.0)
"""Room for axes and labels around the body: left, bottom, right, top."""
SMALL_INSETS = (70.0, 74.0, 40.0, 40.0)
GHOST_DASHES = (11.0, 7.0)
LONE_LINE_COST = 8.0  # of labels on the line that represents a volume without area
Annotate = Callable[[Stage], None]


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
) -> DrawnMap:
    projection = projection or fit_map(canvas, [picture], rect, view, labels=labels)
    faces = map_faces(picture.shape, cut=view == "iso")
    raster = render_bodies(surface_bodies(picture, faces), projection)
    start = len(canvas.rects)
    occupancy = Occupancy(canvas.width, canvas.height, 2.0 * canvas.factor)
    stage = Stage(canvas, picture, projection, raster, occupancy, rect if labels else None)
    if raster is not None:
        draw_raster(canvas, raster)
        occupancy.add_mask(raster.rgba[..., 3] > 0, raster.rect)
    _draw_surface_lines(stage, faces)
    draw_lone_line(canvas, picture, projection, occupancy)
    if ghost:
        _draw_ghost(stage)
    _draw_axes(stage)
    occupancy.add_rects(canvas.rects[start:])
    if annotate is not None:
        annotate(stage)
    return DrawnMap(projection, picture, raster)


def surface_bodies(picture: Picture, faces: list[surfaces.Index]) -> list[RenderedBody]:
    """Build the coloured surface of the displaced volume; empty for a volume without one."""
    surface = surfaces.triangulate(faces)
    if not len(surface.triangles):
        return []
    nodes, values = picture.drawn_mm.reshape(-1, 3), picture.values.reshape(-1)
    return [
        RenderedBody(nodes[surface.nodes], surface.triangles, values[surface.nodes], picture.scale)
    ]


def draw_raster(canvas: Canvas, raster: Raster, opacity: float = 1.0, zorder: float = 1.0) -> None:
    """Place drawn bodies; in vector formats with all their pixels."""
    rgba = (raster.reduced() if canvas.exact else raster.rgba).copy()
    rgba[..., 3] = (rgba[..., 3] * opacity).astype(np.uint8)
    canvas.image(rgba, raster.rect, zorder)


def fit_map(
    canvas: Canvas,
    pictures: Sequence[Picture],
    rect: Rect,
    view: str,
    *,
    labels: bool = True,
    beside_mm: Array | None = None,
) -> Projection:
    """Fit one projection in which each of several maps fills a box."""
    sides = (rect[2] - rect[0], rect[3] - rect[1]) * 2
    room = zip(INSETS if labels else SMALL_INSETS, sides, strict=True)
    x, y, right, top = (min(canvas.px(inset), 0.24 * side) for inset, side in room)
    inner = (rect[0] + x, rect[1] + y, rect[2] - right, rect[3] - top)
    points = [map_points_mm(picture) for picture in pictures]
    points += [] if beside_mm is None else [beside_mm]
    return fit_projection(view, np.concatenate(points), inner)


def draw_maps_alike(
    canvas: Canvas,
    pictures: Sequence[Picture],
    names: Sequence[str],
    cells: Sequence[Rect],
    view: str,
) -> tuple[DrawnMap, ...]:
    head = canvas.px(30.0)
    rooms = [(left, bottom, right, top - head) for left, bottom, right, top in cells]
    shared = fit_map(canvas, pictures, rooms[0], view)
    maps: list[DrawnMap] = []
    for picture, name, area in zip(pictures, names, rooms, strict=True):
        projection = shared.moved(np.array(area[:2]) - np.array(rooms[0][:2]))
        maps.append(draw_map(canvas, picture, area, view, projection=projection))
        canvas.text(
            area[0] + head, area[3] + head - canvas.px(4.0), name, size=SIZES.heading,
            weight="bold", va="top", max_width=area[2] - area[0] - 2.0 * head,
        )  # fmt: skip
    return tuple(maps)


def map_points_mm(picture: Picture) -> Array:
    """Collect the points that a drawing of a volume contains, [n, 3], mm: nominal and displaced."""
    points = [picture.grid.nominal_mm.reshape(-1, 3), picture.drawn_mm.reshape(-1, 3)]
    if any(axis and not is_linear(axis) for axis in picture.grid.axes):
        nodes = np.concatenate(points)
        x, y, z = np.stack([nodes.min(axis=0), nodes.max(axis=0)], -1)
        points.append(np.stack(np.meshgrid(x, y, z), -1).reshape(-1, 3))
    if not picture.grid.longest_edge_mm > 0.0:
        margin = 0.5 * picture.size_mm * np.array([[-1.0], [1.0]])
        points.append(picture.grid.bounds_mm + margin)
    return np.concatenate(points)


def _draw_surface_lines(stage: Stage, faces: list[surfaces.Index]) -> None:
    if not faces:
        return
    canvas, picture, occupancy = stage.canvas, stage.picture, stage.occupancy
    theme, shape = canvas.theme, picture.shape
    nodes, values = picture.drawn_mm.reshape(-1, 3), picture.values.reshape(-1)

    def visible(lines: Iterable[surfaces.Index]) -> list[Array]:
        return stage.split(nodes[line] for line in lines)[0]

    grid = visible(surfaces.face_lines(faces, shape, surfaces.line_spacing(shape)))
    canvas.lines(grid, width=SIZES.hair, colour=theme.grid, alpha=0.42, zorder=2.0)
    creases = visible(surfaces.crease_lines(faces, shape))
    canvas.lines(creases, width=SIZES.line, colour=theme.grid, zorder=3.0)
    occupancy.add_lines(creases, LINE_COST)
    diverging = picture.scale.diverging
    levels = surfaces.isoline_levels(picture.scale)
    by_level: dict[float, list[Array]] = {}
    for face in faces:
        for level, line in surfaces.isolines(face, nodes, values, levels):
            by_level.setdefault(level, []).extend(stage.split([line])[0])
    colour = theme.grid if diverging else theme.isoline
    for level, lines in by_level.items():
        width = SIZES.line if diverging and level == 0.0 else SIZES.thin
        canvas.lines(lines, width=width, colour=colour, alpha=0.95, zorder=2.5)
    occupancy.add_lines([line for lines in by_level.values() for line in lines], 0.5)
    if picture.exceeded_um is not None:
        above = values - picture.exceeded_um
        surface, spacing_mm = surfaces.triangulate(faces), HATCH * picture.size_mm
        triangles = surface.nodes[surface.triangles]
        (line, _), (hatching, _) = surfaces.above_limit(nodes, above, triangles, spacing_mm)
        for pieces, width in ((line, SIZES.bold), (hatching, SIZES.hair)):
            canvas.lines(stage.split(pieces)[0], width=width, colour=theme.accent, zorder=2.8)
    label_isolines(stage, by_level, colour, theme.isoline if diverging else theme.grid)


def draw_lone_line(
    canvas: Canvas, picture: Picture, projection: Projection, occupancy: Occupancy | None = None
) -> None:
    """Draw a volume without area (one axis, or none that is linear) as a coloured line or point."""
    if not surfaces.is_thin(picture.shape):
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
    if occupancy is not None:
        occupancy.add_lines([spots], LONE_LINE_COST)
    for spot, colour in zip(spots, colours, strict=True):
        canvas.disc(spot, 4.5, colour)


def _draw_ghost(stage: Stage) -> None:
    canvas, occupancy, theme = stage.canvas, stage.occupancy, stage.canvas.theme
    nodes = stage.picture.grid.nominal_mm.reshape(-1, 3)
    visible, hidden = stage.split(nodes[edge] for edge in surfaces.box_edges(stage.picture.shape))
    canvas.lines(
        hidden, width=SIZES.hair, colour=theme.ghost, alpha=0.6, dashes=GHOST_DASHES, zorder=3.2
    )
    canvas.lines(visible, width=SIZES.line, colour=theme.ghost, dashes=GHOST_DASHES, zorder=3.3)
    occupancy.add_lines(visible, LINE_COST)
    occupancy.add_lines(hidden, 0.5 * LINE_COST)


GAP = 16.0  # between the body and an axis line
TICK = 7.0
SHORTEST = 40.0  # axes that appear shorter, nearly end-on, are omitted


def _draw_axes(stage: Stage) -> None:
    projection = stage.projection
    flat = stage.picture.grid.nominal_mm.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    spots = projection.project(np.concatenate([flat, stage.picture.drawn_mm.reshape(-1, 3)]))
    for axis in range(3):
        ends = _silhouette_edge(axis, low, high, projection)
        if ends is None:
            continue
        length = np.hypot(*np.diff(projection.project(ends), axis=0)[0])
        if length >= stage.canvas.px(SHORTEST):
            _draw_axis(stage, axis, ends, spots)


def _silhouette_edge(axis: int, low: Array, high: Array, projection: Projection) -> Array | None:
    if high[axis] - low[axis] <= 0.0:
        return None
    edges = np.tile(np.stack([low, high]), (4, 1, 1))
    across = [other for other in range(3) if other != axis]
    corners = product(*((low[other], high[other]) for other in across))
    edges[:, :, across] = np.array(list(corners))[:, None]
    spots = projection.project(edges)
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


def _draw_axis(stage: Stage, axis: int, ends_mm: Array, spots: Array) -> None:
    canvas = stage.canvas
    start, end = stage.projection.project(ends_mm)
    along = (end - start) / np.hypot(*(end - start))
    normal = np.array([along[1], -along[0]])
    upright = abs(along[1]) > 2.0 * abs(along[0])
    if (normal[0] > 0.0) if upright else (normal[1] > 0.0):
        normal = -normal
    # clear of nodes displaced beyond the nominal edge along the axis
    positions = (spots - start) @ along
    near = spots[(positions > 0.0) & (positions < np.hypot(*(end - start)))]
    sticking = float(((near - start) @ normal).max(initial=0.0))
    base = normal * (max(sticking, 0.0) + canvas.px(GAP))
    theme = canvas.theme
    line = np.stack([start + base, end + base])
    canvas.line(line, width=SIZES.thin, colour=theme.muted, zorder=2.0)
    stage.occupancy.add_lines([line], LINE_COST)
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
            centre[0], centre[1], text, size=SIZES.small, colour=theme.muted, ha="center",
            va="center_baseline",
        )  # fmt: skip
    if stage.frame is not None:
        angle = math.degrees(math.atan2(along[1], along[0]))
        angle = (angle + 90.0) % 180.0 - 90.0 if abs(abs(angle) - 90.0) > 1e-6 else 90.0
        height = canvas.text_size("X", SIZES.text)[1]
        x, y = (start + end) / 2.0 + base + (reach + canvas.px(6.0) + 0.7 * height) * normal
        name = f"{'XYZ'[axis]} [mm]"
        canvas.text(x, y, name, ha="center", va="center_baseline", rotation=angle)


def _half_extent(size: tuple[float, float], normal: Array) -> float:
    return 0.5 * (size[0] * abs(float(normal[0])) + size[1] * abs(float(normal[1])))
