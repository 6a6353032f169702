"""Scenes that results propose, as states: drawn beside what is shown, or in its place."""

from dataclasses import replace

from warpspace.app.evaluation.compare import plain_state, with_before
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.comparison import Side
from warpspace.scene.model import Scene

DIGITS = 3  # decimals of a proposed error, µm or µrad: a nanometre is nothing to be set


def applied(state: AppState, scene: Scene) -> AppState:
    """Give the state with the errors, tolerances and machine of a scene; the view stays."""
    own = state.scene
    if (
        scene.machine.axes != own.machine.axes
        or scene.workspace.volume_axes != own.workspace.volume_axes
    ):
        return state.with_scene(scene)
    fresh = start_state(scene)
    values = {key: round(value, DIGITS) for key, value in fresh.amplitudes.items()}
    kept = {
        key: value
        for key, value in state.amplitudes.items()
        if key in fresh.amplitudes and not state.exclusions.active(key)
    }
    start = {key: state.start.get(key, 0.0) for key in fresh.amplitudes}
    return replace(
        state, scene=replace(scene, title=own.title, name=own.name), loaded=state.origin,
        amplitudes={**values, **kept}, start=start,
        tolerances=scene.tolerances,
    )  # fmt: skip


def with_proposal(state: AppState, scene: Scene, title: str) -> AppState:
    """Compare what is steered with a proposal, and draw the latter."""
    after = Side(title, applied(plain_state(state), scene))
    return replace(state, comparison=replace(state.comparison, a=Side(), b=after, shown="b"))


def with_applied(state: AppState, scene: Scene, before: str) -> AppState:
    """Apply a proposal; the state before it stays as A of a comparison."""
    return applied(with_before(state, Side(before, plain_state(state))), scene)
