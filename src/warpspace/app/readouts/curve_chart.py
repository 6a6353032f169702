"""The chart of one error along its axis: curves, standard uncertainty, and the readings behind."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import GuiApi, GuiUplotHandle, uplot

from warpspace.app.readouts.html import render
from warpspace.app.state.curve_text import sample_curve
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.errors import BACKWARD, Measurement
from warpspace.units import Array, spell

CURVE_COLOUR = "#4a7ab5"
ZERO_COLOUR = "#9aa3af"
ROOM = 0.06  # share of the range of the values that is left free above and below
FEW_READINGS = 2000  # readings that are drawn at most, evenly picked from all


def _readings(label: str, fill: str) -> uplot.Series:
    dots = uplot.Series_Points(show=True, size=5, width=1, stroke=CURVE_COLOUR, fill=fill)
    return uplot.Series(label=label, stroke=CURVE_COLOUR, width=0, points=dots)


SERIES = (
    uplot.Series(label="error", stroke=CURVE_COLOUR, width=2),
    uplot.Series(label="forward, or first section", stroke=CURVE_COLOUR, width=1),
    uplot.Series(label="backward, or last section", stroke=CURVE_COLOUR, width=1, dash=(5, 4)),
    uplot.Series(label="+ standard uncertainty", stroke=ZERO_COLOUR, width=1, dash=(2, 3)),
    uplot.Series(label="- standard uncertainty", stroke=ZERO_COLOUR, width=1, dash=(2, 3)),
    uplot.Series(label="zero", stroke=ZERO_COLOUR, width=1),
    _readings("reading", CURVE_COLOUR),
    _readings("reading backward", "#ffffff"),
)
"""What `curve_data` gives a line of numbers each."""


def curve_data(
    function: ErrorFunction | None,
    span: tuple[float, float],
    uncertainty: ErrorFunction | None = None,
    measurement: Measurement | None = None,
) -> tuple[Array, ...]:
    """Give the numbers of the chart of one error."""
    along, _ = sample_curve(function, span)
    readings = {} if measurement is None else _thinned(measurement)
    at = np.sort(np.concatenate([along, *(points[:, 0] for points in readings.values())]))
    nothing = np.full(at.shape, np.nan)
    value = _values(function, at)
    lines = () if function is None or len(function.lines) == 1 else function.lines
    first = _values(lines[0][1], at) if lines else nothing
    last = _values(lines[-1][1], at) if lines else nothing
    half = nothing if uncertainty is None else uncertainty.evaluate(at)
    dots = [_placed(readings.get(way), at) for way in ("forward", "backward")]
    return at, value, first, last, value + half, value - half, np.zeros(at.shape), *dots


def value_span(data: tuple[Array, ...]) -> tuple[float, float]:
    """Give the ends of the chart of some data: what holds all its numbers, with a little room."""
    numbers = np.concatenate(data[1:])
    numbers = numbers[np.isfinite(numbers)]
    if not numbers.size or not np.ptp(numbers):
        middle = float(numbers[0]) if numbers.size else 0.0
        return middle - 1.0, middle + 1.0
    room = ROOM * float(np.ptp(numbers))
    return float(numbers.min()) - room, float(numbers.max()) + room


def _values(function: ErrorFunction | None, at: Array) -> Array:
    """Evaluate a curve; what no number holds is NaN."""
    values = np.zeros(at.shape) if function is None else function.evaluate(at)
    return np.where(np.isfinite(values), values, np.nan)


def _thinned(measurement: Measurement) -> dict[str, Array]:
    """Give the readings backward, and all others, [n, 2] each."""
    found: dict[str, list[Array]] = {}
    for way, points in measurement.scatter.items():
        found.setdefault("backward" if way == BACKWARD else "forward", []).append(points)
    joined = {way: np.concatenate(parts) for way, parts in found.items()}
    return {way: points[:: -(-len(points) // FEW_READINGS)] for way, points in joined.items()}


def _placed(points: Array | None, at: Array) -> Array:
    found = np.full(at.shape, np.nan)
    if points is None:
        return found
    ordered = points[np.argsort(points[:, 0], kind="stable")]
    place = np.searchsorted(at, ordered[:, 0])
    same = np.concatenate([[True], np.diff(ordered[:, 0]) > 0.0])
    first = np.maximum.accumulate(np.where(same, np.arange(len(ordered)), 0))
    found[place + np.arange(len(ordered)) - first] = ordered[:, 1]
    return found


# --- What a chart shows in words, for those who do not see it -------------------------------------


def chart_text(words: str) -> str:
    """Write the text that stands, unseen, just before a chart."""
    return render("chart_text", words=words)


def describe_curve(name: str, unit: str, along: str, at: Array, value: Array) -> str:
    """Say what the curve of an error shows."""
    places = [0, len(at) - 1, int(np.argmin(value)), int(np.argmax(value))]
    words = ("starts with", "ends with", "least", "greatest")
    if np.ptp(value) == 0.0:
        return f"Chart of {name}: {spell(float(value[0]))} {unit} everywhere"
    said = [
        f"{word} {spell(float(value[place]))} {unit} at {spell(float(at[place]))} {along}"
        for word, place in zip(words, places, strict=True)
        if word.endswith("with") or place not in places[:2]
    ]
    return f"Chart of {name}: " + ", ".join(said)


def measured_words(uncertainty: ErrorFunction | None, measurement: Measurement | None) -> str:
    """Say what is known of the measurement of an error, behind the words of its curve."""
    parts: list[str] = []
    if uncertainty is not None:
        parts.append(f"standard uncertainty up to {spell(abs(uncertainty.amplitude))}")
    if measurement is not None:
        parts.append(f"{measurement.count} readings in {len(measurement.runs)} runs")
    return "".join(f", {part}" for part in parts)


def describe_histogram(
    edges_um: Array, counts: NDArray[np.integer[Any]], limit_um: float, words: str
) -> str:
    """Say what the histogram of the error shows."""
    top = int(np.argmax(counts))
    return (
        f"Histogram of |E|: {words} from {spell(float(edges_um[0]))} to"
        f" {spell(float(edges_um[-1]))} µm, most of them between {spell(float(edges_um[top]))} and"
        f" {spell(float(edges_um[top + 1]))} µm; the limit is {spell(limit_um)} µm"
    )


# --- Small charts beside the numbers, drawn by viser's uPlot --------------------------------------

FONT = "11px sans-serif"
WHOLE = "whole"
"""Scale of lines that are given in heights of the chart, 0 to 1, beside the one of the values."""


def add_chart(
    gui: GuiApi,
    data: tuple[Array, ...],
    lines: Sequence[uplot.Series],
    height: int,
    *,
    axes: tuple[uplot.Axis, ...] | None = None,
    visible: bool = True,
) -> GuiUplotHandle:
    """Add a chart without a legend, whose `data` may be assigned anew."""
    return gui.add_uplot(
        data,
        (uplot.Series(label="along"), *lines),
        scales=chart_scales(None),
        axes=axes,
        legend=uplot.Legend(show=False),
        height=height,
        padding=(8, 14, 0, 0),
        visible=visible,
    )


def chart_scales(
    span: tuple[float, float] | None, along: tuple[float, float] | None = None
) -> dict[str, uplot.Scale]:
    """Describe the scales of a chart."""
    scales = {"x": uplot.Scale(time=False), WHOLE: uplot.Scale(range=(0.0, 1.0))}
    if along is not None and along[0] < along[1]:
        scales["x"]["range"] = along
    return scales if span is None else {**scales, "y": uplot.Scale(range=span)}


def chart_axis(label: str, size: int) -> uplot.Axis:
    """Describe an axis of a chart; its colours are the page's, light or dark."""
    return uplot.Axis(
        label=label, size=size, labelSize=16, font=FONT, space=18 if size > 40 else 40
    )
