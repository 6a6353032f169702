"""Component errors before or after the motion: the same motions of the body, written in each."""

from collections.abc import Mapping
from dataclasses import replace

from warpspace.kinematics import transforms
from warpspace.kinematics.conversion.axis_errors import Along, AxisErrors
from warpspace.kinematics.conversion.small_motion import SmallMotion
from warpspace.kinematics.model import ComponentErrors, Model
from warpspace.machine.curves.curve import Span
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array


def convert_order(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], orders: Mapping[str, str]
) -> tuple[Model, ErrorSet]:
    """Write component errors in another order of motion and errors.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    spans : mapping of str to tuple of float, (2,), mm or degrees
        Range of each axis within which the numbers must hold.
    orders : mapping of str to str
        Axis to "after_motion" or "before_motion"; axes left out stay as they are.

    Returns
    -------
    model : Model
        With these orders.
    errors : ErrorSet

    Raises
    ------
    OptionError
        If an order is none of the two, or an error that depends on a second axis would change.

    Notes
    -----
    Exact: ``E_before = M · E_after · M⁻¹`` with the nominal motion M of the axis. A linear axis
    changes its shifts by the arm of its position, −q × ε to first order; a rotary one turns the
    directions of its errors by its angle.
    """
    for axis, wanted in orders.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        present, target = own.order, replace(model, own_component_errors=((axis, wanted),))
        if present != AxisErrors(target, errors, axis, spans[axis]).order:
            forward = wanted == ComponentErrors.BEFORE_MOTION
            linear = model.machine.axes[axis].is_linear
            errors = own.with_components(_across(own, forward=forward), adds=linear)
    names = {axis: model.convention(axis).name for axis in model.machine.axes} | dict(orders)
    main = max(dict.fromkeys(names.values()), key=list(names.values()).count)
    others = tuple((axis, name) for axis, name in names.items() if name != main)
    return replace(model, component_errors=main, own_component_errors=others), errors


def _across(own: AxisErrors, *, forward: bool) -> Along:
    """Take errors across the motion of their axis."""

    def along(position: Array, errors: SmallMotion) -> SmallMotion:
        pose = own.pose(position)
        return errors.seen_from(pose if forward else transforms.inverse(pose))

    return along
