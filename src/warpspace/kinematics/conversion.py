"""Conversion of an error set to another convention; the error field is unchanged, exactly."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics import chain, transforms
from warpspace.kinematics.model import ComponentErrors, Coordinates, Loop, Model
from warpspace.machine import axes
from warpspace.machine.curves.curve import Span
from warpspace.machine.curves.polynomial_pieces import SMALL, Pieces, fit_curves
from warpspace.machine.curves.simple import Constant, Directional
from warpspace.machine.curves.table import TableCurve
from warpspace.machine.definition import Machine, Vector
from warpspace.machine.errors import ErrorSet
from warpspace.units import MM_PER_UM, RAD_PER_URAD, UM_PER_MM, URAD_PER_RAD, Array

# A rotation by its half-angle vector, and a shift.
#
# Matrices near the identity lose the digits of small angles; here all numbers are small, so that
# products and inverses are exact to the last digit.


@dataclass(frozen=True, slots=True)
class SmallMotion:
    """``Trans(shift) · Rot``, the transformation of errors, in a batch."""

    half: Array  # [..., 3]; direction of the rotation axis times the sine of half the angle
    shift_mm: Array  # [..., 3]

    @classmethod
    def from_errors(cls, errors: Array) -> "SmallMotion":
        """Build the motion of six errors, [..., 6]: shifts, µm, and rotation vector, µrad."""
        angle = errors[..., 3:] * RAD_PER_URAD
        size = np.linalg.norm(angle, axis=-1, keepdims=True)
        share = np.sinc(size / (2.0 * np.pi)) / 2.0  # sin(a/2) / a
        return cls(angle * share, errors[..., :3] * MM_PER_UM)

    def to_errors(self) -> Array:
        """Return the six errors, [..., 6], µm and µrad."""
        sine = np.linalg.norm(self.half, axis=-1, keepdims=True)
        safe = np.where(sine > 0.0, sine, 1.0)
        share = np.where(sine > 0.0, 2.0 * np.arcsin(np.minimum(sine, 1.0)) / safe, 2.0)
        turn_urad = self.half * share * URAD_PER_RAD
        return np.concatenate([self.shift_mm * UM_PER_MM, turn_urad], axis=-1)

    def __matmul__(self, other: "SmallMotion") -> "SmallMotion":
        """Multiply: the other motion first, then this one."""
        half = (
            self._cosine * other.half + other._cosine * self.half + np.cross(self.half, other.half)
        )
        return SmallMotion(half, self.shift_mm + other.shift_mm + self.displacement(other.shift_mm))

    @property
    def _cosine(self) -> Array:
        return np.sqrt(1.0 - np.sum(self.half**2, axis=-1, keepdims=True))

    def displacement(self, lever_mm: Array) -> Array:
        """Compute the displacement by the rotation, ``(Rot − 1) · lever``, [..., 3], mm."""
        across = np.cross(self.half, lever_mm)
        return 2.0 * (self._cosine * across + np.cross(self.half, across))

    @property
    def inverse(self) -> "SmallMotion":
        rotation = SmallMotion(-self.half, np.zeros(3))
        return SmallMotion(-self.half, -self.shift_mm - rotation.displacement(self.shift_mm))

    def conjugate(self, pose: Array) -> "SmallMotion":
        """Compute ``pose · motion · pose⁻¹`` for poses, [..., 4, 4], of any size."""
        turn, place = pose[..., :3, :3], pose[..., :3, 3]
        turned = SmallMotion(transforms.rotate(turn, self.half), np.zeros(3))
        shift = transforms.rotate(turn, self.shift_mm) - turned.displacement(place)
        return SmallMotion(turned.half, shift)


Along = Callable[[Array, SmallMotion], SmallMotion]
"""Function from positions, [n], and their component errors to other component errors."""
N_POSITIONS = 101  # for the fit of a line to a curve without measured points


@dataclass(frozen=True, slots=True)
class AxisErrors:
    """Errors of one axis, read as motions and written as curves."""

    model: Model
    errors: ErrorSet
    axis: str
    span: Span  # mm or degrees; range over which the conversion holds

    @property
    def order(self) -> str:
        name = self.model.convention(self.axis).name
        if name not in [*ComponentErrors]:
            names = ", ".join(ComponentErrors)
            raise OptionError(
                f"convention {name!r} of {self.axis} cannot be converted; only {names}"
            )
        return name

    def keys(self, *, constant: bool = False) -> tuple[str, ...]:
        """Keys of the six component or constant errors: shifts, then rotations."""
        return tuple(f"E{letter}{'0' * constant}{self.axis}" for letter in axes.DIRECTIONS)

    def pose(self, position: Array) -> Array:
        """Nominal motion of the axis, [..., 4, 4]."""
        return chain.motion(self.model.machine.axes[self.axis], position)

    def at(self, position: Array, direction: str = axes.TravelDirection.MEAN) -> SmallMotion:
        """Evaluate the component errors at positions, [n], without those of two arguments."""
        along = {self.axis: np.asarray(position, dtype=float)}
        values = [
            np.zeros(along[self.axis].shape)
            if self._depends_on_others(key)
            else self.errors.evaluate_at(key, along, direction)
            for key in self.keys()
        ]
        return SmallMotion.from_errors(np.stack(values, -1))

    def _depends_on_others(self, key: str) -> bool:
        return any(axis != self.axis for axis in self.errors.arguments(key))

    def points(self, key: str) -> tuple[float, ...]:
        """Measured positions of an error, empty for a curve without."""
        function = self.errors.functions.get(key)
        if isinstance(function, Pieces):
            return function.points
        return function.kinks if isinstance(function, TableCurve) else ()

    def line_positions(self, key: str) -> Array:
        """Return positions for a line fit, [n]: the measured points, else evenly spaced."""
        low, high = self.span
        points = np.array(self.points(key))
        points = points[(points >= low) & (points <= high)]
        return points if len(points) > 1 else np.linspace(low, high, N_POSITIONS)

    def with_components(self, along: Along, *, adds: bool = False) -> ErrorSet:
        """Change the component errors; where it only adds to shifts these may have two arguments.

        Raises OptionError for others of two arguments.
        """
        self._refuse_two_arguments(adds=adds)
        functions = [self.errors.functions[key] for key in self.keys() if key in self.errors]
        kinks = np.unique(np.concatenate([np.zeros(0), *(curve.kinks for curve in functions)]))
        directions = [axes.TravelDirection.MEAN]
        if any(curve.has_directions for curve in functions):
            directions = [axes.TravelDirection.FORWARD, axes.TravelDirection.BACKWARD]

        def values(direction: str, position: Array) -> Array:
            return along(position, self.at(position, direction)).to_errors()

        def differences(direction: str, position: Array) -> Array:
            present = self.at(position, direction).to_errors()
            difference = values(direction, position) - present
            return np.where(np.abs(difference) > 1e-14 * np.abs(present), difference, 0.0)

        changes, new = (
            [fit_curves(partial(function, way), self.span, kinks) for way in directions]
            for function in (differences, values)
        )
        chosen = dict(self.errors.functions)
        for index, key in enumerate(self.keys()):
            if all(change[index] is None for change in changes):
                continue
            if self._depends_on_others(key):
                raise OptionError(
                    f"{key} depends on {' and '.join(self.errors.arguments(key))} and would change"
                    " along one of them; this cannot be converted exactly"
                )
            chosen.pop(key, None)
            forward, backward = new[0][index], new[-1][index]
            curve = forward
            if forward != backward:
                nothing = Constant(self.span)
                curve = Directional(self.span, forward or nothing, backward or nothing)
            if isinstance(curve, Pieces):
                curve = replace(curve, points=self.points(key))
            if curve is not None:
                chosen[key] = curve
        return ErrorSet(chosen)

    def _refuse_two_arguments(self, *, adds: bool) -> None:
        for key in self.keys():
            if self._depends_on_others(key) and not (adds and key[1] in axes.DIRECTIONS[:3]):
                other = " and ".join(self.errors.arguments(key))
                raise OptionError(
                    f"{key} depends on {other}; errors of {self.axis} cannot be converted exactly"
                    " with it"
                )

    def across_motion(self, position: Array, errors: SmallMotion) -> SmallMotion:
        """Move component errors, [n], to the other side of the motion."""
        pose = self.pose(position)
        is_after = self.order == ComponentErrors.AFTER_MOTION
        return errors.conjugate(pose if is_after else transforms.inverse(pose))

    def on_arm(
        self, point_mm: Array, sign: float, position: Array, errors: SmallMotion
    ) -> SmallMotion:
        """Add the displacement of a point to the shifts, or subtract it."""
        is_fixed = self.order == ComponentErrors.BEFORE_MOTION
        lever = transforms.apply(self.pose(position), point_mm) if is_fixed else point_mm
        return SmallMotion(errors.half, errors.shift_mm + sign * errors.displacement(lever))

    def without(self, motion: SmallMotion, position: Array, present: SmallMotion) -> SmallMotion:
        """Remove from component errors, [n], a motion that was moved to the constants."""
        correction = motion.inverse
        if self.order == ComponentErrors.AFTER_MOTION:
            correction = correction.conjugate(transforms.inverse(self.pose(position)))
        return correction @ present

    def moved_to_constants(self, motion: SmallMotion) -> ErrorSet:
        """Move a motion from the component errors to the constants; the field is unchanged.

        ``E0 · M · E = (E0 · G) · M · (M⁻¹ · G⁻¹ · M · E)``, exactly; before the motion
        ``E0 · E · M = (E0 · G) · (G⁻¹ · E) · M``.
        """
        self._refuse_two_arguments(adds=False)
        if not motion.half.any() and not motion.shift_mm.any():
            return self.errors
        keys = self.keys(constant=True)
        present = np.array([self.errors.amplitude(key) for key in keys])
        values = (SmallMotion.from_errors(present) @ motion).to_errors()
        chosen = dict(self.with_components(partial(self.without, motion)).functions)
        for key, value, before in zip(keys, values.tolist(), present.tolist(), strict=True):
            if abs(value - before) <= SMALL:
                continue
            chosen.pop(key, None)
            if abs(value) > SMALL:
                chosen[key] = Constant(self.span, value)
        return ErrorSet(chosen)


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
        target = replace(model, own_component_errors=((axis, order),))
        if axis_errors.order != replace(axis_errors, model=target).order:
            linear = model.machine.axes[axis].is_linear
            errors = axis_errors.with_components(axis_errors.across_motion, adds=linear)
    names = {axis: model.convention(axis).name for axis in model.machine.axes} | dict(orders)
    main = max(dict.fromkeys(names.values()), key=list(names.values()).count)
    exceptions = tuple((axis, name) for axis, name in names.items() if name != main)
    return replace(model, component_errors=main, own_component_errors=exceptions), errors


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
        errors = axis_errors.moved_to_constants(motion)
    return errors


AT_REST_UM = 1e-6  # µm: largest error of a point that counts as zero


def _error_at(model: Model, errors: ErrorSet, at: Coordinates) -> Array:
    point = chain.nominal_point(model, Loop.TOOL, at)
    values = {key: errors.evaluate_at(key, at, model.direction) for key in errors}
    return chain.loop_error(model, Loop.TOOL, at, values, point)[0]


def held_by_constants(model: Model, errors: ErrorSet, at: Coordinates) -> ErrorSet:
    """Return errors that are zero at a point; all others change by the same vector.

    The location of the first axis moves the entire tool branch in R; exact.
    """
    branch = model.machine.branch("tool")
    if not branch:
        raise OptionError(
            "no axis carries the tool; no location of an axis can make the error of the point zero"
        )
    first = branch[0]
    placed = transforms.placed(first.offset_mm, first.rotation_deg)[:3, :3]
    functions = dict(errors.functions)
    shift_um = -(placed.T @ _error_at(model, errors, at))
    for letter, part in zip("XYZ", shift_um.tolist(), strict=True):
        key = f"E{letter}0{first.name}"
        value = errors.amplitude(key) + part
        functions.pop(key, None)
        if abs(value) > SMALL:
            functions[key] = Constant(first.travel, value)
    return ErrorSet(functions)


def held_by_view(model: Model, errors: ErrorSet, at: Coordinates) -> ErrorSet:
    """Return errors without the location of the first axis, redundant with a reference point."""
    norm = np.linalg.norm(_error_at(model, errors, at))
    if norm > AT_REST_UM:
        raise OptionError(
            f"the error at that point is {norm:.3g} µm; expected a point of"
            " zero error, since any other reference changes the map"
        )
    first_axes = model.machine.chain.tool[:1]
    gone = {f"E{letter}0{axis}" for axis in first_axes for letter in "XYZ"}
    functions = {key: function for key, function in errors.functions.items() if key not in gone}
    return ErrorSet(functions)


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
        errors = axis_errors.moved_to_constants(_line_motion(axis_errors, ReferenceLine(line)))
    return errors


def _line_motion(axis_errors: AxisErrors, line: ReferenceLine) -> SmallMotion:
    axis = axis_errors.model.machine.axes[axis_errors.axis]
    along = axis.direction * np.eye(3)[axis.index]
    motion = SmallMotion(np.zeros(3), np.zeros(3))
    for _ in range(MAX_STEPS):
        offset, slope = np.zeros(3), np.zeros(3)
        for index in range(3):
            if index != axis.index:
                at = axis_errors.line_positions(axis_errors.keys()[index])
                errors = axis_errors.without(motion, at, axis_errors.at(at)).to_errors()
                offset[index], slope[index] = fit_line(at, errors[:, index], line)
        if not offset.any() and not slope.any():
            break
        turn = np.cross(along, slope * MM_PER_UM)
        motion = motion @ SmallMotion(turn / 2.0, offset * MM_PER_UM)
    return motion


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
        errors = axis_errors.with_components(partial(axis_errors.on_arm, point, sign), adds=True)
    return errors


class SquarenessSign(StrEnum):
    """Sign convention of squareness errors."""

    RIGHT_HAND = "right_hand"
    OVER_90 = "over_90"
    UNDER_90 = "under_90"


def angle_sign(key: str) -> int:
    """Return the sign of the change of the angle between axes by a positive squareness."""
    row = axes.parameter(key)
    along, about = axes.direction_index(row.axis), row.direction
    return -1 if (along - about) % 3 == 1 else 1


def squareness_keys(machine: Machine) -> tuple[str, ...]:
    directions = {axes.direction_index(axis) for axis in machine.axes if axes.is_linear(axis)}
    parameters = map(axes.parameter, machine.allowed_keys)
    rows = ((row, axes.direction_index(row.axis)) for row in parameters)
    return tuple(
        row.key
        for row, along in rows
        if row.kind is axes.ErrorKind.SQUARENESS
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
