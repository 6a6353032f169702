"""Why a point is where it is: the contribution of every parameter to its error."""

from dataclasses import dataclass

import numpy as np

from warpspace.field.evaluate import View, amplitudes_of, build_basis, error_values, evaluate_exact
from warpspace.kinematics.chain import columns, nominal_point
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.axes import parameter
from warpspace.machine.errors import ErrorSet
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Contribution:
    """What one parameter does to one point."""

    key: str  # parameter key
    value: float  # µm or µrad; the error at the point's axis position
    error_um: Array  # [3]; displacement of the point by this error alone, first order
    # its part along the total error: these parts add up to the length of the first-order error
    along_um: float
    direction: Array  # [3]; unit vector in R along or about which the error acts
    origin_mm: Array  # [3]; origin in R of the frame the error sits in
    lever_mm: Array  # [3]; from that origin to the point


@dataclass(frozen=True, slots=True)
class Explanation:
    """The error of one point, taken apart."""

    nominal_mm: Array  # [3]
    error_um: Array  # [3]; from the exact chain
    orientation_urad: Array  # [3]; from the exact chain
    # all parameters of the loop that are not zero there, largest first
    contributions: tuple[Contribution, ...]
    # [3]; exact error minus the sum of the contributions: what the first order leaves out
    remainder_um: Array


def explain(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> Explanation:
    """Take the error of one point apart into its parameters.

    At one position of every axis; the nominal point in R is the functional one of the loop unless
    given. With a reference each contribution is that of the point minus that of the reference.
    """
    view = view or View()
    point = nominal_point(model, view.loop, coordinates) if point_mm is None else point_mm
    keys = [key for key in errors if parameter(key).axis in model.machine.axes]
    vectors = build_basis(model, errors, keys, coordinates, view, point).contributions(
        amplitudes_of(errors, keys)
    )
    total = vectors.sum(axis=0)
    length = float(np.linalg.norm(total))
    towards = total / length if length > 0.0 else np.zeros(3)
    found = columns(model, view.loop, keys, coordinates, point)
    values = error_values(model, errors, coordinates)
    parts = [
        Contribution(
            key,
            float(values[key]),
            vector,
            float(vector @ towards),
            found[key].direction,
            point - found[key].lever_mm,
            found[key].lever_mm,
        )
        for key, vector in zip(keys, vectors, strict=True)
        if key in found and np.any(vector != 0.0)
    ]
    parts.sort(key=lambda part: float(np.linalg.norm(part.error_um)), reverse=True)
    exact = evaluate_exact(model, errors, coordinates, view, point)
    return Explanation(
        np.asarray(point, dtype=float),
        exact.error_um,
        exact.orientation_urad,
        tuple(parts),
        exact.error_um - total,
    )
