"""The live gain chart: which parameters reach a point most, by gain and by what they do there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.field.basis import ErrorBasis
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.firstorder import columns
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.parameters import Parameter, parameter
from warpspace.units import Array

SHOWN_BARS = 10


@dataclass(frozen=True, slots=True)
class Bar:
    """One parameter at one point.

    Attributes
    ----------
    key : str
    gain : float, µm/µm or µm/µrad
        Length of the displacement per unit.
    lever_mm : float
        Distance from the frame the error sits in.
    amplitude : float, µm or µrad
        What the parameter has at present.
    moved_um : float, µm
        Displacement of the point by this parameter alone.
    along_um : float, µm
        Its part along the total error at the point; these add up to the total's length.
    """

    key: str
    gain: float
    lever_mm: float
    amplitude: float
    moved_um: float
    along_um: float

    @property
    def parameter(self) -> Parameter:
        """The row of the parameter table."""
        return parameter(self.key)


def rank_gains(
    model: Model,
    loop: Loop,
    basis: ErrorBasis,
    amplitudes: Mapping[str, float],
    node: tuple[int, ...],
    coordinates: Coordinates,
) -> tuple[Bar, ...]:
    """Rank the parameters of a machine by their gain at one node of a grid.

    Parameters
    ----------
    model : Model
    loop : Loop
    basis : ErrorBasis
        First-order response of the grid.
    amplitudes : mapping of str to float, µm or µrad
    node : tuple of int
        Index of the node.
    coordinates : mapping of str to ndarray, [], mm or degrees
        Axis positions of the node.

    Returns
    -------
    tuple of Bar
        Largest gain first; parameters outside the loop are left out.
    """
    values = np.array([amplitudes.get(key, 0.0) for key in basis.keys])
    moved = basis.contributions(values, node)
    total = moved.sum(axis=0)
    length = float(np.linalg.norm(total))
    towards = total / length if length > 0.0 else np.zeros(3)
    found = columns(
        model, loop, basis.keys, coordinates, nominal_point(model, Loop.TOOL, coordinates)
    )
    bars = [
        Bar(
            key,
            _length(found[key].position),
            _length(found[key].lever_mm),
            float(value),
            _length(vector),
            float(vector @ towards),
        )
        for key, value, vector in zip(basis.keys, values, moved, strict=True)
        if key in found
    ]
    # Rounded, so that gains that are equal but for rounding errors keep the order of the table.
    return tuple(sorted(bars, key=lambda bar: -round(bar.gain, 9)))


def node_coordinates(
    coordinates: Coordinates, node: tuple[int, ...], shape: tuple[int, ...]
) -> dict[str, Array]:
    """Pick the axis positions of one node out of those of a grid, mm or degrees."""
    return {
        name: np.asarray(np.broadcast_to(values, shape)[node])
        for name, values in coordinates.items()
    }


def _length(vector: Array) -> float:
    """Length of one vector, [3]."""
    return float(np.linalg.norm(vector))
