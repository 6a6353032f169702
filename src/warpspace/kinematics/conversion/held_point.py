"""The reference point of zero: held still by the view, or by the location of the first axis."""

from dataclasses import replace

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.deviation import exact_error
from warpspace.kinematics.model import Coordinates, Loop, Model
from warpspace.machine.curves.constant import Constant
from warpspace.machine.curves.pieces import SMALL
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array

AT_REST_UM = 1e-6
"""µm: a point whose error is smaller is held still by the errors themselves."""


def error_at(model: Model, errors: ErrorSet, at: Coordinates) -> Array:
    """Give the exact error of the tool point in R at one position of the axes, [3], µm."""
    point = nominal_point(model, Loop.TOOL, at)
    values = {key: errors.evaluate_at(key, at, model.direction) for key in errors}
    return exact_error(model, Loop.TOOL, at, values, point)[0]


def shifted(model: Model, errors: ErrorSet, shift_um: Array) -> ErrorSet:
    """Move the whole tool branch in R by the location of its first axis; exact.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    shift_um : ndarray, [3], µm
        In R.

    Raises
    ------
    OptionError
        If no axis carries the tool.
    """
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
    """Give errors without the location of the first axis, where the view may hold the point.

    Raises
    ------
    OptionError
        If the error of the point is not zero: holding it would change the map.
    """
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
