"""One error along its axis: its curves, their standard uncertainty and the readings behind them."""

from typing import Any

import numpy as np

from warpspace.machine.errors import ErrorSet
from warpspace.machine.measurement import BACKWARD, Measurement
from warpspace.outputs.drawing.canvas import Canvas
from warpspace.outputs.drawing.sheet import LegendEntry
from warpspace.scene.model import Scene
from warpspace.units import Array

SECTION_DASHES = (":", "-", "-.")
"""Of the sections of an error with a second axis: at its first, middle and last position."""
DOT = 5.0
"""Radius of a reading in the legend."""
UNCERTAIN = 0.18
"""Opacity of a band of uncertainty."""
FEW_READINGS = 5000
"""Readings that are drawn at most, evenly picked from all."""


def draw_error(
    axes: Any, scene: Scene, key: str, at: Array, colour: str, width: float, dot: float
) -> float:
    """Draw the curves of an error that is not a single plain one, its uncertainty and readings.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    scene : Scene
    key : str
    at : ndarray, [n], mm or degrees
        Positions of its axis.
    colour : str
    width, dot : float, points
        Of lines and of readings.

    Returns
    -------
    float, µm or µrad
        Largest magnitude drawn.
    """
    function = scene.errors.functions.get(key)
    lines = () if function is None or len(function.lines) == 1 else function.lines
    reach = 0.0
    for number, (words, line) in enumerate(lines):
        values = line.evaluate(at)
        style = _dashes(words, number, len(lines))
        axes.plot(at, values, style, color=colour, linewidth=0.6 * width, zorder=3.0)
        reach = max(reach, float(np.abs(values).max()))
    if key in scene.uncertainty:
        middle = scene.errors.evaluate(key, at)
        half = scene.uncertainty[key].evaluate(at)
        axes.fill_between(
            at, middle - half, middle + half, color=colour, alpha=UNCERTAIN, linewidth=0.0,
            zorder=1.0,
        )  # fmt: skip
        reach = max(reach, float(np.abs(middle).max() + half.max()))
    if key in scene.measured:
        reach = max(reach, _draw_readings(axes, scene.measured[key], colour, dot))
    return reach


def _dashes(words: str, number: int, count: int) -> str:
    """Choose the dashes of one curve of several."""
    if words.startswith("backward"):
        return "--"
    return "-" if words.startswith("forward") else SECTION_DASHES[number % count % 3]


def _draw_readings(axes: Any, measurement: Measurement, colour: str, dot: float) -> float:
    """Draw readings: full dots, open ones of backward runs; their largest magnitude."""
    reach = 0.0
    for way, points in measurement.scatter.items():
        step = max(1, -(-len(points) // FEW_READINGS))
        axes.plot(
            points[::step, 0], points[::step, 1], linestyle="none", marker="o", markersize=dot,
            color=colour, fillstyle="none" if way == BACKWARD else "full",
            markeredgewidth=0.3 * dot, alpha=0.8, zorder=4.0,
        )  # fmt: skip
        reach = max(reach, float(np.abs(points[:, 1]).max()))
    return reach


def line_legend(scene: Scene) -> list[LegendEntry]:
    """Build the legend of what `draw_error` draws of a scene."""
    entries: list[LegendEntry] = []
    if scene.errors.has_directions:
        entries += [
            LegendEntry(_dashed(None), "forward"),
            LegendEntry(_dashed((5.0, 3.0)), "backward"),
        ]
    if _sections(scene.errors):
        entries.append(LegendEntry(_dashed((1.6, 3.0)), "at the ends of its second axis"))
    if scene.uncertainty:
        entries.append(LegendEntry(_band, "± standard uncertainty"))
    if scene.measured:
        entries.append(LegendEntry(_dots, "reading, open where backward"))
    return entries


def _sections(errors: ErrorSet) -> bool:
    """Tell whether an error depends on a second axis."""
    return any(len(errors.arguments(key)) > 1 for key in errors)


def _dashed(dashes: tuple[float, float] | None) -> Any:
    """Show a line of a style."""

    def draw(canvas: Canvas, x: float, y: float, width: float) -> None:
        canvas.line(
            [(x, y), (x + width, y)], width=1.6, colour=canvas.theme.series[0], dashes=dashes
        )

    return draw


def _band(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a band of uncertainty."""
    height = canvas.px(14.0)
    canvas.rectangle(
        x, y - height / 2, width, height, facecolor=canvas.theme.series[0], alpha=UNCERTAIN,
        edgecolor="none",
    )  # fmt: skip


def _dots(canvas: Canvas, x: float, y: float, width: float) -> None:
    """Show a reading forward, and one backward."""
    for share, open_at in ((0.3, 0.0), (0.7, 0.6)):
        centre = np.array([x + share * width, y])
        canvas.disc(centre, DOT, canvas.theme.series[0])
        canvas.disc(centre, open_at * DOT, canvas.theme.paper)
