"""Base class of error curves: values, representation in files, editing as rows.

The value of a curve is in µm or µrad, the axis position in file units (mm or degrees). All are
linear in one amplitude, which a slider sets: the value of a constant, the upper end of a ramp, the
largest value (with its sign) of any other kind.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
"""Function from file and column name to axis positions and values; may raise SceneError."""
ReadCurve = Callable[[object, Path], "ErrorFunction | None"]
"""Function from raw value and path to a nested curve; None where problems were noted."""
MISSING = object()  # placeholder of missing keys of a table


@dataclass(frozen=True, slots=True)
class Finding:
    """Problem of a raw value: its path, the expectation, and the value."""

    path: Path
    text: str
    value: object = ...  # the ellipsis where the message shows no value


def is_number(value: object) -> bool:
    """Check for a number; a Boolean is none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass
class ValueReader:
    """Reader that checks raw values and collects findings."""

    csv_column: CsvColumn | None = None
    axis: str = ""  # of the error
    axes: Collection[str] = ()  # of the machine
    nested: ReadCurve | None = None  # reader of nested curves
    findings: list[Finding] = field(default_factory=list[Finding])

    def note(self, path: Path, text: str, value: object = ...) -> None:
        """Add a finding."""
        finding = Finding(path, "is missing") if value is MISSING else Finding(path, text, value)
        self.findings.append(finding)

    def number(
        self,
        value: object,
        path: Path,
        low: float = -math.inf,
        high: float = math.inf,
        least: float = MIN_NUMBER,
        expected: str = "a number",
    ) -> float:
        """Read a finite number between limits, zero or of a minimum magnitude."""
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

    def entries(
        self, value: object, path: Path, max_count: int, least: int = 1
    ) -> Sequence[object]:
        """Read a list with a minimum and maximum number of entries."""
        if not isinstance(value, list | tuple):
            self.note(path, "expected a list", value)
            return ()
        entries = cast("Sequence[object]", value)
        if len(entries) < least:
            self.note(path, "expected at least 1, not 0 entries", value)
        elif len(entries) > max_count:
            self.note(path, f"expected at most {max_count} entries", value)
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
        """Read a text of limited length."""
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

    def only(self, table: Mapping[str, object], path: Path, allowed: Collection[str]) -> None:
        """Note unknown keys of a table."""
        for key in table:
            if key not in allowed:
                hint = near_miss(key, allowed) if len(self.findings) < SHOWN_PROBLEMS else ""
                self.note((*path, key), f"unknown key{hint}")

    def ascending(
        self, value: object, path: Path, max_count: int, limit: tuple[float, float]
    ) -> tuple[float, ...]:
        """Read a list of ascending numbers between limits."""
        before = len(self.findings)
        numbers = tuple(
            self.number(entry, (*path, index), *limit)
            for index, entry in enumerate(self.entries(value, path, max_count))
        )
        for number, (low, high) in enumerate(pairwise(numbers), start=2):
            if len(self.findings) == before and not low < high:
                text = f"entry {number} is {high:g} after {low:g}; expected ascending positions"
                self.note(path, text)
        return numbers

    def curve(self, value: object, path: Path) -> "ErrorFunction | None":
        """Read a nested curve; None where problems were noted."""
        if self.nested is None:
            self.note(path, "expected a number", value)
            return None
        return self.nested(value, path)

    def csv_points(self, file: str, column: str) -> Points:
        """Read a column of a CSV file; empty after an earlier finding."""
        if self.findings:
            return ()
        if self.csv_column is None:
            self.note((), "CSV files are not read here; expected the values as { table = }")
            return ()
        try:
            return self.csv_column(file, column)
        except SceneError as error:
            for problem in error.problems:
                self.note((), f"{error.source}: {problem}")
            return ()


SPAN_SAMPLES = 721
"""Positions at which the peak of a curve is searched: every half degree of a turn."""
NEGLIGIBLE = 1e-12
"""Peak in µm or µrad below which a curve counts as zero, to avoid division by it."""

OWN_AXIS = "own"
"""Placeholder of the axis of the error among the arguments of a curve."""

Coordinates = Mapping[str, Array]
"""Axis to positions, [...], broadcastable: mm for linear axes, degrees for rotary ones."""
Span = tuple[float, float]  # lower and upper end of an axis range, mm or degrees
Rows = Sequence[Sequence[float]]  # numbers for editing, one row per line
Spell = Callable[[float], str]  # formats one number


@dataclass(frozen=True)
class ErrorFunction(ABC):
    """A value that may vary along an axis. A subclass is a kind of curve."""

    name: ClassVar[str]  # short name of the kind, for instance "poly"
    title: ClassVar[str]  # name of the kind in lists, for instance "polynomial"
    # keys of the tables that represent it in a scene file; empty where it is a number
    forms: ClassVar[tuple[tuple[str, ...], ...]]
    row_words: ClassVar[str]  # description of its rows
    # description of the amplitude, with the fields {axis} and {curve}
    slider: ClassVar[str] = "{curve.name} along {axis}; this is its largest value"
    # false where it comes from files only
    edited_as_rows: ClassVar[bool] = True
    # true where it depends on the direction of travel
    has_directions: ClassVar[bool] = False
    span: Span  # axis range of the curve, mm or degrees

    @abstractmethod
    def evaluate(self, position: Array) -> Array:
        """Evaluate the error at axis positions.

        Parameters
        ----------
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...], µm or µrad
        """

    @property
    def arguments(self) -> tuple[str, ...]:
        """Axes of its arguments: `OWN_AXIS` for that of its error; empty for a constant."""
        return (OWN_AXIS,)

    def evaluate_at(
        self, axis: str, coordinates: Coordinates, direction: str = TravelDirection.MEAN
    ) -> Array:
        """Evaluate the error at axis positions reached in a direction of travel.

        Parameters
        ----------
        axis : str
            Axis of the error.
        coordinates : mapping of str to ndarray, [...], mm or degrees
            Broadcastable positions of all axes of its arguments.
        direction : str, optional
            One of `TravelDirection`.

        Returns
        -------
        ndarray, [...], µm or µrad
            Shape of the broadcast positions of its arguments, the axis of the error included.
        """
        if direction == TravelDirection.DIFFERENCE:
            return np.zeros(np.shape(coordinates[axis]))
        return self.evaluate(coordinates[axis])

    @property
    def lines(self) -> tuple[tuple[str, "ErrorFunction"], ...]:
        """Curves along the axis of the error for a chart, each with its label."""
        return (("", self),)

    def without_axes(self, positions: Mapping[str, float]) -> "ErrorFunction":
        """Return the curve with other axes fixed at positions, mm or degrees."""
        del positions
        return self

    @property
    def parts(self) -> tuple["ErrorFunction", ...]:
        """Curves of which it consists."""
        return (self,)

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return the curve with all values multiplied by a factor."""

    @cached_property
    def amplitude(self) -> float:
        """Largest value over the span, with its sign, µm or µrad."""
        values = self.evaluate(np.linspace(*self.span, self.samples))
        return float(values[np.argmax(np.abs(values))])

    @property
    def samples(self) -> int:
        """Number of positions over the span at which the peak is searched."""
        return SPAN_SAMPLES

    @property
    def kinks(self) -> tuple[float, ...]:
        """Positions at which the slope jumps, mm or degrees: charts have a point there."""
        return ()

    def with_amplitude(self, amplitude: float) -> Self:
        """Return a curve of the same kind with another amplitude, µm or µrad.

        A zero curve takes the shape of `grown`; it remains zero where that is zero too.
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
        """Return the shape of a zero curve when its slider leaves zero, of any amplitude.

        For kinds of several numbers, whose shape is lost if all are zero. Other kinds override
        `with_amplitude` only.
        """
        return self

    @classmethod
    @abstractmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Build a curve from the raw value of a scene file.

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
        """Return the value of this curve in a scene file."""

    def for_span(self, span: Span) -> "ErrorFunction":
        """Return a curve with the same values that is represented equally over another range.

        Most representations do not depend on the range; a kind whose values follow from its range
        returns a curve of another kind.
        """
        del span
        return self

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Format a description of the curve for a report."""
        del unit, value, position
        return self.title

    def slider_words(self, axis: str) -> str:
        """Format the description of the amplitude for the slider."""
        return self.slider.format(axis=axis, curve=self)

    @classmethod
    def tidied(cls, rows: Rows) -> tuple[Rows, tuple[str, ...]]:
        """Sort rows for `from_rows`, and list the changes."""
        return rows, ()

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Build a curve from edited rows; OptionError names an invalid row."""
        del span, rows
        raise OptionError(cls.row_words)

    def rows(self) -> Rows:
        """Return the rows from which `from_rows` builds this curve."""
        return ()

    @classmethod
    def from_curve(cls, present: "ErrorFunction", span: Span) -> Self:
        """Build the initial curve of this kind when it replaces another."""
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


def refuse_more(count: int, limit: int, what: str) -> None:
    if count > limit:
        raise OptionError(f"{count} {what}; expected at most {limit}")
