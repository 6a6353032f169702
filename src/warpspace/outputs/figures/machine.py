"""Figures with the machine: its bent bodies around the bent volume, and the traces of its table."""

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from warpspace.bodies.placed import PlacedBody, place_bodies, scene_motions
from warpspace.geometry.surfaces import (
    box_edges,
    crease_lines,
    face_lines,
    line_spacing,
    outer_faces,
    triangulate,
)
from warpspace.kinematics.chain import BASE
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.map3d import GHOST_DASHES, draw_lone_line, map_room_mm
from warpspace.outputs.drawing.render import (
    Body,
    Projection,
    Raster,
    Rect,
    fit_projection,
    render_bodies,
    split_visible,
)
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    DrawnMap,
    LegendEntry,
    line_entry,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES, Theme
from warpspace.outputs.figures.error_map import say_statistics
from warpspace.picture.model import ScenePicture
from warpspace.scene.model import Scene
from warpspace.units import Array

VOLUME_ALPHA, BEHIND_ALPHA = 0.72, 0.22
"""Opacity of the coloured volume before bodies, and behind them."""
DARKER = 0.62


def drawn_body(part: PlacedBody, theme: Theme) -> Body:
    """Give what is drawn of a placed body on the ground of a theme."""
    shade = 1.0 if theme.name == "light" else DARKER
    red, green, blue = (shade * channel / 255.0 for channel in part.body.colour)
    triangles = part.body.triangles.astype(np.intp)
    return Body(part.vertices_mm, triangles, colour=(red, green, blue), shaded=True)


def bodies_of(
    picture: ScenePicture, exaggeration: float, only: Collection[str] | None = None
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a picture's machine, axes at their place in the scene."""
    motions = scene_motions(picture.scene, picture.view)
    return place_bodies(picture.scene, motions, exaggeration, only)


def draw_machine(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw a machine with its bent bodies and its bent working volume."""
    picture = evaluate_for(settings, scenes[0])
    exaggeration, scale, values = picture.exaggeration, picture.scale, picture.values
    title = f"Machine and working volume: {picture.scene.title}"
    placed = bodies_of(picture, exaggeration)
    facts = [
        *scene_facts(picture, exaggeration),
        "bodies schematic, deformed and tilted like their frames",
    ]
    sheet = start_sheet("machine", settings, title, facts, scenes, _legend(), exact=exact)
    canvas = sheet.canvas
    drawn_mm = picture.drawn_mm
    points = [map_room_mm(picture), *(part.vertices_mm for part in placed)]
    projection = fit_projection(settings.view, np.concatenate(points), _room(canvas, sheet.content))
    machine = draw_bodies(canvas, placed, projection)
    faces = outer_faces(picture.grid.shape)
    surface = triangulate(faces)
    volume: Raster | None = None
    if len(surface.triangles):
        nodes = drawn_mm.reshape(-1, 3)[surface.nodes]
        body = Body(nodes, surface.triangles, values.reshape(-1)[surface.nodes], scale)
        volume = render_bodies([body], projection)
        _overlay(canvas, volume, machine)
    _draw_volume_lines(canvas, picture, drawn_mm, projection, volume, machine)
    draw_lone_line(canvas, picture, projection)
    label_bodies(canvas, placed, projection, machine, sheet.content)
    say_statistics(sheet, picture, projection.px_per_mm)
    drawn = DrawnMap(projection, scale, values, drawn_mm, exaggeration, volume)
    return sheet.finish(exaggeration, [drawn])


def draw_bodies(
    canvas: Canvas,
    placed: Sequence[PlacedBody],
    projection: Projection,
    *,
    opacity: float = 1.0,
    nominal: bool = True,
    zorder: float = 1.0,
) -> Raster | None:
    """Draw the bodies of a machine with their edges, faintly also where these would be nominally.

    None where there is no body.
    """
    if not placed:
        return None
    theme = canvas.theme
    raster = render_bodies([drawn_body(part, theme) for part in placed], projection)
    rgba = (raster.reduced() if canvas.exact else raster.rgba).copy()
    rgba[..., 3] = (rgba[..., 3] * opacity).astype(np.uint8)
    canvas.image(rgba, raster.rect, zorder)

    def seen(edges: Iterable[Array]) -> list[Array]:
        return [line for edge in edges for line in split_visible(edge, projection, raster)[0]]

    edges = seen(edge for part in placed for edge in part.edges_mm)
    canvas.lines(edges, width=SIZES.hair, colour=theme.grid, alpha=0.75, zorder=zorder + 0.1)
    if nominal:
        moving = [part for part in placed if part.body.frame != BASE]
        edges = seen(edge for part in moving for edge in part.nominal_edges_mm)
        canvas.lines(edges, width=SIZES.hair, colour=theme.ghost, alpha=0.8, zorder=zorder + 0.05)
    return raster


def _room(canvas: Canvas, rect: Rect) -> Rect:
    left, bottom, right, top = rect
    side = canvas.px(20.0)
    return (left + side, bottom + side, right - canvas.px(150.0), top - side)


def _overlay(canvas: Canvas, volume: Raster, machine: Raster | None) -> None:
    rgba = volume.rgba.copy()
    before = np.ones(rgba.shape[:2], dtype=bool)
    if machine is not None:
        left, _, _, top = volume.rect
        step = volume.sampling
        rows, columns = np.indices(rgba.shape[:2])
        spots = np.stack([left + (columns + 0.5) / step, top - (rows + 0.5) / step], -1)
        before = volume.depth_mm <= machine.depth_at(spots)
    share = np.where(before, VOLUME_ALPHA, BEHIND_ALPHA)
    rgba[..., 3] = (rgba[..., 3] * share).astype(np.uint8)
    canvas.image(rgba, volume.rect, zorder=1.6)


def _draw_volume_lines(
    canvas: Canvas,
    picture: ScenePicture,
    drawn_mm: Array,
    projection: Projection,
    volume: Raster | None,
    machine: Raster | None,
) -> None:
    theme, shape = canvas.theme, picture.grid.shape
    nodes = drawn_mm.reshape(-1, 3)
    faces = outer_faces(shape)
    nx, ny, nz = (2 * line_spacing(count) for count in shape)
    for lines, width, alpha in (
        (face_lines(faces, shape, (nx, ny, nz)), SIZES.hair, 0.35),
        (crease_lines(faces, shape) or box_edges(shape), SIZES.line, 0.95),
    ):
        seen = [
            part for line in lines for part in split_visible(nodes[line], projection, volume)[0]
        ]
        canvas.lines(seen, width=width, colour=theme.grid, alpha=alpha, zorder=2.0)
    nominal = picture.grid.nominal_mm.reshape(-1, 3)
    for edge in box_edges(shape):
        seen, hidden = split_visible(nominal[edge], projection, machine)
        canvas.lines(
            seen, width=SIZES.thin, colour=theme.ink, alpha=0.6, dashes=GHOST_DASHES, zorder=2.2
        )
        canvas.lines(
            hidden, width=SIZES.hair, colour=theme.ink, alpha=0.3, dashes=GHOST_DASHES, zorder=2.2
        )


def label_bodies(
    canvas: Canvas,
    placed: Sequence[PlacedBody],
    projection: Projection,
    raster: Raster | None,
    frame: Rect,
) -> None:
    """Name bodies in a column at the right, with leaders to a spot of each that can be seen."""
    if raster is None:
        return
    wanted: list[tuple[float, str, tuple[float, float]]] = []
    for part in placed:
        spot = _visible_spot(part, projection, raster)
        if spot is not None:
            wanted.append((spot[1], part.label, spot))
    wanted.sort()
    column = frame[2] - canvas.px(120.0)
    step = canvas.px(30.0)
    y = -np.inf
    for spot_y, name, spot in wanted:
        y = max(spot_y, y + step)
        canvas.line(
            [spot, (column - canvas.px(26.0), y), (column - canvas.px(8.0), y)],
            width=SIZES.hair, colour=canvas.theme.muted, zorder=5.0,
        )  # fmt: skip
        canvas.disc(np.array(spot), 2.5, canvas.theme.muted)
        canvas.text(column, y, name, size=SIZES.small, va="center_baseline")


def _visible_spot(
    part: PlacedBody, projection: Projection, raster: Raster
) -> tuple[float, float] | None:
    corners = part.vertices_mm[part.body.triangles]
    rng = np.random.default_rng(0)
    weights = rng.dirichlet([1.0, 1.0, 1.0], size=(24, len(corners)))
    points = np.einsum("ktc,tcx->ktx", weights, corners).reshape(-1, 3)
    spots = projection.project(points)
    seen = projection.depth_mm(points) <= raster.depth_at(spots) + 1.5 / projection.px_per_mm
    if not seen.any():
        return None
    visible = spots[seen]
    middle = np.median(visible, axis=0)
    best = visible[np.argmin(np.hypot(*(visible - middle).T))]
    return float(best[0]), float(best[1])


def _legend() -> list[LegendEntry]:
    return [
        line_entry("nominal volume", lambda theme: theme.ink, SIZES.thin, GHOST_DASHES, 0.6),
        line_entry("deformed volume", lambda theme: theme.ink),
        line_entry("nominal bodies", lambda theme: theme.ghost, SIZES.thin, alpha=0.6),
    ]
