"""Errors of a machine: curves of the parameters, covariance, tolerances and measured runs."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpspace.machine.axes import TravelDirection, parameter
from warpspace.machine.curves.curve import OWN_AXIS, Coordinates, ErrorFunction
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
        """Raise UnknownNameError for unknown keys."""
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
        own_axis, named = parameter(key).axis, self._function(key).arguments
        return tuple(dict.fromkeys(own_axis if axis == OWN_AXIS else axis for axis in named))

    def evaluate(self, key: str, position: Array) -> Array:
        """Evaluate one error along its axis, the mean of both directions of travel, [...]."""
        return self._function(key).evaluate(position)

    def evaluate_at(
        self, key: str, coordinates: Coordinates, direction: str = TravelDirection.MEAN
    ) -> Array:
        """Evaluate one error at positions of its arguments, reached in a direction, [...]."""
        return self._function(key).evaluate_at(parameter(key).axis, coordinates, direction)

    def shape_at(
        self, key: str, coordinates: Coordinates, direction: str = TravelDirection.MEAN
    ) -> Array:
        """Evaluate one error for an amplitude of one; an absent error is a constant.

        A zero curve takes the shape of `ErrorFunction.grown`.
        """
        shape = self._function(key).with_amplitude(1.0)
        return shape.evaluate_at(parameter(key).axis, coordinates, direction)

    def amplitude(self, key: str) -> float:
        """Return the amplitude of one error, µm or µrad; 0 where it is absent."""
        return self._function(key).amplitude

    def with_amplitude(self, key: str, amplitude: float, span: tuple[float, float]) -> "ErrorSet":
        """Return the set with one amplitude changed; an absent error becomes a constant."""
        function = self.functions.get(key, Constant(span))
        return ErrorSet({**self.functions, key: function.with_amplitude(amplitude)})


@dataclass(frozen=True, slots=True)
class Covariance:
    """Covariance of the amplitudes of some errors."""

    keys: tuple[str, ...]  # (K,)
    rows: tuple[tuple[float, ...], ...]  # (K, K); products of µm and µrad
    dof: float = np.inf  # degrees of freedom of its estimate
    # ranges of the axes in the measurement, mm or degrees
    measured_range: Mapping[str, tuple[float, float]] = field(
        default_factory=dict[str, tuple[float, float]]
    )
    undetermined: tuple[str, ...] = ()  # other errors, not determined by the data although they act
    lack_of_fit: float = 0.0  # ratio of residuals to the scatter of readings; 0: not detected

    @property
    def matrix(self) -> Array:
        return np.array(self.rows, dtype=float).reshape(len(self.keys), len(self.keys))

    def without(self, keys: Collection[str]) -> "Covariance":
        """Return the covariance of the other errors."""
        remaining = [at for at, key in enumerate(self.keys) if key not in keys]
        rows = tuple(tuple(self.rows[a][b] for b in remaining) for a in remaining)
        undetermined = tuple(key for key in self.undetermined if key not in keys)
        return replace(
            self,
            keys=tuple(self.keys[at] for at in remaining),
            rows=rows,
            undetermined=undetermined,
        )

    def extended(self, places: Mapping[str, ArrayLike]) -> "Covariance":
        """Extend the measured range by axis positions, mm or degrees."""
        reach = dict(self.measured_range)
        for axis, at in places.items():
            positions = np.append(at, reach.get(axis, ()))
            low, high = float(positions.min()), float(positions.max())
            reach[axis] = low, high if high - low >= MIN_SPAN else low
        return replace(self, measured_range=reach)

    def outside(self, at: Mapping[str, Array], shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Check where axes are outside the measured range; of a shape."""
        is_outside = np.zeros(shape, dtype=bool)
        for axis, (low, high) in self.measured_range.items():
            is_outside |= (at[axis] < low - MIN_SPAN) | (at[axis] > high + MIN_SPAN)
        return is_outside


TOLERANCE_CLASSES = ("translation", "rotation", "squareness")


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Range of one parameter."""

    centre: float  # µm or µrad
    half_width: float  # µm or µrad, not negative


@dataclass(frozen=True, slots=True)
class ToleranceSet:
    """Tolerances of a machine's parameters."""

    # half-width about zero per class: translation [µm], rotation and squareness [µrad]
    default: Mapping[str, float] = field(default_factory=dict[str, float])
    # tolerances of single parameters
    individual: Mapping[str, Tolerance] = field(default_factory=dict[str, Tolerance])

    def __bool__(self) -> bool:
        return bool(self.default or self.individual)

    def get(self, key: str) -> Tolerance | None:
        """Return the tolerance of a parameter; None where neither it nor its class has one."""
        if key in self.individual:
            return self.individual[key]
        half_width = self.default.get(parameter(key).tolerance_class)
        return None if half_width is None else Tolerance(0.0, half_width)

    def missing(self, keys: Sequence[str]) -> tuple[str, ...]:
        return tuple(key for key in keys if self.get(key) is None)

    def with_half_widths(self, half_widths: Mapping[str, float]) -> "ToleranceSet":
        """Change half-widths of parameters, µm or µrad; centres are unchanged."""
        individual = dict(self.individual)
        for key, half_width in half_widths.items():
            present = self.get(key)
            individual[key] = Tolerance(0.0 if present is None else present.centre, half_width)
        return replace(self, individual=individual)


FORWARD, BACKWARD, UNKNOWN = "+", "-", ""
RUN_DIRECTIONS = (FORWARD, BACKWARD, UNKNOWN)
"""Towards increasing positions, towards decreasing ones, unknown."""


@dataclass(frozen=True, slots=True)
class TravelRun:
    """Readings of one travel along an axis."""

    # "+" towards increasing positions, "-" towards decreasing ones, empty where unknown
    direction: str
    # (n, 2); position in mm or degrees and reading in µm or µrad, in the order of measurement
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Measurement:
    """All runs of one error."""

    runs: tuple[TravelRun, ...]

    @cached_property
    def scatter(self) -> dict[str, Array]:
        """Readings by direction, [n, 2]: position in mm or degrees, value in µm or µrad."""
        readings: dict[str, list[tuple[float, float]]] = {}
        for run in self.runs:
            readings.setdefault(run.direction, []).extend(run.points)
        return {direction: np.array(points) for direction, points in readings.items()}

    @property
    def count(self) -> int:
        return sum(len(run.points) for run in self.runs)
