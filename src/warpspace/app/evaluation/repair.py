"""Repairs of what is shown: what is asked, the answer, and the states before and after."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.adjusting import Objective
from warpspace.analysis.options import ALL
from warpspace.analysis.repair import Repair, RepairResult, find_repairs
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.compare import plain_state, with_before
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import Side
from warpspace.field.evaluate import View
from warpspace.field.grid import build_grid
from warpspace.machine.axes import parameter
from warpspace.scene.model import Scene, grid_basis
from warpspace.units import spell

BEFORE = "before repair"


@dataclass(frozen=True, slots=True)
class Question:
    """All that an answer depends on; equal questions have equal answers."""

    scene: Identity  # scene with machine and curves; its amplitudes are not used
    amplitudes: tuple[tuple[str, float], ...]  # µm or µrad; errors that are not excluded
    positions: tuple[tuple[str, float], ...]  # degrees; where the rotary axes stand
    view: View
    nodes: int
    objective: Objective
    any_error: bool  # whether errors other than squareness and alignment are adjusted, too
    limit: float  # µm or µrad

    def answer(self) -> RepairResult:
        """Find the repairs; takes from a tenth of a second to some seconds."""
        scene: Scene = self.scene.thing
        grid = build_grid(scene.model, scene.workspace.moved(dict(self.positions)), self.nodes)
        keys = tuple(key for key, _ in self.amplitudes)
        basis = grid_basis(scene, grid, self.view, keys)
        asked = Repair(
            loop=self.view.loop,
            objective=self.objective,
            adjustable=(ALL,) if self.any_error else (),
            limit=((ALL, self.limit),),
            grid=self.nodes,
        )
        values = np.array([value for _, value in self.amplitudes])
        return find_repairs(basis, grid, values, asked, scene)


def ask(state: AppState, objective: Objective, *, any_error: bool, limit: float) -> Question:
    """Ask what repairs a state; excluded errors neither act nor are adjusted."""
    active = {k: v for k, v in state.amplitudes.items() if state.exclusions.active(k)}
    return Question(
        Identity(state.scene),
        tuple(active.items()),
        tuple(state.positions.items()),
        state.view(),
        state.nodes,
        objective,
        any_error,
        limit,
    )


def with_adjusted(state: AppState, adjust: Mapping[str, float]) -> AppState:
    """Give some errors other amplitudes, µm or µrad; their sliders grow where that is needed."""
    for key, value in adjust.items():
        if key in state.amplitudes:
            state = edits.with_typed_amplitude(state, key, value)
    return state


def with_preview(state: AppState, adjust: Mapping[str, float]) -> AppState:
    """Compare what is steered with the same after a repair, and draw the latter."""
    after = Side(_after_words(adjust), with_adjusted(plain_state(state), adjust))
    comparison = replace(state.comparison, a=Side(), b=after, shown="b")
    return replace(state, comparison=comparison)


def with_repair(state: AppState, adjust: Mapping[str, float]) -> AppState:
    """Apply a repair; the state before it stays as the other side of a comparison."""
    return with_adjusted(with_before(state, Side(BEFORE, plain_state(state))), adjust)


def _after_words(adjust: Mapping[str, float]) -> str:
    parts = ", ".join(f"{key} {spell(v)} {parameter(key).unit}" for key, v in adjust.items())
    return f"after repair: {parts}"
