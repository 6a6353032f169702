"""Figures of the test bench: the charts of a test side by side, its numbers where there is room."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from warpspace.bench.evaluation.layout import LEAST, PolarLayout, lay_polar
from warpspace.bench.outcome import Chart, Curve, Outcome
from warpspace.bench.run import BenchResult
from warpspace.outputs.charts.paper import SMALL, TEXT, ground, quiet, sheet, style

CHART_IN, ROW_IN, GAP_IN = 4.9, 4.6, 0.25
NUMBERS_IN, VALUE_IN, LINE_IN, NOTE_IN = 3.7, 0.95, 0.25, 0.6
"""Widths of the numbers and of one more column of values; heights of a number and of a note."""
LEGEND_IN = 0.19
DASHES: dict[str, Any] = {"line": "-", "dashed": (0, (4, 3)), "thin": "-", "dots": "none"}
MOST_NUMBERS = 16


def bench_chart(result: BenchResult, title: str | None = None) -> Figure:
    """Draw the customary figure of a test.

    Parameters
    ----------
    result : BenchResult
    title : str, optional

    Returns
    -------
    Figure
    """
    charts = result.charts
    columns = 1 if len(charts) == 1 else 2
    rows = -(-len(charts) // columns)
    numbers = NUMBERS_IN + VALUE_IN * (len(result.runs) - 1)
    width = columns * CHART_IN + (numbers if columns == 1 else 0.0)
    # beside one chart, in the place of the fourth one, or below all
    below = 0.0 if len(charts) % 2 else _numbers_in(result)
    height = 0.85 + rows * (ROW_IN + GAP_IN) + below + 0.1
    with style():
        heading = title or f"{result.test.title} · {result.scene.title}"
        figure, top = sheet(
            width, height, heading, f"{result.test.standard} · {result.model.plan.place}"
        )
        for number, chart in enumerate(charts):
            row, column = divmod(number, columns)
            left = column * CHART_IN / width
            bottom = top - (row * (ROW_IN + GAP_IN) + ROW_IN) / height
            _draw(figure, chart, (left, bottom, CHART_IN / width, ROW_IN / height))
        left = 0.3 if below else CHART_IN + 0.3
        down = rows if below else rows - 1
        _numbers(
            figure, result, left / width, (left + numbers - 0.45) / width,
            top - down * (ROW_IN + GAP_IN) / height,
        )  # fmt: skip
        return figure


def _draw(figure: Figure, chart: Chart, box: tuple[float, float, float, float]) -> None:
    """Draw one chart into its box, shares of the figure."""
    width, height = figure.get_size_inches()
    left, bottom, wide, high = box
    names = sum(bool(curve.name) for curve in chart.curves) + len(chart.bands)
    lines = -(-names // 2)
    legend = LEGEND_IN * lines / height
    note = 0.2 / height if chart.note else 0.0
    figure.text(left + 0.3 / width, bottom + high - 0.05 / height, chart.title, size=TEXT,
                weight="bold", va="top")  # fmt: skip
    inner = 0.75 if chart.kind != "polar" else 0.15
    under = 0.5 if chart.kind != "polar" else 0.1
    axes = figure.add_axes(
        (
            left + inner / width,
            bottom + under / height + legend + note,
            wide - (inner + 0.2) / width,
            high - (under + 0.35) / height - legend - note,
        )
    )
    if chart.kind == "polar":
        _polar(axes, chart)
    else:
        _lines(axes, chart)
    figure.legend(
        handles=_handles(chart), loc="lower left",
        bbox_to_anchor=(left + 0.2 / width, bottom + note), ncols=2, frameon=False,
        fontsize=SMALL - 0.5, handlelength=1.8, columnspacing=1.2, labelspacing=0.2,
        borderaxespad=0.0,
    )  # fmt: skip
    figure.text(left + 0.3 / width, bottom + 0.05 / height, chart.note, size=SMALL - 0.5,
                color=ground().muted)  # fmt: skip


def _colour(curve: Curve) -> str:
    """Colour of a curve; what is nominal is grey."""
    if curve.style == "thin":
        return ground().ghost
    return ground().series[curve.colour % len(ground().series)]


def _plot(axes: Axes, curve: Curve, x: "np.ndarray", y: "np.ndarray") -> None:
    """Plot one curve in the style of who took it."""
    dots = curve.style == "dots"
    axes.plot(
        x, y,
        color=_colour(curve),
        linestyle=DASHES[curve.style],
        linewidth=0.9 if curve.style in {"thin", "dashed"} else 1.6,
        marker="o" if dots else "",
        markersize=4.0 if len(x) < 60 else 2.2,
        markerfacecolor=ground().paper if dots and len(x) < 60 else _colour(curve),
        markeredgewidth=1.1,
    )  # fmt: skip


def _lines(axes: Axes, chart: Chart) -> None:
    """Draw curves over an abscissa, or a plane to scale."""
    quiet(axes, "both")
    for band in chart.bands:
        colour = ground().series[band.colour % len(ground().series)]
        axes.fill_between(band.x, band.low, band.high, color=colour, alpha=0.16, linewidth=0.0)
    for curve in chart.curves:
        _plot(axes, curve, curve.x, curve.y)
    if chart.kind == "plane":
        axes.set_aspect("equal", adjustable="datalim")
    else:
        values = np.concatenate([curve.y for curve in chart.curves])
        if np.ptp(values) < LEAST:  # nothing but rounding: no chart of noise
            middle = float(np.round(values.mean(), 6))
            axes.set_ylim(middle - 1.0, middle + 1.0)
    axes.set_xlabel(chart.x_label, size=SMALL)
    axes.set_ylabel(chart.y_label, size=SMALL)
    axes.tick_params(labelsize=SMALL - 0.5)


def _polar(axes: Axes, chart: Chart) -> None:
    """Draw deviations, magnified, on the nominal circle."""
    layout: PolarLayout = lay_polar(chart)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(-1.18, 1.18)
    axes.set_ylim(-1.18, 1.18)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    for value, radius in layout.rings:
        colour = ground().ink if value == 0.0 else ground().faint
        axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=colour,
                  linewidth=1.0 if value == 0.0 else 0.8)  # fmt: skip
        if value != 0.0:
            axes.text(0.0, radius, f"{value:+g}", size=SMALL - 2.0, color=ground().muted,
                      ha="center", va="center",
                      bbox={"facecolor": ground().paper, "edgecolor": "none", "pad": 0.4},
            )  # fmt: skip
    for degrees in (0, 90, 180, 270):
        x, y = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        axes.plot([0.0, x], [0.0, y], color=ground().faint, linewidth=0.8)
        axes.text(1.1 * x, 1.1 * y, f"{degrees}°", size=SMALL - 1.0, color=ground().muted,
                  ha="center", va="center")  # fmt: skip
    for curve, points in zip(chart.curves, layout.curves, strict=True):
        _plot(axes, curve, points[:, 0], points[:, 1])
    axes.text(-1.15, -1.15, f"rings {layout.ring:g} {layout.unit} apart", size=SMALL - 1.0,
              color=ground().muted)  # fmt: skip


def _handles(chart: Chart) -> list[Line2D | Patch]:
    """Give the entries of the legend."""
    found: list[Line2D | Patch] = []
    for curve in chart.curves:
        if curve.name:
            dots = curve.style == "dots"
            found.append(
                Line2D([], [], color=_colour(curve), label=curve.name,
                       linestyle=DASHES[curve.style], linewidth=1.4, marker="o" if dots else "",
                       markersize=4.0, markerfacecolor=ground().paper)
            )  # fmt: skip
    for band in chart.bands:
        colour = ground().series[band.colour % len(ground().series)]
        found.append(Patch(facecolor=colour, alpha=0.16, label=band.name))
    return found


def _numbers_in(result: BenchResult) -> float:
    """Height of the numbers and notes of a test."""
    lines = len(_rows(*(run.outcome for run in result.runs))) + 1
    return 0.2 + LINE_IN * lines + NOTE_IN * len(result.notes)


def _numbers(figure: Figure, result: BenchResult, left: float, right: float, top: float) -> None:
    """Write the numbers of the model, and of the data beside them, a line each."""
    width, height = figure.get_size_inches()
    y = top - 0.15 / height
    runs = result.runs
    places = [right - VALUE_IN / width * (len(runs) - 1 - index) for index in range(len(runs))]
    for run, place in zip(runs, places, strict=True):
        figure.text(place, y, run.who, size=SMALL, color=ground().muted, ha="right")
    for key, name, unit in _rows(*(run.outcome for run in runs)):
        rule = y - 0.07 / height
        figure.add_artist(Line2D([left, right], [rule, rule], color=ground().faint, linewidth=0.6))
        y -= LINE_IN / height
        figure.text(left, y, f"{name} [{unit}]", size=SMALL, color=ground().muted,
                    parse_math=False)  # fmt: skip
        for run, place in zip(runs, places, strict=True):
            values = {quantity.key: quantity.value for quantity in run.outcome.quantities}
            text = f"{_clean(values[key]):.2f}".replace("-", "−") if key in values else "–"
            figure.text(place, y, text, size=TEXT, weight="bold", ha="right")
    y -= LINE_IN / height
    for text in result.notes:
        figure.text(left, y, _wrapped(text), size=SMALL - 1.0, color=ground().accent, va="top")
        y -= NOTE_IN / height


def _rows(*outcomes: Outcome) -> list[tuple[str, str, str]]:
    """List the quantities of all runs, each once, as many as fit."""
    found = {
        quantity.key: (quantity.key, quantity.name, quantity.unit)
        for outcome in outcomes
        for quantity in outcome.quantities
    }
    return list(found.values())[:MOST_NUMBERS]


def _clean(value: float) -> float:
    """Give zero for what would be printed as −0.00."""
    return 0.0 if abs(value) < 0.005 else value


def _wrapped(text: str) -> str:
    """Break a sentence into lines."""
    from textwrap import fill

    return fill(text, 46)
