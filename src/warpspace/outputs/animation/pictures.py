"""Single pictures of an animation, each drawn like a figure, all with one camera and one scale."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import evaluate_first_order
from warpspace.geometry.deform import deform
from warpspace.geometry.traces import build_traces
from warpspace.machine.limits import ANIMATION_FRAMES
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.map3d import draw_map, fit_map
from warpspace.outputs.drawing.panel import draw_panel
from warpspace.outputs.drawing.projection import fit_projection
from warpspace.outputs.drawing.settings import (
    FigureSettings,
    evaluate_for,
)
from warpspace.outputs.drawing.sheet import map_legend, metadata, scene_facts, start_sheet
from warpspace.outputs.drawing.style import SIZES
from warpspace.outputs.figures.error_map import (
    isoline_words,
    statistics_rows,
    value_marks,
)
from warpspace.outputs.figures.machine import bodies_of, draw_body_edges, render_placed
from warpspace.picture.bodies import PlacedBody
from warpspace.picture.exaggeration import choose_exaggeration
from warpspace.picture.model import choose_scale
from warpspace.picture.scene_picture import evaluate_picture
from warpspace.picture.words import quantity_words, spell, spell_short
from warpspace.scene.model import Scene
from warpspace.units import Array

MOTIONS = ("exaggeration", "rotation")
MIN_FRAMES, MAX_FRAMES = ANIMATION_FRAMES
MAX_PIXELS = 1_500_000_000
"""Of all pictures together."""
_TRACE_SAMPLES = 241


@dataclass(frozen=True, slots=True)
class AnimationSettings:
    """Options of an animation.

    Attributes
    ----------
    motion : str
        "exaggeration" (from true scale to the display factor and back) or "rotation" (one turn of
        the rotary axis next to the workpiece).
    frames : int
        Pictures of one round; the last leads back to the first.
    fps : float
        Pictures a second.
    figure : FigureSettings
        Component, display factor, view, size, loop, grid and theme.

    Raises
    ------
    OptionError
        If a value cannot be drawn with.
    """

    motion: str = "exaggeration"
    frames: int = 48
    fps: float = 15.0
    figure: FigureSettings = field(default_factory=lambda: FigureSettings(size=(960, 720)))

    def __post_init__(self) -> None:
        """Check the values."""
        if self.motion not in MOTIONS:
            raise OptionError(f"motion {self.motion!r}; expected one of {', '.join(MOTIONS)}")
        if not MIN_FRAMES <= self.frames <= MAX_FRAMES:
            raise OptionError(f"frames: {self.frames}; expected {MIN_FRAMES} to {MAX_FRAMES}")
        if not 1.0 <= self.fps <= 60.0:
            raise OptionError(f"fps: {self.fps:g}; expected 1 to 60 pictures a second")
        width, height = self.figure.size
        if self.frames * width * height > MAX_PIXELS:
            raise OptionError(
                f"{self.frames} pictures of {width}x{height} are too many; expected at most"
                f" {MAX_PIXELS // (width * height)} of that size"
            )


def draw_frame(scene: Scene, settings: AnimationSettings, number: int) -> Drawing:
    """Draw one picture of an animation.

    Parameters
    ----------
    scene : Scene
    settings : AnimationSettings
    number : int
        From 0 to frames − 1.

    Returns
    -------
    Drawing

    Raises
    ------
    OptionError
        If the scene has nothing that could move like that.
    """
    phase = number / settings.frames
    if settings.motion == "rotation":
        return _rotation_frame(scene, settings.figure, phase)
    return _exaggeration_frame(scene, settings.figure, phase)


def sweep_factor(top: float, phase: float) -> float:
    """Give the display factor at a phase of the sweep: 1 at its ends, the top in its middle.

    It is rounded to three digits, so that the picture is drawn with the number it shows.
    """
    share = (1.0 - np.cos(2.0 * np.pi * phase)) / 2.0
    return float(f"{1.0 + (top - 1.0) * share:.3g}")


def _exaggeration_frame(scene: Scene, figure: FigureSettings, phase: float) -> Drawing:
    """Draw the error map at one display factor."""
    largest = evaluate_for(figure, scene)
    factor = sweep_factor(largest.exaggeration, phase)
    picture = replace(largest, exaggeration=factor)
    scale = picture.scale
    title = f"Volumetric error: {scene.title}"
    facts = scene_facts(picture, factor)
    legend = map_legend(isoline_words(scale))
    sheet = start_sheet(figure, title, facts, [scene], legend, exact=True)
    camera = fit_map(sheet.canvas, [picture, largest], sheet.content, figure.view)
    drawn = draw_map(sheet.canvas, picture, sheet.content, figure.view, projection=camera)
    draw_panel(
        sheet.canvas,
        sheet.panel,
        scale,
        quantity_words(figure.component),
        value_marks(picture),
        statistics_rows(picture),
        (camera.px_per_mm, factor),
    )
    about = metadata(title, [scene], figure, factor, "exaggeration")
    return Drawing(sheet.canvas.figure, title, about, (drawn,), tuple(sheet.canvas.rects))


@dataclass(frozen=True, slots=True)
class Round:
    """The traces of one turn.

    Attributes
    ----------
    axis : str
        The axis that turns.
    turn_deg : ndarray, [n], degrees
    nominal_mm : ndarray, [P, n, 3], mm
    error_um : ndarray, [P, n, 3], µm
    """

    axis: str
    turn_deg: Array
    nominal_mm: Array
    error_um: Array


def one_round(scene: Scene) -> Round:
    """Evaluate the traces of a scene's points over the rotary axis next to them.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Round

    Raises
    ------
    OptionError
        If the scene has no rotary axis or no points to trace.
    """
    positions = scene.workspace.positions
    groups = build_traces(scene.model, scene.trace_points_mm, positions, _TRACE_SAMPLES)
    if not groups:
        raise OptionError(
            f"{scene.name}: nothing turns; expected a rotary axis, and points in [points_mm] traces"
        )
    group = groups[0]
    side = "workpiece" if str(group.loop) == "workpiece" else "tool"
    axis = [axis.name for axis in scene.machine.branch(side) if not axis.is_linear][-1]
    chosen = [
        index
        for index, trace in enumerate(group.traces)
        if trace.axis == axis and all(positions.get(n, 0.0) == at for n, at in trace.at.items())
    ]
    coordinates = {
        name: values[chosen] if values.ndim else values
        for name, values in group.coordinates.items()
    }
    nominal = group.nominal_mm[chosen]
    found = evaluate_first_order(
        scene.model, scene.errors, coordinates, scene.view(group.loop), nominal
    )
    return Round(axis, coordinates[axis][0], nominal, found.error_um)


def _rotation_frame(scene: Scene, figure: FigureSettings, phase: float) -> Drawing:
    """Draw the bodies that turn and the traces as far as they have come."""
    path = one_round(scene)
    at = round(phase * (len(path.turn_deg) - 1))
    angle = float(path.turn_deg[at])
    turned = replace(scene, workspace=scene.workspace.moved({path.axis: angle}))
    factor = _trace_factor(scene, figure, path)
    picture = evaluate_picture(turned, grid=3, loop="workpiece", exaggeration=factor)
    size = np.linalg.norm(path.error_um, axis=-1)
    scale = choose_scale([size], "norm")
    title = f"Rotary traces: {scene.title}"
    facts = scene_facts(picture, factor)
    sheet = start_sheet(figure, title, facts, [scene], [], exact=True)
    canvas = sheet.canvas
    actual = deform(path.nominal_mm, path.error_um, factor)
    carried = [axis.name for axis in scene.machine.branch("workpiece")]
    placed = bodies_of(picture, factor, only=[*carried, "w"])
    reach = [path.nominal_mm.reshape(-1, 3), actual.reshape(-1, 3)]
    reach += _swept(placed)
    camera = fit_projection(figure.view, np.concatenate(reach), _room(sheet.content))
    raster = render_placed(placed, figure.theme, camera)
    if raster is not None:
        canvas.image(raster.reduced(), raster.rect)
        draw_body_edges(canvas, placed, camera, raster)
    for nominal, drawn, length in zip(path.nominal_mm, actual, size, strict=True):
        ghost = camera.project(nominal)
        canvas.lines([ghost], width=SIZES.line, colour=canvas.theme.ghost, dashes=(8.0, 5.0))
        spots = camera.project(drawn)
        canvas.lines([spots], width=SIZES.hair, colour=canvas.theme.muted, alpha=0.6)
        for step in range(at):
            red, green, blue = scale.colours(length[step])
            colour = f"#{red:02x}{green:02x}{blue:02x}"
            canvas.line(spots[step : step + 2], width=3.4, colour=colour, zorder=3.0)
        canvas.disc(ghost[at], 4.0, canvas.theme.ghost)
        canvas.disc(spots[at], 5.0, canvas.theme.accent)
    rows = [(f"{path.axis}", f"{spell_short(round(angle, 1))}°")]
    for point, length in zip(_points(scene), size, strict=False):
        rows.append((f"|E| of {point}", f"{spell(float(length[at]))} µm"))
    marks = [("max", float(size.max())), ("mean", float(size.mean()))]
    draw_panel(canvas, sheet.panel, scale, "|E|  [µm]", marks, rows, (camera.px_per_mm, factor))
    about = metadata(title, [scene], figure, factor, "rotation")
    return Drawing(canvas.figure, title, about, (), tuple(canvas.rects))


def _trace_factor(scene: Scene, figure: FigureSettings, path: Round) -> float:
    """Choose the display factor of traces: what is asked for, or a round one that suits them."""
    reach = float(np.ptp(path.nominal_mm.reshape(-1, 3), axis=0).max())
    largest = float(np.linalg.norm(path.error_um, axis=-1).max())
    return choose_exaggeration(figure.exaggeration, scene.exaggeration, largest, reach)


def _points(scene: Scene) -> list[str]:
    """Spell the traced points."""
    return [
        "(" + ", ".join(spell_short(value) for value in point) + ")"
        for point in scene.trace_points_mm
    ]


def _swept(placed: Sequence[PlacedBody]) -> list[Array]:
    """Room that bodies need while they turn: the box around each, turned to both diagonals."""
    found: list[Array] = []
    for part in placed:
        points = part.nominal_mm
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        reach = float(np.linalg.norm((points - middle)[:, :2], axis=1).max())
        height = (points[:, 2].min(), points[:, 2].max())
        found += [
            np.array([[middle[0] + x * reach, middle[1] + y * reach, z]])
            for x in (-1.0, 1.0)
            for y in (-1.0, 1.0)
            for z in height
        ]
    return found


def _room(rect: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Leave a margin around what is drawn."""
    left, bottom, right, top = rect
    side = 0.03 * (right - left)
    return (left + side, bottom + side, right - side, top - side)
