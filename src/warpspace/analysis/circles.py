"""Deviations of a traced circle: how a rotary axis runs, in the words of ISO 230-7."""

from dataclasses import dataclass

import numpy as np

from warpspace.units import MM_PER_UM, URAD_PER_RAD, Array


@dataclass(frozen=True, slots=True)
class CircleDeviation:
    """How the trace of a point differs from its nominal circle or arc.

    Attributes
    ----------
    radius_mm : float, mm
        Nominal radius.
    centre_um : float, µm
        Displacement of the centre in the plane of the circle.
    radial_um : float, µm
        Peak to valley of the radial error once centre and radius are fitted.
    axial_um : float, µm
        Peak to valley of the axial error once offset and tilt are fitted.
    axial_offset_um : float, µm
        Mean displacement along the axis.
    tilt_urad : float, µrad
        Tilt of the plane of the trace.
    """

    radius_mm: float
    centre_um: float
    radial_um: float
    axial_um: float
    axial_offset_um: float
    tilt_urad: float


def circle_deviation(nominal_mm: Array, error_um: Array) -> CircleDeviation:
    """Take the error of a trace apart into displacement, tilt and what remains.

    Parameters
    ----------
    nominal_mm : ndarray, [n, 3], mm
        Points of a circle or arc in order, at least five and not all in one line.
    error_um : ndarray, [n, 3], µm

    Returns
    -------
    CircleDeviation

    Notes
    -----
    Least squares of ``1, cos θ, sin θ`` to the radial and to the axial error; first order in
    error/radius.
    """
    centre_mm, radius, normal = fit_circle(nominal_mm)
    outwards = (nominal_mm - centre_mm) / radius
    first = outwards[0]
    angle = np.arctan2(outwards @ np.cross(normal, first), outwards @ first)
    harmonic = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], -1)
    radial = np.sum(error_um * outwards, axis=-1)
    axial = error_um @ normal
    around, *_ = np.linalg.lstsq(harmonic, radial, rcond=None)
    along, *_ = np.linalg.lstsq(harmonic, axial, rcond=None)
    return CircleDeviation(
        radius,
        float(np.hypot(*around[1:])),
        float(np.ptp(radial - harmonic @ around)),
        float(np.ptp(axial - harmonic @ along)),
        float(along[0]),
        float(np.hypot(*along[1:]) * MM_PER_UM / radius * URAD_PER_RAD),
    )


def fit_circle(points_mm: Array) -> tuple[Array, float, Array]:
    """Find centre, radius and normal of points that lie on a circle.

    Parameters
    ----------
    points_mm : ndarray, [n, 3], mm

    Returns
    -------
    centre_mm : ndarray, [3], mm
    radius_mm : float, mm
    normal : ndarray, [3]
        Right-handed with the order of the points.
    """
    middle = points_mm.mean(axis=0)
    _, _, axes = np.linalg.svd(points_mm - middle, full_matrices=False)
    flat, radius = fit_flat_circle((points_mm - middle) @ axes[:2].T)
    centre = middle + flat @ axes[:2]
    normal = np.cross(axes[0], axes[1])
    turning = np.cross(points_mm[:-1] - centre, points_mm[1:] - centre).sum(axis=0)
    return centre, radius, normal if turning @ normal >= 0.0 else -normal


def fit_flat_circle(points_mm: Array) -> tuple[Array, float]:
    """Fit a circle to points of a plane.

    Parameters
    ----------
    points_mm : ndarray, [n, 2], mm

    Returns
    -------
    centre_mm : ndarray, [2], mm
    radius_mm : float, mm

    Notes
    -----
    Algebraic least squares: x² + y² = 2·a·x + 2·b·y + c, about the mean of the points.
    """
    middle = points_mm.mean(axis=0)
    flat = points_mm - middle
    system = np.column_stack([2.0 * flat, np.ones(len(flat))])
    solution, *_ = np.linalg.lstsq(system, np.sum(flat**2, axis=-1), rcond=None)
    return middle + solution[:2], float(np.sqrt(solution[2] + solution[:2] @ solution[:2]))
