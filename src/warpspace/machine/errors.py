"""The errors of a machine: the curve of every parameter, and the set of all of them.

The kinds of curve are in `warpspace.machine.curves`; those that come with warpspace can be imported
from here as well.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.curve import ErrorFunction
from warpspace.machine.curves.harmonics import Harmonics
from warpspace.machine.curves.poly import Poly
from warpspace.machine.curves.ramp import Ramp
from warpspace.machine.curves.table import Table
from warpspace.machine.parameters import parameter
from warpspace.units import Array

__all__ = ["Constant", "ErrorFunction", "ErrorSet", "Harmonics", "Poly", "Ramp", "Table"]


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
