"""Which axis is played, and where the traced points are while it turns."""

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
    here = state.positions.get(axis, low)
    if high - low >= 360.0:
        return {axis: low + (here - low + angle_deg) % 360.0}
    swing = (here - low + 2.0 * (high - low) * angle_deg / 360.0) % (2.0 * (high - low))
    return {axis: low + (swing if swing <= high - low else 2.0 * (high - low) - swing)}


def points_on_traces(picture: LivePicture, position: dict[str, float]) -> tuple[Array, Array]:
    """Find where the traced points are at a position of the played axis.

    Parameters
    ----------
    picture : LivePicture
    position : dict of str to float, degrees
        As `played_position` gives it.

    Returns
    -------
    tuple of ndarray, [n, 3], mm
        Nominal, and as drawn: on the circles of the picture, one a trace over that axis.
    """
    nominal: list[Array] = []
    actual: list[Array] = []
    for lines in picture.traces:
        for number, trace in enumerate(lines.group.traces):
            if trace.axis in position:
                sweep = lines.group.coordinates[trace.axis][number]
                nominal.append(_at(lines.nominal_mm[number], sweep, position[trace.axis]))
                actual.append(_at(lines.actual_mm[number], sweep, position[trace.axis]))
    if not nominal:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return np.stack(nominal), np.stack(actual)


def _at(line_mm: Array, sweep: Array, position: float) -> Array:
    """Interpolate a trace at a position of its axis, [3]."""
    return np.array([np.interp(position, sweep, line_mm[:, i]) for i in range(3)])
