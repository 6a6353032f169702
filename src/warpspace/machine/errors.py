"""The errors of a machine: the curve of every parameter, tolerances, and what was measured."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpspace.machine.axes import TravelDirection, parameter
from warpspace.machine.curves.curve import OWN_AXIS, ErrorFunction
from warpspace.machine.curves.simple import NOTHING, Constant, Directional, Harmonics, Poly, Ramp
from warpspace.machine.curves.table import TableCurve, TwoArguments
from warpspace.machine.limits import MIN_SPAN
from warpspace.units import Array

__all__ = [
    "Constant",
    "Directional",
    "ErrorFunction",
    "ErrorSet",
    "Harmonics",
    "Poly",
    "Ramp",
    "TableCurve",
    "TwoArguments",
]


@dataclass(frozen=True)
class ErrorSet:
    """The error functions of a machine; a parameter that is absent is zero."""

    # parameter key to function
    functions: Mapping[str, ErrorFunction] = field(default_factory=dict[str, ErrorFunction])

    def __post_init__(self) -> None:
        """Refuse keys that are no parameters."""
        for key in self.functions:
            parameter(key)

    def __iter__(self) -> Iterator[str]:
        return iter(self.functions)

    @property
    def has_directions(self) -> bool:
        return any(function.has_directions for function in self.functions.values())

    def _function(self, key: str) -> ErrorFunction:
        return self.functions.get(key, NOTHING)

    def arguments(self, key: str) -> tuple[str, ...]:
        """List the axes whose positions one error depends on; none where it is constant or zero."""
        own, named = parameter(key).axis, self._function(key).arguments
        return tuple(dict.fromkeys(own if axis == OWN_AXIS else axis for axis in named))

    def evaluate(self, key: str, position: Array) -> Array:
        """Give one error along its axis, the mean of both directions of travel, [...]."""
        return self._function(key).evaluate(position)

    def evaluate_at(
        self,
        key: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give one error where the axes it depends on stand, reached in a direction, [...]."""
        return self._function(key).evaluate_at(parameter(key).axis, coordinates, direction)

    def shape_at(
        self,
        key: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give `evaluate_at` for an amplitude of one; an absent error is a constant.

        One that is zero takes the shape it grows into.
        """
        shape = self._function(key).with_amplitude(1.0)
        return shape.evaluate_at(parameter(key).axis, coordinates, direction)

    def amplitude(self, key: str) -> float:
        """Give the amplitude of one error, µm or µrad; 0 where it is absent."""
        return self._function(key).amplitude

    def with_amplitude(self, key: str, amplitude: float, span: tuple[float, float]) -> "ErrorSet":
        """Give the set with one amplitude changed; an absent one becomes a constant."""
        function = self.functions.get(key, Constant(span))
        return ErrorSet({**self.functions, key: function.with_amplitude(amplitude)})


@dataclass(frozen=True, slots=True)
class Covariance:
    """How sure the amplitudes of some errors are, together."""

    keys: tuple[str, ...]  # (K,)
    rows: tuple[tuple[float, ...], ...]  # (K, K); products of µm and µrad
    dof: float = np.inf  # degrees of freedom of what it was found from
    # positions between which axes stood, mm or degrees; beyond them nothing was measured
    measured_range: Mapping[str, tuple[float, float]] = field(
        default_factory=dict[str, tuple[float, float]]
    )
    undetermined: tuple[str, ...] = ()  # other errors, which the data left open although they act
    lack_of_fit: float = 0.0  # how many times as far residuals scattered as readings; 0: not seen

    @property
    def matrix(self) -> Array:
        return np.array(self.rows, dtype=float).reshape(len(self.keys), len(self.keys))

    def without(self, keys: Collection[str]) -> "Covariance":
        """Give what is left where some errors are found anew."""
        kept = [at for at, key in enumerate(self.keys) if key not in keys]
        rows = tuple(tuple(self.rows[a][b] for b in kept) for a in kept)
        undetermined = tuple(key for key in self.undetermined if key not in keys)
        return replace(
            self, keys=tuple(self.keys[at] for at in kept), rows=rows, undetermined=undetermined
        )

    def extended(self, places: Mapping[str, ArrayLike]) -> "Covariance":
        """Count positions where axes stood as measured, mm or degrees."""
        reach = dict(self.measured_range)
        for axis, at in places.items():
            every = np.append(at, reach.get(axis, ()))
            low, high = float(every.min()), float(every.max())
            reach[axis] = low, high if high - low >= MIN_SPAN else low
        return replace(self, measured_range=reach)

    def outside(self, at: Mapping[str, Array], shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Tell where axes stand outside what was reached, of a shape."""
        found = np.zeros(shape, dtype=bool)
        for axis, (low, high) in self.measured_range.items():
            found |= (at[axis] < low - MIN_SPAN) | (at[axis] > high + MIN_SPAN)
        return found


TOLERANCE_CLASSES = ("translation", "rotation", "squareness")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Range of one parameter."""

    centre: float  # µm or µrad
    half_width: float  # µm or µrad, not negative


@dataclass(frozen=True, slots=True)
class ToleranceSet:
    """Tolerances of a machine's parameters."""

    # half width about zero per class: translation [µm], rotation and squareness [µrad]
    default: Mapping[str, float] = field(default_factory=dict[str, float])
    # parameters with a tolerance of their own
    individual: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])

    def __bool__(self) -> bool:
        return bool(self.default or self.individual)

    def get(self, key: str) -> Tolerance | None:
        """Give the tolerance of a parameter; None where neither it nor its class has one."""
        if key in self.individual:
            return self.individual[key]
        half_width = self.default.get(parameter(key).tolerance_class)
        return None if half_width is None else Tolerance(0.0, half_width)

    def missing(self, keys: Sequence[str]) -> tuple[str, ...]:
        return tuple(key for key in keys if self.get(key) is None)

    def with_half_widths(self, half_widths: Mapping[str, float]) -> "ToleranceSet":
        """Give parameters other half widths, µm or µrad; centres stay where they are."""
        individual = dict(self.individual)
        for key, half_width in half_widths.items():
            present = self.get(key)
            individual[key] = Tolerance(0.0 if present is None else present.centre, half_width)
        return replace(self, individual=individual)


FORWARD, BACKWARD, UNKNOWN = "+", "-", ""
RUN_DIRECTIONS = (FORWARD, BACKWARD, UNKNOWN)
"""Towards growing positions, towards falling ones, not known."""


@dataclass(frozen=True, slots=True)
class TravelRun:
    """Readings of one travel along an axis."""

    # "+" towards growing positions, "-" towards falling ones, empty where it is not known
    direction: str
    # (n, 2); position in mm or degrees and reading in µm or µrad, in the order they were taken
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Measurement:
    """All runs of one error."""

    runs: tuple[TravelRun, ...]

    @cached_property
    def scatter(self) -> dict[str, Array]:
        """Readings by direction, [n, 2]: position in mm or degrees, value in µm or µrad."""
        found: dict[str, list[tuple[float, float]]] = {}
        for run in self.runs:
            found.setdefault(run.direction, []).extend(run.points)
        return {way: np.array(points) for way, points in found.items()}

    @property
    def count(self) -> int:
        return sum(len(run.points) for run in self.runs)
