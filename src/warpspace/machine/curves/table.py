"""Tables: measured points along an axis, and values over the positions of two axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import fsum
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError
from warpspace.machine.axes import TravelDirection
from warpspace.machine.curves.curve import (
    MISSING,
    Coordinates,
    ErrorFunction,
    Path,
    Rows,
    Span,
    Spell,
    ValueReader,
    limited,
    refuse_more,
)
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS
from warpspace.units import Array

MAX_FILE_NAME, MAX_COLUMN_NAME = 1024, 256
FIRST_POINTS = 5
"""Points of a table made from a straight curve of another kind; a bent one has more."""
MAX_DEPARTURE = 0.002
"""Largest deviation of a table from the curve it replaces, as a share of the peak."""
BETWEEN = 8  # positions between two points at which the deviation is evaluated
DIGITS = 6  # decimals of initial values, relative to the amplitude
POSITIONS, VALUES = (-MAX_LENGTH_MM, MAX_LENGTH_MM), (-MAX_ERROR, MAX_ERROR)  # limits
SHOWN_POSITIONS = 3  # in a remark
Point = tuple[float, float]


@dataclass(frozen=True)
class TableCurve(ErrorFunction):
    """Piecewise linear curve through measured points, constant beyond its ends."""

    name = "table"
    title = "table"
    forms = (("table",), ("csv", "column"))
    row_words = "position and value in each row"
    points: tuple[Point, ...] = ()  # (n, 2); axis position (ascending) and value

    def evaluate(self, position: Array) -> Array:
        at, value = np.array(self.points).T
        return np.interp(np.asarray(position, dtype=float), at, value)

    def scaled(self, factor: float) -> Self:
        return replace(self, points=tuple((q, factor * value) for q, value in self.points))

    @cached_property
    def amplitude(self) -> float:
        return max((value for _, value in self.points), key=abs)

    @property
    def kinks(self) -> tuple[float, ...]:
        return tuple(q for q, _ in self.points)

    def grown(self) -> Self:
        """Return the line from 0 at its first position to 1 at its last; one row becomes 1."""
        first, last = self.points[0][0], self.points[-1][0]
        reach = last - first
        return replace(
            self, points=tuple((q, (q - first) / reach if reach else 1.0) for q, _ in self.points)
        )

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ table = [[q, value], …] }`` or ``{ csv = file, column = name }``."""
        if "table" in raw:
            return cls(span, _points(raw["table"], reader))
        file = reader.text(raw["csv"], ("csv",), MAX_FILE_NAME)
        column = reader.text(raw["column"], ("column",), MAX_COLUMN_NAME)
        return cls(span, tuple(reader.csv_points(file, column)))

    def to_toml(self) -> object:
        """Return ``{ table = [[q, value], …] }``, whatever the source of the points."""
        return {"table": [list(point) for point in self.points]}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        del unit, value, position
        return f"table of {len(self.points)} points"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        refuse_more(len(rows), MAX_CURVE_ROWS, "rows")
        for number, row in enumerate(rows, start=1):
            if len(row) != 2:
                raise OptionError(f"row {number}: {len(row)} numbers; expected {cls.row_words}")
            limited(row[0], number, MAX_LENGTH_MM, "position")
            limited(row[1], number)
        points = tuple((row[0], row[1]) for row in rows)
        unsorted = _first_unsorted(points)
        if unsorted:
            number, low, high = unsorted
            raise OptionError(
                f"row {number}: position {high:g} after {low:g}; expected ascending positions"
            )
        return cls(span, points)

    @classmethod
    def tidied(cls, rows: Rows) -> tuple[Rows, tuple[str, ...]]:
        if any(len(row) != 2 for row in rows):
            return rows, ()  # refused by `from_rows`
        if all(low[0] < high[0] for low, high in pairwise(rows)):
            return rows, ()
        remarks: list[str] = []
        if any(low[0] > high[0] for low, high in pairwise(rows)):
            remarks.append("Rows sorted by position.")
        values: dict[float, list[float]] = {}
        for position, value in rows:
            values.setdefault(position, []).append(value)
        repeated = sorted(q for q, repeats in values.items() if len(repeats) > 1)
        if repeated:
            listed = ", ".join(f"{q:g}" for q in repeated[:SHOWN_POSITIONS])
            ellipsis = ", …" if len(repeated) > SHOWN_POSITIONS else ""
            remarks.append(f"Values of the same position averaged, at {listed}{ellipsis}.")
        return [(q, fsum(values[q]) / len(values[q])) for q in sorted(values)], tuple(remarks)

    def rows(self) -> Rows:
        return self.points

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Build a table of evenly spaced points, as many as the shape of the curve needs."""
        peak = abs(present.amplitude)
        kinks = [q for q in present.kinks if span[0] < q < span[1]][: MAX_CURVE_ROWS // 2]
        count, max_count = FIRST_POINTS, MAX_CURVE_ROWS - len(kinks)
        at = np.union1d(np.linspace(*span, count), np.array(kinks))
        while count < max_count and _departure(present, at) > MAX_DEPARTURE * peak:
            count = min(2 * count - 1, max_count)
            at = np.union1d(np.linspace(*span, count), np.array(kinks))
        values = present.evaluate(at)
        if peak > 0.0 and np.isfinite(peak):
            digits = DIGITS - int(np.floor(np.log10(peak)))
            values = np.round(values, digits) + 0.0
        return cls(span, tuple(zip(at.tolist(), values.tolist(), strict=True)))


def _departure(curve: ErrorFunction, at: Array) -> float:
    share = np.arange(1, BETWEEN) / BETWEEN
    between = (at[:-1, None] + np.diff(at)[:, None] * share).reshape(-1)
    straight = np.interp(between, at, curve.evaluate(at))
    return float(np.max(np.abs(curve.evaluate(between) - straight)))


def _points(raw: object, reader: ValueReader) -> tuple[Point, ...]:
    points: list[Point] = []
    for index, entry in enumerate(reader.entries(raw, ("table",), MAX_POINTS)):
        position, value = reader.row(
            entry, ("table", index), "[position, value]", (POSITIONS, VALUES)
        )
        points.append((position, value))
    unsorted = None if reader.findings else _first_unsorted(points)
    if unsorted:
        number, low, high = unsorted
        text = f"row {number} has position {high} after {low}; expected ascending positions"
        reader.note(("table",), text, raw)
    return tuple(points)


def _first_unsorted(points: Sequence[Point]) -> tuple[int, float, float] | None:
    for number, ((low, _), (high, _)) in enumerate(pairwise(points), start=2):
        if not low < high:
            return number, low, high
    return None


FORM = "table2"
Numbers = tuple[float, ...]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class TwoArguments(ErrorFunction):
    """Bilinear table over the positions of two axes, constant beyond its edges.

    It is an error of the first of the two axes and acts in the frame of that axis; only its value
    depends on the other axis as well.

    Notes
    -----
    Between four neighbouring points the value is bilinear: linear in either position for a constant
    other one. Beyond the table the value is that of the nearest point of its edge.
    """

    name = "table2"
    title = "table over two axes"
    forms = ((FORM,),)
    row_words = "a table over two axes comes from a scene file or an import"
    slider = "varies with {axis} and {curve.axes[1]}; this is its largest value"
    edited_as_rows = False
    axes: tuple[str, str] = ("X", "Z")  # the axis of the error and the other one
    # (2, …); ascending positions of each, mm or degrees
    positions: tuple[Numbers, Numbers] = ((0.0,), (0.0,))
    # (n, m); one row per position of the first axis, µm or µrad
    values: tuple[Numbers, ...] = ((0.0,),)

    @property
    def arguments(self) -> tuple[str, ...]:
        return self.axes

    @property
    def middle(self) -> float:
        """Middle position of the other axis, mm or degrees, used by `evaluate`."""
        other = self.positions[1]
        return (other[0] + other[-1]) / 2.0

    @cached_property
    def _grid(self) -> Array:
        return np.array(self.values)

    def evaluate(self, position: Array) -> Array:
        """Evaluate the error with the other axis in the middle of its positions."""
        along = np.asarray(position, dtype=float)
        return self._bilinear(along, np.asarray(self.middle))

    def evaluate_at(
        self, axis: str, coordinates: Coordinates, direction: str = TravelDirection.MEAN
    ) -> Array:
        """Interpolate between the positions of both axes, [...]."""
        del axis  # is the first of `axes`
        along, other = (np.asarray(coordinates[name], dtype=float) for name in self.axes)
        if direction == TravelDirection.DIFFERENCE:
            return np.zeros(np.broadcast_shapes(along.shape, other.shape))
        return self._bilinear(along, other)

    def _bilinear(self, along: Array, other: Array) -> Array:
        low, high, share = _cell(self.positions[0], along)
        near, far, across = _cell(self.positions[1], other)
        grid = self._grid
        lower = grid[low, near] * (1.0 - across) + grid[low, far] * across
        upper = grid[high, near] * (1.0 - across) + grid[high, far] * across
        return np.asarray(lower * (1.0 - share) + upper * share)

    def section(self, other: float) -> TableCurve:
        """Return the curve along the first axis with the other one at a position."""
        at = self.positions[0]
        values = self._bilinear(np.array(at), np.asarray(other))
        return TableCurve(self.span, tuple(zip(at, values.tolist(), strict=True)))

    def without_axes(self, positions: Mapping[str, float]) -> ErrorFunction:
        """Return the section at the fixed position of the other axis."""
        other = self.axes[1]
        return self.section(positions[other]) if other in positions else self

    @property
    def lines(self) -> tuple[tuple[str, ErrorFunction], ...]:
        """Sections at the first, the middle and the last position of the other axis."""
        other = self.positions[1]
        sections = dict.fromkeys((other[0], self.middle, other[-1]))
        return tuple((f"{self.axes[1]} {at:g}", self.section(at)) for at in sections)

    def scaled(self, factor: float) -> Self:
        rows = (factor * self._grid).tolist()
        return replace(self, values=tuple(map(tuple, rows)))

    @cached_property
    def amplitude(self) -> float:
        flat = self._grid.ravel()
        return float(flat[np.argmax(np.abs(flat))])

    @property
    def kinks(self) -> tuple[float, ...]:
        return self.positions[0]

    def grown(self) -> Self:
        """Return the ramp from 0 at the first position of its axis to 1 at the last, or 1."""
        at = np.array(self.positions[0])
        reach = at[-1] - at[0]
        ramp = (at - at[0]) / reach if reach else np.ones(1)
        rows = np.broadcast_to(ramp[:, None], self._grid.shape).tolist()
        return replace(self, values=tuple(map(tuple, rows)))

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ table2 = { axes = ["X", "Z"], X = […], Z = […], values = [[…], …] } }``."""
        empty, place = cls(span), (FORM,)
        inner = reader.dictionary(raw[FORM], place)
        axes = None if reader.findings else _axes(inner.get("axes", MISSING), reader)
        if axes is None:
            return empty
        keys = ("axes", *axes, "values")
        reader.only(inner, place, keys)
        table = {**dict.fromkeys(keys, MISSING), **inner}
        at = tuple(
            reader.ascending(table[axis], (*place, axis), MAX_POINTS, POSITIONS) for axis in axes
        )
        size = len(at[0]) * len(at[1])
        if size > MAX_POINTS:
            reader.note(place, f"has {size:,} values; expected at most {MAX_POINTS:,}")
        if reader.findings:
            return empty
        values = _values(
            table["values"], (*place, "values"), axes, (len(at[0]), len(at[1])), reader
        )
        if reader.findings:
            return empty
        if axes[1] == reader.axis:  # the axis of the error goes first
            swapped = tuple(zip(*values, strict=True))
            return cls(span, (axes[1], axes[0]), (at[1], at[0]), swapped)
        return cls(span, axes, (at[0], at[1]), values)

    def to_toml(self) -> object:
        axis, other = self.axes
        inner = {
            "axes": [axis, other],
            axis: list(self.positions[0]),
            other: list(self.positions[1]),
            "values": [list(row) for row in self.values],
        }
        return {FORM: inner}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        del unit, value, position
        axis, other = self.axes
        sizes = " × ".join(str(len(at)) for at in self.positions)
        return f"table of {sizes} points over {axis} and {other}"


def _cell(at: Numbers, position: Array) -> tuple[Indices, Indices, Array]:
    points = np.array(at)
    clipped = np.clip(position, points[0], points[-1])
    low = np.clip(np.searchsorted(points, clipped, side="right") - 1, 0, max(len(points) - 2, 0))
    high = np.minimum(low + 1, len(points) - 1)
    width = points[high] - points[low]
    return low, high, (clipped - points[low]) / np.where(width > 0.0, width, 1.0)


def _axes(raw: object, reader: ValueReader) -> tuple[str, str] | None:
    place: Path = (FORM, "axes")
    axis = reader.axis
    names = list(cast("Sequence[object]", raw)) if isinstance(raw, list | tuple) else []
    if len(names) != 2 or not all(isinstance(name, str) for name in names):
        reader.note(place, f'expected two names of axes, for instance ["{axis or "X"}", "Z"]', raw)
        return None
    first, second = cast("list[str]", names)
    unknown = [name for name in (first, second) if name not in reader.axes]
    if first == second:
        reader.note(place, "names one axis twice; expected two axes", raw)
    elif unknown:
        text = f"no axis {unknown[0]} in this machine; expected two of {', '.join(reader.axes)}"
        reader.note(place, text, raw)
    elif axis not in (first, second):
        reader.note(place, f"expected {axis}, the axis of the error, and another one", raw)
    else:
        return first, second
    return None


def _values(
    raw: object,
    place: Path,
    axes: tuple[str, str],
    shape: tuple[int, int],
    reader: ValueReader,
) -> tuple[Numbers, ...]:
    rows = reader.entries(raw, place, MAX_POINTS)
    if rows and len(rows) != shape[0]:
        text = f"has {len(rows)} rows; expected {shape[0]}, one per position of {axes[0]}"
        reader.note(place, text)
        return ()
    table: list[Numbers] = []
    for index, row in enumerate(rows):
        entries = reader.entries(row, (*place, index), MAX_POINTS)
        if entries and len(entries) != shape[1]:
            text = f"has {len(entries)} values; expected {shape[1]}, one per position of {axes[1]}"
            reader.note((*place, index), text)
            return ()
        numbers = (
            reader.number(value, (*place, index, k), *VALUES) for k, value in enumerate(entries)
        )
        table.append(tuple(numbers))
    return tuple(table)
