"""Labels on a map: isoline values, corner displacements, the worst point."""

from collections.abc import Mapping, Sequence

import numpy as np

from warpspace.geometry.surfaces import corners
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.labels import LEADER_FROM, Occupancy, place_label
from warpspace.outputs.drawing.projection import Projection, Rect
from warpspace.outputs.drawing.render import Raster
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.model import Picture
from warpspace.picture.words import spell, spell_short
from warpspace.units import MICROMETRE, Array

ARROW_COST = 12.0
_SHARES = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8)
_CANDIDATE_LINES = 3


def label_isolines(
    canvas: Canvas,
    by_level: Mapping[float, Sequence[Array]],
    colour: str,
    halo: str,
    taken: Occupancy,
) -> None:
    """Write each level once, along a long visible piece of its line.

    Parameters
    ----------
    canvas : Canvas
    by_level : mapping of float to sequence of ndarray, [n, 2], px
        Visible pieces of the lines.
    colour, halo : str
    taken : Occupancy
        Is marked with the labels.
    """
    for level, lines in by_level.items():
        text = spell_short(level)
        size = canvas.text_size(text, SIZES.small)
        found: tuple[float, float, float, float] | None = None
        for line in sorted(lines, key=_length, reverse=True)[:_CANDIDATE_LINES]:
            if _length(line) < 4.0 * size[0]:
                continue
            for share in _SHARES:
                x, y, angle = _beside(line, share, size)
                box = (x - size[0] / 2, y - size[1] / 2, x + size[0] / 2, y + size[1] / 2)
                cost = taken.at(box)
                if found is None or cost < found[0] - 0.05:
                    found = (cost, x, y, angle)
        if found is None:
            continue
        rect = canvas.text(
            found[1], found[2], text, size=SIZES.small, colour=colour, halo=halo, ha="center",
            va="center_baseline", rotation=found[3], zorder=3.1,
        )  # fmt: skip
        taken.add_rects([rect])


def _length(line: Array) -> float:
    """Length of a polyline, px."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _beside(line: Array, share: float, size: tuple[float, float]) -> tuple[float, float, float]:
    """Place text beside a line: its centre, px, and its angle, degrees."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    spots = share * along[-1] + np.array([-0.5, 0.0, 0.5]) * size[0]
    x, y = (np.interp(spots, along, line[:, axis]) for axis in range(2))
    angle = (float(np.degrees(np.arctan2(y[2] - y[0], x[2] - x[0]))) + 90.0) % 180.0 - 90.0
    lift = 0.85 * size[1]
    tilt = np.radians(angle)
    return float(x[1] - lift * np.sin(tilt)), float(y[1] + lift * np.cos(tilt)), angle


def draw_corners(
    canvas: Canvas,
    picture: Picture,
    projection: Projection,
    raster: Raster | None,
    taken: Occupancy,
    frame: Rect | None,
) -> None:
    """Draw the displacement of the corners and label those that can be seen.

    Parameters
    ----------
    canvas : Canvas
    picture : Picture
    projection : Projection
    raster : Raster or None
    taken : Occupancy
        Is marked with the labels.
    frame : tuple of float, (4,), px
        Box that labels stay in; None draws no labels.
    """
    nominal, drawn = picture.grid.nominal_mm.reshape(-1, 3), picture.drawn_mm.reshape(-1, 3)
    length = np.linalg.norm(picture.field.error_um.reshape(-1, 3), axis=-1)
    worst = int(np.argmax(length))
    found = corners(picture.shape).tolist()
    depth = projection.depth_mm(nominal[found])
    front = float(depth.min()) + 0.02 * float(np.ptp(depth)) + 1.0
    wanted: list[tuple[str, Array, Array]] = []
    for corner, deep in zip(found, depth, strict=True):
        tail, tip = projection.project(nominal[corner]), projection.project(drawn[corner])
        ends = np.stack([nominal[corner], drawn[corner]])
        near = bool(deep <= front) or _visible(projection, ends, raster)
        opacity = 1.0 if near else 0.4
        canvas.arrow(tail, tip, alpha=opacity, zorder=4.0 if near else 3.4)
        if np.hypot(*(tip - tail)) > 0.1:
            canvas.disc(tail, 4.0, canvas.theme.accent, alpha=opacity)
            taken.add_lines([np.stack([tail, tip])], ARROW_COST)
        if near:
            wanted.append((_amount(length[corner], largest=corner == worst), tail, tip))
    if worst not in found and _visible(projection, drawn[worst][None], raster):
        spot = projection.project(drawn[worst])
        canvas.ring(spot, 7.0)
        wanted.append((_amount(length[worst], largest=True), spot, spot))
    if frame is not None:
        _write(canvas, wanted, frame, taken)


def _amount(length_um: float, *, largest: bool) -> str:
    """Spell a displacement."""
    tail = " max" if largest and length_um > 0.0 else ""
    return f"{spell(float(length_um))} {MICROMETRE}{tail}"


def _write(
    canvas: Canvas, wanted: Sequence[tuple[str, Array, Array]], frame: Rect, taken: Occupancy
) -> None:
    """Write labels beside arrows, with a leader where they stand apart."""
    colour = canvas.theme.accent
    for text, tail, tip in wanted:
        size = canvas.text_size(text, SIZES.text, "bold")
        anchors = [(float(p[0]), float(p[1])) for p in (tip, tail, (tip + tail) / 2.0)]
        placed = place_label(anchors, size, frame, taken, canvas.factor)
        if placed is None:
            continue
        canvas.text(
            *placed.centre, text, size=SIZES.text, weight="bold", colour=colour,
            ha="center", va="center_baseline", halo=canvas.theme.paper,
        )  # fmt: skip
        if placed.distance > canvas.px(LEADER_FROM):
            x = min(max(placed.anchor[0], placed.rect[0]), placed.rect[2])
            y = min(max(placed.anchor[1], placed.rect[1]), placed.rect[3])
            canvas.line([(x, y), placed.anchor], width=SIZES.hair, colour=colour, zorder=3.9)


def _visible(projection: Projection, points_mm: Array, raster: Raster | None) -> bool:
    """Tell whether any of some points can be seen: not behind the body."""
    if raster is None:
        return True
    surface = raster.depth_at(projection.project(points_mm), spread=True)
    return bool(np.any(projection.depth_mm(points_mm) <= surface + 2.0 / projection.px_per_mm))
