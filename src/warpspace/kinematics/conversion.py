"""One error set in another convention: the same field from other numbers, exactly."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.axis_errors import Along, AxisErrors, SmallMotion
from warpspace.kinematics.chain import loop_error, nominal_point
from warpspace.kinematics.model import ComponentErrors, Coordinates, Loop, Model
from warpspace.machine.axes import ErrorKind, direction_index, is_linear, parameter
from warpspace.machine.curves.curve import Span
from warpspace.machine.curves.polynomial_pieces import SMALL
from warpspace.machine.curves.simple import Constant
from warpspace.machine.definition import Machine, Vector
from warpspace.machine.errors import ErrorSet
from warpspace.units import MM_PER_UM, Array


def convert_order(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], orders: Mapping[str, str]
) -> tuple[Model, ErrorSet]:
    """Write component errors in another order of motion and errors.

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
    def along(position: Array, errors: SmallMotion) -> SmallMotion:
        pose = own.pose(position)
        return errors.conjugate(pose if forward else transforms.inverse(pose))

    return along


def without(
    own: AxisErrors, taken: SmallMotion, position: Array, present: SmallMotion
) -> SmallMotion:
    """Give the component errors, [n], left where a motion before the axis went to the constants."""
    back = taken.inverse
    if own.order == ComponentErrors.AFTER_MOTION:
        back = back.conjugate(transforms.inverse(own.pose(position)))
    return back @ present


def moved_to_constants(own: AxisErrors, taken: SmallMotion) -> ErrorSet:
    """Move a motion from the component errors of an axis to its constants; the field stays.

    ``E0 · M · E = (E0 · G) · M · (M⁻¹ · G⁻¹ · M · E)``, exactly; before the motion ``E0 · E · M =
    (E0 · G) · (G⁻¹ · E) · M``.
    """
    own.refuse_two_arguments(adds=False)
    if not taken.half.any() and not taken.shift_mm.any():
        return own.errors
    errors = own.with_components(lambda q, present: without(own, taken, q, present))
    return AxisErrors(own.model, errors, own.axis, own.span).with_constant(own.constant @ taken)


def zero_at(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], positions: Mapping[str, float]
) -> ErrorSet:
    """Make all six component errors of axes zero at a position; the field stays."""
    for axis, position in positions.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        there = np.asarray(float(position))
        taken = own.at(there)
        if own.order == ComponentErrors.AFTER_MOTION:
            taken = taken.conjugate(own.pose(there))
        errors = moved_to_constants(own, taken)
    return errors


AT_REST_UM = 1e-6  # µm: a point whose error is smaller is held still by the errors themselves


def error_at(model: Model, errors: ErrorSet, at: Coordinates) -> Array:
    """Give the exact error of the tool point in R at one position of the axes, [3], µm."""
    point = nominal_point(model, Loop.TOOL, at)
    values = {key: errors.evaluate_at(key, at, model.direction) for key in errors}
    return loop_error(model, Loop.TOOL, at, values, point)[0]


def shifted(model: Model, errors: ErrorSet, shift_um: Array) -> ErrorSet:
    """Move the whole tool branch in R by the location of its first axis, [3], µm; exact."""
    branch = model.machine.branch("tool")
    if not branch:
        raise OptionError("no axis carries the tool; its point is held by no location of an axis")
    first = branch[0]
    placed = transforms.placed(first.offset_mm, first.rotation_deg)[:3, :3]
    functions = dict(errors.functions)
    for letter, part in zip("XYZ", (placed.T @ shift_um).tolist(), strict=True):
        key = f"E{letter}0{first.name}"
        value = errors.amplitude(key) + part
        functions.pop(key, None)
        if abs(value) > SMALL:
            functions[key] = Constant(first.travel, value)
    return ErrorSet(functions)


def held_by_constants(model: Model, errors: ErrorSet, at: Coordinates) -> ErrorSet:
    """Give errors that are zero at a point by themselves, all others changed by the same vector."""
    return shifted(model, errors, -error_at(model, errors, at))


def held_by_view(model: Model, errors: ErrorSet, at: Coordinates) -> ErrorSet:
    """Give errors without the location of the first axis, where the view may hold the point."""
    there = error_at(model, errors, at)
    if np.linalg.norm(there) > AT_REST_UM:
        raise OptionError(
            f"the error at that point is {np.linalg.norm(there):.3g} µm; expected a point whose"
            " error is zero, since holding any other changes the map"
        )
    first = model.machine.branch("tool")[0].name if model.machine.branch("tool") else ""
    gone = {f"E{letter}0{first}" for letter in "XYZ"}
    kept = {key: one for key, one in errors.functions.items() if key not in gone}
    return replace(errors, functions=kept)


EVENLY = 101  # positions that a line is laid through where a curve has no points of its own
STEPS = 8  # steps to the line of the exact motion; each leaves a millionth of the one before


class ReferenceLine(StrEnum):
    """Which straight line is laid through a straightness curve (ISO 230-1, 3.4.7 to 3.4.9)."""

    END_POINT = "end_point"
    LEAST_SQUARES = "least_squares"
    MINIMUM_ZONE = "minimum_zone"


def fit_line(position: Array, value: Array, line: ReferenceLine | str) -> tuple[float, float]:
    """Lay a reference line through a straightness curve: offset at zero, µm, and slope, µm/mm.

    Positions, [n], mm, ascend; values, [n], are in µm. The line goes through the first and the last
    point, has the least sum of squares, or is the middle of the narrowest band, measured across the
    position, that holds all points.
    """
    match ReferenceLine(line):
        case ReferenceLine.END_POINT:
            slope = float((value[-1] - value[0]) / (position[-1] - position[0]))
            return float(value[0] - slope * position[0]), slope
        case ReferenceLine.LEAST_SQUARES:
            middle = position.mean()
            away = position - middle
            slope = float(away @ (value - value.mean()) / (away @ away))
            return float(value.mean() - slope * middle), slope
        case ReferenceLine.MINIMUM_ZONE:
            slope = _narrowest(position, value)
            rest = value - slope * position
            return float(rest.max() + rest.min()) / 2.0, slope


def _narrowest(x: Array, y: Array) -> float:
    """Give the slope of the narrowest band: one of its sides lies along the convex hull."""
    from scipy.spatial import ConvexHull

    x, y = x - x[0], y - y[0]
    slope = float(y[-1] / x[-1])
    rest = y - slope * x
    length, height = x[-1], np.ptp(rest)
    if len(x) < 3 or not height:
        return slope
    points = np.stack([x / length, rest / height])  # a flat hull would not be found
    hull = points[:, ConvexHull(points.T).vertices]
    run, rise = np.roll(hull, -1, axis=1) - hull
    slopes = rise[run != 0.0] / run[run != 0.0]
    bands = np.ptp(hull[1] - slopes[:, None] * hull[0], axis=1)
    return slope + float(slopes[np.argmin(bands)] * height / length)


def convert_reference_line(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], lines: Mapping[str, str]
) -> ErrorSet:
    """Take the reference line out of the straightness of linear axes; the field stays."""
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
    axis = own.model.machine.axes[own.axis]
    along = axis.direction * np.eye(3)[axis.index]
    taken = SmallMotion(np.zeros(3), np.zeros(3))
    for _ in range(STEPS):
        offset, slope = np.zeros(3), np.zeros(3)
        for index in range(3):
            if index != axis.index:
                at = line_positions(own, own.keys()[index])
                left = without(own, taken, at, own.at(at)).to_errors()[0][:, index]
                offset[index], slope[index] = fit_line(at, left, line)
        if not offset.any() and not slope.any():
            break
        turn = np.cross(along, slope * MM_PER_UM)
        taken = taken @ SmallMotion(turn / 2.0, offset * MM_PER_UM)
    return taken


def line_positions(own: AxisErrors, key: str) -> Array:
    """Give where a line is laid through a curve: its points as measured, else evenly, [n]."""
    low, high = own.span
    points = np.array(own.points(key))
    points = points[(points >= low) & (points <= high)]
    return points if len(points) > 1 else np.linspace(low, high, EVENLY)


def move_measuring_line(
    model: Model,
    errors: ErrorSet,
    spans: Mapping[str, Span],
    lines_mm: Mapping[str, Vector],
    *,
    to_origin: bool,
) -> ErrorSet:
    """Move translations between the origin of an axis and a line beside it.

    The point at p moves by δ + (R(ε) − 1)·p, to first order by δ + ε × p: 10 µrad of pitch on an
    arm of 100 mm are 1 µm. Exact, with the full rotation. Before the motion the arm is the place of
    the same point there, ``M(q) · p``.
    """
    sign = -1.0 if to_origin else 1.0
    for axis, place in lines_mm.items():
        own = AxisErrors(model, errors, axis, spans[axis])
        point = np.array(place, dtype=float)
        errors = own.with_components(_on_arm(own, point, sign), adds=True)
    return errors


def _on_arm(own: AxisErrors, point_mm: Array, sign: float) -> Along:
    is_fixed = own.order == ComponentErrors.BEFORE_MOTION

    def along(position: Array, errors: SmallMotion) -> SmallMotion:
        lever = transforms.apply(own.pose(position), point_mm) if is_fixed else point_mm
        return SmallMotion(errors.half, errors.shift_mm + sign * errors.displacement(lever))

    return along


class SquarenessSign(StrEnum):
    """What a positive squareness means."""

    RIGHT_HAND = "right_hand"
    OVER_90 = "over_90"
    UNDER_90 = "under_90"


def angle_sign(key: str) -> int:
    """Tell what a positive squareness by the right-hand rule does to the angle between the axes."""
    row = parameter(key)
    own, about = direction_index(row.axis), row.direction
    return -1 if (own - about) % 3 == 1 else 1


def squareness_keys(machine: Machine) -> tuple[str, ...]:
    directions = {direction_index(axis) for axis in machine.axes if is_linear(axis)}
    own = [(parameter(key), direction_index(parameter(key).axis)) for key in machine.allowed_keys]
    return tuple(
        row.key
        for row, along in own
        if row.kind is ErrorKind.SQUARENESS
        and row.direction != along
        and 3 - along - row.direction in directions
    )


def convert_squareness(machine: Machine, errors: ErrorSet, sign: SquarenessSign | str) -> ErrorSet:
    """Write squareness errors with another sign, or read them; both are the same step."""
    sign = SquarenessSign(sign)
    if sign is SquarenessSign.RIGHT_HAND:
        return errors
    turned = 1 if sign is SquarenessSign.OVER_90 else -1
    functions = dict(errors.functions)
    for key in squareness_keys(machine):
        if key in functions and angle_sign(key) != turned:
            functions[key] = functions[key].scaled(-1.0)
    return ErrorSet(functions)
