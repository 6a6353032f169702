"""What every figure carries around its content: heading, facts, legend, provenance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace import __version__
from warpspace.kinematics.model import ComponentErrors, Loop
from warpspace.machine.parameters import parameter
from warpspace.outputs.canvas import Canvas
from warpspace.outputs.figures.settings import FigureSettings, spell_settings
from warpspace.outputs.projection import Rect
from warpspace.outputs.style import SIZES
from warpspace.outputs.words import TIMES, spell_factor, spell_short
from warpspace.scene.model import Scene
from warpspace.scene.pipeline import ScenePicture

LOOP_WORDS = {
    Loop.TOOL: "tool loop",
    Loop.WORKPIECE: "workpiece loop",
    Loop.RELATIVE: "tool relative to workpiece",
}
CONVENTION_WORDS = {
    ComponentErrors.AFTER_MOTION: "component errors after the motion",
    ComponentErrors.BEFORE_MOTION: "component errors before the motion",
}
Symbol = Callable[[Canvas, float, float, float], None]


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """One entry of the legend at the bottom.

    Attributes
    ----------
    symbol : callable
        Draws it, given the canvas, its left end, the height of its middle and its width, px.
    text : str
    """

    symbol: Symbol
    text: str


def new_canvas(settings: FigureSettings, *, exact: bool) -> Canvas:
    """Start a figure."""
    return Canvas(*settings.size, settings.theme, exact=exact)


def draw_heading(canvas: Canvas, title: str, facts: Sequence[str]) -> float:
    """Write title and subtitle with a rule below.

    Parameters
    ----------
    canvas : Canvas
    title : str
    facts : sequence of str
        Joined with dots, on up to two lines.

    Returns
    -------
    float, px
        Height of the rule.
    """
    margin = canvas.px(SIZES.margin) * min(1.0, canvas.width / canvas.px(1000.0))
    room = canvas.width - 2.0 * margin
    y = canvas.height - canvas.px(54.0)
    text, size = canvas.fit(title, room, SIZES.title, "bold")
    canvas.text(margin, y, text, size=size, weight="bold")
    y -= canvas.px(14.0)
    for line in wrap(canvas, facts, room, SIZES.subtitle, lines=2):
        y -= canvas.px(24.0)
        canvas.text(margin, y, line[0], size=line[1], colour=canvas.theme.muted)
    y -= canvas.px(18.0)
    canvas.line(
        [(margin, y), (canvas.width - margin, y)], width=SIZES.hair, colour=canvas.theme.faint
    )
    return y


def wrap(
    canvas: Canvas, facts: Sequence[str], room: float, size: float, lines: int
) -> list[tuple[str, float]]:
    """Spread facts over lines; what is left over is shrunk into the last one."""
    rows: list[str] = []
    for fact in facts:
        joined = f"{rows[-1]} · {fact}" if rows else fact
        fits = canvas.text_size(joined, size)[0] <= room
        if rows and (fits or len(rows) == lines):
            rows[-1] = joined
        else:
            rows.append(fact)
    return [canvas.fit(row, room, size) for row in rows]


def scene_facts(picture: ScenePicture, exaggeration: float | None) -> list[str]:
    """List what a reader must know of a picture: machine, volume, loop, reference, factor."""
    scene, grid = picture.scene, picture.grid
    title = scene.machine.title
    facts = [f"{title}, chain {scene.machine.chain}"]
    extent = [value for value in grid.extent_mm if value > 0.0]
    if extent:
        size = f" {TIMES} ".join(f"{value:.5g}" for value in extent)
        nodes = f" {TIMES} ".join(str(count) for count in grid.shape if count > 1)
        facts.append(f"working volume {size} mm")
        facts.append(f"{nodes} nodes")
    still = [
        f"{axis} {spell_short(position)}{scene.machine.axes[axis].unit}"
        for axis, position in scene.workspace.positions.items()
        if axis in scene.machine.axes and not scene.machine.axes[axis].is_linear
    ]
    if still:
        facts.append(" ".join(still))
    facts += [LOOP_WORDS[picture.view.loop], reference_words(scene)]
    if exaggeration is not None:
        facts += [f"displacement drawn {spell_factor(exaggeration)}", "orthographic"]
    return facts


def reference_words(scene: Scene) -> str:
    """Say what errors are referred to."""
    if scene.reference is None:
        return "absolute errors"
    at = " ".join(f"{axis} {spell_short(value)}" for axis, value in scene.reference.items())
    return f"held still at {at}"


def parameter_words(scene: Scene) -> list[str]:
    """Spell the parameters that are not zero, the largest first, µrad before µm."""
    found: list[tuple[bool, float, str]] = []
    for key in scene.errors:
        value = scene.errors.amplitude(key)
        if value == 0.0 or parameter(key).axis not in scene.machine.axes:
            continue
        kind = type(scene.errors.functions[key]).__name__.lower()
        tail = "" if kind == "constant" else f" {kind}"
        row = parameter(key)
        found.append(
            (not row.is_rotation, -abs(value), f"{key} {spell_short(value)} {row.unit}{tail}")
        )
    return [text for _, _, text in sorted(found)]


def draw_footer(
    canvas: Canvas,
    scenes: Sequence[Scene],
    legend: Sequence[LegendEntry],
    notes: Sequence[str] = (),
) -> float:
    """Draw legend, parameters, convention and provenance at the bottom.

    Returns
    -------
    float, px
        Height above which the figure is free.
    """
    margin = canvas.px(SIZES.margin) * min(1.0, canvas.width / canvas.px(1000.0))
    room = canvas.width - 2.0 * margin
    theme = canvas.theme
    y = canvas.px(26.0)
    source = f"warpspace {__version__} · scene {' · '.join(scene.name for scene in scenes)}"
    source, size = canvas.fit(source, 0.45 * room, SIZES.small)
    canvas.text(canvas.width - margin, y, source, size=size, colour=theme.muted, ha="right")
    left = room - canvas.text_size(source, size)[0] - canvas.px(24.0)
    words = [
        CONVENTION_WORDS[scenes[0].model.component_errors],
        "error = actual − nominal",
        "coordinates in the machine frame R",
        *notes,
    ]
    text, size = canvas.fit(" · ".join(words), left, SIZES.small)
    canvas.text(margin, y, text, size=size, colour=theme.muted)
    for scene in reversed(scenes):
        y += canvas.px(25.0)
        head = "errors: " if len(scenes) == 1 else f"errors of {scene.name}: "
        shown = _as_many(canvas, head, parameter_words(scene), room)
        canvas.text(margin, y, shown[0], size=shown[1], colour=theme.muted)
    if legend:
        y += canvas.px(36.0)
        _draw_legend(canvas, legend, margin, y, room)
    return y + canvas.px(30.0)


def _as_many(canvas: Canvas, head: str, items: Sequence[str], room: float) -> tuple[str, float]:
    """Join as many items as fit and count the others."""
    if not items:
        return head + "all zero", SIZES.small
    for count in range(len(items), 0, -1):
        rest = len(items) - count
        text = head + " · ".join(items[:count]) + (f" · and {rest} more" if rest else "")
        if canvas.text_size(text, SIZES.small)[0] <= room:
            return text, SIZES.small
    return canvas.fit(head + items[0], room, SIZES.small)


def _draw_legend(
    canvas: Canvas, legend: Sequence[LegendEntry], x: float, y: float, room: float
) -> None:
    """Draw the entries of a legend in a row; those that do not fit are left out."""
    swatch, gap = canvas.px(36.0), canvas.px(10.0)
    end = x + room
    for entry in legend:
        width = swatch + gap + canvas.text_size(entry.text, SIZES.small)[0]
        if x + width > end:
            return
        entry.symbol(canvas, x, y, swatch)
        canvas.text(
            x + swatch + gap, y, entry.text, size=SIZES.small, colour=canvas.theme.muted,
            va="center_baseline",
        )  # fmt: skip
        x += width + canvas.px(34.0)


def map_legend(isolines: str, *, surface: str = "deformed grid") -> list[LegendEntry]:
    """Build the legend of a map; `isolines` is empty where there are none."""
    entries = [
        LegendEntry(
            lambda c, x, y, w: c.line(
                [(x, y), (x + w, y)], width=SIZES.line, colour=c.theme.ghost, dashes=(11.0, 7.0)
            ),
            "nominal volume",
        ),
        LegendEntry(_grid_symbol, surface),
        LegendEntry(
            lambda c, x, y, w: c.arrow(np.array([x, y]), np.array([x + w, y])),
            "displacement of corners, |E|",
        ),
    ]
    if isolines:
        entries.append(LegendEntry(_isoline_symbol, isolines))
    return entries


def _grid_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show an edge of the deformed grid."""
    colour = canvas.theme.ink
    canvas.line([(x, y), (x + width, y)], width=SIZES.line, colour=colour)


def _isoline_symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a white line on a coloured ground."""
    height = canvas.px(14.0)
    canvas.rectangle(x, y - height / 2, width, height, facecolor="#2f6b8e", edgecolor="none")
    canvas.line([(x, y), (x + width, y)], width=SIZES.line, colour=canvas.theme.isoline, zorder=3.5)


def metadata(
    title: str, scenes: Sequence[Scene], settings: FigureSettings, exaggeration: float, figure: str
) -> dict[str, str]:
    """Collect what the file says about itself; no dates, so that it can be repeated."""
    return {
        "title": title,
        "scene": ", ".join(scene.name for scene in scenes),
        "version": f"warpspace {__version__}",
        "exaggeration": f"{exaggeration:.10g}",
        "settings": spell_settings(settings, exaggeration, figure=figure),
    }


def content_rect(canvas: Canvas, top: float, bottom: float, *, panel: bool = True) -> Rect:
    """Give the box between heading and footer, left of the panel where there is one."""
    margin = canvas.px(SIZES.margin) * min(1.0, canvas.width / canvas.px(1000.0))
    right = canvas.width - margin
    if panel:
        right -= panel_width(canvas) + canvas.px(12.0)
    return (0.6 * margin, bottom, right, top - canvas.px(6.0))


def panel_width(canvas: Canvas) -> float:
    """Width of the column with colour bar and numbers, px."""
    return canvas.px(SIZES.panel)


def panel_rect(canvas: Canvas, top: float, bottom: float) -> Rect:
    """Give the box of that column."""
    margin = canvas.px(SIZES.margin) * min(1.0, canvas.width / canvas.px(1000.0))
    right = canvas.width - margin
    return (right - panel_width(canvas), bottom, right, top - canvas.px(18.0))
