"""The scene that a state amounts to: what is saved, drawn as a figure, and exported."""

from dataclasses import replace

from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import curve_of
from warpspace.app.state.specification import START_UM
from warpspace.machine.errors import ErrorSet
from warpspace.scene.model import Scene


def scene_of(state: AppState) -> Scene:
    """Give the scene that a state amounts to: amplitudes, curves, positions, tolerances, factor."""
    scene = state.scene
    keys = [
        key for key in state.amplitudes if state.amplitudes[key] or key in scene.errors.functions
    ]
    moved = {
        axis: value
        for axis, value in state.positions.items()
        if value != scene.workspace.positions.get(axis)
    }
    limit = state.specification.limit_um
    return replace(
        scene,
        errors=ErrorSet({key: curve_of(state, key) for key in keys}),
        workspace=scene.workspace.moved(moved) if moved else scene.workspace,
        tolerances=state.tolerances,
        exaggeration=state.exaggeration,
        placed=state.placed,
        limit_um=None if scene.limit_um is None and limit == START_UM else limit,
    )


def active_scene(state: AppState) -> Scene:
    """Give the scene as it is drawn: what is excluded is left out."""
    return scene_of(replace(state, amplitudes=dict(state.active)))
