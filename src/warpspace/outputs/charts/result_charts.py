"""Chart of a result: its charts side by side, the numbers of a test, maps of a compensation."""

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from warpspace.analysis.blocks import Bars, Histogram, Lines
from warpspace.analysis.description import Result
from warpspace.exceptions import OptionError
from warpspace.machine.axes import is_linear
from warpspace.outputs.charts.block_charts import (
    CHART_IN,
    DPI,
    GAP_IN,
    ROW_IN,
    SMALL,
    TEXT,
    WIDTH_IN,
    bars_chart,
    charts_sheet,
    ground,
    histogram_chart,
    on_ground,
    sheet,
    style,
)
from warpspace.outputs.drawing.settings import DARK, LIGHT
from warpspace.units import Array, spell_fixed

if TYPE_CHECKING:
    from warpspace.bench.base import BenchResult
    from warpspace.field.evaluate import ErrorField
    from warpspace.formats.compensation.compensate import Compensation


def result_chart(result: Result) -> Figure:
    """Draw the only bar chart of a result, or all its charts under its first lines."""
    blocks = list(result.blocks())
    charts = [block for block in blocks if isinstance(block, (Bars, Lines))]
    histograms = [block for block in blocks if isinstance(block, Histogram)]
    if len(charts) == 1 and isinstance(charts[0], Bars):
        return bars_chart(charts[0])
    if histograms:
        return histogram_chart(histograms[0])
    texts = [block.strip() for block in blocks if isinstance(block, str)]
    title, subtitle = [*texts, ""][:2]
    if not charts:
        raise OptionError(f"{title}: no chart is defined")
    return charts_sheet(charts, title, subtitle, 2 if len(charts) == 4 else min(len(charts), 3))


NUMBERS_IN, VALUE_IN, LINE_IN, NOTE_IN = 3.7, 0.95, 0.25, 0.6
"""Widths of the numbers and of one more column of values; heights of a number and of a note."""
MOST_NUMBERS = 16


def bench_chart(result: "BenchResult", title: str | None = None) -> Figure:
    """Draw the customary figure of a test, with its numbers in the free space."""
    charts = result.charts
    columns = 1 if len(charts) == 1 else 2
    rows = -(-len(charts) // columns)
    numbers = NUMBERS_IN + VALUE_IN * (len(result.runs) - 1)
    quantities = (quantity for run in result.runs for quantity in run.outcome.quantities)
    heads = {quantity.key: f"{quantity.name} [{quantity.unit}]" for quantity in quantities}
    names = dict(list(heads.items())[:MOST_NUMBERS])
    # beside one chart, in the place of the fourth one, or below all
    below = 0.2 + LINE_IN * (len(names) + 1) + NOTE_IN * len(result.notes)
    below = 0.0 if len(charts) % 2 else below
    heading = title or f"{result.test.title} · {result.scene.title}"
    place = f"{result.test.standard} · {result.model.plan.place}"
    with style():
        figure = charts_sheet(
            charts, heading, place, columns, beside_in=numbers if columns == 1 else 0.0,
            below_in=below + 0.1,
        )  # fmt: skip
        width, height = figure.get_size_inches()
        x_left = (0.3 if below else CHART_IN + 0.3) / width
        top = 1.0 - (0.85 + (rows if below else rows - 1) * (ROW_IN + GAP_IN)) / height
        _numbers(figure, result, names, x_left, x_left + (numbers - 0.45) / width, top)
        return figure


def _numbers(
    figure: Figure,
    result: "BenchResult",
    names: dict[str, str],
    x_left: float,
    right: float,
    top: float,
) -> None:
    width, height = figure.get_size_inches()
    y = top - 0.15 / height
    last, muted = len(result.runs) - 1, ground().muted
    columns = [
        (right - VALUE_IN / width * (last - index), run) for index, run in enumerate(result.runs)
    ]
    for place, run in columns:
        figure.text(place, y, run.source, size=SMALL, color=muted, ha="right")
    for key, name in names.items():
        rule = y - 0.07 / height
        line = Line2D([x_left, right], [rule, rule], color=ground().faint, linewidth=0.6)
        figure.add_artist(line)
        y -= LINE_IN / height
        figure.text(x_left, y, name, size=SMALL, color=muted, parse_math=False)
        for place, run in columns:
            values = {one.key: round(one.value, 2) + 0.0 for one in run.outcome.quantities}
            text = f"{values[key]:.2f}".replace("-", "−") if key in values else "–"
            figure.text(place, y, text, size=TEXT, weight="bold", ha="right")
    y -= LINE_IN / height
    for text in result.notes:
        figure.text(x_left, y, fill(text, 46), size=SMALL - 1.0, color=ground().accent, va="top")
        y -= NOTE_IN / height


PLANE_IN = 3.2
COLUMN_IN = 4.3, 5.0  # of the maps in a column of the app
COLUMN_TEXT = 9.0
LEAST_UM = 0.005  # upper end of a colour scale where only rounding remains
PLANES = ((0, 1), (0, 2), (1, 2))  # axes across and up of each slice


def compensation_chart(compensation: "Compensation") -> Figure:
    """Draw slices of |E| before and after in one colour scale, and of the residual in its own."""
    title = f"Compensation · {compensation.controller.scene.title}"
    table = f"{compensation.format.title} · loop {compensation.loop}"
    subtitle = f"{table} · {compensation.points_text}"
    planes, fields = _planes(compensation), _fields(compensation)
    with style():
        height = 1.3 + PLANE_IN * max(len(planes), 1)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.0)
        axes = figure.subplots(max(len(planes), 1), len(fields), squeeze=False)
        figure.subplots_adjust(
            left=0.075, right=0.93, top=top - 0.25 / height, bottom=0.6 / height, wspace=0.42,
            hspace=0.34,
        )  # fmt: skip
        for row, plane in zip(axes, planes, strict=False):
            for column, (heading, field, largest) in zip(row, fields, strict=True):
                mesh = _draw_slice(column, compensation, field, plane, largest)
                bar = figure.colorbar(mesh, ax=column, fraction=0.05, pad=0.03)
                bar.ax.tick_params(labelsize=SMALL - 1.5)
                bar.set_label("|E| [µm]", fontsize=SMALL - 1.0)
                if plane is planes[0]:
                    column.set_title(heading, fontsize=SMALL, color=ground().ink, loc="left")
        return figure


def compensation_column(compensation: "Compensation") -> Figure:
    planes = _planes(compensation)
    with style():
        figure = Figure(figsize=COLUMN_IN, dpi=DPI, facecolor=ground().paper)
        axes = figure.subplots(3, max(len(planes), 1), squeeze=False)
        figure.subplots_adjust(
            left=0.095, right=0.85, top=0.93, bottom=0.085, wspace=0.42, hspace=0.66
        )
        for row, (heading, field, largest) in zip(axes, _fields(compensation), strict=True):
            place = row[0].get_position()
            y = place.y1 + 0.022
            figure.text(place.x0, y, heading, size=COLUMN_TEXT, color=ground().ink)
            if not planes:
                row[0].set_axis_off()
                continue
            for column, plane in zip(row, planes, strict=True):
                mesh = _draw_slice(column, compensation, field, plane, largest)
                across, up = column.get_xlabel(), column.get_ylabel()
                label = f"{up.replace(' [', ' over ' + across.partition(' [')[0] + ' [')}"
                column.set_xlabel(label, fontsize=COLUMN_TEXT - 1.0)
                column.set_ylabel("")
                column.tick_params(labelsize=COLUMN_TEXT - 2.0)
                column.locator_params(nbins=3)
                if plane is planes[0]:
                    colour_axes = figure.add_axes((0.875, place.y0, 0.024, place.height))
                    bar = figure.colorbar(mesh, cax=colour_axes)
                    bar.ax.tick_params(labelsize=COLUMN_TEXT - 2.0)
                    bar.ax.set_title("|E| [µm]", fontsize=COLUMN_TEXT - 1.5, pad=6.0)
        return figure


def compensation_maps(compensation: "Compensation", dark: bool, narrow: bool) -> Figure:
    with on_ground(DARK if dark else LIGHT):
        return (compensation_column if narrow else compensation_chart)(compensation)


def _planes(compensation: "Compensation") -> list[tuple[int, int]]:
    return [plane for plane in PLANES if all(compensation.grid.shape[i] > 1 for i in plane)]


def _fields(compensation: "Compensation") -> Sequence[tuple[str, "ErrorField", float]]:
    before, after = compensation.before, compensation.after
    largest, residual = (max(float(field.norm_um.max()), LEAST_UM) for field in (before, after))
    texts = [
        f"mean {spell_fixed(summary.mean_um)}, max {spell_fixed(summary.max_um)} µm"
        for summary in (compensation.before_statistics, compensation.after_statistics)
    ]
    return (
        (f"before: {texts[0]}", before, largest),
        (f"after, same colours: {texts[1]}", after, largest),
        ("residual error, own colour scale", after, residual),
    )


def _draw_slice(
    axes: Axes,
    compensation: "Compensation",
    field: "ErrorField",
    plane: tuple[int, int],
    largest: float,
) -> AxesImage:
    grid = compensation.grid
    worst = np.unravel_index(int(np.argmax(compensation.after.norm_um)), grid.shape)
    across, up = plane
    normal = 3 - across - up
    values = np.take(field.norm_um, worst[normal], axis=normal)
    names = grid.axes

    def along(index: int) -> Array:
        name = names[index]
        return np.ravel(grid.coordinates[name]) if name else np.zeros(1)

    (x_left, right, half), (low, high, tall) = (
        (line[0], line[-1], (line[-1] - line[0]) / (len(line) - 1) / 2.0)
        for line in map(along, plane)
    )
    mesh = axes.imshow(
        values.T, origin="lower", extent=(x_left - half, right + half, low - tall, high + tall),
        aspect="auto", interpolation="bilinear", cmap="viridis", vmin=0.0, vmax=largest,
    )  # fmt: skip
    axes.set(xlim=(x_left, right), ylim=(low, high))
    x_label, y_label = (f"{names[i]} [{'mm' if is_linear(names[i]) else '°'}]" for i in plane)
    axes.set_xlabel(x_label, fontsize=SMALL)
    axes.set_ylabel(y_label, fontsize=SMALL)
    position = f"{names[normal]} {along(normal)[worst[normal]]:.4g}" if names[normal] else ""
    axes.text(
        0.02, 0.97, position.replace("-", "−"), transform=axes.transAxes, va="top",
        fontsize=SMALL - 1.0, color="white",
        path_effects=[withStroke(linewidth=1.8, foreground="#222222")],
    )  # fmt: skip
    axes.tick_params(labelsize=SMALL - 1.0)
    return mesh
