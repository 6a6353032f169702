"""Bars, curves and distributions of a result, drawn with matplotlib as their blocks say."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from itertools import zip_longest
from textwrap import wrap
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import Bbox

from warpspace.analysis.blocks import Band, Bars, Curve, Histogram, Lines, Panel, Series
from warpspace.bench.base import SMALLEST_DEVIATION, lay_polar
from warpspace.outputs.drawing.settings import FONT, LIGHT, SAVE_RC, Theme

DPI = 160.0
TITLE, SUBTITLE, TEXT, SMALL = 13.0, 9.5, 9.5, 8.5
NO_DEVIATION = "No error: the path is a circle."
WRAPPED = 0.75  # size of a title in two lines, as a share of its regular size
LEAST_SHARE = 0.6  # smallest size of a title, as a share of its regular size
_THEME: ContextVar[Theme] = ContextVar("theme of the charts", default=LIGHT)


@contextmanager
def on_ground(theme: Theme) -> Generator[None]:
    """Draw the charts inside on the ground of a theme; they are light elsewhere."""
    token = _THEME.set(theme)
    try:
        yield
    finally:
        _THEME.reset(token)


def ground() -> Theme:
    return _THEME.get()


def style() -> Any:
    theme = ground()
    return mpl.rc_context(
        {
            **SAVE_RC,
            "font.family": [FONT],
            "font.size": TEXT,
            "axes.facecolor": theme.paper,
            "axes.edgecolor": theme.muted,
            "axes.labelcolor": theme.ink,
            "legend.facecolor": theme.paper,
            "legend.edgecolor": theme.faint,
            "text.color": theme.ink,
            "xtick.color": theme.muted,
            "ytick.color": theme.muted,
            "xtick.labelcolor": theme.ink,
            "ytick.labelcolor": theme.ink,
        }
    )


def sheet(
    width: float, height: float, title: str, subtitle: str, top_in: float
) -> tuple[Figure, float]:
    figure = Figure(figsize=(width, height), dpi=DPI, facecolor=ground().paper)
    x_left = 0.3 / width
    for heading, size, down, weight, colour in (
        (title, TITLE, 0.2, "bold", ground().ink),
        (subtitle, SUBTITLE, 0.5, "normal", ground().muted),
    ):
        y = 1.0 - down / height
        text = figure.text(x_left, y, heading, size=size, weight=weight, color=colour)
        text.set(va="top", parse_math=False)  # a $ in the title of a scene is a dollar
        wide, drawn_size = text.get_window_extent().width / figure.dpi, size
        if wide > width - 0.5 and size == TITLE:  # in two lines
            drawn_size = WRAPPED * size
            text.set(y=y + 0.1 / height, size=drawn_size, linespacing=1.1)
            length = int(len(heading) * (width - 0.5) / wide / WRAPPED)
            text.set_text("\n".join(wrap(heading, length, max_lines=2, placeholder=" …")))
            wide = text.get_window_extent().width / figure.dpi
        if wide > width - 0.5:  # smaller, so that it does not run off the sheet
            text.set_fontsize(drawn_size * max((width - 0.5) / wide, LEAST_SHARE))
    return figure, 1.0 - top_in / height


def quiet(axes: Axes, grid: str = "x") -> None:
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(length=3.0, width=0.8)
    axes.grid(visible=True, axis=grid, color=ground().faint, linewidth=0.7)  # pyright: ignore[reportArgumentType]
    axes.set_axisbelow(True)


CHART_IN, ROW_IN, GAP_IN = 4.9, 4.6, 0.25
"""Width, height and distance of charts that stand side by side."""
WIDTH_IN, PRINTED_IN = 11.0, 7.4
"""Width of bar charts; in a report, without a heading and printed as wide as its page."""
HEAD_IN = 0.65
BAR_IN = 0.235  # height of one bar; rows of two are wider
FEW_ROWS = 8  # below this number of rows, bars beside other charts stay as wide
NUMBER_MARGIN = 1.14  # of the longest bar: space for the number beside it
LEGEND_IN = 0.19
DASHES: dict[str, Any] = {"line": "-", "dashed": (0, (4, 3)), "thin": "-", "dots": "none"}
Box = tuple[float, float, float, float]
"""Left, bottom, width and height of a part of a figure, 0 to 1."""


def chart_figure(chart: Bars | Lines | Histogram) -> Figure:
    """Draw one chart for a report, without its heading."""
    if isinstance(chart, Lines):
        return charts_sheet([replace(chart, title="")], "", "")
    if isinstance(chart, Bars):
        return bars_chart(replace(chart, title="", subtitle=""))
    return histogram_chart(replace(chart, title="", subtitle="", captions=()))


def charts_sheet(
    charts: Sequence[Bars | Lines],
    title: str,
    subtitle: str,
    columns: int | None = None,
    *,
    beside_in: float = 0.0,
    below_in: float = 0.0,
) -> Figure:
    """Draw charts side by side on a sheet, with free space beside or below them on request."""
    columns = columns or len(charts)
    rows = -(-len(charts) // columns)
    width = columns * CHART_IN + beside_in
    above = 0.2 + (HEAD_IN if title else 0.0)
    height = above + rows * (ROW_IN + GAP_IN) + below_in
    with style():
        figure, top = sheet(width, height, title, subtitle, above)
        for number, chart in enumerate(charts):
            row, column = divmod(number, columns)
            bottom = top - (row * (ROW_IN + GAP_IN) + ROW_IN) / height
            box = column * CHART_IN / width, bottom, CHART_IN / width, ROW_IN / height
            if isinstance(chart, Lines):
                draw_lines(figure, chart, box)
            else:
                draw_beside(figure, chart, box)
        return figure


def draw_beside(figure: Figure, bars: Bars, box: Box, size: float = SMALL) -> None:
    width, height = figure.get_size_inches() * SMALL / size
    x_left, bottom, wide, high = box
    longest = max((len(words) for words in bars.rows), default=0)
    names = min((0.35 + 0.075 * longest) / width, 0.41 * wide)
    step = (wide - names - 0.25 / width) / len(bars.panels)
    under, tall = 0.5 / height, max(high - 0.85 / height, 0.1 * high)
    axes = [
        figure.add_axes((x_left + names + at * step, bottom + under, 0.92 * step, tall))
        for at in range(len(bars.panels))
    ]
    for axis in axes[1:]:
        axis.tick_params(labelleft=False)
    draw_bars(axes, bars, size)
    for axis in axes:
        axis.set_ylim(max(len(bars.rows), FEW_ROWS) - 0.4, -0.6)


def bars_chart(bars: Bars) -> Figure:
    with style():
        bars_per_row = max((_bars_per_row(panel) for panel in bars.panels), default=1)
        row = BAR_IN * (1.0 + 0.55 * (bars_per_row - 1))
        width, above = (WIDTH_IN, 0.5 + HEAD_IN) if bars.title else (PRINTED_IN, 0.5)
        height = above + 0.6 + row * max(len(bars.rows), 3)
        figure, top = sheet(width, height, bars.title, bars.subtitle, above)
        axes = figure.subplots(
            1, len(bars.panels), sharey=True, squeeze=False,
            width_ratios=[panel.width for panel in bars.panels],
        )[0]  # fmt: skip
        longest = max((len(words) for words in bars.rows), default=0)
        x_left = min(max(1.2, 0.3 + 0.066 * longest), 3.6)
        figure.subplots_adjust(
            left=x_left / width, right=0.98, top=top, bottom=0.62 / height, wspace=0.09
        )
        draw_bars(list(axes), bars)
        if bars.legend:
            figure.legend(
                handles=legend_handles(bars), loc="lower left",
                bbox_to_anchor=(x_left / width, top + 0.16 / height), ncols=4, frameon=False,
                fontsize=SMALL, borderpad=0.0, handlelength=1.0, handleheight=0.8,
            )  # fmt: skip
        return figure


def draw_bars(axes: list[Axes], bars: Bars, size: float = SMALL) -> None:
    for index, (axis, panel) in enumerate(zip(axes, bars.panels, strict=True)):
        _draw_panel(axis, panel, bars, size, first=index == 0)
    axes[0].set_yticks(range(len(bars.rows)), list(bars.rows), size=size)
    axes[0].set_ylim(max(len(bars.rows), 1) - 0.4, -0.6)


def legend_handles(bars: Bars) -> list[Patch | Line2D]:
    return [
        Line2D([], [], color=ground().ink, linestyle=(0, (4, 3)), label=words)
        if role == "before"
        else Patch(color="none" if role == "none" else _bar_colour(role), label=words)
        for words, role in bars.legend
    ]


def _bars_per_row(panel: Panel) -> int:
    values = (one.values for one in panel.series if not one.as_mark)
    rows = zip_longest(*values)
    return max((sum(value is not None for value in row) for row in rows), default=1)


def _bar_colour(role: str) -> str:
    plain = "#b4bfcc" if ground() is LIGHT else "#56616f"
    return {"key": ground().series[0], "set": ground().series[2]}.get(role, plain)


def _longest(panel: Panel) -> float:
    values = [
        abs(value) + (one.spread[row] if one.spread else 0.0)
        for one in panel.series
        for row, value in enumerate(one.values)
        if value is not None
    ]
    return max((*values, panel.before or 0.0), default=0.0)


def _draw_panel(axis: Axes, panel: Panel, bars: Bars, size: float, *, first: bool) -> None:
    alike = [one for one in bars.panels if one.signed] if panel.signed else [panel]
    longest = max(map(_longest, alike)) or 1.0
    drawn = [one for one in panel.series if not one.as_mark]
    end = (NUMBER_MARGIN if any(one.form for one in panel.series) else 1.05) * longest
    for series in panel.series:
        _draw_series(axis, series, drawn, bars.keys, end, size)
    if panel.before is not None:
        axis.axvline(panel.before, color=ground().ink, linewidth=1.0, linestyle=(0, (4, 3)))
    quiet(axis)
    axis.spines["left"].set_visible(False)
    axis.axvline(0.0, color=ground().muted, linewidth=0.8)
    axis.tick_params(axis="y", length=0)
    axis.tick_params(axis="x", labelsize=size)
    axis.set_xlim(-1.05 * longest if panel.signed else 0.0, end)
    if panel is not bars.panels[-1]:  # a number at the end would meet the first of the next panel
        axis.set_xticks([at for at in axis.get_xticks() if -end <= at < 0.9 * end])
    axis.set_xlabel(panel.unit if first or panel.unit != bars.panels[0].unit else "", size=size)
    axis.set_title(
        panel.title, size=TEXT * size / SMALL, weight="bold", loc="left" if first else "center"
    )


def _draw_series(
    axis: Axes,
    series: Series,
    drawn: list[Series],
    keys: Sequence[bool],
    end: float,
    size: float,
) -> None:
    for row, value in enumerate(series.values):
        if value is None:
            continue
        if series.as_mark:
            axis.plot([value], [row], "|", color=ground().ink, markersize=size)
            continue
        row_series = [one for one in drawn if one.values[row] is not None]
        index = next(i for i, one in enumerate(row_series) if one is series)
        place = row + 0.7 * ((index + 0.5) / len(row_series) - 0.5)
        stands_out = series.role == "plain" and bool(keys) and keys[row]
        axis.barh(
            place, value, height=0.7 / len(row_series),
            color=_bar_colour("key" if stands_out else series.role),
            error_kw={"elinewidth": 0.9, "ecolor": ground().muted},
            xerr=series.spread[row] if series.spread else None,
        )  # fmt: skip
        if series.form:
            number = f"{value:{series.form}}"
            text = axis.text(value + 0.012 * end, place, number, va="center", size=0.9 * size)
            text.set_path_effects([Stroke(linewidth=2.5, foreground=ground().paper), Normal()])


def is_empty(chart: Lines) -> bool:
    """Check if a polar plot would show circles only."""
    largest = max((float(np.abs(curve.y).max()) for curve in chart.curves), default=0.0)
    return chart.kind == "polar" and largest < SMALLEST_DEVIATION


def draw_lines(figure: Figure, chart: Lines, box: Box, size: float = SMALL) -> None:
    width, height = figure.get_size_inches() * SMALL / size
    x_left, bottom, wide, high = box
    names = sum(bool(curve.name) for curve in chart.curves) + len(chart.bands)
    lines = -(-names // 2)
    legend = LEGEND_IN * lines / height
    note = 0.2 / height if chart.note else 0.0
    figure.text(x_left + 0.3 / width, bottom + high - 0.05 / height, chart.title,
                size=TEXT * size / SMALL, weight="bold", va="top")  # fmt: skip
    if is_empty(chart):
        figure.text(x_left + wide / 2, bottom + high / 2, NO_DEVIATION, ha="center", size=size)
        return
    inner, under = (0.15, 0.1) if chart.kind == "polar" else (0.75, 0.5)
    wide_inside = max(wide - (inner + 0.2) / width, 0.2 * wide)
    high_inside = max(high - (under + 0.35) / height - legend - note, 0.1 * high)
    low = bottom + under / height + legend + note
    axes = figure.add_axes((x_left + inner / width, low, wide_inside, high_inside))
    if chart.kind == "polar":
        _polar(axes, chart)
    else:
        _lines(axes, chart, size)
    figure.legend(
        handles=_handles(chart), loc="lower left",
        bbox_to_anchor=(x_left + 0.2 / width, bottom + note), ncols=2, frameon=False,
        fontsize=size - 0.5, handlelength=1.8, columnspacing=1.2, labelspacing=0.2,
        borderaxespad=0.0,
    )  # fmt: skip
    figure.text(x_left + 0.3 / width, bottom + 0.05 / height, chart.note, size=size - 0.5,
                color=ground().muted)  # fmt: skip


def _curve_colour(curve: Curve | Band) -> str:
    if isinstance(curve, Curve) and curve.style == "thin":
        return ground().ghost
    return ground().series[curve.colour % len(ground().series)]


def _plot(axes: Axes, curve: Curve, x: "np.ndarray", y: "np.ndarray") -> None:
    dots = curve.style == "dots"
    axes.plot(
        x, y,
        color=_curve_colour(curve),
        linestyle=DASHES[curve.style],
        linewidth=0.9 if curve.style in {"thin", "dashed"} else 1.6,
        marker="o" if dots else "",
        markersize=4.0 if len(x) < 60 else 2.2,
        markerfacecolor=ground().paper if dots and len(x) < 60 else _curve_colour(curve),
        markeredgewidth=1.1,
    )  # fmt: skip


def _lines(axes: Axes, chart: Lines, size: float) -> None:
    quiet(axes, "both")
    for band in chart.bands:
        look: dict[str, Any] = {"color": _curve_colour(band), "alpha": 0.16, "linewidth": 0.0}
        axes.fill_between(band.x, band.low, band.high, **look)
    for curve in chart.curves:
        _plot(axes, curve, curve.x, curve.y)
    if chart.kind == "plane":
        axes.set_aspect("equal", adjustable="datalim")
    else:
        values = np.concatenate([curve.y for curve in chart.curves])
        if np.ptp(values) < SMALLEST_DEVIATION and not chart.bands:  # rounding only
            middle = float(np.round(values.mean(), 6))
            axes.set_ylim(middle - 1.0, middle + 1.0)
    if chart.log:
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.tick_params(which="minor", labelbottom=False, labelleft=False)
    axes.set_xlabel(chart.x_label, size=size)
    axes.set_ylabel(chart.y_label, size=size)
    axes.tick_params(labelsize=size - 0.5)


def _polar(axes: Axes, chart: Lines) -> None:
    layout = lay_polar(chart)
    axes.set_axis_off()
    axes.set(aspect="equal", xlim=(-1.18, 1.18), ylim=(-1.18, 1.18))
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    faint: dict[str, Any] = {"color": ground().faint, "linewidth": 0.8}
    bold: dict[str, Any] = {"color": ground().ink, "linewidth": 1.0}
    middle: dict[str, Any] = {"color": ground().muted, "ha": "center", "va": "center"}
    for value, radius in layout.rings:
        look = faint if value != 0.0 else bold
        axes.plot(radius * np.cos(turn), radius * np.sin(turn), **look)
        if value != 0.0:
            axes.text(0.0, radius, f"{value:+g}", size=SMALL - 1.5, bbox=_paper(0.4), **middle)
    for degrees in (0, 90, 180, 270):
        x, y = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        axes.plot([0.0, x], [0.0, y], **faint)
        axes.text(1.1 * x, 1.1 * y, f"{degrees}°", size=SMALL - 1.0, **middle)
    for curve, points in zip(chart.curves, layout.curves, strict=True):
        _plot(axes, curve, points[:, 0], points[:, 1])
    rings = f"rings {layout.ring:g} {layout.unit} apart"
    axes.text(-1.15, -1.15, rings, size=SMALL - 1.0, color=ground().muted)


def _handles(chart: Lines) -> list[Line2D | Patch]:
    lines = [
        Line2D([], [], color=_curve_colour(curve), label=curve.name, linewidth=1.4,
               linestyle=DASHES[curve.style], marker="o" if curve.style == "dots" else "",
               markersize=4.0, markerfacecolor=ground().paper)
        for curve in chart.curves
        if curve.name
    ]  # fmt: skip
    bands = [
        Patch(facecolor=_curve_colour(band), alpha=0.16, label=band.name) for band in chart.bands
    ]
    return [*lines, *bands]


HISTOGRAM_IN = 9.0, 5.4
LABEL_ROWS = 4  # rows of labels above the bars, at most


def histogram_chart(histogram: Histogram) -> Figure:
    with style():
        width, height = HISTOGRAM_IN if histogram.title else (PRINTED_IN, HISTOGRAM_IN[1] - HEAD_IN)
        above = 0.85 + (HEAD_IN if histogram.title else 0.0)
        figure, top = sheet(width, height, histogram.title, histogram.subtitle, above)
        axes = figure.add_axes((0.085, 0.115, 0.885, top - 0.115))
        edges, heights, limit = histogram.edges, histogram.heights, histogram.limit
        beyond = [limit is not None and low >= limit for low in edges[:-1]]
        within, outside = ("#a9c4de", "#e3c3c6") if ground() is LIGHT else ("#3f6a92", "#7a4a52")
        axes.bar(
            edges[:-1], heights, np.diff(edges), align="edge", edgecolor=ground().paper,
            color=[outside if one else within for one in beyond], linewidth=0.5,
        )  # fmt: skip
        quiet(axes, "y")
        axes.set_xlabel(histogram.x_label)
        axes.set_ylabel(histogram.y_label)
        last = float(edges[1:][np.cumsum(heights) >= 0.9995 * heights.sum()][0])
        printed = dict(histogram.marks).get("thesis", 0.0)
        axes.set_xlim(0.0, max(last, 1.05 * (limit or 0.0), 1.05 * printed))
        axes.set_ylim(0.0, 1.06 * float(heights.max()))
        styles = {
            "mean": (ground().series[0], "-"), "P95": (ground().muted, "-"),
            "thesis": (ground().series[4], "--"), "limit": (ground().accent, "-"),
        }  # fmt: skip
        marks = [*histogram.marks, *([] if limit is None else [("limit", limit)])]
        _mark(axes, [(name, at, *styles.get(name, (ground().ink, "-"))) for name, at in marks])
        captions: tuple[tuple[float, dict[str, Any]], ...] = (
            (0.95, {"size": TEXT + 2.0, "weight": "bold", "color": ground().ink}),
            (0.83, {"size": SMALL, "weight": "normal", "color": ground().muted}),
        )
        corner: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "va": "top"}
        for line, (height, look) in zip(histogram.captions, captions, strict=False):
            axes.text(0.985, height, line, bbox=_paper(), **corner, **look)
        return figure


def _mark(axes: Axes, marks: Sequence[tuple[str, float, str, str]]) -> None:
    low, high = axes.get_xlim()
    gap = 0.006 * (high - low)
    renderer = FigureCanvasAgg(cast("Figure", axes.figure)).get_renderer()
    occupied: list[Bbox] = []
    for name, value, colour, dash in sorted(marks, key=lambda mark: mark[1]):
        label = axes.text(
            value + gap, 0.0, f"{name} {value:.1f} µm", color=colour, size=TEXT, weight="bold",
            va="bottom", transform=axes.get_xaxis_transform(), zorder=5, bbox=_paper(0.4),
        )  # fmt: skip
        box = label.get_window_extent(renderer).transformed(axes.transData.inverted())
        width = box.width + 2.0 * gap
        if (name == "mode" and value - width >= low) or value + width > high:
            label.set(x=value - gap, ha="right")
        for row in range(LABEL_ROWS):
            label.set_y(1.02 + 0.058 * row)
            # with the gap to its own line, and as much on the other side
            box = label.get_window_extent(renderer).padded(0.006 * axes.bbox.width, 1.0)
            if not box.count_overlaps(occupied):
                break
        occupied.append(box)
        axes.plot(
            [value, value], [0.0, label.get_position()[1] + 0.04], color=colour, linestyle=dash,
            linewidth=1.4, transform=axes.get_xaxis_transform(), clip_on=False, zorder=4,
        )  # fmt: skip


def _paper(pad: float = 1.5) -> dict[str, Any]:
    return {"facecolor": ground().paper, "edgecolor": "none", "pad": pad}
