"""The error motion of a rotary axis along one of its traces, evaluated from the model."""

from collections.abc import Callable

import numpy as np

from warpspace.analysis.axis_motion import AxisMotion, axis_motion, points_on_axis
from warpspace.field.basis import ErrorField
from warpspace.field.evaluate import evaluate_first_order
from warpspace.geometry.traces import Trace, TraceGroup, build_traces
from warpspace.picture.traces import TraceLine
from warpspace.picture.words import spell_short
from warpspace.scene.model import Scene

Evaluate = Callable[..., ErrorField]
LEAST_RADIUS_MM = 1e-3
"""A point nearer to the axis is on it and has no direction from it."""
LEAST_UM = 1e-6
"""Traces with smaller errors are moved by none."""
SAMPLES = 181
"""Places of a turn: every two degrees."""


def is_moved(line: TraceLine) -> bool:
    """Tell whether any error moves a trace."""
    return line.largest_um > LEAST_UM


def name_trace(trace: Trace) -> str:
    """Name a trace: ``C at B −30°, point (275, 0, 0) mm``."""
    held = ", ".join(f"{axis} {spell_short(value)}°" for axis, value in trace.at.items())
    point = ", ".join(map(spell_short, trace.point_mm))
    return f"{trace.axis}{f' at {held}' if held else ''}, point ({point}) mm"


def evaluate_axis_motion(
    scene: Scene, line: TraceLine, evaluate: Evaluate = evaluate_first_order
) -> AxisMotion | None:
    """Evaluate the error motion of the axis that a trace is over.

    Parameters
    ----------
    scene : Scene
        Its errors count, and its reference point is held still.
    line : TraceLine
        Says which point is turned by which axis, and where the other axes stand.
    evaluate : callable, optional
        First order by default; `evaluate_exact` for comparison.

    Returns
    -------
    AxisMotion or None
        None where the point lies on the axis.
    """
    trace = line.trace
    found = build_traces(
        scene.model,
        (trace.point_mm,),
        {**scene.workspace.positions, **trace.at},
        SAMPLES,
        {name: (at,) for name, at in trace.at.items()},
    )
    for group in found:
        number = _number(group, line)
        if number is not None:
            return _of_group(scene, group, number, evaluate)
    return None


def _number(group: TraceGroup, line: TraceLine) -> int | None:
    """Find a trace in a group."""
    if group.loop is not line.loop or line.trace not in group.traces:
        return None
    return group.traces.index(line.trace)


def _of_group(
    scene: Scene, group: TraceGroup, number: int, evaluate: Evaluate
) -> AxisMotion | None:
    """Evaluate the error motion along one trace of a group."""
    nominal, trace = group.nominal_mm[number], group.traces[number]
    if np.ptp(nominal, axis=0).max() < LEAST_RADIUS_MM:
        return None
    coordinates = {
        name: values[number] if values.ndim == 2 else values
        for name, values in group.coordinates.items()
    }
    on_axis, above = (
        evaluate(scene.model, scene.errors, coordinates, scene.view(group.loop), point).error_um
        for point in points_on_axis(nominal)
    )
    return axis_motion(nominal, coordinates[trace.axis], on_axis, above, closed=trace.closed)
