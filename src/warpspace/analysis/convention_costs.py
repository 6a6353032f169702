"""Effect of reading measured errors in a wrong convention."""

from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.field.grid import build_grid
from warpspace.kinematics import conversion, transforms
from warpspace.kinematics.chain import branch_frames, nominal_point
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import TravelDirection, parameter
from warpspace.machine.definition import Vector
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, Poly
from warpspace.scene.model import Scene
from warpspace.scene.scene_writer import covered_spans
from warpspace.units import Array

Effect = tuple[float, float]
"""Mean over the volume and largest length of the change of the error vector, µm."""


def measure_change(weights: Array, change_um: Array) -> Effect:
    length = np.linalg.norm(change_um, axis=-1)
    return float(np.sum(weights * length)), float(length.max())


def convention_costs(scene: Scene, view: View, nodes: int = 21) -> dict[str, Effect]:
    """Compute the effect of each wrong convention over the working volume, to first order.

    The same numbers are read in the convention of the scene and in another one. Those that cannot
    be converted are omitted.
    """
    grid = build_grid(scene.model, scene.workspace, nodes)

    def field_of(errors: ErrorSet, direction: str = scene.model.direction) -> Array:
        at = grid.coordinates, view, grid.point_mm
        return evaluate_first_order(replace(scene.model, direction=direction), errors, *at).error_um

    nominal_field = field_of(scene.errors)
    field_changes = {
        name: field_of(ErrorSet(changes), TravelDirection.MEAN)
        for name, changes in _changes(scene).items()
    }
    for sign in conversion.SquarenessSign:
        read = conversion.convert_squareness(scene.machine, scene.errors, sign)
        field_changes[f"squareness={sign}"] = field_of(read) - nominal_field
    with suppress(OptionError):
        field_changes["measuring_line"] = field_of(_measured_in_the_middle(scene)) - nominal_field
    return {name: measure_change(grid.weights, change) for name, change in field_changes.items()}


def _changes(scene: Scene) -> dict[str, dict[str, ErrorFunction]]:
    """Return the changes of curves whose reference line or mid-axis value is subtracted."""
    errors, axes = scene.errors, scene.machine.axes
    middle = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    changes = {
        name: dict[str, ErrorFunction]()
        for name in ("zero_at", *map(str, conversion.ReferenceLine))
    }
    for row in map(parameter, errors):
        axis, span = axes[row.axis], scene.axis_span(row.axis)
        if not row.is_constant:
            value_in_middle = errors.evaluate_at(row.key, middle, scene.model.direction)
            changes["zero_at"][row.key] = Constant(span, -float(value_in_middle))
            if axis.is_linear and not row.is_rotation and row.direction != axis.index:
                axis_errors = conversion.AxisErrors(scene.model, errors, row.axis, span)
                at = axis_errors.line_positions(row.key)
                for line in conversion.ReferenceLine:
                    offset, slope = conversion.fit_line(at, errors.evaluate(row.key, at), line)
                    changes[line][row.key] = Poly(span, (-offset, -slope))
    return changes


def _measured_in_the_middle(scene: Scene) -> ErrorSet:
    """Convert translations measured along lines through the centre of the volume."""
    model = scene.model
    middle = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    point = nominal_point(model, Loop.TOOL, middle)
    lines: dict[str, Vector] = {}
    branches = (branch_frames(model, branch, middle) for branch in ("tool", "workpiece"))
    for frames in chain(*branches):
        if frames.axis.is_linear:
            x, y, z = transforms.apply(transforms.inverse(frames.after), point).tolist()
            lines[frames.axis.name] = (x, y, z)
    spans = covered_spans(model, scene.workspace)
    return conversion.move_measuring_line(model, scene.errors, spans, lines, to_origin=True)
