"""The live gain chart: which parameters reach a point most, by gain and by what they do there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.field.basis import ErrorBasis
from warpspace.field.evaluate import build_basis
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


@dataclass(frozen=True, slots=True)
class Ranking:
    """The errors of a machine ranked for one point.

    Attributes
    ----------
    bars : tuple of Bar
        Largest first.
    by_effect : bool
        Ranked by what the present errors do, not by gain.
    point_mm : ndarray, [3], mm
        Where the point is drawn.
    at : mapping of str to ndarray, [], mm or degrees
        Where the axes stand.
    error_um : float, µm
        |E| there.
    """

    bars: tuple[Bar, ...]
    by_effect: bool
    point_mm: Array
    at: Mapping[str, Array]
    error_um: float


def rank_picture(picture: LivePicture, *, middle: bool = False, by_effect: bool = False) -> Ranking:
    """Rank the errors for a point of a picture.

    Parameters
    ----------
    picture : LivePicture
    middle : bool, optional
        The middle of the volume instead of its worst point.
    by_effect : bool, optional
        Rank by what the present errors do.

    Returns
    -------
    Ranking
    """
    state, grid = picture.state, picture.grid
    norm = np.broadcast_to(picture.field.norm_um, grid.shape)
    worst = np.unravel_index(int(np.argmax(norm)), grid.shape)
    chosen = tuple(n // 2 for n in grid.shape) if middle else worst
    node = tuple(int(index) for index in chosen)
    at = node_coordinates(grid.coordinates, node, grid.shape)
    scene = state.scene
    basis = build_basis(
        scene.model,
        scene.errors,
        tuple(state.amplitudes),
        at,
        scene.view(state.loop),
        grid.nominal_mm[node],
    )
    bars = rank_gains(scene.model, state.loop, basis, state.active, (), at)
    if by_effect:
        bars = tuple(sorted(bars, key=lambda bar: -round(bar.moved_um, 9)))
    return Ranking(bars, by_effect, grid.nominal_mm[node], at, float(norm[node]))


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
