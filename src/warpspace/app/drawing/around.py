"""Drawing of axes, traces, paths, arrows and markers on and around the box."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpspace.app.browser.incoming import index_of
from warpspace.app.drawing.box import coloured_shape
from warpspace.app.drawing.colours import Rgb, colour, colour_levels, level_colours
from warpspace.app.drawing.labels import TICK, AxisLabels, axes, axis_labels, point_labels
from warpspace.app.drawing.shapes import (
    SCENE_PER_MM,
    SceneNode,
    Shapes,
    ball,
    dashes,
    dots,
    ellipsoid,
    lines,
    polylines,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_bodies import (
    AXIS_HALF,
    chosen_trace,
    diagnosed_guides,
    points_on_traces,
)
from warpspace.app.evaluation.point_explanation import explain_point, measure_distance
from warpspace.app.evaluation.scene_overlays import AT_LINE, planned_adjusters
from warpspace.formats.source import MAX_LINES
from warpspace.geometry.colour import ColourScale, component_values
from warpspace.geometry.surfaces import corners, round_down
from warpspace.picture.map_mesh import outline_pieces
from warpspace.units import MM_PER_UM, Array

# --- Sizes relative to the longest edge of the box ------------------------------------------------

HEAD, BALL = 0.034, 0.009  # of an arrow, and the marker of the worst point
APART = 0.002  # distance from which both the nominal and the actual trace are drawn
TURNED = 0.014  # diameter of a traced point while the table rotates
POINT_MARKER, DASH = 0.011, 0.02  # marker of the picked point, dash of the lever
RESIDUAL_HEAD, LONGEST_RESIDUAL = 0.025, 0.2
ADJUSTER = 0.12  # length of the arrow of an adjuster
MOST_OUTSIDE, OUTSIDE = 4000, 0.006  # marked points beyond the travel, and their size
UNMEASURED, SEEN_THROUGH = 0.008, 0.5  # size of dots, and opacity of ellipsoids
GREY = (70, 78, 90)
GIZMO = "/part/gizmo"  # moves the part

ACCENT = (194, 24, 91)  # colour of explanations; not part of any colour map
RESIDUALS = {True: (138, 143, 152), False: (47, 116, 192)}
"""Colours before the calibration (True) and after, as in the chart."""
MOST_RESIDUALS = 400
TRACE_DASH = 0.016  # of the nominal traces of the rotary axes
HEAD_PART = 0.7  # longest head, relative to its arrow
STROKES, SLANT = 12, 0.3  # lines of a head, and its radius relative to its length


def draw_surroundings(picture: LivePicture) -> Shapes:
    """Draw everything of a picture except the box and the machine."""
    if picture.is_rotary:
        return _rotary_traces(picture)
    draws = (_axes, _traces, _path, _part, _program, _other_side, _point, _adjusters, _diagnosed,
             _measured, _marks, _uncertainty)  # fmt: skip
    return {name: shape for draw in draws for name, shape in draw(picture).items()}


def _axes(picture: LivePicture) -> Shapes:
    if not picture.state.shown.axes or picture.state.machine.shown:
        return {}
    tick, rgb = TICK * picture.size_mm, colour(picture, "axis")
    return {"/axes/lines": _axis_lines(axes(picture), tick, rgb)}


@lru_cache(maxsize=32)
def _axis_lines(of: tuple[AxisLabels, ...], tick: float, rgb: Rgb) -> SceneNode | None:
    pieces = [axis.ends_mm for axis in of]
    pieces += [np.stack([at, at + tick * axis.out]) for axis in of for _, at in axis.ticks]
    return lines(np.stack(pieces), rgb, 1.2)


def _traces(picture: LivePicture) -> Shapes:
    """Draw traces of rotary axes: one in colour, with its nominal circle; the others faint.

    Traces without error are not drawn, nor is the nominal trace where it is covered.
    """
    moved = picture.moved_traces
    if not moved:
        return {}
    name = chosen_trace(picture)
    other_traces = [line.actual_mm for other, line in moved.items() if other != name]
    faint = lines(polylines(other_traces), colour(picture, "trace_elsewhere"), 1.0)
    if not name:
        return {"/traces/others": faint}
    nominal, actual = (polylines([at]) for at in (moved[name].nominal_mm, moved[name].actual_mm))
    apart = np.linalg.norm(actual - nominal, axis=-1) > APART * picture.size_mm
    nominal = nominal[apart.any(axis=-1)]
    return {"/traces/others": faint, **_pair(picture, "/traces", nominal, actual)}


def _rotary_traces(picture: LivePicture) -> Shapes:
    """Draw all traces: nominal dashed, actual coloured by its error."""
    dash = TRACE_DASH * picture.size_mm
    pieces = [dashes(polylines([*of.nominal_mm]), dash, dash) for of in picture.traces]
    nominal = np.concatenate([np.zeros((0, 2, 3)), *pieces])
    shapes: Shapes = {"/rotary/nominal": lines(nominal, colour(picture, "trace_nominal"), 1.5)}
    moved = [line for of in picture.traces if of.error_um.any() for line in of.each()]
    if moved:
        drawn = polylines([line.actual_mm for line in moved])
        errors = polylines([line.error_um for line in moved])
        values = component_values(errors, picture.component)
        shapes["/rotary/actual"] = lines(drawn, _line_colours(values, picture.scale), 4.0)
    return shapes


def _line_colours(values: Array, scale: ColourScale) -> NDArray[np.uint8]:
    """Return the colours of the ends of lines, in the range of viser's lines."""
    linear = np.clip(level_colours(diverging=scale.diverging), 0.0, 1.0)
    return (255.0 * linear).astype(np.uint8)[colour_levels(scale, values)]


def _path(picture: LivePicture) -> Shapes:
    overlay = picture.bench
    if overlay is None:
        return {}
    actual = overlay.drawn_mm(picture.exaggeration)[overlay.at]
    return _pair(picture, "/test", overlay.nominal_mm[overlay.at], actual)


def _pair(picture: LivePicture, root: str, nominal: Array, actual: Array) -> Shapes:
    return {
        f"{root}/nominal": lines(nominal, colour(picture, "trace_nominal"), 1.5),
        f"{root}/actual": lines(actual, colour(picture, "trace_actual"), 3.0),
    }


def _part(picture: LivePicture) -> Shapes:
    part, ghost, state = picture.part, colour(picture, "ghost"), picture.state
    if part is None:
        return {}
    corners, drawn = part.of.corners, part.drawn_mm(picture.exaggeration)
    ends, away = part.at[corners.creases], part.nominal_mm[part.outside]
    away = away[:: 1 + len(away) // MOST_OUTSIDE]
    return {
        "/part/surface": coloured_shape(drawn[part.at], corners.triangles, *picture.coloured(part)),
        "/part/edges": lines(drawn[ends], colour(picture, "edge"), 1.4),
        "/part/outside": dots(away, OUTSIDE * picture.size_mm, ACCENT),
        "/part/nominal": lines(part.nominal_mm[ends], ghost, 1.2) if state.shown.ghost else None,
        f"{GIZMO}/nominal": lines((part.of.vertices_mm - part.of.middle_mm)[ends], ghost, 1.2)
        if state.part.moved
        else None,
    }


def _program(picture: LivePicture) -> Shapes:
    path = picture.path
    if path is None:
        return {}
    drawn, colours = path.drawn_mm(picture.exaggeration), _line_colours(*picture.coloured(path))
    line = index_of(picture.state.forms.get(AT_LINE, ""), MAX_LINES)
    marker = dots(drawn[path.of.line == line][-1:], POINT_MARKER * picture.size_mm, ACCENT)
    pair = _pair(picture, "/program", path.nominal_mm[path.at], drawn[path.at])
    return {**pair, "/program/actual": lines(drawn[path.at], colours, 3.0), "/program/line": marker}


def _other_side(picture: LivePicture) -> Shapes:
    other = None if picture.compared is None else picture.compared.other_mm
    if other is None or not picture.state.comparison.ghost:
        return {}
    edges = outline_pieces(picture, other)[::2]  # dotted
    return {"/compare/other": lines(edges, colour(picture, "edge"), 2.0)}


def _point(picture: LivePicture) -> Shapes:
    picked, size = picture.state.picked, picture.size_mm
    if picked is None or picture.is_difference:
        return {}
    explained = explain_point(picture.drawn_state, picked, picture.exaggeration)
    point = explained.explanation.nominal_mm + explained.shift_mm
    shapes = {
        "/why/marker": ball(explained.drawn_mm, POINT_MARKER * size, ACCENT),
        "/why/vector": lines(np.stack([point, explained.drawn_mm])[None], ACCENT, 3.0),
    }
    for part in explained.explanation.contributions:
        if part.key == picture.state.lever:
            origin, half = part.origin_mm + explained.shift_mm, AXIS_HALF * size * part.direction
            axis, lever = np.array([[origin - half, origin + half], [origin, point]])[:, None]
            shapes["/why/axis"] = lines(axis, ACCENT, 3.5)
            shapes["/why/lever"] = lines(dashes(lever, DASH * size, 0.6 * DASH * size), ACCENT, 2.0)
    return shapes


def _adjusters(picture: LivePicture) -> Shapes:
    """Draw the adjusters of the planned acts as arrows of one length, along their travel."""
    placed = planned_adjusters(picture.state)
    if not placed:
        return {}
    start, along = (
        np.array(part) for part in zip(*((at, way) for _, at, way in placed), strict=True)
    )
    pieces = arrows(start, start + ADJUSTER * picture.size_mm * along, HEAD * picture.size_mm)
    return {"/adjusters/arrows": lines(pieces, ACCENT, 3.0)}


def _diagnosed(picture: LivePicture) -> Shapes:
    return {"/diagnosis/guides": lines(diagnosed_guides(picture), ACCENT, 6.0)}


def _measured(picture: LivePicture) -> Shapes:
    distance = measure_distance(picture)
    if distance is None:
        return {}
    _, nominal, actual = distance
    ends = [[0, 1], [2, 0], [2, 1]] if len(actual) == 3 else [[0, 1]]  # with legs of the angle
    return {
        "/measured/nominal": lines(nominal[ends], colour(picture, "edge"), 1.5),
        "/measured/actual": lines(actual[ends], ACCENT, 3.0),
        "/measured/points": dots(actual, POINT_MARKER * picture.size_mm, ACCENT),
    }


def _marks(picture: LivePicture) -> Shapes:
    look, size, rgb = picture.state.look, picture.size_mm, colour(picture, "edge")
    shapes: dict[str, SceneNode | None] = {}
    if look.arrows:
        chosen = corners(picture.shape)
        start, end = (
            at.reshape(-1, 3)[chosen] for at in (picture.grid.nominal_mm, picture.drawn_mm)
        )
        shapes["/marks/arrows"] = lines(arrows(start, end, HEAD * size), rgb, 1.5)
    worst = picture.worst_node
    if look.worst and picture.values.flat[worst]:
        at = picture.drawn_mm.reshape(-1, 3)[worst]
        shapes["/marks/ball"] = ball(at, BALL * size, rgb)
    return shapes


def _uncertainty(picture: LivePicture) -> Shapes:
    """Draw ellipsoids of U95 at corners and picked point, and dots where nothing was measured.

    The extent of an ellipsoid along a direction is U95 of the error along it, exaggerated.
    """
    uncertainty, look = picture.uncertainty, picture.state.look
    shapes: dict[str, SceneNode | None] = {}
    unmeasured = dots(unmeasured_mm(picture), UNMEASURED * picture.size_mm, GREY)
    if unmeasured is not None:
        shapes["/uncertainty/unmeasured"] = unmeasured
    if uncertainty is None or not uncertainty.errors.is_known or not look.ellipsoids:
        return shapes
    chosen, picked = corners(picture.shape), picture.state.picked
    at = [*picture.drawn_mm.reshape(-1, 3)[chosen]]
    covariances = [*uncertainty.expanded_um2.reshape(-1, 3, 3)[chosen]]
    if picked is not None:
        explained = explain_point(picture.drawn_state, picked, picture.exaggeration)
        if explained.uncertainty is not None:
            at.append(explained.drawn_mm)
            covariances.append(explained.uncertainty.expanded_um2)
    factor = picture.exaggeration * MM_PER_UM
    for number, (middle, square) in enumerate(zip(at, covariances, strict=True)):
        body = ellipsoid(middle, factor**2 * square, ACCENT, SEEN_THROUGH)
        shapes[f"/uncertainty/ellipsoid{number}"] = body
    return shapes


def unmeasured_mm(picture: LivePicture) -> Array:
    """Return drawn points of the surface whose axis positions no measurement covers, [n, 3]."""
    covariance, look = picture.drawn_state.scene.covariance, picture.state.look
    if (
        picture.uncertainty is None
        or covariance is None
        or picture.is_rotary
        or not look.unmeasured
    ):
        return np.zeros((0, 3))
    surface = picture.topology.surface.nodes
    outside = covariance.outside(picture.grid.coordinates, picture.shape).reshape(-1)
    return picture.drawn_mm.reshape(-1, 3)[surface[outside[surface]]]


def turned_points(picture: LivePicture, position: dict[str, float]) -> Shapes:
    """Draw the traced points at a position of the animated axis; none without one."""
    if not position or not (picture.state.shown.traces or picture.is_rotary):
        return {}
    size = TURNED * picture.size_mm
    nominal, actual = points_on_traces(picture, position)
    return {
        "/rotation/nominal": dots(nominal, size, colour(picture, "trace_nominal")),
        "/rotation/actual": dots(actual, size, colour(picture, "trace_actual")),
    }


def program_point(picture: LivePicture, sample: int) -> Shapes:
    """Draw the tool point at a sample of the path of the program."""
    path = picture.path
    if path is None:
        return {}
    at = path.drawn_mm(picture.exaggeration)[sample : sample + 1]
    return {"/rotation/program": dots(at, TURNED * picture.size_mm, ACCENT)}


def residuals(
    foot_mm: Array, vector_mm: Array, size_mm: float, *, before: bool
) -> tuple[Shapes, float]:
    """Draw the residuals of a calibration as arrows, the longest about a fifth of the box.

    Also return their exaggeration; 0 where all have zero length.
    """
    stride = max(1, -(-len(foot_mm) // MOST_RESIDUALS))
    foot, vector = foot_mm[::stride], vector_mm[::stride]
    longest = float(np.linalg.norm(vector, axis=-1).max(initial=0.0))
    if longest <= 0.0:
        return {}, 0.0
    factor = round_down(LONGEST_RESIDUAL * size_mm / longest)
    pieces = arrows(foot, foot + factor * vector, RESIDUAL_HEAD * size_mm)
    return {"/calibration/residuals": lines(pieces, RESIDUALS[before], 1.5)}, factor


def arrows(start_mm: Array, end_mm: Array, head_mm: float) -> Array:
    """Build arrows, [n, 3] to [n, 3], from line segments: shafts, and strokes of the heads.

    Short arrows have a smaller head of the same shape; one of zero length is a point.
    """
    vector = end_mm - start_mm
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    along = vector / np.maximum(length, np.finfo(float).tiny)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=-1)])
    first = first / np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), np.finfo(float).tiny)
    turn = 2.0 * np.pi * np.arange(STROKES)[:, None, None] / STROKES
    aside = np.cos(turn) * first + np.sin(turn) * np.cross(along, first)  # [STROKES, n, 3]
    head = end_mm - np.minimum(head_mm, HEAD_PART * length) * (along - SLANT * aside)
    strokes = np.stack(np.broadcast_arrays(head, end_mm), axis=2).reshape(-1, 2, 3)
    return np.concatenate([np.stack([start_mm, end_mm], axis=1), strokes])


def draw_labels(picture: LivePicture) -> Shapes:
    """Draw all labels in 3-D, for a page that cannot place them."""
    away, middle = 0.03 * picture.size_mm, picture.grid.bounds_mm.mean(axis=0)
    shapes: dict[str, SceneNode | None] = {}
    for number, label in enumerate((*axis_labels(picture), *point_labels(picture))):
        outward = label.at_mm - (middle if label.from_mm is None else label.from_mm)
        out = away * outward / max(float(np.linalg.norm(outward)), 1e-9)
        at = label.at_mm + (5.0 if label.kind == "axis" else 1.0) * out
        looks = {"font_screen_scale": 0.8, "anchor": "center-center"}
        follows = {"text": label.text, "position": at * SCENE_PER_MM}
        shapes[f"/words/{label.kind}{number}"] = SceneNode("add_label", looks, follows)
    return shapes
