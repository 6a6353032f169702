"""Errors at given coordinates, to first order and exactly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, exact_error, nominal_point
from warpspace.kinematics.firstorder import jacobian
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

MAX_RESPONSES = 3_000_000
"""Responses (parameters × points) that are held at a time where no basis is asked for."""


@dataclass(frozen=True, slots=True)
class View:
    """How errors are looked at: the loop, the frame of the result and the point held still.

    Attributes
    ----------
    loop : Loop
    frame : str
        "machine" for results in R, "workpiece" for results in the nominal workpiece frame.
    reference : mapping of str to float or None
        Axis coordinates of the point whose position error is subtracted everywhere; None is
        absolute. Orientation errors stay absolute.
    """

    loop: Loop = Loop.TOOL
    frame: str = "machine"
    reference: Mapping[str, float] | None = None


def error_values(model: Model, errors: ErrorSet, coordinates: Coordinates) -> dict[str, Array]:
    """Evaluate the error functions of a set at axis positions.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    coordinates : mapping of str to ndarray, [...], mm or degrees

    Returns
    -------
    dict of str to ndarray, [...], µm or µrad
        In the direction of travel of the model. Parameters whose axis the machine does not have are
        left out.
    """
    axes = model.machine.axes
    return {
        key: errors.evaluate_at(key, coordinates, model.direction)
        for key in errors
        if parameter(key).axis in axes
    }


def _result_rotation(model: Model, view: View, coordinates: Coordinates) -> Array | None:
    """Rotation from R to the frame of the result, [..., 3, 3]; None for R itself."""
    if view.frame == "machine":
        return None
    pose = branch_pose(model, "workpiece", coordinates)[..., :3, :3]
    return np.swapaxes(pose, -1, -2)


def _reference_point(
    model: Model, view: View, coordinates: Coordinates
) -> tuple[dict[str, Array], Array] | None:
    """Coordinates and nominal tool point of the reference; None for an absolute view."""
    if view.reference is None:
        return None
    held = {
        name: np.asarray(view.reference[name]) if name in view.reference else values
        for name, values in coordinates.items()
    }
    return held, nominal_point(model, Loop.TOOL, held)


def build_basis(
    model: Model,
    errors: ErrorSet,
    keys: Sequence[str],
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> ErrorBasis:
    """Compute the first-order response to every parameter.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
        Gives the curve of each parameter along its axis; its amplitudes are not used.
    keys : sequence of str, (K,)
    coordinates : mapping of str to ndarray, [...], mm or degrees
    view : View, optional
    point_mm : ndarray, [..., 3], mm, optional
        Nominal points in R; by default the functional point of the loop.

    Returns
    -------
    ErrorBasis
    """
    view = view or View()
    point = nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    position, orientation = _shaped_jacobian(model, errors, keys, coordinates, view, point)
    reference = _reference_point(model, view, coordinates)
    if reference is not None:
        held, held_point = reference
        fixed = _shaped_jacobian(model, errors, keys, held, view, held_point)[0]
        batch = (1,) * (position.ndim - fixed.ndim) + fixed.shape[1:]
        position = position - fixed.reshape(len(keys), *batch)
    rotation = _result_rotation(model, view, coordinates)
    if rotation is not None:
        position = transforms.rotate(rotation, position)
        orientation = transforms.rotate(rotation, orientation)
    nominal = np.broadcast_to(point, position.shape[1:])
    return ErrorBasis(tuple(keys), nominal, position, orientation)


def _shaped_jacobian(
    model: Model,
    errors: ErrorSet,
    keys: Sequence[str],
    coordinates: Coordinates,
    view: View,
    point: Array,
) -> tuple[Array, Array]:
    """Jacobian with the unit curve of each parameter folded in, [K, ..., 3] twice."""
    position, orientation = jacobian(model, view.loop, keys, coordinates, point)
    for index, key in enumerate(keys):
        if key in errors.functions or model.direction == TravelDirection.DIFFERENCE:
            shape = errors.shape_at(key, coordinates, model.direction)[..., None]
            position[index] *= shape
            orientation[index] *= shape
    return position, orientation


def amplitudes_of(errors: ErrorSet, keys: Sequence[str]) -> Array:
    """Collect the amplitudes of a set in the order of the keys, [K], µm or µrad."""
    return np.array([errors.amplitude(key) for key in keys], dtype=float)


def evaluate_exact(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> ErrorField:
    """Evaluate the field with the exact chain.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    coordinates : mapping of str to ndarray, [...], mm or degrees
    view : View, optional
    point_mm : ndarray, [..., 3], mm, optional
        Nominal points in R; by default the functional point of the loop.

    Returns
    -------
    ErrorField
        Where the model looks at the difference of both directions of travel, the field forward
        minus that backward.
    """
    view = view or View()
    if model.direction == TravelDirection.DIFFERENCE:
        there, back = (
            evaluate_exact(replace(model, direction=way), errors, coordinates, view, point_mm)
            for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
        )
        return _sum(there, ErrorField(back.nominal_mm, -back.error_um, -back.orientation_urad))
    point = nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    values = error_values(model, errors, coordinates)
    error, orientation = exact_error(model, view.loop, coordinates, values, point)
    reference = _reference_point(model, view, coordinates)
    if reference is not None:
        held, held_point = reference
        held_values = error_values(model, errors, held)
        error = error - exact_error(model, view.loop, held, held_values, held_point)[0]
    rotation = _result_rotation(model, view, coordinates)
    if rotation is not None:
        error = transforms.rotate(rotation, error)
        orientation = transforms.rotate(rotation, orientation)
    shape = np.broadcast_shapes((*batch_shape(coordinates), 3), error.shape, point.shape)
    return ErrorField(
        np.broadcast_to(point, shape),
        np.broadcast_to(error, shape),
        np.broadcast_to(orientation, shape),
    )


def evaluate_first_order(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> ErrorField:
    """Evaluate the field with the first-order model; see `evaluate_exact` for the parameters.

    The basis of a large batch is built for a few parameters at a time, so that memory stays small.
    """
    keys = tuple(key for key in errors if parameter(key).axis in model.machine.axes)
    size = int(np.prod(batch_shape(coordinates))) if point_mm is None else point_mm.size // 3
    together = max(1, MAX_RESPONSES // max(size, 1))
    fields = (
        build_basis(model, errors, part, coordinates, view, point_mm).evaluate(
            amplitudes_of(errors, part)
        )
        for part in (keys[at : at + together] for at in range(0, max(len(keys), 1), together))
    )
    return reduce(_sum, fields)


def _sum(one: ErrorField, other: ErrorField) -> ErrorField:
    """Add the errors of two fields over the same points."""
    return ErrorField(
        one.nominal_mm,
        one.error_um + other.error_um,
        one.orientation_urad + other.orientation_urad,
    )
