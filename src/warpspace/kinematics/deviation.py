"""What errors do to a loop: both branches walked from their outer ends to the frame of the machine.

A branch moves from its nominal to its actual pose by ``I + D``. Behind an axis whose step is
nominally N and actually A the motion is ``I + D'`` in front of it, with

    D' = (A · N⁻¹ − I) + A · D · N⁻¹.

To first order A is N in the second term, and the first one is the sum of the errors of the axis.
An axis knows its own position only, so over a grid the arrays grow by one direction an axis, and
only the last steps have the size of the batch. An error that depends on several axes is an array
over these. The large numbers of a pose never enter D, so that small errors keep their digits.
"""

from typing import NamedTuple

import numpy as np

from warpspace.kinematics import components, transforms
from warpspace.kinematics.chain import ErrorValues, error_transform, motion
from warpspace.kinematics.components import Rows, Triple
from warpspace.kinematics.model import TOOL_AXIS, AxisFrames, Coordinates, Loop, Model
from warpspace.machine.description import Axis
from warpspace.machine.parameters import parameter
from warpspace.units import RAD_PER_URAD, UM_PER_MM, UM_PER_MM_URAD, URAD_PER_RAD, Array


class Link(NamedTuple):
    """One step of a branch: the offset and the motion of an axis, and its errors."""

    nominal: Rows  # rotation of N
    position_mm: Triple  # position of N
    actual: Rows  # rotation of A
    shift_um: Triple  # what A · N⁻¹ − I does to the origin of the frame before the axis
    turn_urad: Rows  # its rotation part


class LoopLinks(NamedTuple):
    """The steps of both branches of a machine."""

    tool: tuple[Link, ...]  # from the frame of the machine outwards
    workpiece: tuple[Link, ...]
    tool_axis: Triple  # direction of the tool axis behind the last step of the tool branch


class Deviation(NamedTuple):
    """The motion D of a branch in R, as `Link` has it of an axis."""

    shift_um: Triple
    turn_urad: Rows

    def move(self, point_mm: Triple) -> Triple:
        """Give the displacement of points of R, µm."""
        turned = components.rotate(self.turn_urad, point_mm)
        return components.add(self.shift_um, components.scale(UM_PER_MM_URAD, turned))


NO_DEVIATION = Deviation(components.ZERO, components.ZERO_ROWS)


def build_links(
    model: Model, coordinates: Coordinates, values: ErrorValues, *, exact: bool
) -> LoopLinks:
    """Work out the steps of both branches; errors at coordinates of one axis stay over that."""
    make = _exact_link if exact else _first_order_link
    tool, workpiece = (
        tuple(make(model, axis, coordinates, values) for axis in model.machine.branch(side))
        for side in ("tool", "workpiece")
    )
    direction = np.array(TOOL_AXIS)
    for _, offset, rotation in reversed(model.machine.end_frames("tool")):
        direction = transforms.placed(offset, rotation)[:3, :3] @ direction
    return LoopLinks(tool, workpiece, components.split(direction))


def _link(nominal: Array, actual: Array, shift_um: Array, turn_urad: Array) -> Link:
    return Link(
        components.split_rows(nominal[..., :3, :3]),
        components.split(nominal[..., :3, 3]),
        components.split_rows(actual[..., :3, :3]),
        components.split(shift_um),
        components.split_rows(turn_urad),
    )


def _exact_link(model: Model, axis: Axis, coordinates: Coordinates, values: ErrorValues) -> Link:
    place = transforms.placed(axis.offset_mm, axis.rotation_deg)
    move = motion(axis, coordinates[axis.name])
    constant = error_transform(axis.name, values, constant=True)
    component = error_transform(axis.name, values, constant=False)
    nominal = place @ move
    if constant is None and component is None:
        return _link(nominal, nominal, np.zeros(3), np.zeros((3, 3)))
    actual = place
    for factor in model.convention(axis.name).factors(constant, move, component):
        actual = actual if factor is None else actual @ factor
    own = actual @ transforms.inverse(nominal) - np.eye(4)
    return _link(nominal, actual, own[..., :3, 3] * UM_PER_MM, own[..., :3, :3] * URAD_PER_RAD)


def _first_order_link(
    model: Model, axis: Axis, coordinates: Coordinates, values: ErrorValues
) -> Link:
    place = transforms.placed(axis.offset_mm, axis.rotation_deg)
    nominal = place @ motion(axis, coordinates[axis.name])
    frames, convention = AxisFrames(axis, place, nominal), model.convention(axis.name)
    shift, turn = np.zeros(3), np.zeros(3)
    for key, value in values.items():
        row = parameter(key)
        if row.axis != axis.name or not np.any(value):
            continue
        pose = convention.frame(frames, row)
        along = pose[..., :3, row.direction] * value[..., None]
        if row.is_rotation:
            turn = turn + along
            along = np.cross(pose[..., :3, 3], along) * UM_PER_MM_URAD
        shift = shift + along
    return _link(nominal, nominal, shift, transforms.skew(turn))


def solve_links(
    links: LoopLinks, loop: Loop, point_mm: Triple, *, exact: bool
) -> tuple[Triple, Triple]:
    """Evaluate the error of a loop."""
    axis = links.tool_axis
    for link in reversed(links.tool):
        axis = components.rotate(link.nominal, axis)
    first = _walk(links.workpiece) if loop is not Loop.TOOL else NO_DEVIATION
    last = _walk(links.tool) if loop is not Loop.WORKPIECE else NO_DEVIATION
    if loop is Loop.WORKPIECE:  # the workpiece against the frame, not the frame against it
        first, last = last, first
    difference = Deviation(
        components.subtract(last.shift_um, first.shift_um),
        components.subtract_rows(last.turn_urad, first.turn_urad),
    )
    error = difference.move(point_mm)
    if exact:
        tilts = (components.rotate(each.turn_urad, axis) for each in (first, last))
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
    found = solve_links(links, loop, components.split(point_mm), exact=exact)
    arrays = [point_mm[..., 0], *coordinates.values(), *values.values()]
    shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
    error, orientation = np.empty((*shape, 3)), np.empty((*shape, 3))
    components.join(found[0], error)
    components.join(found[1], orientation)
    return error, orientation


def _walk(links: tuple[Link, ...]) -> Deviation:
    shift, turn = NO_DEVIATION
    for link in reversed(links):
        inside = components.multiply(link.actual, turn)
        carried = components.multiply(inside, components.transpose(link.nominal))
        lever = components.rotate(carried, link.position_mm)
        shift = components.add(
            components.add(link.shift_um, components.rotate(link.actual, shift)),
            components.scale(-UM_PER_MM_URAD, lever),
        )
        turn = components.add_rows(link.turn_urad, carried)
    return Deviation(shift, turn)


def _between(start: Triple, end: Triple) -> Triple:
    """Rotation vector that takes one unit vector to another the short way, µrad."""
    cross = components.cross(start, end)
    sine = np.sqrt(components.dot(cross, cross))
    angle = np.arctan2(sine, components.dot(start, end))
    ratio = np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0)
    return components.scale(ratio * URAD_PER_RAD, cross)
