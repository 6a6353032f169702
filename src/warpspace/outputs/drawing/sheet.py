"""What every figure carries around its content: heading, facts, legend, provenance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace import __version__
from warpspace.machine.parameters import parameter
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.legend import (
    LegendEntry,
    dark_isoline_symbol,
    draw_legend,
    grid_symbol,
    isoline_symbol,
)
from warpspace.outputs.drawing.projection import Rect
from warpspace.outputs.drawing.settings import FigureSettings, spell_settings
from warpspace.outputs.drawing.style import SIZES
from warpspace.picture.scene_picture import ScenePicture
from warpspace.picture.words import (
    LOOP_WORDS,
    TIMES,
    convention_words,
    reference_words,
    spell_factor,
    spell_short,
)
from warpspace.scene.model import Scene

HINTED = 0.92
"""Share of a room that measured text may take beside other text: small letters are drawn wider."""


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
    facts += [LOOP_WORDS[picture.view.loop], reference_words(scene), *picture.conditions]
    if exaggeration is not None:
        facts += [f"displacement drawn {spell_factor(exaggeration)}", "orthographic"]
    return facts


def parameter_words(scene: Scene) -> list[str]:
    """Spell the parameters that are not zero, the largest first, µrad before µm."""
    found: list[tuple[bool, float, str]] = []
    for key in scene.errors:
        value = scene.errors.amplitude(key)
        if value == 0.0 or parameter(key).axis not in scene.machine.axes:
            continue
        kind = scene.errors.functions[key].name
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
    *,
    errors: bool = True,
) -> float:
    """Draw legend, parameters (where `errors` is true), convention and provenance at the bottom.

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
    left = HINTED * (room - canvas.text_size(source, size)[0]) - canvas.px(24.0)
    words = [
        " / ".join(dict.fromkeys(map(convention_words, scenes))),
        "error = actual − nominal",
        "coordinates in the machine frame R",
        *notes,
    ]
    text, size = canvas.fit(" · ".join(words), left, SIZES.small)
    canvas.text(margin, y, text, size=size, colour=theme.muted)
    for scene in reversed(scenes if errors else ()):
        y += canvas.px(25.0)
        head = "errors: " if len(scenes) == 1 else f"errors of {scene.name}: "
        shown = _as_many(canvas, head, parameter_words(scene), room)
        canvas.text(margin, y, shown[0], size=shown[1], colour=theme.muted)
    if legend:
        y += canvas.px(36.0)
        draw_legend(canvas, legend, margin, y, room)
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


def map_legend(
    isolines: str, *, surface: str = "deformed grid", diverging: bool = False
) -> list[LegendEntry]:
    """Build the legend of a map; `isolines` is empty where there are none."""
    entries = [
        LegendEntry(
            lambda c, x, y, w: c.line(
                [(x, y), (x + w, y)], width=SIZES.line, colour=c.theme.ghost, dashes=(11.0, 7.0)
            ),
            "nominal volume",
        ),
        LegendEntry(grid_symbol, surface),
        LegendEntry(
            lambda c, x, y, w: c.arrow(np.array([x, y]), np.array([x + w, y])),
            "displacement of corners, |E|",
        ),
    ]
    if isolines:
        entries.append(LegendEntry(dark_isoline_symbol if diverging else isoline_symbol, isolines))
    return entries


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


@dataclass(frozen=True, slots=True)
class Sheet:
    """A figure with heading and footer, waiting for its content.

    Attributes
    ----------
    canvas : Canvas
    title : str
    content, panel : tuple of float, (4,), px
        Room for the content and for the column beside it.
    """

    canvas: Canvas
    title: str
    content: Rect
    panel: Rect


def start_sheet(
    settings: FigureSettings,
    title: str,
    facts: Sequence[str],
    scenes: Sequence[Scene],
    legend: Sequence[LegendEntry],
    *,
    exact: bool,
    panel: bool = True,
    notes: Sequence[str] = (),
    errors: bool = True,
) -> Sheet:
    """Start a figure and draw what surrounds its content.

    Parameters
    ----------
    settings : FigureSettings
    title : str
    facts : sequence of str
        For the lines below the title.
    scenes : sequence of Scene
    legend : sequence of LegendEntry
    exact : bool
        Whether the figure becomes pixels of its own size.
    panel : bool, optional
        Whether there is a column beside the content.
    notes : sequence of str, optional
        For the last line.
    errors : bool, optional
        Whether the errors of the scenes are listed at the bottom.

    Returns
    -------
    Sheet
    """
    canvas = new_canvas(settings, exact=exact)
    said = " · ".join(facts)
    facts = [*facts, *(words for words in settings.conditions if words not in said)]
    top = draw_heading(canvas, title, facts)
    bottom = draw_footer(canvas, scenes, legend, notes, errors=errors)
    return Sheet(
        canvas,
        title,
        content_rect(canvas, top, bottom, panel=panel),
        panel_rect(canvas, top, bottom),
    )
