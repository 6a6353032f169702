"""Conversion of an error set to another convention; the error field is unchanged, exactly."""

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
    changes its shifts by the lever arm of its position, −q × ε to first order; for a rotary axis
    the directions of its errors rotate by its angle.
    """
    for axis, order in orders.items():
        axis_errors = AxisErrors(model, errors, axis, spans[axis])
        present, target = axis_errors.order, replace(model, own_component_errors=((axis, order),))
        if present != AxisErrors(target, errors, axis, spans[axis]).order:
            forward = order == ComponentErrors.BEFORE_MOTION
            linear = model.machine.axes[axis].is_linear
            errors = axis_errors.with_components(_across(axis_errors, forward=forward), adds=linear)
    names = {axis: model.convention(axis).name for axis in model.machine.axes} | dict(orders)
    main = max(dict.fromkeys(names.values()), key=list(names.values()).count)
    exceptions = tuple((axis, name) for axis, name in names.items() if name != main)
    return replace(model, component_errors=main, own_component_errors=exceptions), errors


def _across(axis_errors: AxisErrors, *, forward: bool) -> Along:
    def along(position: Array, errors: SmallMotion) -> SmallMotion:
        pose = axis_errors.pose(position)
        return errors.conjugate(pose if forward else transforms.inverse(pose))

    return along


def without(
    axis_errors: AxisErrors, motion: SmallMotion, position: Array, present: SmallMotion
) -> SmallMotion:
    """Remove from component errors, [n], a motion that was moved to the constants."""
    correction = motion.inverse
    if axis_errors.order == ComponentErrors.AFTER_MOTION:
        correction = correction.conjugate(transforms.inverse(axis_errors.pose(position)))
    return correction @ present


def moved_to_constants(axis_errors: AxisErrors, motion: SmallMotion) -> ErrorSet:
    """Move a motion from the component errors of an axis to its constants; the field is unchanged.

    ``E0 · M · E = (E0 · G) · M · (M⁻¹ · G⁻¹ · M · E)``, exactly; before the motion ``E0 · E · M =
    (E0 · G) · (G⁻¹ · E) · M``.
    """
    axis_errors.refuse_two_arguments(adds=False)
    if not motion.half.any() and not motion.shift_mm.any():
        return axis_errors.errors
    errors = axis_errors.with_components(
        lambda q, present: without(axis_errors, motion, q, present)
    )
    return AxisErrors(axis_errors.model, errors, axis_errors.axis, axis_errors.span).with_constant(
        axis_errors.constant @ motion
    )


def zero_at(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], positions: Mapping[str, float]
) -> ErrorSet:
    """Make all six component errors of axes zero at a position; the field is unchanged."""
    for axis, position in positions.items():
        axis_errors = AxisErrors(model, errors, axis, spans[axis])
        at = np.asarray(float(position))
        motion = axis_errors.at(at)
        if axis_errors.order == ComponentErrors.AFTER_MOTION:
            motion = motion.conjugate(axis_errors.pose(at))
        errors = moved_to_constants(axis_errors, motion)
    return errors


AT_REST_UM = 1e-6  # µm: largest error of a point that counts as zero


def error_at(model: Model, errors: ErrorSet, at: Coordinates) -> Array:
    """Compute the exact error of the tool point in R at one position of the axes, [3], µm."""
    point = nominal_point(model, Loop.TOOL, at)
    values = {key: errors.evaluate_at(key, at, model.direction) for key in errors}
    return loop_error(model, Loop.TOOL, at, values, point)[0]


def shifted(model: Model, errors: ErrorSet, shift_um: Array) -> ErrorSet:
    """Move the entire tool branch in R by the location of its first axis, [3], µm; exact."""
    branch = model.machine.branch("tool")
    if not branch:
        raise OptionError(
            "no axis carries the tool; no location of an axis can make the error of the point zero"
        )
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
    """Return errors that are zero at a point; all others change by the same vector."""
    return shifted(model, errors, -error_at(model, errors, at))


def held_by_view(model: Model, errors: ErrorSet, at: Coordinates) -> ErrorSet:
    """Return errors without the location of the first axis, redundant with a reference point."""
    error_um = error_at(model, errors, at)
    if np.linalg.norm(error_um) > AT_REST_UM:
        raise OptionError(
            f"the error at that point is {np.linalg.norm(error_um):.3g} µm; expected a point of"
            " zero error, since any other reference changes the map"
        )
    first = model.machine.branch("tool")[0].name if model.machine.branch("tool") else ""
    gone = {f"E{letter}0{first}" for letter in "XYZ"}
    functions = {key: function for key, function in errors.functions.items() if key not in gone}
    return replace(errors, functions=functions)


N_POSITIONS = 101  # for the fit of a line to a curve without measured points
MAX_STEPS = 8  # iterations of the reference line; each reduces the residual by about 1e-6


class ReferenceLine(StrEnum):
    """Reference line of a straightness curve (ISO 230-1, 3.4.7 to 3.4.9)."""

    END_POINT = "end_point"
    LEAST_SQUARES = "least_squares"
    MINIMUM_ZONE = "minimum_zone"


def fit_line(position: Array, value: Array, line: ReferenceLine | str) -> tuple[float, float]:
    """Fit a reference line to a straightness curve: offset at zero, µm, and slope, µm/mm.

    Positions, [n], mm, ascend; values, [n], are in µm. The line connects the first and the last
    point, minimises the sum of squares, or is the centre of the minimum zone, measured across the
    position.
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
            deviation = value - slope * position
            return float(deviation.max() + deviation.min()) / 2.0, slope


def _narrowest(x: Array, y: Array) -> float:
    """Compute the slope of the minimum zone: one of its sides lies along the convex hull."""
    from scipy.spatial import ConvexHull

    x, y = x - x[0], y - y[0]
    slope = float(y[-1] / x[-1])
    deviation = y - slope * x
    length, height = x[-1], np.ptp(deviation)
    if len(x) < 3 or not height:
        return slope
    points = np.stack(
        [x / length, deviation / height]
    )  # scaled, since the hull of almost collinear points fails
    hull = points[:, ConvexHull(points.T).vertices]
    run, rise = np.roll(hull, -1, axis=1) - hull
    slopes = rise[run != 0.0] / run[run != 0.0]
    bands = np.ptp(hull[1] - slopes[:, None] * hull[0], axis=1)
    return slope + float(slopes[np.argmin(bands)] * height / length)


def convert_reference_line(
    model: Model, errors: ErrorSet, spans: Mapping[str, Span], lines: Mapping[str, str]
) -> ErrorSet:
    """Remove the reference line from the straightness of linear axes; the field is unchanged."""
    for axis, line in lines.items():
        axis_errors = AxisErrors(model, errors, axis, spans[axis])
        if not model.machine.axes[axis].is_linear:
            raise OptionError(f"{axis} is rotary; only linear axes have straightness")
        if axis_errors.order != ComponentErrors.AFTER_MOTION:
            raise OptionError(
                f"errors of {axis} act {axis_errors.order}, where a rotation tilts the motion as"
                " well and a straightness does not; expected component_errors after_motion"
            )
        errors = moved_to_constants(axis_errors, _line_motion(axis_errors, ReferenceLine(line)))
    return errors


def _line_motion(axis_errors: AxisErrors, line: ReferenceLine) -> SmallMotion:
    axis = axis_errors.model.machine.axes[axis_errors.axis]
    along = axis.direction * np.eye(3)[axis.index]
    motion = SmallMotion(np.zeros(3), np.zeros(3))
    for _ in range(MAX_STEPS):
        offset, slope = np.zeros(3), np.zeros(3)
        for index in range(3):
            if index != axis.index:
                at = line_positions(axis_errors, axis_errors.keys()[index])
                straightness = without(axis_errors, motion, at, axis_errors.at(at)).to_errors()[0][
                    :, index
                ]
                offset[index], slope[index] = fit_line(at, straightness, line)
        if not offset.any() and not slope.any():
            break
        turn = np.cross(along, slope * MM_PER_UM)
        motion = motion @ SmallMotion(turn / 2.0, offset * MM_PER_UM)
    return motion


def line_positions(axis_errors: AxisErrors, key: str) -> Array:
    """Return positions for a line fit, [n]: the measured points of a curve, else evenly spaced."""
    low, high = axis_errors.span
    points = np.array(axis_errors.points(key))
    points = points[(points >= low) & (points <= high)]
    return points if len(points) > 1 else np.linspace(low, high, N_POSITIONS)


def move_measuring_line(
    model: Model,
    errors: ErrorSet,
    spans: Mapping[str, Span],
    lines_mm: Mapping[str, Vector],
    *,
    to_origin: bool,
) -> ErrorSet:
    """Move translations between the origin of an axis and a parallel measuring line.

    The point at p moves by δ + (R(ε) − 1)·p, to first order by δ + ε × p: 10 µrad of pitch on an
    arm of 100 mm are 1 µm. Exact, with the full rotation. Before the motion the arm is the place of
    the same point there, ``M(q) · p``.
    """
    sign = -1.0 if to_origin else 1.0
    for axis, place in lines_mm.items():
        axis_errors = AxisErrors(model, errors, axis, spans[axis])
        point = np.array(place, dtype=float)
        errors = axis_errors.with_components(_on_arm(axis_errors, point, sign), adds=True)
    return errors


def _on_arm(axis_errors: AxisErrors, point_mm: Array, sign: float) -> Along:
    is_fixed = axis_errors.order == ComponentErrors.BEFORE_MOTION

    def along(position: Array, errors: SmallMotion) -> SmallMotion:
        lever = transforms.apply(axis_errors.pose(position), point_mm) if is_fixed else point_mm
        return SmallMotion(errors.half, errors.shift_mm + sign * errors.displacement(lever))

    return along


class SquarenessSign(StrEnum):
    """Sign convention of squareness errors."""

    RIGHT_HAND = "right_hand"
    OVER_90 = "over_90"
    UNDER_90 = "under_90"


def angle_sign(key: str) -> int:
    """Return the sign of the change of the angle between axes by a positive squareness."""
    row = parameter(key)
    along, about = direction_index(row.axis), row.direction
    return -1 if (along - about) % 3 == 1 else 1


def squareness_keys(machine: Machine) -> tuple[str, ...]:
    directions = {direction_index(axis) for axis in machine.axes if is_linear(axis)}
    rows = [(parameter(key), direction_index(parameter(key).axis)) for key in machine.allowed_keys]
    return tuple(
        row.key
        for row, along in rows
        if row.kind is ErrorKind.SQUARENESS
        and row.direction != along
        and 3 - along - row.direction in directions
    )


def convert_squareness(machine: Machine, errors: ErrorSet, sign: SquarenessSign | str) -> ErrorSet:
    """Convert squareness errors to, or equally from, another sign convention."""
    sign = SquarenessSign(sign)
    if sign is SquarenessSign.RIGHT_HAND:
        return errors
    turned = 1 if sign is SquarenessSign.OVER_90 else -1
    functions = dict(errors.functions)
    for key in squareness_keys(machine):
        if key in functions and angle_sign(key) != turned:
            functions[key] = functions[key].scaled(-1.0)
    return ErrorSet(functions)
