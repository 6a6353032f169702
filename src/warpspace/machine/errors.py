"""Functions that an error parameter follows along its axis, and the set of all of them.

A function gives µm or µrad for an axis position in file units (mm or degrees). All are linear in
one amplitude, which is what a slider moves: the value of a constant, the upper end of a ramp, the
largest value (with its sign) of anything else.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.polynomial import polynomial

from warpspace.machine.parameters import parameter
from warpspace.units import Array

SPAN_SAMPLES = 721
"""Positions at which the peak of a curve is looked for: every half degree of a turn."""
MAX_SAMPLES = 200_001
SAMPLES_PER_WAVE = 16
NEGLIGIBLE = 1e-12
"""Peak in µm or µrad below which a curve counts as zero: no number may be divided by it."""


@dataclass(frozen=True)
class ErrorFunction(ABC):
    """A value that may vary along an axis.

    Attributes
    ----------
    span : tuple of float, (2,)
        Lower and upper end of the axis range it is meant for, mm or degrees.
    """

    span: tuple[float, float]

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

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Give the same curve with all values times a factor."""

    @abstractmethod
    def to_toml(self) -> object:
        """Give the value that a scene file spells for this function."""

    @property
    def amplitude(self) -> float:
        """Largest value over the span, with its sign, µm or µrad."""
        values = self.evaluate(np.linspace(*self.span, self.samples))
        return float(values[np.argmax(np.abs(values))])

    @property
    def samples(self) -> int:
        """Number of positions over the span at which the peak is looked for."""
        return SPAN_SAMPLES

    def with_amplitude(self, amplitude: float) -> "ErrorFunction":
        """Give the same curve with another amplitude; a flat zero curve becomes a constant."""
        present = self.amplitude
        if abs(present) < NEGLIGIBLE:
            return Constant(self.span, amplitude)
        return self.scaled(amplitude / present)

    def shape(self, position: Array) -> Array:
        """Give the curve for an amplitude of one; 1 everywhere for a flat zero curve.

        Parameters
        ----------
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...]
        """
        return self.with_amplitude(1.0).evaluate(position)


@dataclass(frozen=True)
class Constant(ErrorFunction):
    """The same value everywhere."""

    value: float = 0.0

    def evaluate(self, position: Array) -> Array:
        """Give the value at every position."""
        return np.full(np.shape(position), self.value)

    def scaled(self, factor: float) -> Self:
        """Give the constant times a factor."""
        return replace(self, value=self.value * factor)

    def to_toml(self) -> object:
        """Spell it as a number."""
        return self.value

    @property
    def amplitude(self) -> float:
        """The value itself."""
        return self.value

    def with_amplitude(self, amplitude: float) -> ErrorFunction:
        """Give another constant."""
        return replace(self, value=amplitude)


@dataclass(frozen=True)
class Ramp(ErrorFunction):
    """Zero at the lower end of the span, the value at the upper one, linear between and beyond."""

    value: float = 0.0

    def evaluate(self, position: Array) -> Array:
        """Give the point of the line at each position."""
        lower, upper = self.span
        return self.value * (np.asarray(position, dtype=float) - lower) / (upper - lower)

    def scaled(self, factor: float) -> Self:
        """Give the ramp to a multiple of the value."""
        return replace(self, value=self.value * factor)

    def to_toml(self) -> object:
        """Spell it as ``{ ramp = value }``."""
        return {"ramp": self.value}

    @property
    def amplitude(self) -> float:
        """The value at the upper end."""
        return self.value

    def with_amplitude(self, amplitude: float) -> ErrorFunction:
        """Give the ramp to that value; a ramp of zero stays a ramp."""
        return replace(self, value=amplitude)


@dataclass(frozen=True)
class Poly(ErrorFunction):
    """Polynomial Σ cₖ·qᵏ of the axis position in mm or degrees."""

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

    def to_toml(self) -> object:
        """Spell it as ``{ poly = [c0, c1, …] }``."""
        return {"poly": list(self.coefficients)}


@dataclass(frozen=True)
class Harmonics(ErrorFunction):
    """Sum of A·cos(n·q − φ).

    Attributes
    ----------
    terms : tuple of tuple of float, (n, 3)
        Order n, amplitude A, phase φ in degrees. The product n·q counts as degrees, so on a linear
        axis the wavelength is 360/n mm.
    """

    terms: tuple[tuple[float, float, float], ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Give the sum of the harmonics."""
        angle = np.asarray(position, dtype=float)
        total = np.zeros(angle.shape)
        for order, amplitude, phase in self.terms:
            total = total + amplitude * np.cos(np.deg2rad(order * angle - phase))
        return total

    def scaled(self, factor: float) -> Self:
        """Multiply all amplitudes."""
        return replace(self, terms=tuple((n, factor * a, phase) for n, a, phase in self.terms))

    @property
    def samples(self) -> int:
        """Number of positions that resolves the shortest wave."""
        highest = max((order for order, _, _ in self.terms), default=0.0)
        waves = highest * (self.span[1] - self.span[0]) / 360.0
        return int(min(max(SPAN_SAMPLES, SAMPLES_PER_WAVE * waves + 1), MAX_SAMPLES))

    def to_toml(self) -> object:
        """Spell it as ``{ harmonics = [[n, A, φ], …] }``."""
        return {"harmonics": [list(term) for term in self.terms]}


@dataclass(frozen=True)
class Table(ErrorFunction):
    """Piecewise linear curve through measured points, its ends held.

    Attributes
    ----------
    points : tuple of tuple of float, (n, 2)
        Axis position (ascending) and value.
    """

    points: tuple[tuple[float, float], ...] = ()

    def evaluate(self, position: Array) -> Array:
        """Interpolate between the points."""
        at, value = np.array(self.points).T
        return np.interp(np.asarray(position, dtype=float), at, value)

    def scaled(self, factor: float) -> Self:
        """Multiply all values."""
        return replace(self, points=tuple((q, factor * value) for q, value in self.points))

    def to_toml(self) -> object:
        """Spell it as ``{ table = [[q, value], …] }``."""
        return {"table": [list(point) for point in self.points]}

    @property
    def amplitude(self) -> float:
        """Largest value of a point, with its sign."""
        return max((value for _, value in self.points), key=abs)


@dataclass(frozen=True)
class ErrorSet:
    """The error functions of a machine; a parameter that is absent is zero.

    Attributes
    ----------
    functions : mapping of str to ErrorFunction
        Parameter key to function.
    """

    functions: Mapping[str, ErrorFunction] = field(default_factory=dict[str, ErrorFunction])

    def __post_init__(self) -> None:
        """Refuse keys that are no parameters."""
        for key in self.functions:
            parameter(key)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the keys that are given."""
        return iter(self.functions)

    def evaluate(self, key: str, position: Array) -> Array:
        """Give one error at positions of its axis.

        Parameters
        ----------
        key : str
            Parameter key.
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...], µm or µrad
        """
        function = self.functions.get(key)
        return np.zeros(np.shape(position)) if function is None else function.evaluate(position)

    def shape(self, key: str, position: Array) -> Array:
        """Give the curve of one error for an amplitude of one, [...]; 1 where it is absent."""
        function = self.functions.get(key)
        return np.ones(np.shape(position)) if function is None else function.shape(position)

    def amplitude(self, key: str) -> float:
        """Give the amplitude of one error, µm or µrad; 0 where it is absent."""
        function = self.functions.get(key)
        return 0.0 if function is None else function.amplitude

    def with_amplitude(self, key: str, amplitude: float, span: tuple[float, float]) -> "ErrorSet":
        """Give the set with one amplitude changed; an absent one becomes a constant."""
        function = self.functions.get(key, Constant(span))
        return ErrorSet({**self.functions, key: function.with_amplitude(amplitude)})
