"""Simple curves: constant, ramp, polynomial and harmonics; curves by direction of travel."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.machine import limits
from warpspace.machine.axes import TravelDirection
from warpspace.machine.curves.curve import (
    SPAN_SAMPLES,
    Coordinates,
    ErrorFunction,
    Rows,
    Span,
    Spell,
    ValueReader,
    limited,
    refuse_more,
    single_value,
)
from warpspace.units import Array


@dataclass(frozen=True)
class OneNumber(ErrorFunction):
    """A curve of one number, which is its amplitude."""

    value: float = 0.0

    def scaled(self, factor: float) -> Self:
        return replace(self, value=self.value * factor)

    @cached_property
    def amplitude(self) -> float:
        return self.value

    def with_amplitude(self, amplitude: float) -> Self:
        return replace(self, value=amplitude)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        place = cls.forms[0] if cls.forms else ()
        number = raw[place[0]] if place else raw
        return cls(span, reader.number(number, place, -limits.MAX_ERROR, limits.MAX_ERROR))

    def to_toml(self) -> object:
        return {self.forms[0][0]: self.value} if self.forms else self.value

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        return cls(span, single_value(rows))

    def rows(self) -> Rows:
        return [[self.value]]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        return cls(span, present.amplitude)


@dataclass(frozen=True)
class Constant(OneNumber):
    """The same value everywhere."""

    name = "constant"
    title = "constant"
    forms = ()
    row_words = "one number: the same everywhere"
    slider = "the same everywhere"

    def evaluate(self, position: Array) -> Array:
        return np.full(np.shape(position), self.value)

    @property
    def arguments(self) -> tuple[str, ...]:
        return ()


@dataclass(frozen=True)
class Poly(ErrorFunction):
    """Polynomial Σ cₖ·qᵏ of the axis position in mm or degrees."""

    name = "poly"
    title = "polynomial"
    forms = (("poly",),)
    row_words = "coefficients c0, c1, … of Σ cₖ·qᵏ"
    coefficients: tuple[float, ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Evaluate the polynomial; infinite beyond the range of floating-point numbers."""
        with np.errstate(over="ignore", invalid="ignore"):
            value = np.polynomial.polynomial.polyval(
                np.asarray(position, dtype=float), np.array(self.coefficients)
            )
        return np.asarray(value, dtype=float)

    def scaled(self, factor: float) -> Self:
        return replace(self, coefficients=tuple(factor * c for c in self.coefficients))

    def grown(self) -> Self:
        """Return the line from 0 at the lower end to 1 at the upper; c0 alone becomes 1."""
        if len(self.coefficients) < 2:
            return replace(self, coefficients=(1.0,))
        low, high = self.span
        higher = (0.0,) * (len(self.coefficients) - 2)
        return replace(self, coefficients=(-low / (high - low), 1.0 / (high - low), *higher))

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ poly = [c0, c1, …] }``."""
        entries = reader.entries(raw["poly"], ("poly",), limits.MAX_COEFFICIENTS)
        return cls(span, tuple(reader.number(c, ("poly", k)) for k, c in enumerate(entries)))

    def to_toml(self) -> object:
        return {"poly": list(self.coefficients)}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        del unit, value, position
        return f"polynomial of degree {len(self.coefficients) - 1}"

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Build the polynomial from coefficients in one row or one column."""
        coefficients = tuple(value for row in rows for value in row)
        refuse_more(len(coefficients), limits.MAX_COEFFICIENTS, "coefficients")
        return cls(span, coefficients)

    def rows(self) -> Rows:
        return [[value] for value in self.coefficients]

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        low, high = span
        first, last = (float(v) for v in present.evaluate(np.array(span)))
        slope = (last - first) / (high - low)
        return cls(span, (first - slope * low, slope))


@dataclass(frozen=True)
class Ramp(OneNumber):
    """Zero at the lower end of the span, the value at the upper one, linear between and beyond."""

    name = "ramp"
    title = "ramp"
    forms = (("ramp",),)
    row_words = "one number: the value at the upper end, from zero at the lower"
    slider = "rises along {axis}; this is the value at its upper end"

    def evaluate(self, position: Array) -> Array:
        lower, upper = self.span
        return self.value * (np.asarray(position, dtype=float) - lower) / (upper - lower)

    def for_span(self, span: Span) -> ErrorFunction:
        if span == self.span:
            return self
        low, high = self.span
        slope = self.value / (high - low)
        return Poly(self.span, (-slope * low, slope))

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        del unit, value
        low, high = map(position, self.span)
        return f"ramp, 0 at {low} to the value at {high}"


MAX_SAMPLES = 200_001
MAX_COSINES = 2_000_000  # limit of terms × positions in the search of a peak
SAMPLES_PER_WAVE = 16
SHOWN_TERMS = 3
MIN_PEAK = 1e-6
"""Peak below which a wave of amplitude one counts as zero within the range."""
LIMITS = (
    (0.0, limits.MAX_ORDER),
    (-limits.MAX_ERROR, limits.MAX_ERROR),
    (-limits.MAX_LENGTH_MM, limits.MAX_LENGTH_MM),
)
"""Of order, amplitude and phase."""


@dataclass(frozen=True)
class Harmonics(ErrorFunction):
    """Sum of A·cos(n·q − φ)."""

    name = "harmonics"
    title = "harmonics"
    forms = (("harmonics",),)
    row_words = "order, amplitude and phase in degrees in each row"
    # (n, 3); order n, amplitude A, phase φ in degrees. The product n·q counts as degrees, so on a
    # linear axis the wavelength is 360/n mm.
    terms: tuple[tuple[float, float, float], ...] = ()

    def evaluate(self, position: Array) -> Array:
        angle = np.asarray(position, dtype=float)
        total = np.zeros(angle.shape)
        for order, amplitude, phase in self.terms:
            total = total + amplitude * np.cos(np.deg2rad(order * angle - phase))
        return total

    def scaled(self, factor: float) -> Self:
        return replace(self, terms=tuple((n, factor * a, phase) for n, a, phase in self.terms))

    def grown(self) -> Self:
        """Return the first wave whose order and phase make it non-zero, else one full wave."""
        for index in range(len(self.terms)):
            terms = tuple(
                (n, float(k == index), phase) for k, (n, _, phase) in enumerate(self.terms)
            )
            wave = replace(self, terms=terms)
            if abs(wave.amplitude) > MIN_PEAK:
                return wave
        return replace(self, terms=((_one_wave(self.span), 1.0, 0.0),))

    @property
    def samples(self) -> int:
        highest = max((order for order, _, _ in self.terms), default=0.0)
        waves = highest * (self.span[1] - self.span[0]) / 360.0
        max_count = min(MAX_SAMPLES, MAX_COSINES // max(len(self.terms), 1))
        return int(min(max(SPAN_SAMPLES, SAMPLES_PER_WAVE * waves + 1), max_count))

    @property
    def cosines(self) -> int:
        """Number of cosines in the search of its peak: the cost of opening a scene with it."""
        return self.samples * len(self.terms)

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ harmonics = [[n, A, φ], …] }``."""
        terms: list[tuple[float, float, float]] = []
        for index, entry in enumerate(
            reader.entries(raw["harmonics"], ("harmonics",), limits.MAX_TERMS)
        ):
            place = ("harmonics", index)
            order, amplitude, phase = reader.row(entry, place, "[order, amplitude, phase]", LIMITS)
            terms.append((order, amplitude, phase))
        return cls(span, tuple(terms))

    def to_toml(self) -> object:
        return {"harmonics": [list(term) for term in self.terms]}

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        del position
        terms = ", ".join(f"{value(a)} {unit} × {n:g}" for n, a, _ in self.terms[:SHOWN_TERMS])
        return f"harmonics: {terms}" + (" …" if len(self.terms) > SHOWN_TERMS else "")

    @classmethod
    def from_rows(cls, span: Span, rows: Rows) -> Self:
        """Read terms of order, amplitude and phase; an absent phase is zero."""
        refuse_more(len(rows), limits.MAX_TERMS, "terms")
        terms: list[tuple[float, float, float]] = []
        for number, row in enumerate(rows, start=1):
            if len(row) not in (2, 3):
                raise OptionError(f"row {number}: {len(row)} numbers; expected {cls.row_words}")
            order, amplitude, phase = (*row, 0.0)[:3]
            if not 0.0 <= order <= limits.MAX_ORDER:
                raise OptionError(
                    f"row {number}: order {order:g}; expected 0 to {limits.MAX_ORDER}"
                )
            limited(amplitude, number, what="amplitude")
            terms.append((order, amplitude, limited(phase, number, limits.MAX_LENGTH_MM, "phase")))
        return cls(span, tuple(terms))

    def rows(self) -> Rows:
        return self.terms

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        return cls(span, ((_one_wave(span), present.amplitude, 0.0),))


def _one_wave(span: Span) -> float:
    return float(f"{360.0 / (span[1] - span[0]):.6g}")


SHARES = {
    TravelDirection.MEAN: (0.5, 0.5),
    TravelDirection.FORWARD: (1.0, 0.0),
    TravelDirection.BACKWARD: (0.0, 1.0),
    TravelDirection.DIFFERENCE: (1.0, -1.0),
}
"""Weights of the forward and the backward curve."""
NOTHING = Constant((0.0, 1.0))


@dataclass(frozen=True)
class Directional(ErrorFunction):
    """Error that depends on the direction of travel of its axis.

    `evaluate` returns the mean of both; `evaluate_at` has a direction. The amplitude is that of the
    larger curve and scales both, so that their ratio is constant.
    """

    name = "directional"
    title = "by direction of travel"
    forms = (("forward", "backward"),)
    row_words = "curves by direction come from a scene file or an import"
    slider = "differs by direction of travel of {axis}; this is the larger one's amplitude"
    edited_as_rows = False
    has_directions = True
    # towards increasing and decreasing positions; of any other kind
    forward: ErrorFunction = NOTHING
    backward: ErrorFunction = NOTHING

    @property
    def arguments(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.forward.arguments, *self.backward.arguments)))

    def evaluate(self, position: Array) -> Array:
        return 0.5 * (self.forward.evaluate(position) + self.backward.evaluate(position))

    def evaluate_at(
        self, axis: str, coordinates: Coordinates, direction: str = TravelDirection.MEAN
    ) -> Array:
        """Evaluate the mean, one of the directions, or forward − backward, [...]."""
        forward, backward = SHARES[TravelDirection(direction)]
        weighted = ((forward, self.forward), (backward, self.backward))
        return np.asarray(
            sum(share * curve.evaluate_at(axis, coordinates) for share, curve in weighted if share)
        )

    @property
    def lines(self) -> tuple[tuple[str, ErrorFunction], ...]:
        pairs = (("forward", self.forward), ("backward", self.backward))
        return tuple(
            (f"{direction} {label}".rstrip(), line)
            for direction, curve in pairs
            for label, line in curve.lines
        )

    @property
    def parts(self) -> tuple[ErrorFunction, ...]:
        return (*self.forward.parts, *self.backward.parts)

    def _with_both(self, change: Callable[[ErrorFunction], ErrorFunction]) -> Self:
        return replace(self, forward=change(self.forward), backward=change(self.backward))

    def scaled(self, factor: float) -> Self:
        return self._with_both(lambda curve: curve.scaled(factor))

    @cached_property
    def amplitude(self) -> float:
        forward, backward = self.forward.amplitude, self.backward.amplitude
        return backward if math.isnan(backward) or abs(backward) > abs(forward) else forward

    def without_axes(self, positions: Mapping[str, float]) -> ErrorFunction:
        return self._with_both(lambda curve: curve.without_axes(positions))

    @property
    def kinks(self) -> tuple[float, ...]:
        return tuple(sorted({*self.forward.kinks, *self.backward.kinks}))

    @property
    def samples(self) -> int:
        return max(self.forward.samples, self.backward.samples)

    def grown(self) -> Self:
        return self._with_both(lambda curve: curve.with_amplitude(1.0))

    @classmethod
    def read(cls, raw: Any, span: Span, reader: ValueReader) -> Self:
        """Read ``{ forward = CURVE, backward = CURVE }``."""
        curves: list[ErrorFunction] = []
        for direction in ("forward", "backward"):
            curve = reader.curve(raw[direction], (direction,))
            if isinstance(curve, Directional):
                reader.note((direction,), "expected a curve without directions")
            curves.append(curve or Constant(span))
        return cls(span, *curves)

    def to_toml(self) -> object:
        return {"forward": self.forward.to_toml(), "backward": self.backward.to_toml()}

    def for_span(self, span: Span) -> ErrorFunction:
        return replace(
            self._with_both(lambda curve: replace(curve.for_span(span), span=span)), span=span
        )

    def describe(self, unit: str, value: Spell, position: Spell) -> str:
        forward, backward = (
            curve.describe(unit, value, position) for curve in (self.forward, self.backward)
        )
        return f"forward {forward}, backward {backward}"

    @classmethod
    def from_curve(cls, present: ErrorFunction, span: Span) -> Self:
        if isinstance(present, cls):
            return replace(present, span=span)
        return cls(span, present, present)
