"""Polar plot of a circular test like figures 5-3, 5-9 and 5-14 of the thesis."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from warpspace.analysis.distribution import round_width
from warpspace.bench.ballbar import Ballbar
from warpspace.outputs.charts.paper import SMALL, TEXT, ground, key_colour, sheet, style
from warpspace.units import Array

WIDTH_IN, HEIGHT_IN = 9.0, 6.6
NOMINAL = 1.0
"""Radius the nominal circle is drawn with."""
LEAST_UM = 0.03
"""Deviations below it are drawn as none."""
REACH = 0.34
"""Drawn share of it that the largest deviation takes, at most."""


def ballbar_chart(result: Ballbar, title: str, subtitle: str) -> Figure:
    """Draw the radial deviation, magnified, on the nominal circle.

    Parameters
    ----------
    result : Ballbar
    title, subtitle : str

    Returns
    -------
    Figure
    """
    with style():
        figure, top = sheet(WIDTH_IN, HEIGHT_IN, title, subtitle)
        axes = figure.add_axes((0.03, 0.03, 0.62, top - 0.04))
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(-1.55, 1.55)
        axes.set_ylim(-1.55, 1.55)
        largest = max(float(np.abs(result.radial_um).max()), LEAST_UM)
        # The largest deviation takes between a fifth and a half of three rings.
        ring_um = round_width(largest / 3.0)
        per_um = REACH / (3.0 * ring_um)
        _rings(axes, ring_um, per_um)
        _axes_names(axes, result.plane)
        angle = np.deg2rad(np.append(result.angle_deg, 360.0))
        radial = np.append(result.radial_um, result.radial_um[0])
        axes.plot(*_polar(angle, NOMINAL + per_um * radial), color=key_colour(), linewidth=2.0)
        fitted = result.radius_um + _squareness_um(result, angle)
        axes.plot(
            *_polar(angle, NOMINAL + per_um * fitted),
            color=ground().accent,
            linewidth=1.1,
            linestyle=(0, (4, 3)),
        )
        _numbers(figure, result, ring_um, per_um)
        return figure


def _squareness_um(result: Ballbar, angle: Array) -> Array:
    """Part of the trace that squareness alone would give, µm."""
    sign = 1.0 if result.plane == "XZ" else -1.0
    amplitude = sign * result.squareness_urad * result.radius_mm * 1e-3 / 2.0
    return amplitude * np.sin(2.0 * angle)


def _polar(angle: Array, radius: Array | float) -> tuple[Array, Array]:
    """Turn polar coordinates into those of the drawing."""
    return radius * np.cos(angle), radius * np.sin(angle)


def _rings(axes: Axes, ring_um: float, per_um: float) -> None:
    """Draw the nominal circle and rings of round deviations with their values."""
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    for step in range(-3, 4):
        colour = ground().ink if step == 0 else ground().faint
        width = 1.1 if step == 0 else 0.8
        radius = NOMINAL + per_um * ring_um * step
        axes.plot(*_polar(angle, radius), color=colour, linewidth=width)
        x, y = 0.0, radius
        axes.text(
            x,
            y,
            f"{step * ring_um:+g}" if step else "0",
            size=SMALL - 1.0,
            color=ground().muted,
            ha="center",
            va="center",
            bbox={"facecolor": ground().paper, "edgecolor": "none", "pad": 0.6},
        )


def _axes_names(axes: Axes, plane: str) -> None:
    """Draw the two axes of the plane through the centre."""
    reach = NOMINAL + REACH + 0.03
    for name, (x, y) in zip(plane, ((1.0, 0.0), (0.0, 1.0)), strict=True):
        axes.plot(
            [-reach * x, reach * x], [-reach * y, reach * y], color=ground().faint, linewidth=0.8
        )
        for sign, mark in ((1.0, "+"), (-1.0, "−")):
            axes.text(
                sign * (reach + 0.08) * x,
                sign * (reach + 0.08) * y,
                f"{mark}{name}",
                ha="center",
                va="center",
                weight="bold",
                size=TEXT,
            )


def _numbers(figure: Figure, result: Ballbar, ring_um: float, per_um: float) -> None:
    """Write the result beside the plot."""
    left, y = 0.67, 0.80
    rows = (
        ("circular deviation G", f"{result.circular_deviation_um:.2f} µm"),
        (f"squareness {result.squareness_key}", f"{result.squareness_urad:+.2f} µrad"),
        (f"{result.squareness_key} put in", f"{result.given_urad:+.2f} µrad"),
        ("mean radius − nominal", f"{result.radius_um:+.2f} µm"),
        (
            f"{result.plane[0]} longer than {result.plane[1]}",
            f"{result.scale_difference_um:+.2f} µm",
        ),
        (
            f"centre {result.plane[0]}, {result.plane[1]}",
            f"{result.centre_um[0]:+.1f}, {result.centre_um[1]:+.1f} µm",
        ),
    )
    for name, value in rows:
        figure.text(left, y, name, size=TEXT, color=ground().muted)
        figure.text(0.975, y, value.replace("-", "−"), size=TEXT, weight="bold", ha="right")
        y -= 0.045
    factor = per_um * result.radius_mm * 1e3
    y -= 0.02
    notes = (
        f"deviations magnified {_round(factor):,.0f} times;",
        f"rings {ring_um:g} µm apart, 0 = nominal radius.",
        "Centre: least squares, taken out (ISO 230-4).",
        "Clockwise and counter-clockwise runs coincide:",
        "the model has no backlash or following error.",
    )
    for text in notes:
        figure.text(left, y, text, size=SMALL, color=ground().muted)
        y -= 0.034
    figure.legend(
        handles=[
            Line2D([], [], color=key_colour(), linewidth=2.0, label="radial deviation"),
            Line2D(
                [],
                [],
                color=ground().accent,
                linewidth=1.1,
                linestyle=(0, (4, 3)),
                label="mean radius and squareness alone",
            ),
        ],
        loc="upper left",
        bbox_to_anchor=(left - 0.01, y),
        frameon=False,
        fontsize=TEXT,
    )


def _round(value: float) -> float:
    """Round to two significant digits, for words."""
    digits = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(np.round(value / digits) * digits)
