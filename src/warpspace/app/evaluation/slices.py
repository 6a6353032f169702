"""Slices of a state: grids of their own with their own responses, kept while they stay in place."""

from typing import TYPE_CHECKING

from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import slice_positions
from warpspace.field.evaluate import ErrorBasis, ErrorField
from warpspace.field.grid import Grid, build_slice
from warpspace.geometry.colour import ColourScale
from warpspace.geometry.traces import TraceGroup
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.picture.model import Slice
from warpspace.scene.model import grid_basis
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Corrected


# --------------------------------------------------------------------------------------------------
# The field that a table of compensation leaves on the machine of a state, errors as they are now.
#
# What does not depend on the errors (what the controller adds, where the axes stand then) is kept,
# as the first-order responses are; a slider move is then one evaluation of the exact chain.

CACHE_BYTES = 60_000_000


class CompensatedSource:
    """Fields after a compensation; usable from any thread."""

    def __init__(self) -> None:
        self._kept: Cache[Corrected] = Cache(CACHE_BYTES)

    def field(self, state: AppState, grid: Grid) -> ErrorField | None:
        """Evaluate the field over a grid; None where no table corrects the state."""
        key = Identity(grid)
        return self._field(state, key, grid.coordinates, grid.nominal_mm, state.loop)

    def trace(self, state: AppState, group: TraceGroup) -> ErrorField | None:
        """Evaluate traces of rotary axes; None where no table corrects the state."""
        at, key = group.nominal_mm, Identity(group)
        return self._field(state, key, group.coordinates, at, group.loop, at)

    def _field(
        self,
        state: AppState,
        what: Identity,
        coordinates: Coordinates,
        nominal_mm: Array,
        loop: Loop,
        point_mm: Array | None = None,
    ) -> ErrorField | None:
        controller, scene = state.controller, state.scene
        if controller is None:
            return None
        key = (Identity(controller), what, Identity(scene.model), _spelled(state), loop, state.seen)
        kept = self._kept.get(
            key,
            lambda: controller.at(coordinates, nominal_mm, active_scene(state), loop, point_mm),
            lambda found: found.nbytes,
        )
        return kept.field(active_scene(state).errors)


def _spelled(state: AppState) -> tuple[tuple[str, float], ...]:
    """Spell the reference point of a state as part of a key; empty for none."""
    scene = state.scene
    if scene.reference is None:
        return ()
    held = {**scene.workspace.positions, **state.positions, **scene.reference}
    return tuple(held.items())


class SliceSource:
    """Slices of states; usable from any thread."""

    def __init__(self, compensated: CompensatedSource) -> None:
        self._compensated = compensated
        self._bases: Cache[tuple[Grid, ErrorBasis]] = Cache(CACHE_BYTES)

    def slices(
        self, state: AppState, amplitudes: Array, exaggeration: float, colours: ColourScale | None
    ) -> tuple[Slice, ...]:
        """Evaluate the slices of a state; none where it does not show any."""
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

        return self._bases.get(key, build, _size)


def _size(held: tuple[Grid, ErrorBasis]) -> int:
    _, basis = held
    return basis.position.nbytes + basis.orientation.nbytes
