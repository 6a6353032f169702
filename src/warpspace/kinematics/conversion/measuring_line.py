"""Errors measured along a line beside the origin of the axis, moved to it with Abbe arms."""

from collections.abc import Mapping

import numpy as np

from warpspace.kinematics import transforms
from warpspace.kinematics.conversion.axis_errors import AxisErrors
from warpspace.kinematics.conversion.small_motion import SmallMotion
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.curves.curve import Span
from warpspace.machine.description import Vector
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array


def move_measuring_line(
    model: Model,
    errors: ErrorSet,
    spans: Mapping[str, Span],
    lines_mm: Mapping[str, Vector],
    *,
    to_origin: bool,
) -> ErrorSet:
    """Move translations between the origin of an axis and a line beside it.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    spans : mapping of str to tuple of float, (2,), mm or degrees
        Range of each axis within which the numbers must hold.
    lines_mm : mapping of str to tuple of float, (3,), mm
        Per axis the point of its moving body whose displacement was measured, in the frame of the
        axis (behind its motion).
    to_origin : bool
        From the line to the origin, as what was measured is read; or from the origin to the line.

    Returns
    -------
    ErrorSet
        With the same rotations.

    Raises
    ------
    OptionError
        If rotations of the axis depend on a second axis.

    Notes
    -----
    The point at p moves by δ + (R(ε) − 1)·p, to first order by δ + ε × p: 10 µrad of pitch on an
    arm of 100 mm are 1 µm. Exact, with the full rotation. Before the motion the arm is the place of
    the same point there, ``M(q) · p``.
    """
    sign = -1.0 if to_origin else 1.0
    for axis, place in lines_mm.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        point = np.array(place, dtype=float)
        fixed = own.order == ComponentErrors.BEFORE_MOTION

        def along(
            position: Array,
            present: SmallMotion,
            own: AxisErrors = own,
            point: Array = point,
            fixed: bool = fixed,
        ) -> SmallMotion:
            lever = transforms.apply(own.pose(position), point) if fixed else point
            return SmallMotion(present.half, present.shift_mm + sign * present.arm(lever))

        errors = own.with_components(along, adds=True)
    return errors
