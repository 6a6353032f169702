"""A standard test on the page: its figure as SVG, its numbers, what it is."""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.blocks import Curve, Lines
from warpspace.app.evaluation.bench import BenchPicture
from warpspace.app.readouts.html import message, render
from warpspace.bench.base import LEAST, lay_polar
from warpspace.geometry.colour import tick_values
from warpspace.units import Array

NONE_CHOSEN = (
    "Choose a test: it is run on the model as it would be on the machine, its path drawn in the"
    " box, and its figure follows every slider."
)
WIDE, HIGH = 320.0, 190.0
"""Size of a chart in units of its drawing."""
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 8.0, 30.0


@dataclass(frozen=True, slots=True)
class Tick:
    """A round value: where it stands, and its text."""

    at: float
    text: str


@dataclass(frozen=True, slots=True)
class Plot:
    """A chart ready for SVG."""

    chart: Lines
    curves: tuple[tuple[Curve, str], ...]  # each with its path, or with its dots
    x: tuple[Tick, ...] = ()
    y: tuple[Tick, ...] = ()
    rings: tuple[tuple[float, float], ...] = ()  # of a polar chart
    ring_words: str = ""


def bench_html(found: BenchPicture | str | None) -> str:
    """Draw and spell a test."""
    if found is None:
        return message(NONE_CHOSEN, "test none", small=True)
    if isinstance(found, str):
        return message(found, "test problem")
    run, test = found.run, found.prepared.test
    return render(
        "bench",
        test=test,
        place=found.prepared.plan.place,
        plots=[lay_plot(chart) for chart in found.charts],
        quantities=run.outcome.quantities,
        size=(LEFT, WIDE - RIGHT, TOP, HIGH - BOTTOM, WIDE, HIGH),
    )


def lay_plot(chart: Lines) -> Plot:
    """Lay out a chart for SVG."""
    if chart.kind == "polar":
        layout = lay_polar(chart)
        paths = [_path(points * np.array([1.0, -1.0]), 3) for points in layout.curves]
        return Plot(
            chart,
            tuple(zip(chart.curves, paths, strict=True)),
            rings=layout.rings,
            ring_words=f"rings {layout.ring:g} {layout.unit}",
        )
    xs = np.concatenate([curve.x for curve in chart.curves])
    ys = np.concatenate([curve.y for curve in chart.curves])
    x_ends, y_ends = _ends(xs), _ends(ys)
    if chart.kind == "plane":
        x_ends, y_ends = _to_scale(x_ends, y_ends)
    inner_x, inner_y = WIDE - LEFT - RIGHT, HIGH - TOP - BOTTOM

    def place(x: Array, y: Array) -> Array:
        across = LEFT + inner_x * (x - x_ends[0]) / (x_ends[1] - x_ends[0])
        down = TOP + inner_y * (y_ends[1] - y) / (y_ends[1] - y_ends[0])
        return np.stack([across, down], axis=-1)

    def ticks(ends: tuple[float, float], most: float, *, along: int) -> tuple[Tick, ...]:
        values = np.array(tick_values(*ends, most))
        at = place(values, values)[:, along]
        return tuple(
            Tick(float(where), f"{value:g}".replace("-", "−"))
            for where, value in zip(at, values, strict=True)
        )

    curves = tuple((curve, _path(place(curve.x, curve.y), 1)) for curve in chart.curves)
    return Plot(chart, curves, ticks(x_ends, 6.0, along=0), ticks(y_ends, 5.0, along=1))


def _ends(values: Array) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    if high - low < LEAST:
        middle = round((low + high) / 2.0, 6)
        return middle - 1.0, middle + 1.0
    room = 0.04 * (high - low)
    return low - room, high + room


def _to_scale(
    x: tuple[float, float], y: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Widen one of two ranges so that both are drawn to one scale."""
    per_x = (x[1] - x[0]) / (WIDE - LEFT - RIGHT)
    per_y = (y[1] - y[0]) / (HIGH - TOP - BOTTOM)
    per = max(per_x, per_y)

    def widened(ends: tuple[float, float], room: float) -> tuple[float, float]:
        middle = (ends[0] + ends[1]) / 2.0
        return middle - per * room / 2.0, middle + per * room / 2.0

    return widened(x, WIDE - LEFT - RIGHT), widened(y, HIGH - TOP - BOTTOM)


def _path(points: Array, digits: int) -> str:
    return "M" + "L".join(f"{x:.{digits}f} {y:.{digits}f}" for x, y in points)
