"""The constant: the same value everywhere."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from warpspace.machine.curves.curve import ErrorFunction, Rows, Span
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import single_value
from warpspace.machine.limits import MAX_ERROR
from warpspace.units import Array


@dataclass(frozen=True)
class Constant(ErrorFunction):
    """The same value everywhere."""

    name: ClassVar[str] = "constant"
    title: ClassVar[str] = "constant"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = ()
    row_words: ClassVar[str] = "one number: the same everywhere"
    value: float = 0.0

    def evaluate(self, position: Array) -> Array:
        """Give the value at every position."""
        return np.full(np.shape(position), self.value)

    @property
    def arguments(self) -> tuple[str, ...]:
        """No axis: it does not vary."""
        return ()

    def scaled(self, factor: float) -> Self:
        """Give the constant times a factor."""
        return replace(self, value=self.value * factor)

    @property
    def amplitude(self) -> float:
        """The value itself."""
        return self.value

    def with_amplitude(self, amplitude: float) -> Self:
        """Give another constant."""
        return replace(self, value=amplitude)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read a number."""
        return cls(span, reader.number(raw, (), -MAX_ERROR, MAX_ERROR))

    def to_toml(self) -> object:
        """Spell it as a number."""
        return self.value

    def slider_words(self, axis: str) -> str:
        """Say that it does not vary."""
        del axis
        return "the same everywhere"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read one number."""
        return cls(span, single_value(rows))

    def rows(self) -> Rows:
        """Give the value."""
        return [[self.value]]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Keep the amplitude."""
        return cls(span, present.amplitude)
