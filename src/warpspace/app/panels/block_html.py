"""Results as HTML: sentences, tables, bars, and curves as SVG."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup

from warpspace.analysis import blocks
from warpspace.analysis.blocks import Bars, Block, Curve, Lines, Table
from warpspace.app.browser.html import EMPTY, fill, join, number, tag
from warpspace.app.panels.panel import details, tiny
from warpspace.bench.base import SMALLEST_DEVIATION, lay_polar
from warpspace.geometry.colour import tick_values
from warpspace.units import MINUS, THIN_SPACE, Array, spell_short

WIDEST = 5  # columns of a table that fit into the column of the page
MOST_BARS = 10
WIDE, HIGH = 320.0, 190.0  # of a chart, in its own units
MARGIN_LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 8.0, 30.0
INNER = WIDE - MARGIN_LEFT - RIGHT, HIGH - TOP - BOTTOM
SERIES = 6  # colours of series in the style sheet
ANGLES = Markup(
    '<path class="ws-faint" d="M-1 0H1M0 -1V1"/><text x="1.02" y=".05">0°</text>'
    '<text x="0" y="-1.03" text-anchor="middle">90°</text>'
    '<text x="-1.02" y=".05" text-anchor="end">180°</text>'
)


def result_html(blocks: Iterable[Block]) -> Markup:
    """Render tables and charts; those too wide for the column of the page are folded."""
    visible, folded = list[Markup](), list[Block]()
    for block in blocks:
        narrow = _transposed(block) if isinstance(block, Table) else block
        if isinstance(narrow, Bars):
            visible.append(_first_bars(narrow))
        elif not _is_wide(narrow):
            visible.append(block_html(narrow))
        if isinstance(narrow, Bars) or _is_wide(narrow):
            folded.append(narrow)
    return join(visible) + details_html(folded)


def details_html(blocks: Iterable[Block], title: str = "Details") -> Markup:
    """Render blocks that are too wide for the column, or rarely read, folded away."""
    inner = join(map(block_html, blocks))
    if not inner:
        return EMPTY
    wide = tag("div", inner, tabindex=0, role="group", aria_label=title)  # scrolled by keys
    return details(title, wide, kind="details", data_key=f"details.{title}")


def block_html(block: Block) -> Markup:
    if isinstance(block, str):
        return tag("p", spelt(block))
    if isinstance(block, Lines):
        return lines_html(block)
    if isinstance(block, blocks.Histogram):
        return histogram_html(block)
    return Markup(re.sub(r">-(?=\d)", f">{MINUS}", blocks.blocks_html([block])))  # noqa: S704 - escaped


def spelt(sentence: str) -> str:
    """Format a sentence of a command for the page: true minus, thin spaces in large counts."""
    text = re.sub(r"(?<![\w.])-(?=\d)", MINUS, sentence.strip())
    return re.sub(r"(?<=\d),(?=\d{3}\b)", THIN_SPACE, text[:1].upper() + text[1:])


def _is_wide(block: Block) -> bool:
    return isinstance(block, Table) and len(block.visible_columns) > WIDEST


def _transposed(table: Table) -> Table:
    if not _is_wide(table) or not 0 < len(table.rows) < WIDEST:
        return table
    (first, *names), *lines = zip(table.visible_columns, *table.cells(), strict=True)
    form = "s" if all(one.is_number for one, *_ in lines) else ""
    columns = (blocks.Column(first.heading), *(blocks.Column(name, form) for name in names))
    lines = [(" ".join(filter(None, (one.heading, one.unit))), *cells) for one, *cells in lines]
    return replace(table, columns=columns, rows=lines, marks=())


def _first_bars(bars: Bars) -> Markup:
    panel = bars.panels[0]
    values = panel.series[0].values
    longest = max((abs(value) for value in values if value is not None), default=0.0) or 1.0
    lines = [
        fill('<div class="ws-pair"><span>{words}</span><span>{value}</span></div>'
             '<div class="ws-effect"><i style="width:{share}%"></i></div>', words=label,
             value=number(value, 2), share=number(100.0 * abs(value) / longest))
        for label, value in zip(bars.rows, values, strict=True) if value is not None
    ]  # fmt: skip
    head = tiny(" · ".join(filter(None, (panel.title, panel.unit))))
    return head + join(lines[:MOST_BARS])


@dataclass(frozen=True, slots=True)
class PlotFrame:
    """Limits of the two axes of a chart, and the transformation to its drawing."""

    x: tuple[float, float]
    y: tuple[float, float]

    def place(self, x: Array | float, y: Array | float) -> Array:
        """Compute points of the drawing, [..., 2]."""
        across = MARGIN_LEFT + INNER[0] * (x - self.x[0]) / (self.x[1] - self.x[0])
        down = TOP + INNER[1] * (self.y[1] - y) / (self.y[1] - self.y[0])
        return np.stack(np.broadcast_arrays(across, down), axis=-1)

    def to_scale(self) -> "PlotFrame":
        """Widen one of the axes until a unit is as long on both."""
        rooms = (self.x, INNER[0]), (self.y, INNER[1])
        per = max((high - low) / room for (low, high), room in rooms) / 2.0
        x, y = (
            ((low + high) / 2.0 - per * room, (low + high) / 2.0 + per * room)
            for (low, high), room in rooms
        )
        return PlotFrame(x, y)

    def axes(self, x_label: str, y_label: str) -> Markup:
        floor, middle = HIGH - BOTTOM, (TOP + HIGH - BOTTOM) / 2.0
        parts = [_text(x_label, (MARGIN_LEFT + WIDE - RIGHT) / 2.0, HIGH - 4),
                 _text(y_label, 9, middle, transform=f"rotate(-90 9 {middle:.0f})")]  # fmt: skip
        for value in tick_values(*self.x, 6.0):
            at = self.place(value, self.y[0])[0]
            parts += [_line(f"M{at:.1f} {TOP}V{floor}"), _text(spell_short(value), at, floor + 11)]
        for value in tick_values(*self.y, 5.0):
            at = self.place(self.x[0], value)[1]
            label = _text(spell_short(value), MARGIN_LEFT - 4, at + 3, text_anchor="end")
            parts += [_line(f"M{MARGIN_LEFT} {at:.1f}H{WIDE - RIGHT}"), label]
        return join(parts)


def lines_html(chart: Lines) -> Markup:
    """Draw curves over an abscissa, to scale, or in polar coordinates."""
    if chart.kind == "polar":
        layout = lay_polar(chart)
        rings = join(
            tag("circle", class_="ws-faint" if value else "ws-base", r=f"{radius:.3f}")
            for value, radius in layout.rings
        )
        curves = join(
            _curve(curve, polar * np.array([1.0, -1.0]), 3)
            for curve, polar in zip(chart.curves, layout.curves, strict=True)
        )
        note = f"rings {layout.ring:g} {layout.unit}"
        return _figure(chart, ANGLES + rings + curves, "-1.3 -1.16 2.6 2.24", note, "ws-polar")
    xs = np.concatenate([curve.x for curve in chart.curves])
    ys = np.concatenate([curve.y for curve in chart.curves])
    frame = PlotFrame(_ends(xs), _ends(ys))
    frame = frame.to_scale() if chart.kind == "plane" else frame
    curves = join(_curve(curve, frame.place(curve.x, curve.y)) for curve in chart.curves)
    for band in chart.bands:
        edges = frame.place(band.x, band.low), frame.place(band.x, band.high)[::-1]
        curves += _line(_path(np.concatenate(edges)), f"ws-band ws-s{band.colour % SERIES}")
    return _figure(chart, frame.axes(chart.x_label, chart.y_label) + curves)


def histogram_html(chart: blocks.Histogram) -> Markup:
    limit = math.inf if chart.limit is None else chart.limit
    ends = float(chart.edges[0]), max(float(chart.edges[-1]), chart.limit or 0.0)
    frame = PlotFrame(ends, (0.0, max(float(chart.heights.max()), 1e-9) * 1.05))
    bars: list[Markup] = []
    for low, high, height in zip(chart.edges[:-1], chart.edges[1:], chart.heights, strict=True):
        (x0, y0), (x1, y1) = frame.place(np.array([low, high]), np.array([height, 0.0]))
        bars.append(tag("rect", class_="ws-over" if low >= limit else "ws-under",
                        x=f"{x0:.1f}", y=f"{y0:.1f}", width=f"{max(x1 - x0 - 0.5, 0.5):.1f}",
                        height=f"{y1 - y0:.1f}"))  # fmt: skip
    if chart.limit is not None:
        at = frame.place(chart.limit, 0.0)[0]
        bars.append(_line(f"M{at:.1f} {TOP}V{HIGH - BOTTOM}", "ws-limit"))
    statements = join(tag("p", spelt(statement), class_="ws-tiny" if index else "ws-headline")
                for index, statement in enumerate(chart.captions))  # fmt: skip
    svg = _svg(frame.axes(chart.x_label, chart.y_label) + join(bars), chart.title)
    return tag("figure", statements + svg + tag("figcaption", chart.subtitle, class_="ws-tiny"))


FLAT = f"0 0 {WIDE:g} {HIGH:g}"


def _figure(
    chart: Lines, inner: Markup, box: str = FLAT, rings: str = "", kind: str = ""
) -> Markup:
    named = (curve for curve in chart.curves if curve.name)
    key = join(
        tag("span", one.name, class_=f"ws-s{one.colour % SERIES} ws-{one.style}") for one in named
    )
    note = tiny(chart.note) if chart.note else EMPTY
    svg = _svg(inner, f"{chart.title}: {chart.y_label}", box, kind)
    key = tag("div", join((key, rings)), class_="ws-key ws-tiny")
    return tag("figure", tag("figcaption", chart.title) + svg + key + note)


def _svg(inner: Markup, label: str, box: str = FLAT, kind: str = "") -> Markup:
    return tag("svg", inner, viewBox=box, role="img", aria_label=label, class_=kind or None)


def _curve(curve: Curve, points: Array, digits: int = 1) -> Markup:
    path = _path(points, digits, dots=curve.style == "dots")
    return _line(path, f"ws-s{curve.colour % SERIES} ws-{curve.style}")


def _line(path: str, kind: str = "ws-faint") -> Markup:
    return tag("path", class_=kind, d=path)


def _text(text: str, x: float, y: float, text_anchor: str = "middle", **attributes: str) -> Markup:
    return tag("text", text, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=text_anchor, **attributes)


def _path(points: Array, digits: int = 1, *, dots: bool = False) -> str:
    """Format a path with gaps at NaN; dots are strokes without length."""
    path, joint = "", "M"
    for x, y in points.tolist():
        is_finite = not (math.isnan(x) or math.isnan(y))
        if is_finite:
            path += f"{joint}{x:.{digits}f} {y:.{digits}f}" + ("h0" if dots else "")
        joint = "L" if is_finite and not dots else "M"
    return path


def _ends(values: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = 0.04 * (high - low) if high - low >= SMALLEST_DEVIATION else 1.0
    return low - room, high + room
