"""The frame of every figure: heading, facts, legend, panel, provenance.

The symbols of the legend are drawn with the strokes of the picture itself, and entries that do not
fit are omitted; matplotlib's legend does neither.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from matplotlib.figure import Figure

from warpspace.geometry.colour import LEVELS, ColourScale
from warpspace.geometry.surfaces import round_down
from warpspace.machine.axes import parameter
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.off_screen import Projection, Raster, Rect
from warpspace.outputs.drawing.settings import SIZES, FigureSettings, Theme
from warpspace.picture.formatting import (
    LOOP_WORDS,
    TIMES,
    convention_words,
    reference_words,
    spell_factor,
)
from warpspace.picture.model import Picture, ScenePicture
from warpspace.resources import __version__
from warpspace.scene.model import Scene, common_loop
from warpspace.units import MICROMETRE, MM_PER_UM, spell_short


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """A map in a figure, with its projection and raster."""

    projection: Projection
    picture: Picture
    raster: Raster | None  # the drawn body; None without a surface


@dataclass(frozen=True, slots=True)
class Drawing:
    """A finished figure."""

    figure: Figure
    title: str
    facts: Mapping[str, str]  # metadata of the file: scene, version, settings
    maps: tuple[DrawnMap, ...] = ()
    rects: tuple[Rect, ...] = ()  # (n, 4), px; boxes of all text


Symbol = Callable[[Canvas, float, float, float], None]


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """One entry of the legend at the bottom."""

    # draws it, given the canvas, its left end, the height of its middle and its width, px
    symbol: Symbol
    text: str


def line_entry(
    text: str,
    colour: Callable[[Theme], str],
    width: float = SIZES.line,
    dashes: tuple[float, float] | None = None,
    alpha: float = 1.0,
) -> LegendEntry:
    def symbol(canvas: Canvas, x: float, y: float, length: float) -> None:
        ends = [(x, y), (x + length, y)]
        ink = colour(canvas.theme)
        canvas.line(ends, width=width, colour=ink, dashes=dashes, alpha=alpha)

    return LegendEntry(symbol, text)


def draw_legend(
    canvas: Canvas, legend: Sequence[LegendEntry], x: float, y: float, max_width: float
) -> None:
    swatch, gap = canvas.px(36.0), canvas.px(10.0)
    end = x + max_width
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


def isoline_entries(text: str, *, diverging: bool = False) -> list[LegendEntry]:
    """Build the entry of isolines, a white or dark line on a coloured ground; none without text."""

    def symbol(canvas: Canvas, x: float, y: float, width: float) -> None:
        height, theme = canvas.px(14.0), canvas.theme
        ground = "#d9a98c" if diverging else "#2f6b8e"
        canvas.rectangle(x, y - height / 2, width, height, facecolor=ground, edgecolor="none")
        thick, ink = (SIZES.thin, theme.grid) if diverging else (SIZES.line, theme.isoline)
        canvas.line([(x, y), (x + width, y)], width=thick, colour=ink, zorder=3.5)

    return [LegendEntry(symbol, text)] if text else []


Row = tuple[str, str]


def draw_colour_bar(
    canvas: Canvas, rect: Rect, scale: ColourScale, marks: Sequence[tuple[str, float]] = ()
) -> None:
    """Draw a colour bar with numbers on its right and marked values on its left."""
    x_left, low, right, high = rect
    theme, ticks = canvas.theme, scale.ticks
    colours = scale.colours(np.linspace(scale.high, scale.low, LEVELS))[:, None, :]
    canvas.image(colours, rect, zorder=2.0)
    canvas.rectangle(
        x_left, low, right - x_left, high - low, fill=False, edgecolor=theme.muted,
        linewidth=canvas.px(1.0) * 0.72, zorder=2.6,
    )  # fmt: skip
    height = canvas.text_size("0", SIZES.text)[1]
    tick_step = 1
    # a small figure may have no room for any
    while tick_step < len(ticks) and high - low < 1.6 * height * (len(ticks) - 1) / tick_step:
        tick_step += 1
    zero = min(range(len(ticks)), key=lambda i: abs(ticks[i]))
    for index, tick in enumerate(ticks):
        y = low + (tick - scale.low) / (scale.high - scale.low) * (high - low)
        if scale.low < tick < scale.high:
            colour = theme.grid if scale.diverging else theme.isoline
            canvas.line([(x_left, y), (right, y)], width=SIZES.thin, colour=colour, zorder=2.5)
        if (index - zero) % tick_step:
            continue
        canvas.line([(right, y), (right + canvas.px(7.0), y)], width=SIZES.thin, colour=theme.muted)
        canvas.text(right + canvas.px(13.0), y, spell_short(tick), va="center_baseline")
    _draw_marks(canvas, rect, scale, marks)


def _draw_marks(
    canvas: Canvas, rect: Rect, scale: ColourScale, marks: Sequence[tuple[str, float]]
) -> None:
    x_left, low, _, high = rect
    distance = canvas.px(19.0)
    ordered = sorted(marks, key=lambda mark: mark[1])
    spots = [low + float(scale.fraction(np.asarray(value))) * (high - low) for _, value in ordered]
    # names keep a distance upwards, then downwards from the end of the bar
    heights = list(accumulate(spots, lambda below, spot: max(spot, below + distance)))
    heights[-1:] = [min(height, high + canvas.px(6.0)) for height in heights[-1:]]
    downwards = accumulate(heights[::-1], lambda above, height: min(height, above - distance))
    tip, side, small = x_left - canvas.px(2.0), canvas.px(5.0), SIZES.small
    base = tip - canvas.px(9.0)
    for (name, value), spot, height in zip(ordered, spots, list(downwards)[::-1], strict=True):
        beyond = " ↑" if value > scale.high else " ↓" if value < scale.low else ""
        canvas.polygon([(tip, spot), (base, spot + side), (base, spot - side)], canvas.theme.ink)
        if abs(height - spot) > canvas.px(1.0):
            canvas.line([(base, spot), (base - side, height)], width=SIZES.hair)
        x = base - canvas.px(7.0)
        canvas.text(x, height, name + beyond, size=small, ha="right", va="center_baseline")


def draw_scale_bars(
    canvas: Canvas, rect: Rect, px_per_mm: float, exaggeration: float | None
) -> float:
    """Draw one bar for lengths and one for displacements, both as seen in the picture plane."""
    x, y, right, _ = rect
    foot = canvas.px(6.0)
    y += foot
    bars = [(px_per_mm, "mm geometry", canvas.theme.ink)]
    if exaggeration is not None:
        name = f"µm displacement ({spell_factor(exaggeration)})"
        bars.insert(0, (px_per_mm * MM_PER_UM * exaggeration, name, canvas.theme.accent))
    for px_per_unit, quantity, colour in bars:
        length = round_down(min(right - x, canvas.px(190.0)) / px_per_unit)
        end, name = x + length * px_per_unit, f"{spell_short(length)} {quantity}"
        points = [(x, y - foot), (x, y), (end, y), (end, y - foot)]
        canvas.line(points, colour=colour, cap="butt")
        height = y + canvas.px(13.0)
        canvas.text(x, height, name, size=SIZES.small, colour=colour, max_width=right - x)
        y += canvas.px(52.0)
    return y - canvas.px(18.0)


MOST_TITLE_LINES = 3
CAPTION = 0.15  # share of the height for a line of the caption, wrapped
HINTED = 0.92
"""Share of the width for measured text beside other text: hinting widens small letters."""


def draw_heading(canvas: Canvas, title: str, facts: Sequence[str]) -> float:
    margin = canvas.margin
    max_width = canvas.width - 2.0 * margin
    y = canvas.height - canvas.px(16.0)
    for line in _wrap(canvas, title.split(), max_width, SIZES.title, "bold", " ", MOST_TITLE_LINES):
        y -= canvas.px(38.0)
        canvas.text(margin, y, line, size=SIZES.title, weight="bold", max_width=max_width)
    y -= canvas.px(14.0)
    for line in _wrap(canvas, facts, max_width, SIZES.subtitle):
        y -= canvas.px(24.0)
        colour = canvas.theme.muted
        canvas.text(margin, y, line, size=SIZES.subtitle, colour=colour, max_width=max_width)
    y -= canvas.px(18.0)
    canvas.line(
        [(margin, y), (canvas.width - margin, y)], width=SIZES.hair, colour=canvas.theme.faint
    )
    return y


def _wrap(
    canvas: Canvas, parts: Sequence[str], max_width: float, size: float, weight: str = "normal",
    between: str = " · ", max_rows: int = 2,
) -> list[str]:  # fmt: skip
    rows: list[str] = []
    for part in parts:
        joined = f"{rows[-1]}{between}{part}" if rows else part
        fits = canvas.text_size(joined, size, weight)[0] <= max_width
        if rows and (fits or len(rows) == max_rows):
            rows[-1] = joined
        else:
            rows.append(part)
    return rows


def scene_facts(picture: ScenePicture, exaggeration: float | None) -> list[str]:
    """List the conditions of a picture: machine, volume, loop, reference, factor."""
    scene, grid = picture.scene, picture.grid
    facts = [f"{scene.machine.title}, chain {scene.machine.chain}"]
    extent = [value for value in grid.extent_mm if value > 0.0]
    if extent:
        size = f" {TIMES} ".join(f"{value:.5g}" for value in extent)
        nodes = f" {TIMES} ".join(str(count) for count in grid.shape if count > 1)
        facts += [f"working volume {size} mm", f"{nodes} nodes"]
    axes, positions = scene.machine.axes, scene.workspace.positions.items()
    placed = [(axes[name], at) for name, at in positions if name in axes]
    rotary = [
        f"{axis.name} {spell_short(at)}{axis.unit}" for axis, at in placed if not axis.is_linear
    ]
    facts += [" ".join(rotary)] if rotary else []
    facts += [LOOP_WORDS[picture.view.loop], reference_words(scene), *picture.conditions]
    if exaggeration is not None:
        facts += [f"displacement drawn {spell_factor(exaggeration)}", "orthographic"]
    return facts


def parameter_words(scene: Scene) -> list[str]:
    """Spell the parameters that are not zero, the largest first, µrad before µm."""
    ranked: list[tuple[bool, float, str]] = []
    for key in scene.errors:
        value, row = scene.errors.amplitude(key), parameter(key)
        if value == 0.0 or row.axis not in scene.machine.axes:
            continue
        kind = scene.errors.functions[key].name
        text = f"{key} {spell_short(value)} {row.unit}{'' if kind == 'constant' else f' {kind}'}"
        ranked.append((not row.is_rotation, -abs(value), text))
    return [text for _, _, text in sorted(ranked)]


def draw_footer(
    canvas: Canvas,
    scenes: Sequence[Scene],
    legend: Sequence[LegendEntry],
    *,
    errors: bool,
) -> float:
    """Draw legend, parameters (where `errors` is true), convention and provenance at the bottom."""
    margin = canvas.margin
    max_width = canvas.width - 2.0 * margin
    theme = canvas.theme
    y = canvas.px(26.0)
    source = f"warpspace {__version__} · scene {' · '.join(scene.name for scene in scenes)}"
    source_rect = canvas.text(
        canvas.width - margin, y, source, size=SIZES.small, colour=theme.muted, ha="right",
        max_width=0.45 * max_width,
    )  # fmt: skip
    text_width = HINTED * (max_width - (source_rect[2] - source_rect[0])) - canvas.px(24.0)
    conventions = " / ".join(dict.fromkeys(map(convention_words, scenes)))
    text = f"{conventions} · error = actual − nominal · coordinates in the machine frame R"
    canvas.text(margin, y, text, size=SIZES.small, colour=theme.muted, max_width=text_width)
    for scene in reversed(scenes if errors else ()):
        y += canvas.px(25.0)
        head = "errors: " if len(scenes) == 1 else f"errors of {scene.name}: "
        text = _fitting_text(canvas, head, parameter_words(scene), max_width)
        canvas.text(margin, y, text, size=SIZES.small, colour=theme.muted, max_width=max_width)
    if legend:
        y += canvas.px(36.0)
        draw_legend(canvas, legend, margin, y, max_width)
    return y + canvas.px(30.0)


def _fitting_text(canvas: Canvas, head: str, items: Sequence[str], max_width: float) -> str:
    for omitted in range(len(items)):
        parts = [*items[: len(items) - omitted], *([f"and {omitted} more"] if omitted else [])]
        text = head + " · ".join(parts)
        if canvas.text_size(text, SIZES.small)[0] <= max_width:
            return text
    return head + (items[0] if items else "all zero")


def map_legend(
    isolines: str,
    limit_um: float | None,
    *,
    surface: str = "deformed grid",
    diverging: bool = False,
) -> list[LegendEntry]:
    """Build the legend of a map; an empty `isolines` has no entry."""
    return [
        line_entry("nominal volume", lambda theme: theme.ghost, dashes=(11.0, 7.0)),
        line_entry(surface, lambda theme: theme.ink),
        LegendEntry(
            lambda c, x, y, w: c.arrow(np.array([x, y]), np.array([x + w, y])),
            "displacement of corners, |E|",
        ),
        *isoline_entries(isolines, diverging=diverging),
        *limit_entries(limit_um),
    ]


def limit_entries(limit_um: float | None) -> list[LegendEntry]:
    if limit_um is None:
        return []
    text = f"limit {spell_short(limit_um)} {MICROMETRE}, hatched above"
    return [line_entry(text, lambda theme: theme.accent, SIZES.bold)]


def metadata(
    title: str, scenes: Sequence[Scene], settings: FigureSettings, exaggeration: float, figure: str
) -> dict[str, str]:
    top, factor = settings.range_top, f"{exaggeration:.10g}"
    options = {
        "component": settings.component,
        "view": settings.view,
        "loop": common_loop(scenes, settings.loop),
        "grid": settings.grid,
        "exaggeration": factor,
        "size": f"{settings.size[0]}x{settings.size[1]}",
        "theme": settings.theme.name,
        **({} if top is None else {"range": f"{top:.10g}"}),
        "figure": figure,
    }
    return {
        "title": title,
        "scene": ", ".join(scene.name for scene in scenes),
        "version": f"warpspace {__version__}",
        "exaggeration": factor,
        "settings": ", ".join(f"{key}={value}" for key, value in options.items()),
    }


@dataclass(frozen=True, slots=True)
class Sheet:
    """A figure with heading and footer, before its content is drawn."""

    name: str  # of the figure
    canvas: Canvas
    title: str
    content: Rect  # px; area of the content; `panel` is the column beside it
    panel: Rect
    scenes: Sequence[Scene]
    settings: FigureSettings

    def draw_panel(
        self,
        scale: ColourScale,
        heading: str,
        marks: Sequence[tuple[str, float]],
        rows: Sequence[Row],
        bars: tuple[float, float | None] | None,
    ) -> None:
        canvas, rect = self.canvas, self.panel
        x_left, _, right, top = rect
        y = (rect[1] if bars is None else draw_scale_bars(canvas, rect, *bars)) + canvas.px(24.0)
        step = canvas.px(27.0)
        visible_rows = rows[: max(1, int((top - y - canvas.px(150.0)) / step))]
        for index, (name, value) in enumerate(reversed(visible_rows)):
            weight = "bold" if index == len(visible_rows) - 1 else "normal"
            height, width = y + index * step, 0.8 * (right - x_left)
            start = canvas.text(right, height, value, weight=weight, ha="right", max_width=width)[0]
            width = start - x_left - canvas.px(8.0)
            canvas.text(x_left, height, name, colour=canvas.theme.muted, max_width=width)
        y += len(visible_rows) * step + canvas.px(26.0)
        width, size = right - x_left, SIZES.heading
        canvas.text(x_left, top, heading, size=size, weight="bold", va="top", max_width=width)
        high = top - canvas.px(40.0)
        low = max(y, high - canvas.px(560.0))
        draw_colour_bar(
            canvas, (x_left + canvas.px(64.0), low, x_left + canvas.px(94.0), high), scale, marks
        )

    def finish(self, factor: float, maps: Sequence[DrawnMap] = ()) -> Drawing:
        about = metadata(self.title, self.scenes, self.settings, factor, self.name)
        return Drawing(self.canvas.figure, self.title, about, tuple(maps), tuple(self.canvas.rects))


def start_sheet(
    name: str,
    settings: FigureSettings,
    title: str,
    facts: Sequence[str],
    scenes: Sequence[Scene],
    legend: Sequence[LegendEntry],
    *,
    exact: bool,
    panel: bool = True,
    errors: bool = True,
) -> Sheet:
    printed = settings.printed
    canvas = Canvas(*settings.size, settings.theme, exact=exact, printed=printed)
    margin = 0.0 if printed else canvas.margin
    if printed:
        draw_legend(canvas, legend, margin, canvas.px(14.0), canvas.width)
        top, bottom = float(canvas.height), canvas.px(40.0 if legend else 0.0)
    else:
        facts_text = " · ".join(facts)
        facts = [*facts, *(words for words in settings.conditions if words not in facts_text)]
        top = draw_heading(canvas, title, facts)
        bottom = draw_footer(canvas, scenes, legend, errors=errors)
    right, width = canvas.width - margin, canvas.px(SIZES.panel)
    max_rows = max(1, int(CAPTION * canvas.height / canvas.px(30.0)))
    for text in reversed(settings.caption.splitlines()):
        rows = _wrap(canvas, text.split(), right - margin, SIZES.heading, between=" ",
                     max_rows=max_rows)  # fmt: skip
        for row in reversed(rows):
            canvas.text(margin, bottom, row, size=SIZES.heading, max_width=right - margin)
            bottom += canvas.px(30.0)
    edge = right - width - canvas.px(12.0) if panel else right
    content = (0.6 * margin, bottom, edge, top - canvas.px(6.0))
    column = (right - width, bottom, right, top - canvas.px(18.0))
    return Sheet(name, canvas, title, content, column, scenes, settings)
