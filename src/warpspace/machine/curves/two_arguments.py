"""The table of two arguments: an error that also depends on where a second axis stands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from warpspace.exceptions import OptionError
from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import Path, ValueReader
from warpspace.machine.curves.table import Table
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM, MAX_POINTS
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

POSITIONS = (-MAX_LENGTH_MM, MAX_LENGTH_MM)
VALUES = (-MAX_ERROR, MAX_ERROR)
FORM = "table2"
Numbers = tuple[float, ...]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class TwoArguments(ErrorFunction):
    """Bilinear table over the positions of two axes, its ends held.

    It stays an error of its own axis, which is the first of the two: where the errors of that axis
    act, this one acts; only its value depends on the other axis as well.

    Attributes
    ----------
    axes : tuple of str, (2,)
        The axis of the error and the other one.
    positions : tuple of tuple of float, (2, …)
        Ascending positions of each, mm or degrees.
    values : tuple of tuple of float, (n, m)
        One row per position of the first axis, µm or µrad.

    Notes
    -----
    Between four neighbouring points the value is bilinear: linear in either position while the
    other one stays. Beyond the table the nearest point of its edge counts.
    """

    name: ClassVar[str] = "table2"
    title: ClassVar[str] = "table over two axes"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = ((FORM,),)
    row_words: ClassVar[str] = "a table over two axes comes from a scene file or an import"
    edited_as_rows: ClassVar[bool] = False
    axes: tuple[str, str] = ("X", "Z")
    positions: tuple[Numbers, Numbers] = ((0.0,), (0.0,))
    values: tuple[Numbers, ...] = ((0.0,),)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Both axes, that of the error first."""
        return self.axes

    @property
    def beside(self) -> float:
        """Position of the other axis, mm or degrees, that `evaluate` takes: between the ends."""
        other = self.positions[1]
        return (other[0] + other[-1]) / 2.0

    @cached_property
    def _grid(self) -> Array:
        """The values as an array, [n, m]."""
        return np.array(self.values)

    def evaluate(self, position: Array) -> Array:
        """Give the value while the other axis stands in the middle of its positions."""
        own = np.asarray(position, dtype=float)
        return self._bilinear(own, np.asarray(self.beside))

    def evaluate_at(
        self,
        axis: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Interpolate between the positions of both axes, [...]."""
        del axis  # is the first of `axes`
        own, other = (np.asarray(coordinates[name], dtype=float) for name in self.axes)
        if direction == TravelDirection.DIFFERENCE:
            return np.zeros(np.broadcast_shapes(own.shape, other.shape))
        return self._bilinear(own, other)

    def _bilinear(self, own: Array, other: Array) -> Array:
        """Interpolate, [...]."""
        low, high, share = _cell(self.positions[0], own)
        left, right, across = _cell(self.positions[1], other)
        grid = self._grid
        lower = grid[low, left] * (1.0 - across) + grid[low, right] * across
        upper = grid[high, left] * (1.0 - across) + grid[high, right] * across
        return np.asarray(lower * (1.0 - share) + upper * share)

    def section(self, other: float) -> Table:
        """Give the curve along the own axis while the other one stands at a position."""
        at = self.positions[0]
        values = self._bilinear(np.array(at), np.asarray(other))
        return Table(self.span, tuple(zip(at, values.tolist(), strict=True)))

    def without_axes(self, positions: Mapping[str, float]) -> ErrorFunction:
        """Give the section where the other axis stands, if it is gone."""
        other = self.axes[1]
        return self.section(positions[other]) if other in positions else self

    @property
    def lines(self) -> tuple[tuple[str, ErrorFunction], ...]:
        """Sections at the first, the middle and the last position of the other axis."""
        other = self.positions[1]
        shown = dict.fromkeys((other[0], self.beside, other[-1]))
        return tuple((f"{self.axes[1]} {at:g}", self.section(at)) for at in shown)

    def scaled(self, factor: float) -> Self:
        """Multiply all values: the surface as a whole."""
        rows = (factor * self._grid).tolist()
        return replace(self, values=tuple(map(tuple, rows)))

    @property
    def amplitude(self) -> float:
        """Largest value of a point, with its sign."""
        flat = self._grid.ravel()
        return float(flat[np.argmax(np.abs(flat))])

    @property
    def kinks(self) -> tuple[float, ...]:
        """The positions of the own axis."""
        return self.positions[0]

    def grown(self) -> Self:
        """Give the ramp from 0 at the first position of its axis to 1 at the last, of one row 1."""
        at = np.array(self.positions[0])
        reach = at[-1] - at[0]
        ramp = (at - at[0]) / reach if reach else np.ones(1)
        rows = np.broadcast_to(ramp[:, None], self._grid.shape).tolist()
        return replace(self, values=tuple(map(tuple, rows)))

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ table2 = { axes = ["X", "Z"], X = […], Z = […], values = [[…], …] } }``."""
        empty = cls(span)
        place: Path = (FORM,)
        inner = raw[FORM]
        named = cast("dict[str, object]", inner).get("axes") if isinstance(inner, dict) else None
        axes = _axes(named, reader) if isinstance(inner, dict) else None
        if axes is None:
            if not isinstance(inner, dict):
                reader.note(place, "expected a table", inner)
            return empty
        table = reader.table(inner, place, ("axes", *axes, "values"))
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
        """Spell it as ``{ table2 = { axes, positions, values } }``."""
        own, other = self.axes
        inner = {
            "axes": [own, other],
            own: list(self.positions[0]),
            other: list(self.positions[1]),
            "values": [list(row) for row in self.values],
        }
        return {FORM: inner}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Count the points along both axes."""
        del unit, value, position
        own, other = self.axes
        sizes = " × ".join(str(len(at)) for at in self.positions)
        return f"table of {sizes} points over {own} and {other}"

    def slider_words(self, axis: str) -> str:
        """Say that the whole surface is scaled."""
        return f"varies with {axis} and {self.axes[1]}; this is its largest value"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Refuse: rows do not say which the other axis is."""
        del span, rows
        raise OptionError(cls.row_words)

    def rows(self) -> Rows:
        """Give one position of the own axis a row, its values behind it."""
        pairs = zip(self.positions[0], self.values, strict=True)
        return [(position, *row) for position, row in pairs]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Refuse a curve that is no table over two axes."""
        if not isinstance(present, cls):
            raise OptionError(cls.row_words)
        return replace(present, span=span)


def _cell(at: Numbers, position: Array) -> tuple[Indices, Indices, Array]:
    """Find the neighbours of positions, and the share of the way from the lower to the upper."""
    points = np.array(at)
    held = np.clip(position, points[0], points[-1])
    low = np.clip(np.searchsorted(points, held, side="right") - 1, 0, max(len(points) - 2, 0))
    high = np.minimum(low + 1, len(points) - 1)
    width = points[high] - points[low]
    return low, high, (held - points[low]) / np.where(width > 0.0, width, 1.0)


def _axes(raw: object, reader: ValueReader) -> tuple[str, str] | None:
    """Read the names of the two axes; None where problems were noted."""
    place: Path = (FORM, "axes")
    own = reader.axis
    names = list(cast("Sequence[object]", raw)) if isinstance(raw, list | tuple) else []
    if len(names) != 2 or not all(isinstance(name, str) for name in names):
        expected = f'expected two names of axes, for instance ["{own or "X"}", "Z"]'
        reader.note(place, "is missing" if raw is None else expected, ... if raw is None else raw)
        return None
    first, second = cast("list[str]", names)
    known = ", ".join(reader.axes)
    if first == second:
        reader.note(place, "names one axis twice; expected two axes", raw)
    elif unknown := [name for name in (first, second) if name not in reader.axes]:
        reader.note(place, f"no axis {unknown[0]} in this machine; expected two of {known}", raw)
    elif own not in (first, second):
        reader.note(place, f"expected {own}, the axis of the error, and another one", raw)
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
    """Read the rows of values."""
    rows = reader.entries(raw, place, MAX_POINTS)
    if rows and len(rows) != shape[0]:
        text = f"has {len(rows)} rows; expected {shape[0]}, one per position of {axes[0]}"
        reader.note(place, text)
        return ()
    found: list[Numbers] = []
    for index, row in enumerate(rows):
        entries = reader.entries(row, (*place, index), MAX_POINTS)
        if entries and len(entries) != shape[1]:
            text = f"has {len(entries)} values; expected {shape[1]}, one per position of {axes[1]}"
            reader.note((*place, index), text)
            return ()
        numbers = (
            reader.number(value, (*place, index, k), *VALUES) for k, value in enumerate(entries)
        )
        found.append(tuple(numbers))
    return tuple(found)
