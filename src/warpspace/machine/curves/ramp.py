"""The ramp: a straight line from zero."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.poly import Poly
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import single_value
from warpspace.machine.limits import MAX_ERROR
from warpspace.units import Array


@dataclass(frozen=True)
class Ramp(ErrorFunction):
    """Zero at the lower end of the span, the value at the upper one, linear between and beyond."""

    name: ClassVar[str] = "ramp"
    title: ClassVar[str] = "ramp"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = (("ramp",),)
    row_words: ClassVar[str] = "one number: the value at the upper end, from zero at the lower"
    value: float = 0.0

    def evaluate(self, position: Array) -> Array:
        """Give the point of the line at each position."""
        lower, upper = self.span
        return self.value * (np.asarray(position, dtype=float) - lower) / (upper - lower)

    def scaled(self, factor: float) -> Self:
        """Give the ramp to a multiple of the value."""
        return replace(self, value=self.value * factor)

    @property
    def amplitude(self) -> float:
        """The value at the upper end."""
        return self.value

    def with_amplitude(self, amplitude: float) -> Self:
        """Give the ramp to that value; a ramp of zero stays a ramp."""
        return replace(self, value=amplitude)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ ramp = value }``."""
        return cls(span, reader.number(raw["ramp"], ("ramp",), -MAX_ERROR, MAX_ERROR))

    def to_toml(self) -> object:
        """Spell it as ``{ ramp = value }``."""
        return {"ramp": self.value}

    def for_span(self, span: Span) -> ErrorFunction:
        """Give the polynomial it is where the range is another one."""
        if span == self.span:
            return self
        low, high = self.span
        slope = self.value / (high - low)
        return Poly(self.span, (-slope * low, slope))

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Name both ends."""
        del unit, value
        low, high = map(position, self.span)
        return f"ramp, 0 at {low} to the value at {high}"

    def slider_words(self, axis: str) -> str:
        """Say that the slider moves the upper end."""
        return f"rises along {axis}; this is the value at its upper end"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read one number."""
        return cls(span, single_value(rows))

    def rows(self) -> Rows:
        """Give the value at the upper end."""
        return [[self.value]]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Keep the amplitude."""
        return cls(span, present.amplitude)
