"""The field that a table of compensation leaves on the machine of a state, errors as they are now.

What does not depend on the errors (what the controller adds, where the axes stand then) is kept, as
the first-order responses are; a slider move is then one evaluation of the exact chain.
"""

from typing import TYPE_CHECKING

from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.field.basis import ErrorField
from warpspace.field.grid import Grid
from warpspace.geometry.traces import TraceGroup
from warpspace.kinematics.model import Coordinates, Loop
from warpspace.units import Array

if TYPE_CHECKING:
    from warpspace.formats.compensation.controller import Corrected

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
        """Evaluate a field with the errors that take part."""
        controller, scene = state.controller, state.scene
        if controller is None:
            return None
        key = (Identity(controller), what, Identity(scene.model), _spelled(state), loop)
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
