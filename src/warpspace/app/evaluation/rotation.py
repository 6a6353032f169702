"""Which axis is played, and where the traced points are while it turns."""

from dataclasses import replace

import numpy as np

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.picture.traces import (
    TraceLine,
    evaluate_axis_motion,
    is_moved,
    name_trace,
    trace_lines,
)
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
    """Find where the traced points are at a position of the played axis."""
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
    return np.array([np.interp(position, sweep, line_mm[:, i]) for i in range(3)])


# --- Which of the traces is looked at: the one chosen, as long as an error moves it ---------------


def moved_traces(picture: LivePicture) -> dict[str, TraceLine]:
    """Give the traces that an error moves, by name."""
    if not picture.state.shown.traces:
        return {}
    return {name_trace(line.trace): line for line in trace_lines(picture.traces) if is_moved(line)}


def chosen_trace(picture: LivePicture, moved: dict[str, TraceLine] | None = None) -> str:
    """Name the trace that is looked at; empty where no error moves one."""
    moved = moved_traces(picture) if moved is None else moved
    state = picture.state
    if state.rotary.chosen in moved:
        return state.rotary.chosen
    played = played_axis(state)

    def rank(line: TraceLine) -> tuple[bool, bool]:
        at = line.trace.at.items()
        stands = all(state.positions.get(axis) == value for axis, value in at)
        return line.trace.axis != played, not stands

    return min(moved, key=lambda name: rank(moved[name]), default="")


def motion_of(picture: LivePicture, line: TraceLine) -> AxisMotion | None:
    """Evaluate how the axis of a trace runs, with the errors that take part."""
    if picture.compared is None or not picture.is_difference:
        return _of_state(picture.drawn_state, line)
    one, other = (_of_state(side, line) for side in picture.compared.sides)
    if one is None or other is None:
        return None
    radial, axial, tilt = (
        a.values - b.values for a, b in zip(other.motions, one.motions, strict=True)
    )
    turn = other.angle_deg, other.radius_mm
    return assemble_motion(*turn, (radial, axial, tilt), closed=other.closed)


def _of_state(state: AppState, line: TraceLine) -> AxisMotion | None:
    scene = active_scene(state)
    return evaluate_axis_motion(replace(scene, trace_points_mm=(line.trace.point_mm,)), line)
