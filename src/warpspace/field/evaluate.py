"""Errors at given coordinates, to first order and exactly.

Fields of many points are evaluated in pieces that fit into the processor cache. Errors are
evaluated at the coordinates of a piece only: an error of one axis is an array over that axis, so
that only sums and products have the size of the grid; an error of several axes is an array over
these.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from warpspace.field import grid as grids
from warpspace.kinematics import chain, transforms
from warpspace.kinematics.components import join, rotate, split, split_rows, subtract
from warpspace.kinematics.model import Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import TravelDirection, is_linear, parameter
from warpspace.machine.errors import ErrorSet
from warpspace.units import RAD_PER_URAD, UM_PER_MM, UM_PER_MM_URAD, Array, spell


@dataclass(frozen=True)
class ErrorField:
    """Errors over a batch of points.

    Attributes
    ----------
    nominal_mm : ndarray, [..., 3], mm
        Nominal points in R.
    error_um : ndarray, [..., 3], µm
        Position error, actual − nominal.
    orientation_urad : ndarray, [..., 3], µrad
        Orientation error of the tool axis: the small rotation vector that turns it, right-hand
        rule. It has no component about the tool axis itself; its norm is the tilt. NaN where it was
        not evaluated.
    """

    nominal_mm: Array
    error_um: Array
    orientation_urad: Array

    @cached_property
    def norm_um(self) -> Array:
        """Length of the position error, [...], µm."""
        x, y, z = (self.error_um[..., axis] for axis in range(3))
        squared = x * x
        squared += y * y  # in place: a volume of points exceeds the processor cache
        squared += z * z
        return np.sqrt(squared)

    @property
    def tilts(self) -> "ErrorField":
        """Field with the orientation error in place of the position error, µrad for µm."""
        return replace(self, error_um=self.orientation_urad)

    def __sub__(self, other: "ErrorField") -> "ErrorField":
        """Compute the difference of errors at the same points."""
        error, orientation = self.error_um, self.orientation_urad
        return ErrorField(
            self.nominal_mm, error - other.error_um, orientation - other.orientation_urad
        )

    @cached_property
    def cells_um(self) -> Array:
        """Length of the position error in cells of a volume, [X, Y, Z], µm; linear between nodes.

        Percentiles and shares of the volume are computed from it, for any number of nodes.
        """
        return grids.cell_values(self.norm_um)


PIECE = 14_000  # numbers of a sum of responses that stay in the processor cache


@dataclass(frozen=True, slots=True)
class ErrorBasis:
    """First-order response of a batch of points to every parameter."""

    keys: tuple[str, ...]  # (K,); parameter keys
    nominal_mm: Array  # [..., 3]; nominal points in R
    # [K, ..., 3], µm per µm or µrad of amplitude; the curve of each parameter along its axis is
    # folded in
    position: Array
    orientation: Array  # [K, ..., 3], µrad per µm or µrad of amplitude

    def evaluate(self, amplitudes: Array, *, orientation: bool = True) -> ErrorField:
        """Sum the responses to amplitudes, [K]; the orientation error doubles the time."""
        tilt = np.broadcast_to(np.nan, self.nominal_mm.shape)
        if orientation:
            tilt = self._combine(amplitudes, self.orientation)
        return ErrorField(self.nominal_mm, self._combine(amplitudes, self.position), tilt)

    def _combine(self, amplitudes: Array, response: Array) -> Array:
        flat = response.reshape(len(self.keys), self.nominal_mm.size)
        (used,) = amplitudes.nonzero()
        if 2 * len(used) > len(self.keys):
            return (amplitudes @ flat).reshape(self.nominal_mm.shape)
        if not len(used):
            return np.zeros(self.nominal_mm.shape)
        total = np.empty(self.nominal_mm.size)
        for start in range(0, total.size, PIECE):
            part, responses = total[start : start + PIECE], flat[:, start : start + PIECE]
            np.multiply(responses[used[0]], amplitudes[used[0]], out=part)
            product = np.empty_like(part)
            for index in used[1:]:
                np.multiply(responses[index], amplitudes[index], out=product)
                part += product
        return total.reshape(self.nominal_mm.shape)

    def contributions(self, amplitudes: Array, index: tuple[int, ...] = ()) -> Array:
        """Split the position error at one node into the parameters, [K, 3], µm."""
        chosen = self.position[(slice(None), *index)]
        return amplitudes[:, None] * chosen.reshape(len(self.keys), 3)


# Placement numbers are a shift along the axes of the workpiece frame and a small rotation about
# them, so that they do not depend on the axis positions.

EXACT_STEPS = 3  # that fit a full rotation; each leaves the product of the turn and the step before
MIN_EFFECT = 1e-12
"""Share of the largest effect, squared, below which a combination of the six is not fitted."""


class Turn(IntEnum):
    """Extent of the turn of a placement, and where its effect is observed."""

    IN_FRAME = -1  # in full; the workpiece moves, in R
    SMALL = 0  # to first order
    ON_PART = 1  # in full; the tool moves, on the workpiece


def fit_placement(
    model: Model, grid: grids.Grid, error_um: Array, turn: Turn = Turn.SMALL
) -> Array:
    """Fit the placement of the workpiece, [..., 6], µm and µrad, to relative errors over a volume.

    Errors, [..., nx, ny, nz, 3], µm, are absolute, in R; leading axes are independent fits.
    Least squares, nodes weighted by their share of the volume; the minimum-norm solution where a
    line or a point does not determine all six. A full turn is fitted to a single field.
    """
    pose = chain.branch_pose(model, "workpiece", grid.coordinates)
    columns = _columns(pose, grid.point_mm)
    weighted = (grid.weights[..., None, None] * columns).reshape(-1, 6)
    normal = np.linalg.pinv(columns.reshape(-1, 6).T @ weighted, rcond=MIN_EFFECT, hermitian=True)

    def fit(errors: Array) -> Array:
        fitted = errors.reshape(-1, len(weighted)) @ weighted @ normal
        return fitted.reshape(*error_um.shape[:-4], 6)

    placement = fit(error_um)
    for _ in range(EXACT_STEPS if turn else 0):
        moved = placement_effect(model, placement, grid.coordinates, grid.point_mm, turn)[0]
        placement = placement + fit(error_um - moved)
    return placement


def placement_effect(
    model: Model,
    placement: Array,
    coordinates: Coordinates,
    point_mm: Array,
    turn: Turn = Turn.SMALL,
) -> tuple[Array, Array]:
    """Compute the relative error in R that placements, [6] or [K, 6], remove.

    µm and µrad, [..., 3] or [K, ..., 3]; the orientation is without the part about the tool axis.
    A full turn is that of one placement, [6].
    """
    pose = chain.branch_pose(model, "workpiece", coordinates)
    columns = _columns(pose, point_mm)
    turned = {name: np.zeros(()) if is_linear(name) else at for name, at in coordinates.items()}
    aim = chain.tool_axis(model, turned)
    rotation = chain.branch_pose(model, "workpiece", turned)[..., :3, :3]
    tilt = rotation - aim[..., None] * (aim[..., None, :] @ rotation)
    shift = np.tensordot(placement, columns, (-1, -1))
    if turn:
        angle = placement[3:] * RAD_PER_URAD
        beyond = turn * (transforms.vector_rotation(turn * angle) - np.eye(3))
        beyond = beyond - transforms.skew(angle)
        arm_mm = transforms.apply(transforms.inverse(pose), point_mm)
        shift = shift + transforms.rotate(pose[..., :3, :3] @ beyond, arm_mm) * UM_PER_MM
    tilted = np.broadcast_to(tilt, columns[..., 3:].shape)
    return shift, np.tensordot(placement[..., 3:], tilted, (-1, -1))


def _columns(pose: Array, point_mm: Array) -> Array:
    rotation = pose[..., :3, :3]
    about = transforms.skew(pose[..., :3, 3] - point_mm) @ rotation * UM_PER_MM_URAD
    return np.concatenate([np.broadcast_to(rotation, about.shape), about], axis=-1)


@dataclass(frozen=True, slots=True)
class View:
    """View of errors: the loop, the frame of the result and the reference point."""

    loop: Loop = Loop.TOOL
    # "machine" for results in R, "workpiece" for results in the nominal workpiece frame
    frame: str = "machine"
    # axis coordinates of the point whose position error is subtracted everywhere; None is absolute.
    # Orientation errors stay absolute.
    reference: Mapping[str, float] | None = None
    # working volume over which the placement of the workpiece is fitted out of a relative error,
    # before the reference is subtracted; None without a fit
    placed_over: grids.Workspace | None = None


class SecondOrder(NamedTuple):
    """Deviation of the first order from the exact position errors."""

    um: float  # largest |E exact − E first order|
    largest_um: float  # largest |E| of the exact chain

    @property
    def matters(self) -> bool:
        """True above 0.1 µm or 1 % of the largest |E|, at least 1 nm: the user is warned."""
        return self.um > min(0.1, max(0.01 * self.largest_um, 0.001))


def compare_orders(first_um: Array, exact_um: Array) -> SecondOrder:
    """Compare position errors, [..., 3], µm, of the same points."""
    lengths = (
        np.linalg.norm(difference, axis=-1) for difference in (exact_um - first_um, exact_um)
    )
    return SecondOrder(*(float(length.max(initial=0.0)) for length in lengths))


def placed_words(view: View) -> tuple[str, ...]:
    """Format the note that the placement is fitted out; empty where it is not."""
    return () if view.placed_over is None else ("placement of the workpiece fitted out",)


def second_order_words(*orders: SecondOrder) -> tuple[str, ...]:
    """Format the warning that the first order is insufficient, for one picture or several."""
    largest = max((order.um for order in orders if order.matters), default=0.0)
    return (f"first order; the exact chain differs by up to {spell(largest)} µm",) * (largest > 0.0)


def error_values(model: Model, errors: ErrorSet, coordinates: Coordinates) -> dict[str, Array]:
    """Evaluate the errors of axes of the machine, in the direction of travel of the model."""
    axes = model.machine.axes
    return {
        key: errors.evaluate_at(key, coordinates, model.direction)
        for key in errors
        if parameter(key).axis in axes
    }


def _result_rotation(model: Model, view: View, coordinates: Coordinates) -> Array | None:
    if view.frame == "machine":
        return None
    pose = chain.branch_pose(model, "workpiece", coordinates)[..., :3, :3]
    return np.swapaxes(pose, -1, -2)


def reference_point(
    model: Model, view: View, coordinates: Coordinates
) -> tuple[dict[str, Array], Array] | None:
    """Coordinates and nominal tool point of the reference; None for an absolute view."""
    if view.reference is None:
        return None
    fixed = {
        name: np.asarray(view.reference[name]) if name in view.reference else values
        for name, values in coordinates.items()
    }
    return fixed, chain.nominal_point(model, Loop.TOOL, fixed)


def build_basis(
    model: Model,
    errors: ErrorSet,
    keys: Sequence[str],
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> ErrorBasis:
    """Compute the first-order response to every parameter, its curve along its axis folded in.

    Points are nominal ones in R, [..., 3], mm: by default the functional point of the loop. The
    amplitudes of the set are not used.
    """
    view = view or View()
    point = chain.nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    placement = None
    if view.placed_over is not None:
        volume = grids.build_grid(model, view.placed_over)
        at, nodes = volume.coordinates, volume.point_mm
        response = _shaped_jacobian(model, errors, keys, at, view, nodes)[0]
        placement = fit_placement(model, volume, response)

    def respond(at: Coordinates, point: Array) -> tuple[Array, Array]:
        response = _shaped_jacobian(model, errors, keys, at, view, point)
        if placement is None:
            return response
        placed = placement_effect(model, placement, at, point)
        return response[0] - placed[0], response[1] - placed[1]

    position, orientation = respond(coordinates, point)
    reference = reference_point(model, view, coordinates)
    if reference is not None:
        fixed = respond(*reference)[0]
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
    position, orientation = chain.jacobian(model, view.loop, keys, coordinates, point)
    for index, key in enumerate(keys):
        if key in errors.functions or model.direction == TravelDirection.DIFFERENCE:
            shape = errors.shape_at(key, coordinates, model.direction)[..., None]
            position[index] *= shape
            orientation[index] *= shape
    return position, orientation


def amplitudes_of(errors: ErrorSet, keys: Sequence[str]) -> Array:
    """Collect the amplitudes of a set in the order of the keys, [K], µm or µrad."""
    return np.array([errors.amplitude(key) for key in keys], dtype=float)


def find_placement(
    model: Model, errors: ErrorSet, view: View, *, exact: bool = False
) -> Array | None:
    """Fit the placement of the workpiece, [6], µm and µrad; None where a view has none."""
    if view.placed_over is None:
        return None
    volume = grids.build_grid(model, view.placed_over)
    field = evaluate_field(
        model, errors, volume.coordinates, View(view.loop), volume.point_mm, exact=exact
    )
    return fit_placement(model, volume, field.error_um, Turn.IN_FRAME if exact else Turn.SMALL)


def evaluate_field(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
    *,
    exact: bool,
) -> ErrorField:
    """Evaluate the field at points in R, [..., 3], or at that of the loop.

    For the difference of both directions of travel, the exact field is forward minus backward. To
    first order the numbers are those of the basis, with less memory.
    """
    view = view or View()
    if exact and model.direction == TravelDirection.DIFFERENCE:
        forward, backward = (
            evaluate_exact(replace(model, direction=direction), errors, coordinates, view, point_mm)
            for direction in (TravelDirection.FORWARD, TravelDirection.BACKWARD)
        )
        return forward - backward
    point = chain.nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    shape = (*np.broadcast_shapes(batch_shape(coordinates), point.shape[:-1]), 3)
    error, orientation = np.empty(shape), np.empty(shape)
    reference, fixed = reference_point(model, view, coordinates), np.zeros(3)
    if reference is not None:
        unreferenced = replace(view, frame="machine", reference=None)
        at, point_of_reference = reference
        fixed = evaluate_field(
            model, errors, at, unreferenced, point_of_reference, exact=exact
        ).error_um
    placement = find_placement(model, errors, view, exact=exact)
    turn = Turn.IN_FRAME if exact else Turn.SMALL

    def steps(at: Coordinates) -> chain.LoopLinks:
        return chain.build_links(model, at, error_values(model, errors, at), exact=exact)

    # A grid has few positions of each axis: the links of all of them are computed once.
    is_shared = all(positions.size <= grids.NODES for positions in coordinates.values())
    links = steps(coordinates) if is_shared else None
    for piece in grids.pieces(shape[:-1]):
        at = {name: grids.cut(values, piece) for name, values in coordinates.items()}
        piece_links = steps(at) if links is None else grids.cut_all(links, piece)
        nodes = (*piece, slice(None))
        error_um, tilt = chain.solve_links(
            piece_links, view.loop, split(grids.cut(point, nodes)), exact=exact
        )
        if placement is not None:
            part = grids.cut(point, nodes)
            placed = map(split, placement_effect(model, placement, at, part, turn))
            error_um, tilt = map(subtract, (error_um, tilt), placed)
        error_um = subtract(error_um, split(grids.cut(fixed, nodes)))
        rotation = _result_rotation(model, view, at)
        if rotation is not None:
            error_um, tilt = (rotate(split_rows(rotation), vectors) for vectors in (error_um, tilt))
        join(error_um, error[nodes])
        join(tilt, orientation[nodes])
    return ErrorField(np.broadcast_to(point, shape), error, orientation)


evaluate_exact = partial(evaluate_field, exact=True)
evaluate_first_order = partial(evaluate_field, exact=False)
