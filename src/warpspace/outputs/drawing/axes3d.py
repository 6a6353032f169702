"""Coordinate axes along the edges of the nominal volume, outside the body."""

import math

import numpy as np

from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.labels import LINE_COST, Occupancy
from warpspace.outputs.drawing.projection import Projection
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.ticks import tick_values
from warpspace.picture.words import spell_short
from warpspace.units import Array

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
    """Draw the axes of the machine frame beside the silhouette of the nominal volume.

    Parameters
    ----------
    canvas : Canvas
    nominal_mm : ndarray, [nx, ny, nz, 3], mm
    drawn_mm : ndarray, [N, 3], mm
        Everything the axes must stay clear of.
    projection : Projection
    taken : Occupancy
        Is marked with the lines.
    titles : bool, optional
    """
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
    """Choose the edge of the box to write an axis along: lower or left on its outline, [2, 3]."""
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
    """Draw one axis with ticks, numbers and its title."""
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
    """Half the extent of a box along a direction."""
    return 0.5 * (size[0] * abs(float(normal[0])) + size[1] * abs(float(normal[1])))
