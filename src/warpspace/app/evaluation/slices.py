"""Slices of a state: grids of their own with their own responses, kept while they stay in place."""

from dataclasses import dataclass

from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.colouring import shown_values
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import slice_positions
from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.field.grid import Grid
from warpspace.geometry.deform import deform
from warpspace.geometry.slices import build_slice
from warpspace.scene.pipeline import grid_basis
from warpspace.units import Array

KEPT_BYTES = 60_000_000


@dataclass(frozen=True, slots=True)
class SliceMap:
    """One slice, ready to be drawn.

    Attributes
    ----------
    axis : str
        The axis that stands still.
    position_mm : float, mm
    grid : Grid
        One node along the axis of the slice.
    field : ErrorField
    values : ndarray, [nx, ny, nz], µm or µrad
        What is coloured.
    drawn_mm : ndarray, [nx, ny, nz, 3], mm
    """

    axis: str
    position_mm: float
    grid: Grid
    field: ErrorField
    values: Array
    drawn_mm: Array


class SliceSource:
    """Slices of states; usable from any thread."""

    def __init__(self) -> None:
        self._cache: Cache[tuple[Grid, ErrorBasis]] = Cache(KEPT_BYTES)

    def maps(self, state: AppState, amplitudes: Array, exaggeration: float) -> tuple[SliceMap, ...]:
        """Evaluate the slices of a state; none where it does not show any.

        Parameters
        ----------
        state : AppState
        amplitudes : ndarray, [K], µm or µrad
        exaggeration : float

        Returns
        -------
        tuple of SliceMap
        """
        if state.look.surface != "slices":
            return ()
        found: list[SliceMap] = []
        for axis, at in slice_positions(state.scene, state.look, state.machine).items():
            grid, basis = self._basis(state, axis, at)
            field = basis.evaluate(amplitudes, orientation=state.look.tilts)
            found.append(draw_slice(state, axis, at, grid, field, exaggeration))
        return tuple(found)

    def _basis(self, state: AppState, axis: str, at: float) -> tuple[Grid, ErrorBasis]:
        """Give grid and response of one slice."""
        scene = state.scene
        turned = tuple(state.positions.items())
        key = (Identity(scene), state.nodes, turned, state.loop, axis, at)

        def build() -> tuple[Grid, ErrorBasis]:
            workspace = scene.workspace.moved(state.positions)
            grid = build_slice(scene.model, workspace, axis, at, state.nodes)
            return grid, grid_basis(scene, grid, scene.view(state.loop))

        return self._cache.get(key, build, _size)


def draw_slice(
    state: AppState, axis: str, at: float, grid: Grid, field: ErrorField, exaggeration: float
) -> SliceMap:
    """Colour and displace the nodes of a slice as a state is looked at."""
    drawn = deform(field.nominal_mm, field.error_um, exaggeration)
    return SliceMap(axis, at, grid, field, shown_values(state, field), drawn)


def _size(held: tuple[Grid, ErrorBasis]) -> int:
    """Bytes of a kept slice, about."""
    _, basis = held
    return basis.position.nbytes + basis.orientation.nbytes
