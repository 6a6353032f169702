"""Moving a constant motion between the component errors of an axis and its constant errors."""

from warpspace.kinematics import transforms
from warpspace.kinematics.conversion.axis_errors import AxisErrors
from warpspace.kinematics.conversion.small_motion import SmallMotion
from warpspace.kinematics.model import ComponentErrors
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array


def without(
    own: AxisErrors, taken: SmallMotion, position: Array, present: SmallMotion
) -> SmallMotion:
    """Give the component errors at positions that are left where a motion went to the constants.

    Parameters
    ----------
    own : AxisErrors
    taken : SmallMotion
        In the frame before the motion of the axis.
    position : ndarray, [n], mm or degrees
    present : SmallMotion
        Component errors there.
    """
    back = taken.inverse
    if own.order == ComponentErrors.AFTER_MOTION:
        back = back.seen_from(transforms.inverse(own.pose(position)))
    return back @ present


def moved_to_constants(own: AxisErrors, taken: SmallMotion) -> ErrorSet:
    """Move a motion from the component errors of an axis to its constants; the field stays.

    Parameters
    ----------
    own : AxisErrors
    taken : SmallMotion
        In the frame before the motion of the axis.

    Returns
    -------
    ErrorSet

    Notes
    -----
    ``E0 · M · E = (E0 · G) · M · (M⁻¹ · G⁻¹ · M · E)``, exactly; before the motion ``E0 · E · M =
    (E0 · G) · (G⁻¹ · E) · M``.
    """
    own.refuse_two_arguments(adds=False)
    if not taken.half.any() and not taken.shift_mm.any():
        return own.errors
    errors = own.with_components(lambda q, present: without(own, taken, q, present))
    return AxisErrors(own.model, errors, own.axis, own.span).with_constant(own.constant @ taken)
