"""The table: measured points, given in the scene file or in a column of a CSV file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import fsum
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import limited, refuse_more
from warpspace.machine.limits import MAX_CURVE_ROWS, MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS
from warpspace.units import Array

MAX_FILE_NAME, MAX_COLUMN_NAME = 1024, 256
FIRST_POINTS = 5
"""Points that a straight curve of another kind is turned into; a bent one takes more."""
KEPT = 0.002
"""Largest distance of the table from the curve it was made of, as a share of its largest value."""
BETWEEN = 8
"""Places between two points at which that distance is looked for."""
DIGITS = 6
"""Digits behind the point of the share of the amplitude that a first value is rounded to."""
LIMITS = ((-MAX_LENGTH_MM, MAX_LENGTH_MM), (-MAX_ERROR, MAX_ERROR))
"""Of position and value."""
SHOWN_POSITIONS = 3
"""Positions that a remark names."""
Point = tuple[float, float]


@dataclass(frozen=True)
class Table(ErrorFunction):
    """Piecewise linear curve through measured points, its ends held.

    Attributes
    ----------
    points : tuple of tuple of float, (n, 2)
        Axis position (ascending) and value.
    """

    name: ClassVar[str] = "table"
    title: ClassVar[str] = "table"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = (("table",), ("csv", "column"))
    row_words: ClassVar[str] = "position and value in each row"
    points: tuple[Point, ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Interpolate between the points."""
        at, value = np.array(self.points).T
        return np.interp(np.asarray(position, dtype=float), at, value)

    def scaled(self, factor: float) -> Self:
        """Multiply all values."""
        return replace(self, points=tuple((q, factor * value) for q, value in self.points))

    @property
    def amplitude(self) -> float:
        """Largest value of a point, with its sign."""
        return max((value for _, value in self.points), key=abs)

    @property
    def kinks(self) -> tuple[float, ...]:
        """The positions of the points."""
        return tuple(q for q, _ in self.points)

    def grown(self) -> Self:
        """Give the line from 0 at its first position to 1 at its last; of one row the value 1."""
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
        """Spell it as ``{ table = [[q, value], …] }``, wherever the points came from."""
        return {"table": [list(point) for point in self.points]}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Count the points."""
        del unit, value, position
        return f"table of {len(self.points)} points"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read points; positions must ascend, see `tidied`."""
        refuse_more(len(rows), MAX_CURVE_ROWS, "rows")
        for number, row in enumerate(rows, start=1):
            if len(row) != 2:
                raise OptionError(f"row {number}: {len(row)} numbers; expected {cls.row_words}")
            limited(row[0], number, MAX_LENGTH_MM, "position")
            limited(row[1], number)
        points = tuple((row[0], row[1]) for row in rows)
        if unsorted := _first_unsorted(points):
            number, low, high = unsorted
            raise OptionError(
                f"row {number}: position {high:g} after {low:g}; expected ascending positions"
            )
        return cls(span, points)

    @classmethod
    def tidied(cls, rows: Rows) -> tuple[Rows, tuple[str, ...]]:
        """Sort rows by position, and average the values of one position."""
        if any(len(row) != 2 for row in rows):
            return rows, ()  # `from_rows` says so
        if all(low[0] < high[0] for low, high in pairwise(rows)):
            return rows, ()
        remarks: list[str] = []
        if any(low[0] > high[0] for low, high in pairwise(rows)):
            remarks.append("Rows sorted by position.")
        values: dict[float, list[float]] = {}
        for position, value in rows:
            values.setdefault(position, []).append(value)
        repeated = sorted(q for q, found in values.items() if len(found) > 1)
        if repeated:
            shown = ", ".join(f"{q:g}" for q in repeated[:SHOWN_POSITIONS])
            more = ", …" if len(repeated) > SHOWN_POSITIONS else ""
            remarks.append(f"Values of the same position averaged, at {shown}{more}.")
        return [(q, fsum(values[q]) / len(values[q])) for q in sorted(values)], tuple(remarks)

    def rows(self) -> Rows:
        """Give one point a row."""
        return self.points

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Give evenly spread points of the present curve, as many as its shape needs.

        Kinks within the range are points as well. A wave too short for the rows that a user may
        edit is kept at these points only.
        """
        peak = abs(present.amplitude)
        kinks = [q for q in present.kinks if span[0] < q < span[1]][: MAX_CURVE_ROWS // 2]
        count, most = FIRST_POINTS, MAX_CURVE_ROWS - len(kinks)
        at = np.union1d(np.linspace(*span, count), np.array(kinks))
        while count < most and _departure(present, at) > KEPT * peak:
            count = min(2 * count - 1, most)
            at = np.union1d(np.linspace(*span, count), np.array(kinks))
        values = present.evaluate(at)
        if peak > 0.0 and np.isfinite(peak):
            digits = DIGITS - int(np.floor(np.log10(peak)))
            values = np.round(values, digits) + 0.0
        return cls(span, tuple(zip(at.tolist(), values.tolist(), strict=True)))


def _departure(curve: ErrorFunction, at: Array) -> float:
    """Give how far straight lines between positions of a curve are from it at most."""
    share = np.arange(1, BETWEEN) / BETWEEN
    between = (at[:-1, None] + np.diff(at)[:, None] * share).reshape(-1)
    straight = np.interp(between, at, curve.evaluate(at))
    return float(np.max(np.abs(curve.evaluate(between) - straight)))


def _points(raw: object, reader: ValueReader) -> tuple[Point, ...]:
    """Read the points of a scene file."""
    points: list[Point] = []
    for index, entry in enumerate(reader.entries(raw, ("table",), MAX_POINTS)):
        position, value = reader.row(entry, ("table", index), "[position, value]", LIMITS)
        points.append((position, value))
    if not reader.findings and (unsorted := _first_unsorted(points)):
        number, low, high = unsorted
        text = f"row {number} has position {high} after {low}; expected ascending positions"
        reader.note(("table",), text, raw)
    return tuple(points)


def _first_unsorted(points: Sequence[Point]) -> tuple[int, float, float] | None:
    """Give the number of the first row whose position does not ascend, and both positions."""
    for number, ((low, _), (high, _)) in enumerate(pairwise(points), start=2):
        if not low < high:
            return number, low, high
    return None
