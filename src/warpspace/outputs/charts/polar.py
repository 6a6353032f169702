"""Polar plots of the error motions of rotary axes."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from warpspace.analysis.axis_motion import AxisMotion, Motion
from warpspace.outputs.charts.paper import SMALL, TEXT, ground, key_colour, sheet, style
from warpspace.picture.polar import PolarPlot, polar_plot, turn_words

WIDTH_IN, ROW_IN, FOOT_IN = 9.0, 3.85, 0.95
POSITIVE = {
    "radial": "+ towards the point",
    "axial": "+ along the axis",
    "tilt": "+ axis leans towards the point",
}
DASHES = (0, (4, 3))


def axis_motion_chart(
    motions: Mapping[str, AxisMotion | None], title: str, subtitle: str
) -> Figure:
    """Draw radial, axial and tilt error motion of several traces, one row a trace.

    Parameters
    ----------
    motions : mapping of str to AxisMotion or None
        By name of the trace; None where its point lies on the axis.
    title, subtitle : str

    Returns
    -------
    Figure
    """
    height = 0.85 + ROW_IN * max(len(motions), 1) + FOOT_IN
    with style():
        figure, top = sheet(WIDTH_IN, height, title, subtitle)
        row = ROW_IN / height
        for number, (name, motion) in enumerate(motions.items()):
            upper = top - number * row
            figure.text(0.035, upper, name, size=TEXT, weight="bold", va="top")
            if motion is None:
                figure.text(0.035, upper - 0.3 / height, "The point lies on the axis.", size=TEXT,
                            color=ground().muted, va="top")  # fmt: skip
                continue
            for place, part in enumerate(motion.motions):
                box = (0.02 + place / 3.1, upper - row + 0.95 / height, 0.31, 2.65 / height)
                _draw(figure, figure.add_axes(box), part, motion)
        _explain(figure, height)
        return figure


def _draw(figure: Figure, axes: Axes, part: Motion, motion: AxisMotion) -> None:
    """Draw one plot with its numbers below."""
    plot = polar_plot(part, motion.angle_deg)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(-1.2, 1.2)
    axes.set_ylim(-1.2, 1.2)
    _rings(axes, plot)
    axes.plot(*plot.about_line.T, color=ground().accent, linewidth=1.1, linestyle=DASHES)
    axes.plot(*plot.curve.T, color=key_colour(), linewidth=2.0)
    turns = turn_words(part.times_a_turn) if motion.closed else "an arc"
    rows = (
        (f"{part.iso}, {POSITIVE[part.name]}", TEXT, ground().ink),
        (f"peak to valley {part.peak_to_valley:.2f} {part.unit}, {turns}", SMALL, ground().ink),
        (f"about the average line {part.motion_value:.2f} {part.unit}", SMALL, ground().ink),
        (f"rings {plot.ring:g} {part.unit}" if plot.varies else "no deviation", SMALL,
         ground().muted),
    )  # fmt: skip
    box = axes.get_position()
    height = figure.get_size_inches()[1]
    for number, (text, size, colour) in enumerate(rows):
        figure.text(
            box.x0 + box.width / 2.0, box.y0 - (0.02 + 0.19 * number) / height, text,
            size=size - 0.5, color=colour, ha="center", va="top",
        )  # fmt: skip


def _rings(axes: Axes, plot: PolarPlot) -> None:
    """Draw the circle of no deviation, rings around it, and the positions of the axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    for value, radius in plot.rings:
        colour, width = (ground().ink, 1.1) if value == 0.0 else (ground().faint, 0.8)
        axes.plot(radius * np.cos(angle), radius * np.sin(angle), color=colour, linewidth=width)
    for degrees in (0, 90, 180, 270):
        x, y = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        axes.plot([0.0, x], [0.0, y], color=ground().faint, linewidth=0.8)
        axes.text(1.1 * x, 1.08 * y, f"{degrees}°", size=SMALL - 1.0, color=ground().muted,
                  ha="center", va="center")  # fmt: skip


def _explain(figure: Figure, height: float) -> None:
    """Say what the lines mean."""
    figure.legend(
        handles=[
            Line2D([], [], color=key_colour(), linewidth=2.0, label="actual − nominal"),
            Line2D([], [], color=ground().accent, linewidth=1.1, linestyle=DASHES,
                   label="about the axis average line"),
            Line2D([], [], color=ground().ink, linewidth=1.1, label="no deviation"),
        ],
        loc="lower left", bbox_to_anchor=(0.02, 0.42 / height), ncols=3, frameon=False,
        fontsize=TEXT,
    )  # fmt: skip
    figure.text(
        0.035, 0.26 / height,
        "Deviation over the position of the axis, at the height of the point and in its direction,"
        " which turns with it (ISO 230-7).",
        size=SMALL, color=ground().muted,
    )  # fmt: skip
