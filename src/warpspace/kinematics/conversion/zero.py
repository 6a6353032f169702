"""Component errors that are zero at a position of their axis: what they were there is constant."""

from collections.abc import Mapping

import numpy as np

from warpspace.kinematics.conversion.axis_errors import AxisErrors
from warpspace.kinematics.conversion.gauge import moved_to_constants
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.curves.curve import Span
from warpspace.machine.errors import ErrorSet


def zero_at(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], positions: Mapping[str, float]
) -> ErrorSet:
    """Make all six component errors of axes zero at a position; the field stays.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    spans : mapping of str to tuple of float, (2,), mm or degrees
        Range of each axis within which the numbers must hold.
    positions : mapping of str to float, mm or degrees
        Per axis where its errors are to be zero; other axes stay as they are.

    Returns
    -------
    ErrorSet
        What the errors were there is in the constants of the axis (location, orientation,
        squareness), those of the reference axis included. Exact.

    Raises
    ------
    OptionError
        If an error of an axis depends on a second one.
    """
    for axis, position in positions.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        there = np.asarray(float(position))
        taken = own.at(there)
        if own.order == ComponentErrors.AFTER_MOTION:
            taken = taken.seen_from(own.pose(there))
        errors = moved_to_constants(own, taken)
    return errors
