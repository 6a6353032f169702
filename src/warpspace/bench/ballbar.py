"""The circular test in the words of a ball bar: what the command `ballbar` prints."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.bench.evaluation.circle import fit_circle_readings
from warpspace.bench.kinds.circular import DEFAULT_POINTS, Circular
from warpspace.bench.paths.planes import find_plane, plane_axes
from warpspace.bench.readings import RELATIVE, simulate
from warpspace.field.evaluate import evaluate_first_order
from warpspace.scene.model import Scene
from warpspace.units import Array


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
        Radial deviation from the nominal circle about the least-squares centre, run
        counter-clockwise.
    clockwise_um : ndarray, [n], µm
        The same of the clockwise run, in the order it is run. It differs only where errors depend
        on the direction of travel: a rigid-body model has no following errors.
    circular_deviation_um : float, µm
        G of ISO 230-4: largest minus smallest radial deviation, both runs together.
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
    clockwise_um: Array
    circular_deviation_um: float
    squareness_urad: float
    squareness_key: str
    given_urad: float
    centre_um: tuple[float, float]
    radius_um: float
    scale_difference_um: float

    @property
    def both_alike(self) -> bool:
        """Whether both runs trace the same."""
        back = np.concatenate([self.clockwise_um[:1], self.clockwise_um[:0:-1]])
        return bool(np.abs(self.radial_um - back).max() < 1e-6)


def ballbar(
    scene: Scene,
    *,
    plane: str,
    radius_mm: float,
    centre: Mapping[str, float] | None = None,
    points: int = DEFAULT_POINTS,
) -> Ballbar:
    """Run the circular test of ISO 230-4 on the errors of a scene, to first order.

    Parameters
    ----------
    scene : Scene
    plane : str
        "XY", "XZ" or "YZ".
    radius_mm : float, mm
    centre : mapping of str to float, mm or degrees, optional
        Axis positions; the middle of the working volume where absent.
    points : int, optional

    Returns
    -------
    Ballbar

    Raises
    ------
    OptionError, UnknownNameError
        If the circle cannot be run in the working volume of the scene.

    Examples
    --------
    >>> import warpspace
    >>> scene = warpspace.load_scene("dvf5000_first")
    >>> result = warpspace.ballbar(scene, plane="XY", radius_mm=150)
    >>> round(result.circular_deviation_um, 2), round(result.squareness_urad, 2)
    (6.86, 2.94)
    """
    test = Circular(plane=plane, radius_mm=radius_mm, at=centre or {}, points=points)
    key = plane_axes(scene.machine, plane)[2]
    plan = test.plan(scene)
    fit = fit_circle_readings(plan, simulate(scene, plan, exact=False))
    stand = test.stand(scene)
    middle = evaluate_first_order(scene.model, scene.errors, stand, RELATIVE).error_um
    found = find_plane(scene.model, stand, plane)
    there = [float(middle @ vector) for vector in (found.along, found.up)]
    back = fit.radial_um[points:][::-1]
    return Ballbar(
        plane,
        radius_mm,
        {name: float(value) for name, value in stand.items()},
        plan.marks["angle_deg"][:points],
        fit.radial_um[:points],
        np.concatenate([back[:1], back[:0:-1]]),
        fit.deviation_um,
        fit.squareness_urad or 0.0,
        key,
        scene.errors.amplitude(key),
        (fit.centre_um[0] + there[0], fit.centre_um[1] + there[1]),
        fit.radius_um,
        fit.scale_difference_um,
    )
