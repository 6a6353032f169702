"""The error motion of the axis that is looked at: three polar plots and their numbers."""

from warpspace.analysis.axis_motion import AxisMotion
from warpspace.app.readouts.html import message, render
from warpspace.picture.polar import PolarPlot, polar_plot, turn_words
from warpspace.units import Array

NOTHING_MOVED = (
    "No error moves the traced points: all errors of the axes that carry them are zero or"
    " excluded. Set one, for instance a translation error of a rotary axis, and the traces appear."
)
TRACES_OFF = "Traces are switched off (C switches them on)."
ON_THE_AXIS = "The point lies on the axis: it has no direction that deviations could be taken in."
MARKS = {
    "radial": "towards the point",
    "axial": "along the axis",
    "tilt": "leans to the point",
}
"""What is positive."""


def no_motion(*, shown: bool, nominal: bool) -> str:
    """Say why there is no polar plot.

    Parameters
    ----------
    shown : bool
        Whether traces are switched on.
    nominal : bool
        Whether it is since no error moves a trace.
    """
    text = (NOTHING_MOVED if nominal else ON_THE_AXIS) if shown else TRACES_OFF
    return message(text, "polar none", small=True)


def polar_html(motion: AxisMotion, name: str) -> str:
    """Draw and spell an error motion.

    Parameters
    ----------
    motion : AxisMotion
    name : str
        Of the trace.

    Returns
    -------
    str
        HTML.
    """
    plots = [(part, polar_plot(part, motion.angle_deg)) for part in motion.motions]
    return render(
        "polar",
        name=name,
        closed=motion.closed,
        plots=[(part, plot, _path(plot.curve), _path(plot.about_line)) for part, plot in plots],
        marks=MARKS,
        ring_words=_ring_words,
        turn_words=turn_words,
    )


def _path(points: Array) -> str:
    """Spell a line for SVG, whose y points down."""
    return "M" + "L".join(f"{x:.3f} {-y:.3f}" for x, y in points)


def _ring_words(plot: PolarPlot, unit: str) -> str:
    """Say how far rings are apart."""
    return f"rings {plot.ring:g} {unit}"
