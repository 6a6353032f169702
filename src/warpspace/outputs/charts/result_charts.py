"""The chart of a result: its charts side by side; of a test its numbers; of a compensation maps."""

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
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.bench.base import BenchResult
    from warpspace.field.evaluate import ErrorField
    from warpspace.formats.compensation.compensate import Compensation


def result_chart(found: Result) -> Figure:
    """Draw the only bars of a result, or all its charts under what it says first."""
    blocks = list(found.blocks())
    charts = [block for block in blocks if isinstance(block, (Bars, Lines))]
    if len(charts) == 1 and isinstance(charts[0], Bars):
        return bars_chart(charts[0])
    for histogram in (block for block in blocks if isinstance(block, Histogram)):
        return histogram_chart(histogram)
    said = [block.strip() for block in blocks if isinstance(block, str)]
    title, subtitle = [*said, ""][:2]
    if not charts:
        raise OptionError(f"{title}: there is no chart of it")
    return charts_sheet(charts, title, subtitle, 2 if len(charts) == 4 else min(len(charts), 3))


NUMBERS_IN, VALUE_IN, LINE_IN, NOTE_IN = 3.7, 0.95, 0.25, 0.6
"""Widths of the numbers and of one more column of values; heights of a number and of a note."""
MOST_NUMBERS = 16


def bench_chart(result: "BenchResult", title: str | None = None) -> Figure:
    """Draw the customary figure of a test, its numbers where there is room."""
    charts = result.charts
    columns = 1 if len(charts) == 1 else 2
    rows = -(-len(charts) // columns)
    numbers = NUMBERS_IN + VALUE_IN * (len(result.runs) - 1)
    found = {one.key: (one.name, one.unit) for run in result.runs for one in run.outcome.quantities}
    names = dict(list(found.items())[:MOST_NUMBERS])
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
        left = (0.3 if below else CHART_IN + 0.3) / width
        top = 1.0 - (0.85 + (rows if below else rows - 1) * (ROW_IN + GAP_IN)) / height
        _numbers(figure, result, names, left, left + (numbers - 0.45) / width, top)
        return figure


def _numbers(
    figure: Figure,
    result: "BenchResult",
    names: dict[str, tuple[str, str]],
    left: float,
    right: float,
    top: float,
) -> None:
    width, height = figure.get_size_inches()
    y = top - 0.15 / height
    runs = result.runs
    places = [right - VALUE_IN / width * (len(runs) - 1 - index) for index in range(len(runs))]
    for run, place in zip(runs, places, strict=True):
        figure.text(place, y, run.who, size=SMALL, color=ground().muted, ha="right")
    for key, (name, unit) in names.items():
        rule = y - 0.07 / height
        figure.add_artist(Line2D([left, right], [rule, rule], color=ground().faint, linewidth=0.6))
        y -= LINE_IN / height
        figure.text(left, y, f"{name} [{unit}]", size=SMALL, color=ground().muted,
                    parse_math=False)  # fmt: skip
        for run, place in zip(runs, places, strict=True):
            values = {one.key: round(one.value, 2) + 0.0 for one in run.outcome.quantities}
            text = f"{values[key]:.2f}".replace("-", "−") if key in values else "–"
            figure.text(place, y, text, size=TEXT, weight="bold", ha="right")
    y -= LINE_IN / height
    for text in result.notes:
        figure.text(left, y, fill(text, 46), size=SMALL - 1.0, color=ground().accent, va="top")
        y -= NOTE_IN / height


PLANE_IN = 3.2
COLUMN_IN = 4.3, 5.0  # of the maps in a column of the app
WORDS = 9.0
LEAST_UM = 0.005  # upper end of a colour scale where nothing but the rounding of a file is left
PLANES = ((0, 1), (0, 2), (1, 2))  # axes across and up of each slice


def compensation_chart(found: "Compensation") -> Figure:
    """Draw |E| before, after on the same colours, and what is left on its own, in slices."""
    title = f"Compensation · {found.controller.scene.title}"
    subtitle = f"{found.format.title} · loop {found.loop} · {found.points_text}"
    planes, fields = _planes(found), _fields(found)
    with style():
        height = 1.3 + PLANE_IN * max(len(planes), 1)
        figure, top = sheet(WIDTH_IN, height, title, subtitle, top_in=1.0)
        axes = figure.subplots(max(len(planes), 1), len(fields), squeeze=False)
        figure.subplots_adjust(
            left=0.075, right=0.93, top=top - 0.25 / height, bottom=0.6 / height, wspace=0.42,
            hspace=0.34,
        )  # fmt: skip
        for row, plane in zip(axes, planes, strict=False):
            for column, (words, field, largest) in zip(row, fields, strict=True):
                mesh = _draw_slice(column, found, field, plane, largest)
                bar = figure.colorbar(mesh, ax=column, fraction=0.05, pad=0.03)
                bar.ax.tick_params(labelsize=SMALL - 1.5)
                bar.set_label("|E| [µm]", fontsize=SMALL - 1.0)
                if plane is planes[0]:
                    column.set_title(words, fontsize=SMALL, color=ground().ink, loc="left")
        return figure


def compensation_column(found: "Compensation") -> Figure:
    planes = _planes(found)
    with style():
        figure = Figure(figsize=COLUMN_IN, dpi=DPI, facecolor=ground().paper)
        axes = figure.subplots(3, max(len(planes), 1), squeeze=False)
        figure.subplots_adjust(
            left=0.095, right=0.85, top=0.93, bottom=0.085, wspace=0.42, hspace=0.66
        )
        for row, (words, field, largest) in zip(axes, _fields(found), strict=True):
            place = row[0].get_position()
            figure.text(place.x0, place.y1 + 0.022, words, size=WORDS, color=ground().ink)
            if not planes:
                row[0].set_axis_off()
                continue
            for column, plane in zip(row, planes, strict=True):
                mesh = _draw_slice(column, found, field, plane, largest)
                across, up = column.get_xlabel(), column.get_ylabel()
                over = f"{up.replace(' [', ' over ' + across.partition(' [')[0] + ' [')}"
                column.set_xlabel(over, fontsize=WORDS - 1.0)
                column.set_ylabel("")
                column.tick_params(labelsize=WORDS - 2.0)
                column.locator_params(nbins=3)
                if plane is planes[0]:
                    beside = figure.add_axes((0.875, place.y0, 0.024, place.height))
                    bar = figure.colorbar(mesh, cax=beside)
                    bar.ax.tick_params(labelsize=WORDS - 2.0)
                    bar.ax.set_title("|E| [µm]", fontsize=WORDS - 1.5, pad=6.0)
        return figure


def compensation_maps(found: "Compensation", dark: bool, narrow: bool) -> Figure:
    with on_ground(DARK if dark else LIGHT):
        return (compensation_column if narrow else compensation_chart)(found)


def _planes(found: "Compensation") -> list[tuple[int, int]]:
    return [plane for plane in PLANES if all(found.grid.shape[i] > 1 for i in plane)]


def _fields(found: "Compensation") -> Sequence[tuple[str, "ErrorField", float]]:
    before, after = (
        max(float(field.norm_um.max()), LEAST_UM) for field in (found.before, found.after)
    )
    was, is_now = (
        f"mean {one.mean_um:.2f}, max {one.max_um:.2f} µm"
        for one in (found.before_statistics, found.after_statistics)
    )
    return (
        (f"before: {was}", found.before, before),
        (f"after, same colours: {is_now}", found.after, before),
        ("what is left, colours of its own", found.after, after),
    )


def _draw_slice(
    axes: Axes, found: "Compensation", field: "ErrorField", plane: tuple[int, int], largest: float
) -> AxesImage:
    worst = np.unravel_index(int(np.argmax(found.after.norm_um)), found.grid.shape)
    across, up = plane
    rest = 3 - across - up
    values = np.take(field.norm_um, worst[rest], axis=rest)
    names = found.grid.axes

    def along(index: int) -> Array:
        name = names[index]
        return np.ravel(found.grid.coordinates[name]) if name else np.zeros(1)

    lines = [along(index) for index in plane]
    (left, right, half), (low, high, tall) = (
        (line[0], line[-1], (line[-1] - line[0]) / (len(line) - 1) / 2.0) for line in lines
    )
    mesh = axes.imshow(
        values.T, origin="lower", extent=(left - half, right + half, low - tall, high + tall),
        aspect="auto", interpolation="bilinear", cmap="viridis", vmin=0.0, vmax=largest,
    )  # fmt: skip
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    labels = [f"{names[i]} [{'mm' if names[i][:1] in 'XYZUVW' else '°'}]" for i in plane]
    axes.set_xlabel(labels[0], fontsize=SMALL)
    axes.set_ylabel(labels[1], fontsize=SMALL)
    still = f"{names[rest]} {along(rest)[worst[rest]]:.4g}" if names[rest] else ""
    axes.text(
        0.02, 0.97, still.replace("-", "−"), transform=axes.transAxes, va="top",
        fontsize=SMALL - 1.0, color="white",
        path_effects=[withStroke(linewidth=1.8, foreground="#222222")],
    )  # fmt: skip
    axes.tick_params(labelsize=SMALL - 1.0)
    return mesh
