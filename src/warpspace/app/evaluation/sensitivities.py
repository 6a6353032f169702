"""The live gain chart: which parameters reach a point most, by gain and by what they do there."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.field.evaluate import ErrorBasis, build_basis
from warpspace.kinematics.chain import columns, nominal_point
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.axes import Parameter, parameter
from warpspace.units import Array

SHOWN_BARS = 10


@dataclass(frozen=True, slots=True)
class Bar:
    """One parameter at one point."""

    key: str
    gain: float  # µm/µm or µm/µrad; length of the displacement per unit
    lever_mm: float  # distance from the frame the error sits in
    amplitude: float  # µm or µrad; what the parameter has at present
    moved_um: float  # displacement of the point by this parameter alone
    # its part along the total error at the point; these add up to the total's length
    along_um: float

    @property
    def parameter(self) -> Parameter:
        """The row of the parameter table."""
        return parameter(self.key)


@dataclass(frozen=True, slots=True)
class Ranking:
    """The errors of a machine ranked for one point."""

    bars: tuple[Bar, ...]  # largest first
    by_effect: bool  # ranked by what the present errors do, not by gain
    point_mm: Array  # [3]; where the point is drawn
    at: Mapping[str, Array]  # [], mm or degrees; where the axes stand
    error_um: float  # |E| there


def rank_picture(picture: LivePicture, *, middle: bool = False, by_effect: bool = False) -> Ranking:
    """Rank the errors for a point of a picture."""
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
        state.view(),
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
    """Rank the parameters of a machine by their gain at one node of a grid."""
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
    return float(np.linalg.norm(vector))
