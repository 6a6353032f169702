"""Results as HTML: sentences, tables, bars, and curves as SVG."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from markupsafe import Markup

from warpspace.analysis import blocks
from warpspace.analysis.blocks import Bars, Block, Curve, Lines, Table
from warpspace.app.browser.html import EMPTY, join, tag
from warpspace.app.browser.templates import Templates
from warpspace.bench.base import SMALLEST_DEVIATION, lay_polar
from warpspace.geometry.colour import tick_values
from warpspace.units import MINUS, THIN_SPACE, Array, spell_short

WIDEST = 5  # columns of a table that fit into the column of the page
MOST_BARS = 10
SERIES = 6  # colours of series in the style sheet
HTML = Templates("block_html")


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
    return HTML.details(title, inner) if inner else EMPTY


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
    lines = [pair for pair in zip(bars.rows, values, strict=True) if pair[1] is not None]
    title = " · ".join(filter(None, (panel.title, panel.unit)))
    return HTML.bars(title, lines[:MOST_BARS], longest)


@dataclass(frozen=True, slots=True)
class PlotFrame:
    """Limits of the two axes of a chart, and the transformation to its drawing."""

    MARGIN, RIGHT, TOP, FLOOR = 40.0, 312.0, 8.0, 160.0
    BOX = "0 0 320 190"  # of the drawing, in the same units

    x: tuple[float, float]
    y: tuple[float, float]

    def place(self, x: Array | float, y: Array | float) -> Array:
        """Compute points of the drawing, [..., 2]."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        columns = self.MARGIN + (self.RIGHT - self.MARGIN) * across
        rows = self.FLOOR - (self.FLOOR - self.TOP) * up
        return np.stack(np.broadcast_arrays(columns, rows), axis=-1)

    def to_scale(self) -> "PlotFrame":
        """Widen one of the axes until a unit is as long on both."""
        rooms = (self.x, self.RIGHT - self.MARGIN), (self.y, self.FLOOR - self.TOP)
        per = max((high - low) / room for (low, high), room in rooms) / 2.0
        x, y = (
            ((low + high) / 2.0 - per * room, (low + high) / 2.0 + per * room)
            for (low, high), room in rooms
        )
        return PlotFrame(x, y)

    def x_ticks(self) -> list[tuple[float, str]]:
        """Return places and labels of the numbers of the x axis."""
        values = tick_values(*self.x, 6.0)
        return [(self.place(value, self.y[0])[0], spell_short(value)) for value in values]

    def y_ticks(self) -> list[tuple[float, str]]:
        values = tick_values(*self.y, 5.0)
        return [(self.place(self.x[0], value)[1], spell_short(value)) for value in values]


def lines_html(chart: Lines) -> Markup:
    """Draw curves over an abscissa, to scale, or in polar coordinates."""
    if chart.kind == "polar":
        layout = lay_polar(chart)
        mirrored = [polar * np.array([1.0, -1.0]) for polar in layout.curves]
        return HTML.polar(
            chart, layout, list(map(partial(_curve, digits=3), chart.curves, mirrored))
        )
    xs = np.concatenate([curve.x for curve in chart.curves])
    ys = np.concatenate([curve.y for curve in chart.curves])
    frame = PlotFrame(_ends(xs), _ends(ys))
    frame = frame.to_scale() if chart.kind == "plane" else frame
    curves = [_curve(curve, frame.place(curve.x, curve.y)) for curve in chart.curves]
    for band in chart.bands:
        edges = frame.place(band.x, band.low), frame.place(band.x, band.high)[::-1]
        curves.append((f"ws-band ws-s{band.colour % SERIES}", _path(np.concatenate(edges))))
    return HTML.lines(chart, frame, curves)


def histogram_html(chart: blocks.Histogram) -> Markup:
    limit = math.inf if chart.limit is None else chart.limit
    ends = float(chart.edges[0]), max(float(chart.edges[-1]), chart.limit or 0.0)
    frame = PlotFrame(ends, (0.0, max(float(chart.heights.max()), 1e-9) * 1.05))
    low = frame.place(chart.edges[:-1], chart.heights)
    right, floor = frame.place(chart.edges[1:], 0.0).T
    bars = [
        ("over" if edge >= limit else "under", x, y, max(end - x - 0.5, 0.5), base - y)
        for edge, (x, y), end, base in zip(chart.edges, low, right, floor, strict=False)
    ]
    limit_at = None if chart.limit is None else frame.place(chart.limit, 0.0)[0]
    return HTML.histogram(chart, frame, list(map(spelt, chart.captions)), bars, limit_at)


def _curve(curve: Curve, points: Array, digits: int = 1) -> tuple[str, str]:
    """Return class and path of a curve."""
    path = _path(points, digits, dots=curve.style == "dots")
    return f"ws-s{curve.colour % SERIES} ws-{curve.style}", path


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
