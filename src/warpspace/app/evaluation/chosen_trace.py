"""Which of the traces is looked at: the one chosen, as long as an error moves it."""

from dataclasses import replace

from warpspace.analysis.axis_motion import AxisMotion, subtract_motions
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.evaluation.rotation import played_axis
from warpspace.app.state.app_state import AppState
from warpspace.picture.axis_motion import evaluate_axis_motion, is_moved, name_trace
from warpspace.picture.traces import TraceLine, trace_lines


def moved_traces(picture: LivePicture) -> dict[str, TraceLine]:
    """Give the traces that an error moves, by name.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    dict of str to TraceLine
        Empty where traces are switched off.
    """
    if not picture.state.shown.traces:
        return {}
    return {name_trace(line.trace): line for line in trace_lines(picture.traces) if is_moved(line)}


def chosen_trace(picture: LivePicture, moved: dict[str, TraceLine] | None = None) -> str:
    """Name the trace that is looked at; empty where no error moves one.

    Parameters
    ----------
    picture : LivePicture
    moved : dict of str to TraceLine, optional
        As `moved_traces` gives them.

    Returns
    -------
    str
        The one chosen. Where that is none of them: the first over the axis next to the point, with
        the other axes where they stand.
    """
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
    """Evaluate how the axis of a trace runs, with the errors that take part.

    Parameters
    ----------
    picture : LivePicture
    line : TraceLine
        One of the picture.

    Returns
    -------
    AxisMotion or None
        Of a difference of two states B − A; None where the point lies on the axis.
    """
    if picture.compared is None or not picture.is_difference:
        return _of_state(picture.drawn_state, line)
    one, other = (_of_state(side, line) for side in picture.compared.sides)
    return None if one is None or other is None else subtract_motions(other, one)


def _of_state(state: AppState, line: TraceLine) -> AxisMotion | None:
    """Evaluate how an axis runs in a state."""
    scene = active_scene(state)
    return evaluate_axis_motion(replace(scene, trace_points_mm=(line.trace.point_mm,)), line)
