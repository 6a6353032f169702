"""The length that a picture is sized by: labels, markers, axes, the display factor."""

import math

from warpspace.field.grid import Grid
from warpspace.scene.model import Scene

LEAST_SIZE_MM = 100.0
"""Of a single point without traces, on a machine without linear axes."""


def picture_size_mm(scene: Scene, grid: Grid) -> float:
    """Choose the length that a picture of a scene is sized by.

    Parameters
    ----------
    scene : Scene
    grid : Grid

    Returns
    -------
    float, mm
        Longest edge of the working volume. Where the volume is a single point: the diameter of the
        largest circle that a traced point can run on, else the longest travel of a linear axis,
        else 100 mm.
    """
    if grid.longest_edge_mm > 0.0:
        return grid.longest_edge_mm
    axes = scene.machine.axes.values()
    if any(not axis.is_linear for axis in axes):
        circle = 2.0 * max((math.hypot(*point) for point in scene.trace_points_mm), default=0.0)
        if circle > 0.0:
            return circle
    travels = (axis.travel[1] - axis.travel[0] for axis in axes if axis.is_linear)
    return max(travels, default=0.0) or LEAST_SIZE_MM
