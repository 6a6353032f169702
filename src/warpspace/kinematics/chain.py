"""Errors of a kinematic chain: with full transformations, and to first order.

Per axis ``T = Trans(offset) · Rot(fixed) · E0 · Motion(direction·q) · E(q)``, or another
order of the last three; E0 and E(q) are ``Trans(δ) · Rot(ε)`` with the full rotation of
the vector ε.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from warpspace.kinematics import components, transforms
from warpspace.kinematics.components import Rows, Triple
from warpspace.kinematics.model import TOOL_AXIS, AxisFrames, Coordinates, Loop, Model, batch_shape
from warpspace.machine.axes import DIRECTIONS, parameter
from warpspace.machine.definition import Axis
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, UM_PER_MM_URAD, URAD_PER_RAD, Array

ErrorValues = Mapping[str, Array]  # parameter key to values at the coordinates, [...], µm or µrad


def motion(axis: Axis, position: Array) -> Array:
    """Build the nominal motion of an axis at positions, mm or degrees, [..., 4, 4]."""
    signed = axis.direction * np.asarray(position, dtype=float)
    if axis.is_linear:
        return transforms.translation(signed[..., None] * np.eye(3)[axis.index])
    return transforms.rigid(transforms.axis_rotation(axis.index, np.deg2rad(signed)), np.zeros(3))


def error_transform(axis: str, values: ErrorValues, *, constant: bool) -> Array | None:
    """Build ``Trans(δ)·Rot(ε)`` of an axis, [..., 4, 4]; None without any parameter."""
    middle = "0" if constant else ""
    keys = [f"E{letter}{middle}{axis}" for letter in DIRECTIONS]
    if not any(key in values for key in keys):
        return None
    parts = np.broadcast_arrays(*(np.asarray(values.get(key, 0.0), dtype=float) for key in keys))
    shift = np.stack(parts[:3], -1) * MM_PER_UM
    turn = np.stack(parts[3:], -1) * RAD_PER_URAD
    return transforms.rigid(transforms.vector_rotation(turn), shift)


def branch_frames(model: Model, side: str, coordinates: Coordinates) -> Iterator[AxisFrames]:
    """Iterate over the nominal frames of a branch, tool or workpiece, from the frame outwards."""
    pose = np.eye(4)
    for axis in model.machine.branch(side):
        before = pose @ transforms.placed(axis.offset_mm, axis.rotation_deg)
        pose = before @ motion(axis, coordinates[axis.name])
        yield AxisFrames(axis, before, pose)


def branch_pose(
    model: Model, side: str, coordinates: Coordinates, values: ErrorValues | None = None
) -> Array:
    """Compute the pose of the tool or workpiece frame in R, [..., 4, 4]."""
    pose = np.eye(4)
    errors = values or {}
    for axis in model.machine.branch(side):
        pose = pose @ transforms.placed(axis.offset_mm, axis.rotation_deg)
        move = motion(axis, coordinates[axis.name])
        constant = error_transform(axis.name, errors, constant=True)
        component = error_transform(axis.name, errors, constant=False)
        for factor in model.convention(axis.name).factors(constant, move, component):
            pose = pose if factor is None else pose @ factor
    for _, offset, rotation in model.machine.end_frames(side):
        pose = pose @ transforms.placed(offset, rotation)
    return pose


def nominal_point(model: Model, loop: Loop, coordinates: Coordinates) -> Array:
    """Compute the nominal tool point, or workpiece point in its loop, in R, [..., 3], mm."""
    side, point = "tool", model.tool_point_mm
    if loop is Loop.WORKPIECE:
        side, point = "workpiece", model.workpiece_point_mm
    carried = components.split(np.array(point, dtype=float))
    for _, offset, rotation in reversed(model.machine.end_frames(side)):
        carried = components.move(transforms.placed(offset, rotation), carried)
    axes = [np.shape(coordinates[axis.name]) for axis in model.machine.branch(side)]
    out = np.empty((*np.broadcast_shapes(*axes), 3))
    components.join(carry_inwards(model, side, coordinates, carried), out)
    return out


def tool_axis(model: Model, coordinates: Coordinates) -> Array:
    """Compute the nominal direction of the tool axis in R, unit vectors, [..., 3]."""
    return transforms.rotate(branch_pose(model, "tool", coordinates)[..., :3, :3], TOOL_AXIS)


def carry_inwards(model: Model, side: str, coordinates: Coordinates, point_mm: Triple) -> Triple:
    """Transform a point from the frame after the last axis of a branch to R, components, mm."""
    for axis in reversed(model.machine.branch(side)):
        if not axis.is_linear:
            point_mm = components.move(_nominal_step(axis, coordinates), point_mm)
            continue
        place = transforms.placed(axis.offset_mm, axis.rotation_deg)
        signed = axis.direction * np.asarray(coordinates[axis.name], dtype=float)
        along = components.scale(
            components.simplify(signed), components.split(place[:3, axis.index])
        )
        position = components.add(components.split(place[:3, 3]), along)
        turned = components.rotate(components.split_rows(place[:3, :3]), point_mm)
        point_mm = components.add(turned, position)
    return point_mm


def carry_outwards(model: Model, side: str, coordinates: Coordinates, point_mm: Triple) -> Triple:
    """Transform a point from R to the frame after the last axis of a branch, components, mm."""
    for axis in model.machine.branch(side):
        step = transforms.inverse(_nominal_step(axis, coordinates))
        point_mm = components.move(step, point_mm)
    return point_mm


def _nominal_step(axis: Axis, coordinates: Coordinates) -> Array:
    place = transforms.placed(axis.offset_mm, axis.rotation_deg)
    if not axis.is_linear:
        return place @ motion(axis, coordinates[axis.name])
    signed = axis.direction * np.asarray(coordinates[axis.name], dtype=float)
    # each component is contiguous; a product of matrices of each position takes ten times longer
    step = np.moveaxis(np.empty((4, 4, *signed.shape)), (0, 1), (-2, -1))
    step[...] = place
    step[..., :3, 3] += signed[..., None] * place[:3, axis.index]
    return step


# Both branches are walked from their outer ends to the frame of the machine. A branch moves from
# its nominal to its actual pose by I + D. Behind an axis whose step is nominally N and actually A
# the motion is I + D' in front of it, with D' = (A · N⁻¹ − I) + A · D · N⁻¹. To first order A is N
# in the second term, and the first one is the sum of the errors of the axis.
#
# A step depends on the position of its axis only, so over a grid the arrays grow by one dimension
# per axis, and only the last steps have the size of the batch. An error of several axes is an
# array over these. The large numbers of a pose never enter D, so that small errors keep their
# digits.


class Link(NamedTuple):
    """One step of a branch: the offset and the motion of an axis, and its errors."""

    nominal: Rows  # rotation of N
    position_mm: Triple  # position of N
    actual: Rows  # rotation of A
    shift_um: Triple  # displacement of the origin of the frame before the axis, by A · N⁻¹ − I
    turn_urad: Rows  # its rotation part


class LoopLinks(NamedTuple):
    """The steps of both branches of a machine."""

    tool: tuple[Link, ...]  # from the frame of the machine outwards
    workpiece: tuple[Link, ...]
    tool_axis: Triple  # direction of the tool axis after the last step of the tool branch


class BranchMotion(NamedTuple):
    """Motion D of a branch in R, in the form of `Link`."""

    shift_um: Triple
    turn_urad: Rows

    def move(self, point_mm: Triple) -> Triple:
        """Compute the displacement of points of R, µm."""
        turned = components.rotate(self.turn_urad, point_mm)
        return components.add(self.shift_um, components.scale(UM_PER_MM_URAD, turned))


NO_DEVIATION = BranchMotion(components.ZERO, components.ZERO_ROWS)


def build_links(
    model: Model, coordinates: Coordinates, values: ErrorValues, *, exact: bool
) -> LoopLinks:
    tool, workpiece = (
        tuple(
            _build_link(model, axis, coordinates, values, exact=exact)
            for axis in model.machine.branch(side)
        )
        for side in ("tool", "workpiece")
    )
    direction = np.array(TOOL_AXIS)
    for _, offset, rotation in reversed(model.machine.end_frames("tool")):
        direction = transforms.placed(offset, rotation)[:3, :3] @ direction
    return LoopLinks(tool, workpiece, components.split(direction))


def _build_link(
    model: Model, axis: Axis, coordinates: Coordinates, values: ErrorValues, *, exact: bool
) -> Link:
    place = transforms.placed(axis.offset_mm, axis.rotation_deg)
    nominal = _nominal_step(axis, coordinates)
    actual = rotation = components.split_rows(nominal[..., :3, :3])
    shift_um, turn_urad = components.ZERO, components.ZERO_ROWS
    if not exact:
        shift_um, (x, y, z) = _small_motion(model, AxisFrames(axis, place, nominal), values)
        turn_urad = (0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)
    elif any(parameter(key).axis == axis.name for key in values):
        move, pose = motion(axis, coordinates[axis.name]), place
        constant = error_transform(axis.name, values, constant=True)
        component = error_transform(axis.name, values, constant=False)
        for factor in model.convention(axis.name).factors(constant, move, component):
            pose = pose if factor is None else pose @ factor
        deviation = pose @ transforms.inverse(place @ move) - np.eye(4)
        actual = components.split_rows(pose[..., :3, :3])
        shift_um = components.split(deviation[..., :3, 3] * UM_PER_MM)
        turn_urad = components.split_rows(deviation[..., :3, :3] * URAD_PER_RAD)
    return Link(rotation, components.split(nominal[..., :3, 3]), actual, shift_um, turn_urad)


def _small_motion(
    model: Model, frames: AxisFrames, values: Mapping[str, Array | float]
) -> tuple[Triple, Triple]:
    """Sum the errors of an axis to first order: displacement of the origin, and rotation vector."""
    convention = model.convention(frames.axis.name)
    shift_um = turn_urad = components.ZERO
    for key, value in values.items():
        row = parameter(key)
        if row.axis != frames.axis.name or not np.any(value):
            continue
        pose = convention.frame(frames, row)
        along = components.scale(
            components.simplify(np.asarray(value)), components.split(pose[..., :3, row.direction])
        )
        if row.is_rotation:
            turn_urad = components.add(turn_urad, along)
            lever = components.cross(components.split(pose[..., :3, 3]), along)
            along = components.scale(UM_PER_MM_URAD, lever)
        shift_um = components.add(shift_um, along)
    return shift_um, turn_urad


def solve_links(
    links: LoopLinks, loop: Loop, point_mm: Triple, *, exact: bool
) -> tuple[Triple, Triple]:
    axis = links.tool_axis
    for link in reversed(links.tool):
        axis = components.rotate(link.nominal, axis)
    first = _walk(links.workpiece) if loop is not Loop.TOOL else NO_DEVIATION
    last = _walk(links.tool) if loop is not Loop.WORKPIECE else NO_DEVIATION
    if loop is Loop.WORKPIECE:  # the workpiece relative to the frame, not the reverse
        first, last = last, first
    difference = BranchMotion(
        components.subtract(last.shift_um, first.shift_um),
        components.triple(map(components.subtract, last.turn_urad, first.turn_urad)),
    )
    error = difference.move(point_mm)
    if exact:
        tilts = (components.rotate(branch.turn_urad, axis) for branch in (first, last))
        start, end = (components.add(axis, components.scale(RAD_PER_URAD, tilt)) for tilt in tilts)
        return error, _between(start, end)
    (_, _, y), (z, _, _), (_, x, _) = difference.turn_urad
    along = components.dot((x, y, z), axis)
    return error, components.subtract((x, y, z), components.scale(along, axis))


def loop_error(
    model: Model,
    loop: Loop,
    coordinates: Coordinates,
    values: ErrorValues,
    point_mm: Array,
    *,
    exact: bool = True,
) -> tuple[Array, Array]:
    """Evaluate the error of a loop: with full rotations and all products, or to first order.

    Parameters
    ----------
    model : Model
    loop : Loop
    coordinates : mapping of str to ndarray, [...], mm or degrees
    values : mapping of str to ndarray, [...], µm or µrad
        Errors at the coordinates.
    point_mm : ndarray, [..., 3], mm
        Nominal point in R, which the tool and the workpiece point share.
    exact : bool, optional

    Returns
    -------
    error_um : ndarray, [..., 3], µm
        Position error in R, actual − nominal; for the relative loop tool minus workpiece.
    orientation_urad : ndarray, [..., 3], µrad
        Rotation vector that takes the nominal tool axis to the actual one; it has no part about
        the tool axis itself.
    """
    links = build_links(model, coordinates, values, exact=exact)
    solution = solve_links(links, loop, components.split(point_mm), exact=exact)
    arrays = [point_mm[..., 0], *coordinates.values(), *values.values()]
    shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
    error, orientation = np.empty((*shape, 3)), np.empty((*shape, 3))
    components.join(solution[0], error)
    components.join(solution[1], orientation)
    return error, orientation


def _walk(links: tuple[Link, ...]) -> BranchMotion:
    shift, turn = NO_DEVIATION
    for link in reversed(links):
        inside = components.multiply(link.actual, turn)
        carried = components.multiply(inside, components.transpose(link.nominal))
        lever = components.rotate(carried, link.position_mm)
        shift = components.add(
            components.add(link.shift_um, components.rotate(link.actual, shift)),
            components.scale(-UM_PER_MM_URAD, lever),
        )
        turn = components.triple(map(components.add, link.turn_urad, carried))
    return BranchMotion(shift, turn)


def _between(start: Triple, end: Triple) -> Triple:
    cross = components.cross(start, end)
    sine = np.sqrt(components.dot(cross, cross))
    angle = np.arctan2(sine, components.dot(start, end))
    ratio = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
    return components.scale(ratio * URAD_PER_RAD, cross)


# A translation error moves a point along its direction; a rotation error about direction d at frame
# origin p moves point P by d × (P − p). The lever P − p is the explanation of every gain.


@dataclass(frozen=True, slots=True)
class JacobianColumn:
    """One column of the geometric Jacobian."""

    direction: Array  # [..., 3]; unit vector in R along or about which the error acts
    lever_mm: Array  # [..., 3]; from the origin of the frame of the error to the point
    position: Array  # [..., 3], µm/µm or µm/µrad; displacement of the point per unit of the error
    sign: float  # +1, or −1 for the workpiece branch in the relative loop; already in `position`


def rotation_gain(lever_mm: ArrayLike, direction: ArrayLike) -> Array:
    """Compute the displacement of a point per unit of a small rotation.

    Parameters
    ----------
    lever_mm : array_like, [..., 3], mm
        From the rotating frame's origin to the point.
    direction : array_like, [..., 3]
        Unit vector of the rotation axis.

    Returns
    -------
    ndarray, [..., 3], µm/µrad
        First order: direction × lever, a millimetre times a microradian being a nanometre.
    """
    x, y, z = np.moveaxis(np.asarray(lever_mm, dtype=float), -1, 0)
    a, b, c = np.moveaxis(np.asarray(direction, dtype=float) * UM_PER_MM_URAD, -1, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], -1)


def columns(
    model: Model, loop: Loop, keys: Sequence[str], coordinates: Coordinates, point_mm: ArrayLike
) -> dict[str, JacobianColumn]:
    """Build the Jacobian columns of parameters that act in a loop, at points, [..., 3], mm."""
    sides = {"tool": 1.0, "workpiece": -1.0} if loop == Loop.RELATIVE else {str(loop): 1.0}
    rows = [parameter(key) for key in keys]
    jacobian_columns: dict[str, JacobianColumn] = {}
    for side, sign in sides.items():
        for frames in branch_frames(model, side, coordinates):
            convention = model.convention(frames.axis.name)
            for row in rows:
                if row.axis != frames.axis.name:
                    continue
                pose = convention.frame(frames, row)
                direction = pose[..., :3, row.direction]
                lever = np.asarray(point_mm, dtype=float) - pose[..., :3, 3]
                gain = rotation_gain(lever, direction) if row.is_rotation else direction
                jacobian_columns[row.key] = JacobianColumn(direction, lever, sign * gain, sign)
    return jacobian_columns


def jacobian(
    model: Model, loop: Loop, keys: Sequence[str], coordinates: Coordinates, point_mm: ArrayLike
) -> tuple[Array, Array]:
    """Build the Jacobian of position and tool-axis orientation.

    Parameters
    ----------
    model : Model
    loop : Loop
    keys : sequence of str, (K,)
        Parameter keys; one whose axis is not in the loop gives zeros.
    coordinates : mapping of str to ndarray, [...], mm or degrees
    point_mm : array_like, [..., 3], mm
        Nominal point in R.

    Returns
    -------
    position : ndarray, [K, ..., 3], µm/µm or µm/µrad
        Displacement in R per unit.
    orientation : ndarray, [K, ..., 3], µrad/µrad
        Rotation vector of the tool axis per unit, without the part about the axis itself.

    Notes
    -----
    First order in all errors; `warpspace.kinematics.chain.loop_error` is exact.
    """
    point = np.asarray(point_mm, dtype=float)
    shape = np.broadcast_shapes((*batch_shape(coordinates), 3), point.shape)
    position = np.zeros((len(keys), *shape))
    orientation = np.zeros((len(keys), *shape))
    about = tool_axis(model, coordinates)
    jacobian_columns = columns(model, loop, keys, coordinates, point)
    for index, key in enumerate(keys):
        col = jacobian_columns.get(key)
        if col is None:
            continue
        position[index] = col.position
        if parameter(key).is_rotation:
            along = np.sum(col.direction * about, axis=-1, keepdims=True)
            orientation[index] = col.sign * (col.direction - along * about)
    return position, orientation


# The small motion of a body is that of all errors between the frame and the body: to first order
# one rotation vector and one displacement. Exaggerated, it is an affine map that agrees exactly
# with the deformed grid.

BASE = "R"


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """Nominal pose of a body and its small motion."""

    nominal: Array  # [4, 4]; pose of the body's frame in R
    rotation_rad: Array  # [3]; small rotation vector in R
    displacement_mm: Array  # [3]; displacement of the point of the body at the origin of R

    def drawn(self, exaggeration: float) -> Array:
        """Compute the exaggerated affine map, [4, 4], from the frame of the body to R."""
        bend = np.eye(4)
        bend[:3, :3] += exaggeration * transforms.skew(self.rotation_rad)
        bend[:3, 3] = exaggeration * self.displacement_mm
        return bend @ self.nominal


def body_motions(
    model: Model, values: Mapping[str, Array | float], coordinates: Coordinates
) -> dict[str, BodyMotion]:
    """Compute the pose and the small motion of all bodies: R, the axes, S, t and w."""
    motions = {BASE: BodyMotion(np.eye(4), np.zeros(3), np.zeros(3))}
    for side in ("tool", "workpiece"):
        pose, turn, shift = np.eye(4), np.zeros(3), np.zeros(3)
        for frames in branch_frames(model, side, coordinates):
            shift_um, turn_urad = _small_motion(model, frames, values)
            pose, turn = frames.after, turn + np.array(turn_urad) * RAD_PER_URAD
            shift = shift + np.array(shift_um) * MM_PER_UM
            motions[frames.axis.name] = BodyMotion(pose, turn, shift)
        for name, offset, rotation in model.machine.end_frames(side):
            pose = pose @ transforms.placed(offset, rotation)
            motions[name] = BodyMotion(pose, turn, shift)
    return motions
