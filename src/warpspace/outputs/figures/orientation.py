"""The orientation-error map: how far the tool axis leans, over the working volume."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.geometry.surfaces import Index, corners, triangulate
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import TOOL_AXIS
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.labels import Occupancy, place_label
from warpspace.outputs.drawing.map3d import draw_map, fit_map
from warpspace.outputs.drawing.render import Projection, Raster, Rect, split_visible
from warpspace.outputs.drawing.settings import FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    LegendEntry,
    line_entry,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import isoline_words, place_rows
from warpspace.picture.model import Picture, ScenePicture, map_faces, view_words
from warpspace.picture.words import spell_factor
from warpspace.scene.model import Scene
from warpspace.units import MICRORADIAN, RAD_PER_URAD, Array, spell

LEAN_RAD = 0.45
"""Largest lean on screen that the factor aims at."""
NEEDLE_SHARE = 0.13
"""Length of a needle, as a share of the longest edge."""
NEEDLES = 5
"""Needles along each edge, about."""
_ROUND = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class Needles:
    """Tool axes to draw at the nodes."""

    axis: Array  # [N, 3]; nominal tool axis, unit vectors
    lean: Array  # [N, 3]; exaggerated lean of its end, per length of the needle
    length_mm: float
    tilt_urad: Array  # [N]

    def ends_mm(self, nodes_mm: Array, at: Index) -> tuple[Array, Array]:
        """Give nominal and drawn ends of needles, [n, 2, 3] each, mm."""
        foot = nodes_mm[at]
        nominal = np.stack([foot, foot + self.length_mm * self.axis[at]], 1)
        drawn = np.stack([foot, foot + self.length_mm * (self.axis[at] + self.lean[at])], 1)
        return nominal, drawn


def draw_orientation(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    """Draw the orientation-error map of a scene."""
    picture = evaluate_for(settings, scenes[0], quantity="orientation")
    orientation, values, scale = picture.field.orientation_urad, picture.values, picture.scale
    given = settings.exaggeration
    automatic = lean_factor(float(np.linalg.norm(orientation, axis=-1).max()))
    factor = automatic if given is None or given == "auto" else given
    title = f"Orientation error of the tool axis: {picture.scene.title}"
    facts = [
        *scene_facts(picture, None),
        f"lean of the tool axis drawn {spell_factor(factor)}",
        "volume undeformed",
        "orthographic",
        view_words(settings.view, picture.grid.shape),
    ]
    legend = _legend(isoline_words(scale, values))
    sheet = start_sheet("orientation-map", settings, title, facts, scenes, legend, exact=exact)
    needles = _needles(picture, factor)

    def annotate(
        canvas: Canvas,
        content: Picture,
        projection: Projection,
        raster: Raster | None,
        taken: Occupancy,
        frame: Rect | None,
    ) -> None:
        _draw_needles(canvas, content, needles, projection, raster, taken, frame, settings.view)

    content = replace(picture, exaggeration=0.0)  # the volume itself is drawn undeformed
    ends = needles.ends_mm(content.grid.nominal_mm.reshape(-1, 3), _feet(content, settings.view))
    drawn = draw_map(
        sheet.canvas,
        content,
        sheet.content,
        settings.view,
        projection=fit_map(
            sheet.canvas,
            [content],
            sheet.content,
            settings.view,
            beside_mm=np.concatenate(ends).reshape(-1, 3),
        ),
        annotate=annotate,
        ghost=False,
    )
    heading = "tilt" if settings.component == "norm" else f"rotation about {settings.component}"
    tilt = np.linalg.norm(orientation, axis=-1)
    worst = int(np.argmax(tilt))
    rows = [
        ("max tilt", f"{spell(float(tilt.max()))} {MICRORADIAN}"),
        ("mean tilt", f"{spell(float(tilt.mean()))} {MICRORADIAN}"),
        ("P95", f"{spell(float(np.percentile(tilt, 95.0)))} {MICRORADIAN}"),
        *place_rows(
            {
                name: float(np.broadcast_to(values, picture.grid.shape).reshape(-1)[worst])
                for name, values in picture.grid.coordinates.items()
            },
            picture.grid.nominal_mm.reshape(-1, 3)[worst].tolist(),
        ),
        ("1° of lean shown", f"{spell(math.radians(1.0) / RAD_PER_URAD / factor)} {MICRORADIAN}"),
    ]
    marks = [("mean", float(values.mean())), ("max", float(values.max()))]
    if settings.component != "norm":
        marks.insert(0, ("min", float(values.min())))
    bars = (drawn.projection.px_per_mm, None)
    sheet.draw_panel(scale, f"{heading}  [{MICRORADIAN}]", marks, rows, bars)
    return sheet.finish(factor, [drawn])


def lean_factor(largest_urad: float) -> float:
    """Choose a round factor that makes the largest lean easy to see; 1000 where there is none."""
    if not largest_urad > 0.0:
        return 1000.0
    wanted = max(LEAN_RAD / (largest_urad * RAD_PER_URAD), 1.0)
    decade = 10.0 ** math.floor(math.log10(wanted))
    return max(step * decade for step in _ROUND if step * decade <= wanted * (1.0 + 1e-9))


def _needles(picture: ScenePicture, factor: float) -> Needles:
    pose = branch_pose(picture.scene.model, "tool", picture.grid.coordinates)
    axis = pose[..., :3, :3] @ np.array(TOOL_AXIS)
    axis = np.broadcast_to(axis, picture.grid.nominal_mm.shape).reshape(-1, 3)
    turn = picture.field.orientation_urad.reshape(-1, 3)
    lean = factor * RAD_PER_URAD * np.cross(turn, axis)
    longest = picture.size_mm
    return Needles(axis, lean, NEEDLE_SHARE * longest, np.linalg.norm(turn, axis=-1))


def _draw_needles(
    canvas: Canvas,
    content: Picture,
    needles: Needles,
    projection: Projection,
    raster: Raster | None,
    taken: Occupancy,
    frame: Rect | None,
    view: str,
) -> None:
    nodes = content.grid.nominal_mm.reshape(-1, 3)
    nominal, drawn = needles.ends_mm(nodes, _feet(content, view))
    theme = canvas.theme
    for ends, colour, width, dashes in (
        (nominal, theme.ghost, SIZES.thin, (6.0, 4.0)),
        (drawn, theme.accent, SIZES.bold, None),
    ):
        lines = [part for line in ends for part in split_visible(line, projection, raster)[0]]
        canvas.lines(lines, width=width, colour=colour, dashes=dashes, zorder=4.0)
        taken.add_lines(lines)
    if frame is None:
        return
    found = corners(content.shape)
    for corner, (foot, tip) in zip(found, needles.ends_mm(nodes, found)[1], strict=True):
        seen = split_visible(np.stack([foot, tip]), projection, raster)[0]
        if not seen:
            continue
        text = f"{spell(float(needles.tilt_urad[corner]))} {MICRORADIAN}"
        size = canvas.text_size(text, SIZES.text, "bold")
        spot = projection.project(tip)
        placed = place_label([(float(spot[0]), float(spot[1]))], size, frame, taken, canvas.factor)
        if placed is not None:
            canvas.text(
                *placed.centre, text, weight="bold", colour=theme.accent, halo=theme.paper,
                ha="center", va="center_baseline",
            )  # fmt: skip


def _feet(content: Picture, view: str) -> Index:
    shape = content.shape
    surface = triangulate(map_faces(shape, cut=view == "iso")).nodes
    surface = surface if len(surface) else np.arange(np.prod(shape))
    at = np.stack(np.unravel_index(surface, shape), -1)
    step = [max(1, (count - 1) // (NEEDLES - 1)) for count in shape]
    chosen = np.ones(len(surface), dtype=bool)
    for axis in range(3):
        chosen &= (at[:, axis] % step[axis] == 0) | (at[:, axis] == shape[axis] - 1)
    return surface[chosen]


def _legend(isolines: str) -> list[LegendEntry]:
    return [
        line_entry("nominal tool axis", lambda theme: theme.ghost, SIZES.thin, (6.0, 4.0)),
        line_entry("actual tool axis, lean exaggerated", lambda theme: theme.accent, SIZES.bold),
        *map_legend(isolines)[3:],
    ]
