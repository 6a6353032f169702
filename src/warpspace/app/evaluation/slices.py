"""Slices of a state, and what a table of compensation leaves: kept while they stay in place."""

from typing import TYPE_CHECKING

from warpspace.app.evaluation.cache import Cache
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import slice_positions
from warpspace.field.evaluate import ErrorBasis, ErrorField
from warpspace.field.grid import Grid, build_slice
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.traces import TraceGroup
from warpspace.picture.model import Slice
from warpspace.scene.model import grid_basis
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Corrected

CACHE_BYTES = 60_000_000


class CompensatedSource:
    """Fields that a table leaves on the machine of a state; usable from any thread.

    What does not depend on the errors (what the controller adds, where the axes stand then) is
    kept, as the first-order responses are; a slider move is then one evaluation of the exact chain.
    """

    def __init__(self) -> None:
        self._kept: Cache[Corrected] = Cache(CACHE_BYTES)

    def field(self, state: AppState, of: Grid | TraceGroup) -> ErrorField | None:
        """Evaluate a grid, or traces of rotary axes; None where no table corrects the state."""
        controller, scene = state.controller, state.scene
        if controller is None:
            return None
        on_trace = isinstance(of, TraceGroup)
        loop, point_mm = (of.loop, of.nominal_mm) if on_trace else (state.loop, None)
        held = tuple((scene.reference or {}).items()), tuple(state.positions.items())
        key = Identity(controller), Identity(of), Identity(scene.model), held, loop, state.seen
        kept = self._kept.get(
            key,
            lambda: controller.at(
                of.coordinates, of.nominal_mm, state.active_scene(), loop, point_mm
            ),
            lambda found: found.nbytes,
        )
        return kept.field(state.active_scene().errors)


class SliceSource:
    def __init__(self, compensated: CompensatedSource) -> None:
        self._compensated = compensated
        self._bases: Cache[tuple[Grid, ErrorBasis]] = Cache(CACHE_BYTES)

    def slices(
        self, state: AppState, amplitudes: Array, exaggeration: float, colours: ColourScale | None
    ) -> tuple[Slice, ...]:
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
                    view=state.view(),
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
        scene = state.scene
        turned = tuple(state.positions.items())
        key = (Identity(scene), state.nodes, turned, state.seen, axis, at)

        def build() -> tuple[Grid, ErrorBasis]:
            workspace = scene.workspace.moved(state.positions)
            grid = build_slice(scene.model, workspace, axis, at, state.nodes)
            return grid, grid_basis(scene, grid, state.view())

        return self._bases.get(key, build, lambda held: 2 * held[1].position.nbytes)
