"""What it would cost, in µm, if errors had been measured in another convention than is read.

The numbers stay as they are and are read once in the convention of the scene and once in another
one; the difference of both fields is the cost. To first order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace, build_grid
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames, nominal_point
from warpspace.kinematics.conversion import (
    ReferenceLine,
    SquarenessSign,
    angle_sign,
    fit_line,
    squareness_keys,
)
from warpspace.kinematics.firstorder import jacobian
from warpspace.kinematics.model import ComponentErrors, Coordinates, Loop, Model, batch_shape
from warpspace.machine.errors import ErrorSet, Table
from warpspace.machine.parameters import axis_parameters, parameter
from warpspace.units import Array

MEASURING_LINE, ZERO = "measuring_line", "zero_at"
EVENLY = 101
URAD_PER_UM_OVER_MM = 1e3
Values = dict[str, Array]
Reading = Callable[["_Read", Values, Coordinates], Values]


@dataclass(frozen=True, slots=True)
class ConventionCost:
    """What one wrong convention would cost."""

    name: str  # for instance "squareness=over_90"
    mean_um: float  # mean over the volume and largest length of the change of the error vector
    max_um: float


@dataclass(frozen=True, slots=True)
class _Read:
    """What all readings work on."""

    model: Model
    errors: ErrorSet
    workspace: Workspace
    keys: tuple[str, ...]

    def values(self, coordinates: Coordinates) -> Values:
        way = self.model.direction
        return {
            key: self.errors.evaluate_at(key, coordinates, way)
            for key in self.keys
            if key in self.errors
        }


def convention_costs(
    model: Model,
    errors: ErrorSet,
    workspace: Workspace,
    view: View | None = None,
    nodes: int = 21,
) -> tuple[ConventionCost, ...]:
    """Find what each wrong convention would cost over the working volume."""
    view = view or View()
    grid = build_grid(model, workspace, nodes)
    keys = tuple(
        row.key
        for axis in model.machine.axes
        for row in axis_parameters(axis)
        if not row.is_constant or row.key in errors
    )
    read = _Read(model, errors, workspace, keys)
    places: list[tuple[Coordinates, Array]] = [(grid.coordinates, grid.point_mm)]
    if view.reference is not None:
        held = {
            axis: np.asarray(view.reference.get(axis, at))
            for axis, at in workspace.positions.items()
        }
        places.append((held, nominal_point(model, Loop.TOOL, held)))
    gains = [jacobian(model, view.loop, keys, *place)[0] for place in places]
    own = [read.values(coordinates) for coordinates, _ in places]
    found: list[ConventionCost] = []
    for name, reading in _readings().items():
        parts = [
            _field(keys, gain, _change(own_values, reading(read, own_values, coordinates)))
            for gain, own_values, (coordinates, _) in zip(gains, own, places, strict=True)
        ]
        change = parts[0] - parts[1] if len(parts) > 1 else parts[0]
        length = np.linalg.norm(np.broadcast_to(change, (*grid.shape, 3)), axis=-1)
        found.append(
            ConventionCost(name, float(np.sum(grid.weights * length)), float(length.max()))
        )
    return tuple(found)


def _change(own: Values, other: Values) -> Values:
    return {key: value - own.get(key, 0.0) for key, value in other.items()}


def _field(keys: tuple[str, ...], gains: Array, values: Mapping[str, Array]) -> Array:
    """Add up gains times values, [..., 3], µm."""
    total = np.zeros(gains.shape[1:])
    for key, value in values.items():
        total += gains[keys.index(key)] * value[..., None]
    return total


def _readings() -> dict[str, Reading]:
    """List how else the numbers may have been meant."""
    found: dict[str, Reading] = {
        f"squareness={sign}": _squareness(sign)
        for sign in (SquarenessSign.OVER_90, SquarenessSign.UNDER_90)
    }
    found[MEASURING_LINE] = _measuring_line
    found |= {f"straightness={line}": _reference_line(line) for line in ReferenceLine}
    found[ZERO] = _zero_in_the_middle
    return found


def _squareness(sign: SquarenessSign) -> Reading:
    def reading(read: _Read, values: Values, coordinates: Coordinates) -> Values:
        del coordinates
        turned = 1 if sign is SquarenessSign.OVER_90 else -1
        keys = squareness_keys(read.model.machine)
        return {k: -values[k] for k in keys if k in values and angle_sign(k) != turned}

    return reading


def _measuring_line(read: _Read, values: Values, coordinates: Coordinates) -> Values:
    model, found = read.model, Values()
    middle = {axis: np.asarray(at) for axis, at in read.workspace.positions.items()}
    point = nominal_point(model, Loop.TOOL, middle)
    shape = batch_shape(coordinates)
    for side in ("tool", "workpiece"):
        for frames in branch_frames(model, side, middle):
            axis = frames.axis
            if not axis.is_linear:
                continue
            lever = transforms.apply(transforms.inverse(frames.after), point)
            fixed = model.convention(axis.name).name == ComponentErrors.BEFORE_MOTION
            levers = np.broadcast_to(lever, (*shape, 3)).copy()
            if fixed:
                levers[..., axis.index] += axis.direction * coordinates[axis.name]
            turns = np.stack(
                [
                    np.broadcast_to(values.get(f"E{letter}{axis.name}", np.zeros(())), shape)
                    for letter in "ABC"
                ],
                -1,
            )
            arm = np.cross(turns, levers) / URAD_PER_UM_OVER_MM
            for index, letter in enumerate("XYZ"):
                key = f"E{letter}{axis.name}"
                if arm[..., index].any():
                    found[key] = values.get(key, np.zeros(())) - arm[..., index]
    return found


def _reference_line(line: ReferenceLine) -> Reading:
    def reading(read: _Read, values: Values, coordinates: Coordinates) -> Values:
        found = Values()
        for key in values:
            row = parameter(key)
            axis = read.model.machine.axes[row.axis]
            straight = not row.is_rotation and not row.is_constant and row.direction != axis.index
            if not axis.is_linear or not straight:
                continue
            at = _points(read, key)
            offset, slope = fit_line(at, read.errors.evaluate(key, at), line)
            found[key] = values[key] - offset - slope * coordinates[axis.name]
        return found

    return reading


def _points(read: _Read, key: str) -> Array:
    axis = parameter(key).axis
    low, high = read.workspace.ranges[axis]
    if low == high:
        low, high = read.model.machine.axes[axis].travel
    function = read.errors.functions[key]
    points = np.array(function.kinks if isinstance(function, Table) else ())
    points = points[(points >= low) & (points <= high)]
    return points if len(points) > 1 else np.linspace(low, high, EVENLY)


def _zero_in_the_middle(read: _Read, values: Values, coordinates: Coordinates) -> Values:
    middle = read.workspace.positions
    found = Values()
    for key in values:
        row = parameter(key)
        if not row.is_constant:
            at = {**coordinates, row.axis: np.asarray(middle[row.axis])}
            there = read.errors.evaluate_at(key, at, read.model.direction)
            found[key] = values[key] - there
    return found
