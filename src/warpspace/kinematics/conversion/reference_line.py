"""The reference line of straightness: its tilt is a matter of squareness, not of straightness."""

from collections.abc import Mapping
from enum import StrEnum
from itertools import pairwise

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics.conversion.axis_errors import AxisErrors
from warpspace.kinematics.conversion.gauge import moved_to_constants, without
from warpspace.kinematics.conversion.small_motion import SmallMotion
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.curves.curve import Span
from warpspace.machine.errors import ErrorSet
from warpspace.units import MM_PER_UM, Array

EVENLY = 101
"""Positions that a line is laid through where a curve has no points of its own."""
STEPS = 8
"""Steps to the line of the exact motion; each leaves a millionth of the one before."""


class ReferenceLine(StrEnum):
    """Which straight line is laid through a straightness curve (ISO 230-1, 3.4.7 to 3.4.9)."""

    END_POINT = "end_point"
    LEAST_SQUARES = "least_squares"
    MINIMUM_ZONE = "minimum_zone"


def fit_line(position: Array, value: Array, line: ReferenceLine | str) -> tuple[float, float]:
    """Lay a reference line through a straightness curve.

    Parameters
    ----------
    position : ndarray, [n], mm
        Ascending.
    value : ndarray, [n], µm
    line : ReferenceLine or str
        Through the first and the last point; with the least sum of squares; or the middle of the
        narrowest band, measured across the position, that holds all points.

    Returns
    -------
    offset : float, µm
        Of the line at position zero.
    slope : float, µm/mm
    """
    match ReferenceLine(line):
        case ReferenceLine.END_POINT:
            slope = float((value[-1] - value[0]) / (position[-1] - position[0]))
            return float(value[0]) - slope * float(position[0]), slope
        case ReferenceLine.LEAST_SQUARES:
            middle = position.mean()
            away = position - middle
            slope = float(away @ (value - value.mean()) / (away @ away))
            return float(value.mean() - slope * middle), slope
        case ReferenceLine.MINIMUM_ZONE:
            return _minimum_zone(position, value)


def _minimum_zone(position: Array, value: Array) -> tuple[float, float]:
    """Find the middle of the narrowest band: one of its sides holds an edge of the convex hull."""
    found: list[tuple[float, float, float]] = []
    for sign in (1.0, -1.0):
        edge = _lower_hull(position, sign * value)
        for first, last in pairwise(edge):
            slope = (value[last] - value[first]) / (position[last] - position[first])
            rest = value - slope * position
            found.append((float(np.ptp(rest)), (rest.max() + rest.min()) / 2.0, slope))
    _, offset, slope = min(found)
    return float(offset), float(slope)


def _lower_hull(x: Array, y: Array) -> list[int]:
    """Give the points of the lower side of the convex hull, by their numbers."""
    hull: list[int] = []
    for new in range(len(x)):
        while len(hull) > 1:
            a, b = hull[-2], hull[-1]
            if (x[b] - x[a]) * (y[new] - y[a]) - (y[b] - y[a]) * (x[new] - x[a]) > 0.0:
                break
            hull.pop()
        hull.append(new)
    return hull


def convert_reference_line(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], lines: Mapping[str, str]
) -> ErrorSet:
    """Take the reference line out of the straightness of linear axes; the field stays.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    spans : mapping of str to tuple of float, (2,), mm
        Range of each axis, over which the line is laid.
    lines : mapping of str to str
        Axis to one of `ReferenceLine`.

    Returns
    -------
    ErrorSet
        Its straightness curves have the zero line as their reference line. The offset of the old
        line is in the location of the axis, its tilt in the constant rotations (squareness), and
        the angular errors of the axis are turned back by the same angle, so that what rides on it
        keeps its orientation. Exact.

    Raises
    ------
    OptionError
        If the axis is rotary, its errors act before the motion, or one depends on a second axis.

    Notes
    -----
    The line of a table is laid through its points within the range, as measured, and that of a
    curve that was converted from one likewise; any other through 101 evenly spread positions.
    """
    for axis, line in lines.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        if not model.machine.axes[axis].is_linear:
            raise OptionError(f"{axis} is rotary; only linear axes have straightness")
        if own.order != ComponentErrors.AFTER_MOTION:
            raise OptionError(
                f"errors of {axis} act {own.order}, where a rotation tilts the motion as well and a"
                " straightness does not; expected component_errors after_motion"
            )
        errors = moved_to_constants(own, _line_motion(own, ReferenceLine(line)))
    return errors


def _line_motion(own: AxisErrors, line: ReferenceLine) -> SmallMotion:
    """Find the motion that takes the reference lines of both straightness curves away."""
    axis = own.model.machine.axes[own.axis]
    along = axis.direction * np.eye(3)[axis.index]
    taken = SmallMotion(np.zeros(3), np.zeros(3))
    for _ in range(STEPS):
        offset, slope = np.zeros(3), np.zeros(3)
        for index in range(3):
            if index != axis.index:
                at = _positions(own, own.keys()[index])
                left = without(own, taken, at, own.at(at)).to_errors()[0][:, index]
                offset[index], slope[index] = fit_line(at, left, line)
        if not offset.any() and not slope.any():
            break
        turn = np.cross(along, slope * MM_PER_UM)
        taken = taken @ SmallMotion(turn / 2.0, offset * MM_PER_UM)
    return taken


def _positions(own: AxisErrors, key: str) -> Array:
    """Choose the positions that the line of a straightness curve is laid through."""
    low, high = own.span
    points = np.array(own.points(key))
    points = points[(points >= low) & (points <= high)]
    return points if len(points) > 1 else np.linspace(low, high, EVENLY)
