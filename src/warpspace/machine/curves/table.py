"""The table: measured points, given in the scene file or in a column of a CSV file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import limited, refuse_more
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS
from warpspace.units import Array

MAX_ROWS = 500
"""Rows that may be edited as text."""
MAX_FILE_NAME, MAX_COLUMN_NAME = 1024, 256
FIRST_POINTS = 5
"""Points that a curve of another kind is turned into."""
LIMITS = ((-MAX_LENGTH_MM, MAX_LENGTH_MM), (-MAX_ERROR, MAX_ERROR))
"""Of position and value."""
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
    row_words: ClassVar[str] = "position and value in each row, positions ascending"
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
        """Read points; positions must ascend."""
        refuse_more(len(rows), MAX_ROWS, "rows")
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

    def rows(self) -> Rows:
        """Give one point a row."""
        return self.points

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Give a few points of the present curve, evenly spread."""
        at = np.linspace(*span, FIRST_POINTS)
        return cls(span, tuple(zip(at.tolist(), present.evaluate(at).tolist(), strict=True)))


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
