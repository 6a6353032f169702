"""Which axis is played and where the traced points are meanwhile; which trace is looked at."""

from collections.abc import Mapping

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.units import Array


def played_axis(state: AppState) -> str | None:
    """Name the rotary axis next to the workpiece, or to the tool; None where there is none."""
    for side in ("workpiece", "tool"):
        rotary = [axis.name for axis in state.scene.machine.branch(side) if not axis.is_linear]
        if rotary:
            return rotary[-1]
    return None


def played_position(state: AppState, angle_deg: float) -> dict[str, float]:
    """Give the played axis' position after an angle, degrees, kept within its travel.

    An axis that cannot go round swings to and fro over its travel.
    """
    axis = played_axis(state)
    if axis is None:
        return {}
    low, high = state.scene.machine.axes[axis].travel
    start, span = state.positions.get(axis, low) - low, high - low
    if span >= 360.0:
        return {axis: low + (start + angle_deg) % 360.0}
    swing = (start + 2.0 * span * angle_deg / 360.0) % (2.0 * span)
    return {axis: low + min(swing, 2.0 * span - swing)}


def points_on_traces(picture: LivePicture, position: Mapping[str, float]) -> tuple[Array, Array]:
    """Find where the traced points are at a position of the played axis, [n, 3] each, mm."""
    found: list[Array] = []
    for lines in picture.traces:
        for number, trace in enumerate(lines.group.traces):
            if trace.axis in position:
                sweep, at = lines.group.coordinates[trace.axis][number], position[trace.axis]
                both = np.concatenate([lines.nominal_mm[number], lines.actual_mm[number]], axis=1)
                found.append(np.array([np.interp(at, sweep, column) for column in both.T]))
    points = np.reshape(found, (-1, 6))
    return points[:, :3], points[:, 3:]


def chosen_trace(picture: LivePicture) -> str:
    """Name the trace that is looked at, as long as an error moves it; empty where none does."""
    state, moved = picture.state, picture.moved_traces
    if state.rotary.chosen in moved:
        return state.rotary.chosen
    played = played_axis(state)

    def rank(name: str) -> tuple[bool, bool]:
        trace = moved[name].trace
        stands = all(state.positions.get(axis) == at for axis, at in trace.at.items())
        return trace.axis != played, not stands

    return min(moved, key=rank, default="")
