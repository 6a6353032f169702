"""The chart of one error along its axis: curves, standard uncertainty, and the readings behind."""

import numpy as np
from viser import uplot

from warpspace.app.state.curve_text import sample_curve
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.measurement import BACKWARD, Measurement
from warpspace.units import Array

CURVE_COLOUR = "#4a7ab5"
ZERO_COLOUR = "#9aa3af"
ROOM = 0.06
"""Share of the range of the values that is left free above and below."""
FEW_READINGS = 2000
"""Readings that are drawn at most, evenly picked from all."""


def _readings(label: str, fill: str) -> uplot.Series:
    """Describe dots without a line."""
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
    """Give the numbers of the chart of one error.

    Parameters
    ----------
    function : ErrorFunction or None
    span : tuple of float, (2,), mm or degrees
        Range of the axis.
    uncertainty : ErrorFunction, optional
    measurement : Measurement, optional

    Returns
    -------
    tuple of ndarray, [n]
        Positions, ascending, then one array for each of `SERIES`; what there is none of is NaN.
    """
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
    """Put readings at their positions among all; several at one position stand side by side."""
    found = np.full(at.shape, np.nan)
    if points is None:
        return found
    ordered = points[np.argsort(points[:, 0], kind="stable")]
    place = np.searchsorted(at, ordered[:, 0])
    same = np.concatenate([[True], np.diff(ordered[:, 0]) > 0.0])
    first = np.maximum.accumulate(np.where(same, np.arange(len(ordered)), 0))
    found[place + np.arange(len(ordered)) - first] = ordered[:, 1]
    return found
