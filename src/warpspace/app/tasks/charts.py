"""What a result says as HTML: sentences, tables, bars, and curves as SVG."""

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Block, Curve, Histogram, Lines, blocks_html
from warpspace.app.browser.html import EMPTY, fill, join, tag
from warpspace.bench.base import LEAST, lay_polar
from warpspace.geometry.colour import tick_values
from warpspace.units import Array

WIDE, HIGH = 320.0, 190.0
"""Size of a chart in units of its drawing."""
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 8.0, 30.0
SERIES = 6  # colours of series in the style sheet


def block_html(block: Block) -> Markup:
    """Say one block."""
    if isinstance(block, Lines):
        return lines_html(block)
    if isinstance(block, Histogram):
        return histogram_html(block)
    return Markup(blocks_html([block]))  # noqa: S704 - escaped there


@dataclass(frozen=True, slots=True)
class Frame:
    """Ends of two axes, and where a point lies between them."""

    x: tuple[float, float]
    y: tuple[float, float]

    def place(self, x: Array | np.float64, y: Array | np.float64) -> Array:
        """Give points of the drawing, [..., 2]."""
        across = LEFT + (WIDE - LEFT - RIGHT) * (x - self.x[0]) / (self.x[1] - self.x[0])
        down = TOP + (HIGH - TOP - BOTTOM) * (self.y[1] - y) / (self.y[1] - self.y[0])
        return np.stack([across, down], axis=-1)

    def axes(self, x_label: str, y_label: str) -> Markup:
        """Draw ticks with their values, and what the axes are."""
        parts: list[Markup] = []
        for value in tick_values(*self.x, 6.0):
            (at, _) = self.place(np.float64(value), np.float64(self.y[0]))
            parts.append(
                _line(at, TOP, at, HIGH - BOTTOM) + _text(at, HIGH - BOTTOM + 11, _spell(value))
            )
        for value in tick_values(*self.y, 5.0):
            (_, at) = self.place(np.float64(self.x[0]), np.float64(value))
            parts.append(
                _line(LEFT, at, WIDE - RIGHT, at) + _text(LEFT - 4, at + 3, _spell(value), "end")
            )
        middle = (TOP + HIGH - BOTTOM) / 2.0
        parts.append(_text((LEFT + WIDE - RIGHT) / 2.0, HIGH - 4, x_label))
        parts.append(
            fill('<text x="9" y="{y}" text-anchor="middle" transform="rotate(-90 9 {y})">'
                 "{words}</text>", y=f"{middle:.0f}", words=y_label)
        )  # fmt: skip
        return join(parts)


def lines_html(chart: Lines) -> Markup:
    """Draw curves over an abscissa, to scale, or around the angle."""
    if chart.kind == "polar":
        layout = lay_polar(chart)
        points = [found * np.array([1.0, -1.0]) for found in layout.curves]
        rings = join(
            fill('<circle class="{kind}" r="{r}"/>', r=f"{radius:.3f}",
                 kind="ws-base" if value == 0 else "ws-faint")
            for value, radius in layout.rings
        )  # fmt: skip
        inner = fill('<path class="ws-faint" d="M-1 0H1M0 -1V1"/>') + rings + join(
            _curve(*pair, 3) for pair in zip(chart.curves, points, strict=True)
        ) + Markup('<text x="1.02" y=".05">0°</text>'
                   '<text x="0" y="-1.03" text-anchor="middle">90°</text>'
                   '<text x="-1.02" y=".05" text-anchor="end">180°</text>')  # fmt: skip
        return _figure(
            chart, inner, "-1.3 -1.16 2.6 2.24", f"rings {layout.ring:g} {layout.unit}", "ws-polar"
        )
    xs = np.concatenate([curve.x for curve in chart.curves])
    ys = np.concatenate([curve.y for curve in chart.curves])
    if chart.log:
        xs, ys = xs[xs > 0], ys[ys > 0]
    ends = Frame(_ends(xs), _ends(ys))
    frame = _to_scale(ends) if chart.kind == "plane" else ends
    curves = join(_curve(one, frame.place(one.x, one.y), 1) for one in chart.curves)
    areas = [
        np.concatenate([frame.place(band.x, band.low), frame.place(band.x, band.high)[::-1]])
        for band in chart.bands
    ]
    bands = join(
        tag("path", "", class_=f"ws-band ws-s{band.colour % SERIES}", d=_path(area, 1))
        for band, area in zip(chart.bands, areas, strict=True)
    )
    return _figure(
        chart, frame.axes(chart.x_label, chart.y_label) + bands + curves, f"0 0 {WIDE:g} {HIGH:g}"
    )


def histogram_html(chart: Histogram) -> Markup:
    """Draw a distribution with its marks and its limit."""
    top = max(float(chart.heights.max()), 1e-9) * 1.05
    last = max(float(chart.edges[-1]), chart.limit or 0.0)
    frame = Frame((float(chart.edges[0]), last), (0.0, top))
    bars: list[Markup] = []
    for low, high, height in zip(chart.edges[:-1], chart.edges[1:], chart.heights, strict=True):
        (x0, y0), (x1, y1) = frame.place(np.array([low, high]), np.array([height, 0.0]))
        over = chart.limit is not None and low >= chart.limit
        bars.append(fill('<rect class="{kind}" x="{x}" y="{y}" width="{w}" height="{h}"/>',
                         kind="ws-over" if over else "ws-under", x=f"{x0:.1f}", y=f"{y0:.1f}",
                         w=f"{max(x1 - x0 - 0.5, 0.5):.1f}", h=f"{y1 - y0:.1f}"))  # fmt: skip
    if chart.limit is not None:
        (at, _) = frame.place(np.float64(chart.limit), np.float64(0.0))
        bars.append(tag("path", "", class_="ws-limit", d=f"M{at:.1f} {TOP}V{HIGH - BOTTOM}"))
    said = join(tag("p", words, class_="ws-told" if index == 0 else "ws-tiny")
                for index, words in enumerate(chart.told))  # fmt: skip
    svg = _svg(
        frame.axes(chart.x_label, chart.y_label) + join(bars), f"0 0 {WIDE:g} {HIGH:g}", chart.title
    )
    return tag("figure", join((said, svg, tag("figcaption", chart.subtitle, class_="ws-tiny"))))


def _figure(chart: Lines, inner: Markup, box: str, rings: str = "", kind: str = "") -> Markup:
    named = [curve for curve in chart.curves if curve.name]
    key = join(
        tag("span", one.name, class_=f"ws-s{one.colour % SERIES} ws-{one.style}") for one in named
    )
    note = tag("p", chart.note, class_="ws-tiny") if chart.note else EMPTY
    return tag("figure", join((
        tag("figcaption", chart.title), _svg(inner, box, f"{chart.title}: {chart.y_label}", kind),
        tag("div", join((key, rings)), class_="ws-key ws-tiny"), note,
    )))  # fmt: skip


def _svg(inner: Markup, box: str, label: str, kind: str = "") -> Markup:
    return tag("svg", inner, viewBox=box, role="img", aria_label=label, class_=kind or None)


def _curve(curve: Curve, points: Array, digits: int) -> Markup:
    path = (_dots if curve.style == "dots" else _path)(points, digits)
    return tag("path", "", class_=f"ws-s{curve.colour % SERIES} ws-{curve.style}", d=path)


def _line(x0: float, y0: float, x1: float, y1: float) -> Markup:
    return tag("path", "", class_="ws-faint", d=f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}")


def _text(x: float, y: float, words: str, anchor: str = "middle") -> Markup:
    return tag("text", words, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=anchor)


def _spell(value: float) -> str:
    return f"{value:g}".replace("-", "−")


def _path(points: Array, digits: int) -> str:
    """Spell a line; what is no number is a gap in it."""
    found, joint = "", "M"
    for x, y in points.tolist():
        if math.isnan(x) or math.isnan(y):
            joint = "M"
        else:
            found, joint = f"{found}{joint}{x:.{digits}f} {y:.{digits}f}", "L"
    return found


def _dots(points: Array, digits: int) -> str:
    """Spell points as strokes without length, whose round ends are dots."""
    return "".join(f"M{x:.{digits}f} {y:.{digits}f}h0" for x, y in points.tolist())


def _ends(values: Array) -> tuple[float, float]:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if high - low < LEAST:
        middle = round((low + high) / 2.0, 6)
        return middle - 1.0, middle + 1.0
    room = 0.04 * (high - low)
    return low - room, high + room


def _to_scale(ends: Frame) -> Frame:
    per_x = (ends.x[1] - ends.x[0]) / (WIDE - LEFT - RIGHT)
    per_y = (ends.y[1] - ends.y[0]) / (HIGH - TOP - BOTTOM)
    per = max(per_x, per_y)

    def widened(pair: tuple[float, float], room: float) -> tuple[float, float]:
        middle = (pair[0] + pair[1]) / 2.0
        return middle - per * room / 2.0, middle + per * room / 2.0

    return Frame(widened(ends.x, WIDE - LEFT - RIGHT), widened(ends.y, HIGH - TOP - BOTTOM))
