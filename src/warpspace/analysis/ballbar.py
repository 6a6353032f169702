"""The circular test of ISO 230-4 on the model: a ball bar run on a computer."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.field.grid import Workspace
from warpspace.kinematics.chain import branch_pose, nominal_point
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine.axes import is_linear
from warpspace.machine.errors import ErrorSet
from warpspace.units import UM_PER_MM_URAD, Array

PLANES: Mapping[str, tuple[str, str, str, float]] = {
    # plane: its axes, the squareness between them, and the sign of the gain: a positive angle turns
    # the second axis by the right-hand rule, towards −x for Y about z, towards +x for Z about y,
    # towards −y for Z about x.
    "XY": ("X", "Y", "EC0Y", -1.0),
    "XZ": ("X", "Z", "EB0Z", 1.0),
    "YZ": ("Y", "Z", "EA0Z", -1.0),
}
DEFAULT_POINTS, MIN_POINTS, MAX_POINTS = 360, 8, 100_000


@dataclass(frozen=True, slots=True)
class Ballbar:
    """Result of a circular test.

    Attributes
    ----------
    plane : str
        "XY", "XZ" or "YZ".
    radius_mm : float, mm
    centre : mapping of str to float, mm or degrees
        Axis positions of the centre.
    angle_deg : ndarray, [n], degrees
        From the first axis of the plane towards the second, counter-clockwise.
    radial_um : ndarray, [n], µm
        Radial deviation from the nominal circle about the least-squares centre.
    circular_deviation_um : float, µm
        G of ISO 230-4: largest minus smallest radial deviation.
    squareness_urad : float, µrad
        Out of the sin 2φ part of the trace, in the sign of `squareness_key`: what a ball bar calls
        squareness, angular errors that look like it included.
    squareness_key : str
        Parameter it stands for.
    given_urad : float, µrad
        Value of that parameter in the error set.
    centre_um : tuple of float, (2,), µm
        Position of the least-squares centre against the commanded one.
    radius_um : float, µm
        Mean radius minus nominal radius.
    scale_difference_um : float, µm
        Amplitude of the cos 2φ part: the first axis runs longer than the second.
    """

    plane: str
    radius_mm: float
    centre: Mapping[str, float]
    angle_deg: Array
    radial_um: Array
    circular_deviation_um: float
    squareness_urad: float
    squareness_key: str
    given_urad: float
    centre_um: tuple[float, float]
    radius_um: float
    scale_difference_um: float

    @property
    def clockwise_um(self) -> Array:
        """Radial deviation of the clockwise run, [n], µm, in the order it is run.

        A rigid-body model has neither backlash nor following errors: both runs trace the same.
        """
        return np.concatenate([self.radial_um[:1], self.radial_um[:0:-1]])


def ballbar(
    model: Model,
    errors: ErrorSet,
    workspace: Workspace,
    plane: str,
    radius_mm: float,
    centre: Mapping[str, float] | None = None,
    points: int = DEFAULT_POINTS,
) -> Ballbar:
    """Run a circle and evaluate it.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    workspace : Workspace
        The circle has to stay in it; other axes stand at their place in it.
    plane : str
        "XY", "XZ" or "YZ".
    radius_mm : float, mm
    centre : mapping of str to float, mm or degrees, optional
        Axis positions; the middle of the working volume where absent.
    points : int, optional
        Points of the circle.

    Returns
    -------
    Ballbar

    Raises
    ------
    OptionError
        If the plane does not exist on the machine, or the circle leaves the working volume.
    UnknownNameError
        If the centre names an axis that does not exist.

    Notes
    -----
    First order; the distance is that between tool and workpiece (loop `relative`). The trace is
    fitted by least squares with mean radius, centre (cos φ, sin φ), unequal scales (cos 2φ) and
    squareness (sin 2φ): a squareness γ gives ∓γ·R/2·sin 2φ. ISO 230-4, 3.3 (circular deviation
    about the least-squares circle).
    """
    first, second, key, sign = _plane(model, plane)
    if not MIN_POINTS <= points <= MAX_POINTS:
        raise OptionError(f"points: {points}; expected {MIN_POINTS} to {MAX_POINTS:,}")
    place = complete_coordinates(
        model.machine, {**workspace.positions, **(centre or {})}, workspace.positions
    )
    middle = {name: float(value) for name, value in place.items()}
    _check_circle(workspace, middle, (first, second), radius_mm)
    angle = np.arange(points) * (2.0 * np.pi / points)
    on_circle = {
        **place,
        first: middle[first] + radius_mm * np.cos(angle),
        second: middle[second] + radius_mm * np.sin(angle),
    }
    outward = _relative_point(model, on_circle) - _relative_point(model, place)
    outward = outward / np.linalg.norm(outward, axis=-1, keepdims=True)
    error = evaluate_first_order(model, errors, on_circle, View(Loop.RELATIVE)).error_um
    deviation = np.sum(error * outward, axis=-1)
    # The nominal path in R; an axis with direction −1 runs the circle the other way round.
    along, up = outward[..., "XYZ".index(first)], outward[..., "XYZ".index(second)]
    design = np.stack([np.ones(points), along, up, along**2 - up**2, 2.0 * along * up], -1)
    fit = np.linalg.lstsq(design, deviation, rcond=None)[0]
    radial = deviation - design[:, 1:3] @ fit[1:3]
    return Ballbar(
        plane,
        radius_mm,
        middle,
        np.rad2deg(angle),
        radial,
        float(np.ptp(radial)),
        float(sign * 2.0 * fit[4] / (radius_mm * UM_PER_MM_URAD)),
        key,
        errors.amplitude(key),
        (float(fit[1]), float(fit[2])),
        float(fit[0]),
        float(fit[3]),
    )


def _plane(model: Model, plane: str) -> tuple[str, str, str, float]:
    """Look up the axes of a plane and the squareness between them."""
    if plane not in PLANES:
        raise OptionError(f"plane {plane!r}; expected one of {', '.join(PLANES)}")
    first, second, key, sign = PLANES[plane]
    for name in (first, second):
        if name not in model.machine.axes:
            raise OptionError(
                f"plane {plane}: the machine {model.machine.chain} has no axis {name}"
            )
    return first, second, key, sign


def _check_circle(
    workspace: Workspace, centre: Mapping[str, float], axes: tuple[str, str], radius_mm: float
) -> None:
    """Refuse a circle that leaves the working volume."""
    if not 0.0 < radius_mm < np.inf:
        raise OptionError(f"radius: {radius_mm:g} mm; expected above 0")
    problems: list[str] = []
    for name, value in centre.items():
        low, high = workspace.ranges[name]
        if name not in axes:
            if is_linear(name) and not low <= value <= high:
                problems.append(f"{name} = {value:g} lies outside {low:g} … {high:g} mm")
        elif value - radius_mm < low or value + radius_mm > high:
            problems.append(
                f"{name} would run {value - radius_mm:g} … {value + radius_mm:g} mm,"
                f" the volume has {low:g} … {high:g} mm"
            )
    if problems:
        room = min(
            min(centre[name] - workspace.ranges[name][0], workspace.ranges[name][1] - centre[name])
            for name in axes
        )
        hint = f"; largest radius about this centre: {room:g} mm" if room > 0.0 else ""
        raise OptionError(f"the circle leaves the working volume: {'; '.join(problems)}{hint}")


def _relative_point(model: Model, coordinates: Coordinates) -> Array:
    """Nominal tool point minus the origin of the workpiece frame, in R, [..., 3], mm."""
    tool = nominal_point(model, Loop.TOOL, coordinates)
    return tool - branch_pose(model, "workpiece", coordinates)[..., :3, 3]
