"""Errors at given coordinates, to first order and exactly.

Fields of many points are evaluated in pieces that stay in the processor's cache. An error is asked
for its values at the coordinates of a piece, and for nothing else: values of one axis are an array
over that axis, so that only sums and products are as large as the grid; values of several axes are
an array over these.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpspace.field.basis import ErrorBasis, ErrorField
from warpspace.field.pieces import cut, cut_all, is_small, pieces
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.components import join, rotate, split, split_rows, subtract
from warpspace.kinematics.deviation import LoopLinks, build_links, solve_links
from warpspace.kinematics.firstorder import jacobian
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array


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
        return ErrorField(
            there.nominal_mm,
            there.error_um - back.error_um,
            there.orientation_urad - back.orientation_urad,
        )
    return _evaluate(model, errors, coordinates, view, point_mm, exact=True)


def evaluate_first_order(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> ErrorField:
    """Evaluate the field with the first-order model; see `evaluate_exact` for the parameters.

    The same numbers as the basis gives for the amplitudes of the set, without its memory.
    """
    return _evaluate(model, errors, coordinates, view or View(), point_mm, exact=False)


def _evaluate(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View,
    point_mm: Array | None,
    *,
    exact: bool,
) -> ErrorField:
    """Evaluate the field piece by piece, straight into the arrays of the result."""
    point = nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    shape = (*np.broadcast_shapes(batch_shape(coordinates), point.shape[:-1]), 3)
    error, orientation = np.empty(shape), np.empty(shape)
    reference = _reference_point(model, view, coordinates)
    if reference is None:
        fixed = np.zeros(3)
    else:
        held, held_point = reference
        fixed = _evaluate(model, errors, held, View(view.loop), held_point, exact=exact).error_um

    def steps(at: Coordinates) -> LoopLinks:
        return build_links(model, at, error_values(model, errors, at), exact=exact)

    # A grid has few positions of each axis: what depends on these alone is worked out once.
    links = steps(coordinates) if is_small(coordinates.values()) else None
    for piece in pieces(shape[:-1]):
        at = {name: cut(values, piece) for name, values in coordinates.items()}
        here = steps(at) if links is None else cut_all(links, piece)
        nodes = (*piece, slice(None))
        found, tilt = solve_links(here, view.loop, split(cut(point, nodes)), exact=exact)
        found = subtract(found, split(cut(fixed, nodes)))
        rotation = _result_rotation(model, view, at)
        if rotation is not None:
            found, tilt = (rotate(split_rows(rotation), vectors) for vectors in (found, tilt))
        join(found, error[nodes])
        join(tilt, orientation[nodes])
    return ErrorField(np.broadcast_to(point, shape), error, orientation)
