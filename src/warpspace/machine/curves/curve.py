"""What every kind of error curve is and can: numbers, spelling in files, editing as rows.

A curve gives µm or µrad for an axis position in file units (mm or degrees). All are linear in one
amplitude, which is what a slider moves: the value of a constant, the upper end of a ramp, the
largest value (with its sign) of anything else.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

SPAN_SAMPLES = 721
"""Positions at which the peak of a curve is looked for: every half degree of a turn."""
NEGLIGIBLE = 1e-12
"""Peak in µm or µrad below which a curve counts as zero: no number may be divided by it."""

OWN = "own"
"""Stands for the axis of the error among the arguments of a curve that does not know its name."""

Span = tuple[float, float]
"""Lower and upper end of an axis range, mm or degrees."""
Rows = Sequence[Sequence[float]]
"""Numbers as a user edits them, one row a line."""
Spell = Callable[[float], str]
"""Writes one number for people."""


@dataclass(frozen=True)
class ErrorFunction(ABC):
    """A value that may vary along an axis. A subclass is a kind of curve.

    Attributes
    ----------
    span : tuple of float, (2,)
        Lower and upper end of the axis range it is meant for, mm or degrees.
    name : str
        Short name of the kind, for instance "poly".
    title : str
        Name of the kind in lists, for instance "polynomial".
    forms : tuple of tuple of str
        The tables that spell it in a scene file, each by its keys; none where it is a number.
    row_words : str
        How its numbers are written as rows.
    edited_as_rows : bool
        Whether people can write its numbers as rows; if not, it comes from files.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    forms: ClassVar[tuple[tuple[str, ...], ...]]
    row_words: ClassVar[str]
    edited_as_rows: ClassVar[bool] = True
    span: Span

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
        """Axes whose positions it depends on: `OWN` for that of its error; empty for a constant."""
        return (OWN,)

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

    def shape_at(
        self,
        axis: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give `evaluate_at` for an amplitude of one; of a zero curve that of the `grown` one."""
        return self.with_amplitude(1.0).evaluate_at(axis, coordinates, direction)

    @property
    def lines(self) -> tuple[tuple[str, "ErrorFunction"], ...]:
        """Curves along the axis of the error that show it in a chart, each with its words."""
        return (("", self),)

    @property
    def parts(self) -> tuple["ErrorFunction", ...]:
        """The curves that it is put together from; itself where it is one curve."""
        return (self,)

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Give the same curve with all values times a factor."""

    @cached_property
    def _peak(self) -> float:
        """Largest value over the span: looked for once, since a curve never changes."""
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
        """Give the same curve with another amplitude; a zero one takes the shape of `grown`.

        Parameters
        ----------
        amplitude : float, µm or µrad

        Returns
        -------
        ErrorFunction
            Of the same kind. Zero where it was zero and stays so, and where `grown` is.
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

    def shape(self, position: Array) -> Array:
        """Give the curve for an amplitude of one; of a zero curve that of the `grown` one.

        Parameters
        ----------
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...]
        """
        return self.with_amplitude(1.0).evaluate(position)

    # --- in scene files ---------------------------------------------------------------------------

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

    # --- in words ---------------------------------------------------------------------------------

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Describe the curve along its axis, for a report.

        Parameters
        ----------
        unit : str
            µm or µrad.
        value, position : callable
            Spell a value and an axis position.

        Returns
        -------
        str
        """
        del unit, value, position
        return self.title

    def slider_words(self, axis: str) -> str:
        """Say what the amplitude of the curve along an axis is."""
        return f"{self.name} along {axis}; this is its largest value"

    # --- edited as rows of numbers ----------------------------------------------------------------

    @classmethod
    def tidied(cls, rows: Rows) -> tuple[Rows, tuple[str, ...]]:
        """Put rows as a user has them into the order that `from_rows` expects.

        Returns
        -------
        rows : sequence of sequence of float
        remarks : tuple of str
            What was changed, a sentence each.
        """
        return rows, ()

    @classmethod
    @abstractmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Build a curve from the rows a user has edited, at least one.

        Raises
        ------
        OptionError
            Naming the row, what it holds and what was expected.
        """

    @abstractmethod
    def rows(self) -> Rows:
        """Give the rows that `from_rows` reads back to this curve."""

    @classmethod
    @abstractmethod
    def from_curve(cls, present: "ErrorFunction", span: Span) -> Self:
        """Give the curve that a user who changes the kind of a present one starts from."""
