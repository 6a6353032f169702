"""The polynomial of the axis position."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.polynomial import polynomial

from warpspace.machine.curves.curve import ErrorFunction, Rows, Span, Spell
from warpspace.machine.curves.reading import ValueReader
from warpspace.machine.curves.rows import refuse_more
from warpspace.machine.limits import MAX_COEFFICIENTS
from warpspace.units import Array


@dataclass(frozen=True)
class Poly(ErrorFunction):
    """Polynomial Σ cₖ·qᵏ of the axis position in mm or degrees."""

    name: ClassVar[str] = "poly"
    title: ClassVar[str] = "polynomial"
    forms: ClassVar[tuple[tuple[str, ...], ...]] = (("poly",),)
    row_words: ClassVar[str] = "coefficients c0, c1, … of Σ cₖ·qᵏ"
    coefficients: tuple[float, ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Give the value of the polynomial; infinite where no number can hold it."""
        with np.errstate(over="ignore", invalid="ignore"):
            value = polynomial.polyval(
                np.asarray(position, dtype=float), np.array(self.coefficients)
            )
        return np.asarray(value, dtype=float)

    def scaled(self, factor: float) -> Self:
        """Multiply all coefficients."""
        return replace(self, coefficients=tuple(factor * c for c in self.coefficients))

    def grown(self) -> Self:
        """Give the line from 0 at the lower end to 1 at the upper; of c0 alone the constant 1.

        The number of coefficients stays.
        """
        if len(self.coefficients) < 2:
            return replace(self, coefficients=(1.0,))
        low, high = self.span
        rest = (0.0,) * (len(self.coefficients) - 2)
        return replace(self, coefficients=(-low / (high - low), 1.0 / (high - low), *rest))

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ poly = [c0, c1, …] }``."""
        entries = reader.entries(raw["poly"], ("poly",), MAX_COEFFICIENTS)
        return cls(span, tuple(reader.number(c, ("poly", k)) for k, c in enumerate(entries)))

    def to_toml(self) -> object:
        """Spell it as ``{ poly = [c0, c1, …] }``."""
        return {"poly": list(self.coefficients)}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        """Name the degree."""
        del unit, value, position
        return f"polynomial of degree {len(self.coefficients) - 1}"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read coefficients, in one row or one below the other."""
        coefficients = tuple(value for row in rows for value in row)
        refuse_more(len(coefficients), MAX_COEFFICIENTS, "coefficients")
        return cls(span, coefficients)

    def rows(self) -> Rows:
        """Give the coefficients one below the other."""
        return [[value] for value in self.coefficients]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        """Give the line through both ends of the present curve."""
        low, high = span
        first, last = (float(v) for v in present.evaluate(np.array(span)))
        slope = (last - first) / (high - low)
        return cls(span, (first - slope * low, slope))
