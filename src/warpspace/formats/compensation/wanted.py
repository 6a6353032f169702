"""What a table is to correct: the corrections at its points, averaged where it has fewer axes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpspace.formats.compensation.corrector import Corrector
from warpspace.machine.curves.directional import Directional
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.scene.model import Scene
from warpspace.units import Array

OTHER_NODES = 9
"""Positions of the other axes that a table of one axis is averaged over."""


@dataclass(frozen=True)
class Wanted:
    """What a table is to correct, and how fine it may be.

    Attributes
    ----------
    scene : Scene
    corrector : Corrector
    points : mapping of str to int
        Points of the table along each axis of the volume.
    resolution : float
        Smallest step of a value, mm or degrees; 0 for as many digits as are printed.
    sign : str
        What the values are: "error" or "correction"; empty for what the format's manual says.
    stem : str
        Name of the files to write, without an ending.
    """

    scene: Scene
    corrector: Corrector
    points: Mapping[str, int]
    resolution: float = 0.0
    sign: str = ""
    stem: str = "compensation"

    @property
    def title(self) -> str:
        """Title of the scene in one line, for comments."""
        return self.scene.title.replace("\n", " ")

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that span the volume, in the order of the machine."""
        spanning = self.scene.workspace.volume_axes
        return tuple(axis for axis in self.scene.machine.axes if axis in spanning)

    def places(self, axis: str) -> Array:
        """Give the positions of a table along an axis, equal steps over the working volume."""
        return np.linspace(*self.scene.workspace.ranges[axis], self.points[axis])

    def factor(self, usual: str) -> float:
        """Give the factor from a correction to a number of the table."""
        return -1.0 if (self.sign or usual) == "error" else 1.0

    def round(self, values: ArrayLike) -> Array:
        """Round values to the resolution."""
        step = self.resolution
        given = np.asarray(values, dtype=float)
        return np.round(given / step) * step if step else given

    @property
    def directed(self) -> tuple[str, ...]:
        """Those of `axes` that have errors by direction of travel."""
        functions = self.corrector.errors.functions
        found = {parameter(key).axis for key, curve in functions.items() if curve.has_directions}
        return tuple(axis for axis in self.axes if axis in found)

    def toward(self, direction: str, axis: str = "") -> "Wanted":
        """Give what is wanted for one direction of travel, of all axes or of one alone.

        Parameters
        ----------
        direction : str
            "mean", "forward" or "backward".
        axis : str, optional
            All other axes travel as in the scene; "forward" or "backward" then.
        """
        model, errors = self.corrector.model, self.corrector.errors
        if not axis:
            corrector = replace(self.corrector, model=replace(model, direction=direction))
            return replace(self, corrector=corrector)
        own = {
            key: curve.forward if direction == TravelDirection.FORWARD else curve.backward
            for key, curve in errors.functions.items()
            if isinstance(curve, Directional) and parameter(key).axis == axis
        }
        changed = ErrorSet({**errors.functions, **own})
        return replace(self, corrector=replace(self.corrector, errors=changed))

    def corrections(self, places: Mapping[str, Array]) -> dict[str, Array]:
        """Give the corrections of all axes on a grid of places along the axes of the volume.

        Parameters
        ----------
        places : mapping of str to ndarray, (n,)

        Returns
        -------
        dict of str to ndarray, [n1, n2, …]
            In the order of `axes`.
        """
        still = self.scene.workspace.positions
        meshed = np.meshgrid(*(places[axis] for axis in self.axes), indexing="ij")
        coordinates = {name: np.asarray(still[name]) for name in self.scene.machine.axes}
        coordinates |= dict(zip(self.axes, meshed, strict=True))
        return self.corrector.moves(coordinates)

    def averaged(self, kept: Sequence[str]) -> dict[str, Array]:
        """Give the corrections over some axes, averaged over the volume along all others.

        Parameters
        ----------
        kept : sequence of str
            In the order of `axes`.

        Returns
        -------
        dict of str to ndarray, [n1, …]
            By corrected axis: the table of these axes that leaves the smallest RMS.
        """
        places = {
            axis: self.places(axis)
            if axis in kept
            else np.linspace(*self.scene.workspace.ranges[axis], OTHER_NODES)
            for axis in self.axes
        }
        weights = np.ones(OTHER_NODES)
        weights[[0, -1]] = 0.5
        weights /= weights.sum()
        found = self.corrections(places)
        for index in reversed(range(len(self.axes))):
            if self.axes[index] not in kept:
                found = {
                    axis: np.moveaxis(value, index, -1) @ weights for axis, value in found.items()
                }
        return found
