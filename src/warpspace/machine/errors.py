"""The errors of a machine: the curve of every parameter, and the set of all of them.

The kinds of curve are in `warpspace.machine.curves`; those that come with warpspace can be imported
from here as well.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import OWN, ErrorFunction
from warpspace.machine.curves.directional import Directional
from warpspace.machine.curves.harmonics import Harmonics
from warpspace.machine.curves.poly import Poly
from warpspace.machine.curves.ramp import Ramp
from warpspace.machine.curves.table import Table
from warpspace.machine.curves.two_arguments import TwoArguments
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

__all__ = [
    "Constant",
    "Directional",
    "ErrorFunction",
    "ErrorSet",
    "Harmonics",
    "Poly",
    "Ramp",
    "Table",
    "TwoArguments",
]


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

    def arguments(self, key: str) -> tuple[str, ...]:
        """List the axes whose positions one error depends on; none where it is constant or zero."""
        function = self.functions.get(key)
        own = parameter(key).axis
        named = () if function is None else function.arguments
        return tuple(dict.fromkeys(own if axis == OWN else axis for axis in named))

    def evaluate(self, key: str, position: Array) -> Array:
        """Give one error along its axis: the mean of both directions of travel.

        Parameters
        ----------
        key : str
            Parameter key.
        position : ndarray, [...], mm or degrees

        Returns
        -------
        ndarray, [...], µm or µrad
            Of an error that depends on a second axis, the section in the middle of its positions;
            see `evaluate_at`.
        """
        function = self.functions.get(key)
        return np.zeros(np.shape(position)) if function is None else function.evaluate(position)

    def evaluate_at(
        self,
        key: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give one error where all axes stand somewhere, reached in a direction of travel.

        Parameters
        ----------
        key : str
            Parameter key.
        coordinates : mapping of str to ndarray, [...], mm or degrees
            Broadcastable positions of the axes that it depends on, its own one among them.
        direction : str, optional
            One of `TravelDirection`.

        Returns
        -------
        ndarray, [...], µm or µrad
            Of the shape that the positions of its arguments broadcast to.
        """
        axis = parameter(key).axis
        function = self.functions.get(key)
        if function is None:
            return np.zeros(np.shape(coordinates[axis]))
        return function.evaluate_at(axis, coordinates, direction)

    def shape(self, key: str, position: Array) -> Array:
        """Give the curve of one error for an amplitude of one, [...]; 1 where it is absent."""
        function = self.functions.get(key)
        return np.ones(np.shape(position)) if function is None else function.shape(position)

    def shape_at(
        self,
        key: str,
        coordinates: Mapping[str, Array],
        direction: str = TravelDirection.MEAN,
    ) -> Array:
        """Give `evaluate_at` for an amplitude of one; an absent error is a constant."""
        axis = parameter(key).axis
        function = self.functions.get(key) or Constant((0.0, 1.0))
        return function.shape_at(axis, coordinates, direction)

    def amplitude(self, key: str) -> float:
        """Give the amplitude of one error, µm or µrad; 0 where it is absent."""
        function = self.functions.get(key)
        return 0.0 if function is None else function.amplitude

    def with_amplitude(self, key: str, amplitude: float, span: tuple[float, float]) -> "ErrorSet":
        """Give the set with one amplitude changed; an absent one becomes a constant."""
        function = self.functions.get(key, Constant(span))
        return ErrorSet({**self.functions, key: function.with_amplitude(amplitude)})
