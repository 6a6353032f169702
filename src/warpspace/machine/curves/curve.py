"""What every kind of error curve is and can: numbers, spelling in files, editing as rows.

A curve gives µm or µrad for an axis position in file units (mm or degrees). All are linear in one
amplitude, which is what a slider moves: the value of a constant, the upper end of a ramp, the
largest value (with its sign) of anything else.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, Self, cast

import numpy as np

from warpspace.exceptions import SHOWN_PROBLEMS, OptionError, SceneError, near_miss
from warpspace.machine.axes import TravelDirection
from warpspace.machine.limits import MAX_ERROR, MIN_NUMBER
from warpspace.units import Array

Path = tuple[int | str, ...]  # keys and indices below the error, for instance ``("table", 3, 0)``
Points = Sequence[tuple[float, float]]
CsvColumn = Callable[[str, str], Points]
"""Reads axis positions and one column, by file and name of the column; may raise SceneError."""
ReadCurve = Callable[[object, Path], "ErrorFunction | None"]
"""Reads a curve within a curve, by its raw value and its place; None where problems were noted."""
MISSING = object()  # stands where a table has not all keys of its form


@dataclass(frozen=True, slots=True)
class Finding:
    """One problem: its place below the error, what was expected, and the value found."""

    path: Path
    text: str
    value: object = ...  # the ellipsis where the message shows no value


def is_number(value: object) -> bool:
    """Tell whether a raw value is a number; a truth value is none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


class ValueReader:
    """Checks raw values and collects what is wrong with them."""

    def __init__(
        self,
        csv_column: CsvColumn | None = None,
        *,
        axis: str = "",
        axes: Collection[str] = (),
        curve: ReadCurve | None = None,
    ) -> None:
        self.findings: list[Finding] = []
        self.axis, self.axes = axis, tuple(axes)
        self._csv_column, self._curve = csv_column, curve

    def note(self, path: Path, text: str, value: object = ...) -> None:
        """Note a problem; of a missing value, that it is missing."""
        found = Finding(path, "is missing") if value is MISSING else Finding(path, text, value)
        self.findings.append(found)

    def number(
        self,
        value: object,
        path: Path,
        low: float = -math.inf,
        high: float = math.inf,
        least: float = MIN_NUMBER,
        expected: str = "a number",
    ) -> float:
        """Read a finite number between limits, and where it is not 0 of a least magnitude."""
        try:
            number = float(cast("float", value)) if is_number(value) else None
        except OverflowError:
            self.note(path, "is too large; expected a finite number", value)
            return math.nan
        if number is None:
            self.note(path, f"expected {expected}", value)
            return math.nan
        if not math.isfinite(number):
            self.note(path, "expected a finite number", value)
        elif number < low:
            self.note(path, f"expected at least {low:g}", value)
        elif number > high:
            self.note(path, f"expected at most {high:g}", value)
        elif 0.0 < abs(number) < least:
            self.note(path, f"expected 0, or at least {least:.3g}", value)
        return number

    def entries(self, value: object, path: Path, most: int, least: int = 1) -> Sequence[object]:
        """Read a list with at least one entry, or none, and at most so many."""
        if not isinstance(value, list | tuple):
            self.note(path, "expected a list", value)
            return ()
        entries = cast("Sequence[object]", value)
        if len(entries) < least:
            self.note(path, "expected at least 1, not 0 entries", value)
        elif len(entries) > most:
            self.note(path, f"expected at most {most} entries", value)
            return ()
        return entries

    def row(
        self, value: object, path: Path, spelling: str, limits: Sequence[tuple[float, float]]
    ) -> tuple[float, ...]:
        """Read a list of numbers, each between its limits, spelled for instance "[q, value]"."""
        if not isinstance(value, list | tuple) or len(cast("Sequence[object]", value)) != len(
            limits
        ):
            self.note(path, f"expected {spelling}", value)
            return (math.nan,) * len(limits)
        return tuple(
            self.number(entry, (*path, index), *limit)
            for index, (entry, limit) in enumerate(
                zip(cast("Sequence[object]", value), limits, strict=True)
            )
        )

    def text(self, value: object, path: Path, longest: int, least: int = 1) -> str:
        """Read a text that is not empty, or may be."""
        if not isinstance(value, str):
            self.note(path, "expected a text", value)
            return ""
        if len(value) < least:
            self.note(path, "expected at least 1 character", value)
        elif len(value) > longest:
            self.note(path, f"expected at most {longest} characters", value)
        return value

    def dictionary(self, value: object, path: Path) -> dict[str, object]:
        if isinstance(value, dict):
            return cast("dict[str, object]", value)
        self.note(path, "expected a table", value)
        return {}

    def only(self, table: Mapping[str, object], path: Path, known: Collection[str]) -> None:
        """Note the keys of a table that it does not have."""
        for key in table:
            if key not in known:
                hint = near_miss(key, known) if len(self.findings) < SHOWN_PROBLEMS else ""
                self.note((*path, key), f"unknown key{hint}")

    def ascending(
        self, value: object, path: Path, most: int, limit: tuple[float, float]
    ) -> tuple[float, ...]:
        """Read a list of ascending numbers between limits."""
        before = len(self.findings)
        found = tuple(
            self.number(entry, (*path, index), *limit)
            for index, entry in enumerate(self.entries(value, path, most))
        )
        for number, (low, high) in enumerate(pairwise(found), start=2):
            if len(self.findings) == before and not low < high:
                text = f"entry {number} is {high:g} after {low:g}; expected ascending positions"
                self.note(path, text)
        return found

    def curve(self, value: object, path: Path) -> "ErrorFunction | None":
        """Read a curve within this one; None where problems were noted."""
        if self._curve is None:
            self.note(path, "expected a number", value)
            return None
        return self._curve(value, path)

    def csv_points(self, file: str, column: str) -> Points:
        """Read a column of a CSV file; nothing where a problem was noted before."""
        if self.findings:
            return ()
        if self._csv_column is None:
            self.note((), "CSV files are not read here; expected the values as { table = }")
            return ()
        try:
            return self._csv_column(file, column)
        except SceneError as error:
            for problem in error.problems:
                self.note((), f"{error.source}: {problem}")
            return ()


SPAN_SAMPLES = 721
"""Positions at which the peak of a curve is looked for: every half degree of a turn."""
NEGLIGIBLE = 1e-12
"""Peak in µm or µrad below which a curve counts as zero: no number may be divided by it."""

OWN_AXIS = "own"
"""Stands for the axis of the error among the arguments of a curve that does not know its name."""

Span = tuple[float, float]  # lower and upper end of an axis range, mm or degrees
Rows = Sequence[Sequence[float]]  # numbers as a user edits them, one row a line
Spell = Callable[[float], str]  # writes one number for people


@dataclass(frozen=True)
class ErrorFunction(ABC):
    """A value that may vary along an axis. A subclass is a kind of curve."""

    name: ClassVar[str]  # short name of the kind, for instance "poly"
    title: ClassVar[str]  # name of the kind in lists, for instance "polynomial"
    # the tables that spell it in a scene file, each by its keys; none where it is a number
    forms: ClassVar[tuple[tuple[str, ...], ...]]
    row_words: ClassVar[str]  # how its numbers are written as rows
    # what the amplitude is; the name of the kind and the axis stand in braces
    slider: ClassVar[str] = "{name} along {axis}; this is its largest value"
    # whether people can write its numbers as rows; if not, it comes from files
    edited_as_rows: ClassVar[bool] = True
    span: Span  # lower and upper end of the axis range it is meant for, mm or degrees

    @abstractmethod
    def evaluate(self, position: Array) -> Array:
        """Give the error at axis positions.

        Parameters
        ----------
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...], µm or µrad
        """

    @property
    def arguments(self) -> tuple[str, ...]:
        """Axes whose positions it depends on: `OWN_AXIS` for that of its error; empty for a constant."""
        return (OWN_AXIS,)

    def evaluate_at(
        self,
        axis: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give the error where all axes stand somewhere, reached in a direction of travel.

        Parameters
        ----------
        axis : str
            Axis of the error.
        coordinates : mapping of str to ndarray, [...], mm or degrees
            Broadcastable positions of all axes that the curve depends on.
        direction : str, optional
            One of `TravelDirection`.

        Returns
        -------
        ndarray, [...], µm or µrad
            Of the shape that the positions of its arguments broadcast to; the axis of the error is
            one of them.
        """
        if direction == TravelDirection.DIFFERENCE:
            return np.zeros(np.shape(coordinates[axis]))
        return self.evaluate(coordinates[axis])

    @property
    def has_directions(self) -> bool:
        """Whether it depends on the direction of travel."""
        return False

    @property
    def lines(self) -> tuple[tuple[str, "ErrorFunction"], ...]:
        """Curves along the axis of the error that show it in a chart, each with its words."""
        return (("", self),)

    def without_axes(self, positions: Mapping[str, float]) -> "ErrorFunction":
        """Give the curve that is left where other axes stand still for good, mm or degrees."""
        del positions
        return self

    @property
    def parts(self) -> tuple["ErrorFunction", ...]:
        """The curves that it is put together from; itself where it is one curve."""
        return (self,)

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Give the same curve with all values times a factor."""

    @cached_property
    def _peak(self) -> float:
        values = self.evaluate(np.linspace(*self.span, self.samples))
        return float(values[np.argmax(np.abs(values))])

    @property
    def amplitude(self) -> float:
        """Largest value over the span, with its sign, µm or µrad."""
        return self._peak

    @property
    def samples(self) -> int:
        """Number of positions over the span at which the peak is looked for."""
        return SPAN_SAMPLES

    @property
    def kinks(self) -> tuple[float, ...]:
        """Positions at which the slope jumps, mm or degrees: charts have a point there."""
        return ()

    def with_amplitude(self, amplitude: float) -> Self:
        """Give the same curve with another amplitude, µm or µrad, of the same kind.

        A zero one takes the shape of `grown`; it stays zero where that is zero too.
        """
        present = self.amplitude
        if abs(present) >= NEGLIGIBLE:
            return self.scaled(amplitude / present)
        if amplitude == present:
            return self
        grown = self.grown()
        reached = grown.amplitude
        return self if abs(reached) < NEGLIGIBLE else grown.scaled(amplitude / reached)

    def grown(self) -> Self:
        """Give the curve that a zero one becomes when its slider leaves zero, of any amplitude.

        Needed by kinds of several numbers, all of which can be zero: their shape is lost then. A
        kind that keeps zero needs no more than its own `with_amplitude`.
        """
        return self

    @classmethod
    @abstractmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Build a curve from what a scene file says.

        Parameters
        ----------
        raw : mapping of str to object, or float
            A table with the keys of one of `forms`, its values unchecked.
        span : tuple of float, (2,), mm or degrees
        reader : ValueReader
            Checks values and notes problems. Where it has noted one the curve is not used.

        Returns
        -------
        ErrorFunction
        """

    @abstractmethod
    def to_toml(self) -> object:
        """Give the value that a scene file spells for this curve."""

    def for_span(self, span: Span) -> "ErrorFunction":
        """Give a curve with the same values that is spelled the same way over another range.

        Most spellings do not depend on the range; a kind whose values follow from its range gives
        a curve of another kind here.
        """
        del span
        return self

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Describe the curve along its axis for a report; values and positions are spelled."""
        del unit, value, position
        return self.title

    def slider_words(self, axis: str) -> str:
        """Say what the amplitude of the curve along an axis is."""
        return self.slider.format(name=self.name, axis=axis)

    @classmethod
    def tidied(cls, rows: Rows) -> tuple[Rows, tuple[str, ...]]:
        """Put rows into the order that `from_rows` expects, and say each change."""
        return rows, ()

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Build a curve from rows that a user edited; OptionError names a row that is wrong."""
        del span, rows
        raise OptionError(cls.row_words)

    @abstractmethod
    def rows(self) -> Rows:
        """Give the rows that `from_rows` reads back to this curve."""

    @classmethod
    def from_curve(cls, present: "ErrorFunction", span: Span) -> Self:
        """Give the curve that a user who changes the kind of a present one starts from."""
        if not isinstance(present, cls):
            raise OptionError(cls.row_words)
        return replace(present, span=span)


def single_value(rows: Rows) -> float:
    if len(rows) != 1 or len(rows[0]) != 1:
        raise OptionError("expected one number")
    return limited(rows[0][0], 1)


def limited(value: float, row: int, limit: float = MAX_ERROR, what: str = "value") -> float:
    if abs(value) > limit:
        raise OptionError(f"row {row}: {what} {value:g}; expected at most ±{limit:g}")
    return value


def refuse_more(count: int, most: int, what: str) -> None:
    if count > most:
        raise OptionError(f"{count} {what}; expected at most {most}")
