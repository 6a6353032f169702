"""Slices of a state: grids of their own with their own responses, kept while they stay in place."""

from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.compensated import CompensatedSource
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import slice_positions
from warpspace.field.basis import ErrorBasis
from warpspace.field.grid import Grid
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.slices import build_slice
from warpspace.picture.slices import Slice
from warpspace.scene.pipeline import grid_basis
from warpspace.units import Array

CACHE_BYTES = 60_000_000


class SliceSource:
    """Slices of states; usable from any thread.

    Parameters
    ----------
    compensated : CompensatedSource
    """

    def __init__(self, compensated: CompensatedSource) -> None:
        self._compensated = compensated
        self._bases: Cache[tuple[Grid, ErrorBasis]] = Cache(CACHE_BYTES)

    def slices(
        self, state: AppState, amplitudes: Array, exaggeration: float, colours: ColourScale | None
    ) -> tuple[Slice, ...]:
        """Evaluate the slices of a state; none where it does not show any.

        Parameters
        ----------
        state : AppState
        amplitudes : ndarray, [K], µm or µrad
        exaggeration : float
        colours : ColourScale or None
            Those of the volume.

        Returns
        -------
        tuple of Slice
        """
        if state.look.surface != "slices":
            return ()
        found: list[Slice] = []
        for axis, at in slice_positions(state.scene, state.look, state.machine).items():
            grid, basis = self._basis(state, axis, at)
            field = self._compensated.field(state, grid)
            if field is None:
                field = basis.evaluate(amplitudes, orientation=state.look.tilts)
            found.append(
                Slice(
                    view=state.scene.view(state.loop),
                    grid=grid,
                    field=field,
                    exaggeration=exaggeration,
                    component=state.component,
                    quantity=state.look.quantity,
                    colours=colours,
                    axis=axis,
                    position_mm=at,
                )
            )
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

        return self._bases.get(key, build, _size)


def _size(held: tuple[Grid, ErrorBasis]) -> int:
    """Bytes of a kept slice, about."""
    _, basis = held
    return basis.position.nbytes + basis.orientation.nbytes
