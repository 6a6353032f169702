"""Why a point is where it is: the contribution of every parameter to its error."""

from dataclasses import dataclass

import numpy as np

from warpspace.field.evaluate import View, amplitudes_of, build_basis, error_values, evaluate_exact
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.firstorder import columns
from warpspace.kinematics.model import Coordinates, Model
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Contribution:
    """What one parameter does to one point.

    Attributes
    ----------
    key : str
        Parameter key.
    value : float, µm or µrad
        The error at the point's axis position.
    error_um : ndarray, [3], µm
        Displacement of the point by this error alone, first order.
    along_um : float, µm
        Its part along the total error: these parts add up to the length of the first-order error.
    direction : ndarray, [3]
        Unit vector in R along or about which the error acts.
    origin_mm : ndarray, [3], mm
        Origin in R of the frame the error sits in.
    lever_mm : ndarray, [3], mm
        From that origin to the point.
    """

    key: str
    value: float
    error_um: Array
    along_um: float
    direction: Array
    origin_mm: Array
    lever_mm: Array


@dataclass(frozen=True, slots=True)
class Explanation:
    """The error of one point, taken apart.

    Attributes
    ----------
    nominal_mm : ndarray, [3], mm
    error_um : ndarray, [3], µm
        From the exact chain.
    orientation_urad : ndarray, [3], µrad
        From the exact chain.
    contributions : tuple of Contribution
        All parameters of the loop that are not zero there, largest first.
    remainder_um : ndarray, [3], µm
        Exact error minus the sum of the contributions: what the first order leaves out.
    """

    nominal_mm: Array
    error_um: Array
    orientation_urad: Array
    contributions: tuple[Contribution, ...]
    remainder_um: Array


def explain(
    model: Model,
    errors: ErrorSet,
    coordinates: Coordinates,
    view: View | None = None,
    point_mm: Array | None = None,
) -> Explanation:
    """Take the error of one point apart into its parameters.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    coordinates : mapping of str to ndarray, [], mm or degrees
        One position of every axis.
    view : View, optional
        Loop, frame and reference; with a reference each contribution is that of the point minus
        that of the reference point.
    point_mm : ndarray, [3], mm, optional
        Nominal point in R; by default the functional point of the loop.

    Returns
    -------
    Explanation
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
