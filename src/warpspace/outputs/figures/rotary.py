"""Error motions of the rotary axes as a figure: one row an axis."""

from collections.abc import Sequence

from warpspace.exceptions import OptionError
from warpspace.outputs.charts.paper import on_ground
from warpspace.outputs.charts.polar import axis_motion_chart
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figures.charts import finish_chart
from warpspace.picture.axis_motion import evaluate_axis_motion, name_trace
from warpspace.picture.traces import TraceLine, evaluate_traces, trace_lines
from warpspace.scene.model import Scene


def draw_rotary(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:  # noqa: ARG001
    """Draw radial, axial and tilt error motion of every rotary axis of a scene.

    Each is drawn for the first traced point of the scene, with the other axes where they stand.

    Parameters
    ----------
    scenes : sequence of Scene, (1,)
    settings : FigureSettings
    exact : bool
        Whether the figure becomes pixels of its own size.

    Returns
    -------
    Drawing

    Raises
    ------
    OptionError
        If the machine has no rotary axis, or the scene no points to trace.
    """
    scene = scenes[0]
    chosen = first_lines(scene)
    if not chosen:
        raise OptionError(
            f"figure 'rotary': {scene.name} has no traces; expected a machine with a rotary axis"
            " and points in [points_mm] traces"
        )
    motions = {name_trace(line.trace): evaluate_axis_motion(scene, line) for line in chosen}
    title = f"Error motions of the rotary axes: {scene.title}"
    with on_ground(settings.theme):
        figure = axis_motion_chart(motions, "Error motions of the rotary axes", scene.title)
    return finish_chart(figure, title, scene, settings, "rotary")


def first_lines(scene: Scene) -> list[TraceLine]:
    """Give one trace of every rotary axis: of the first point, the other axes where they stand."""
    stands = scene.workspace.positions
    found: dict[str, TraceLine] = {}
    for line in trace_lines(evaluate_traces(scene, 1.0)):
        here = all(stands.get(axis, 0.0) == at for axis, at in line.trace.at.items())
        if here:
            found.setdefault(line.trace.axis, line)
    return list(found.values())
