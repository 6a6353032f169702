"""Error motions of a rotary axis at a traced point: radial, axial and tilt (ISO 230-7)."""

from dataclasses import dataclass

import numpy as np

from warpspace.units import Array

LEVER_MM = 1000.0
"""Distance along the axis of the second point that the tilt is taken from: 1 µm there is 1 µrad."""
MOST_A_TURN = 36  # highest harmonic that is looked for; at most half the samples
LEAST = 1e-6  # deviations below it, µm or µrad, are none


@dataclass(frozen=True, slots=True)
class ErrorMotion:
    """One deviation over the turn."""

    name: str  # "radial", "axial" or "tilt"
    iso: str  # what ISO 230-7 calls it
    unit: str  # µm or µrad
    values: Array  # [n], µm or µrad; actual − nominal at every position
    about_line: Array  # [n], µm or µrad; what remains about the axis average line
    # size of that line's part once a turn, µm or µrad: how far the axis is displaced at the height
    # of the point, or how much it is inclined
    once_a_turn: float
    # strongest harmonic of the deviation; None where it does not vary, or the axis does not go
    # round
    times_a_turn: int | None

    @property
    def peak_to_valley(self) -> float:
        """Largest minus smallest deviation, µm or µrad."""
        return float(np.ptp(self.values))

    @property
    def motion_value(self) -> float:
        """Peak to valley about the axis average line: the error motion value, µm or µrad."""
        return float(np.ptp(self.about_line))


@dataclass(frozen=True, slots=True)
class AxisMotion:
    """Error motions of a rotary axis at one point."""

    angle_deg: Array  # [n]; position of the axis
    closed: bool  # whether that is a full turn
    radius_mm: float  # distance of the point from the axis
    # of the axis at the height of the point: towards the point, along the axis, and as the
    # inclination of the axis towards the point
    radial: ErrorMotion
    axial: ErrorMotion
    tilt: ErrorMotion

    @property
    def motions(self) -> tuple[ErrorMotion, ErrorMotion, ErrorMotion]:
        return self.radial, self.axial, self.tilt


def axis_motion(
    nominal_mm: Array, angle_deg: Array, on_axis_um: Array, above_um: Array, *, closed: bool
) -> AxisMotion:
    """Resolve the error motion of a rotating body in the direction of one of its points.

    The nominal circle or arc of the point, [n, 3], has five places or more, not all in one line, at
    rising positions of the axis. The errors are those of the body where the axis meets the plane of
    the circle, and `LEVER_MM` above that along the axis (see `points_on_axis`), [n, 3], µm. Closed
    is a turn whose last place is the first.

    Notes
    -----
    First order. The direction of the point turns with the body (rotating sensitive direction). The
    axial error of the point itself, the face error motion, is axial − radius · tilt. About the axis
    average line: radial and tilt less the least-squares ``1, cos θ, sin θ``, axial less its mean.
    """
    centre_mm, radius, normal = fit_circle(nominal_mm)
    outwards = (nominal_mm - centre_mm) / radius
    radial = np.sum(on_axis_um * outwards, axis=-1)
    tilt = np.sum((above_um - on_axis_um) * outwards, axis=-1) * (1000.0 / LEVER_MM)
    return assemble_motion(angle_deg, radius, (radial, on_axis_um @ normal, tilt), closed=closed)


def assemble_motion(
    angle_deg: Array, radius_mm: float, deviations: tuple[Array, Array, Array], *, closed: bool
) -> AxisMotion:
    """Build the motions from radial, axial and tilt deviations, [n] each."""
    theta = np.deg2rad(angle_deg)
    distinct = slice(None, -1 if closed else None)  # the last place of a turn is the first one
    turn = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], -1)

    def motion(name: str, unit: str, values: Array, line: Array) -> ErrorMotion:
        strongest = times_a_turn(values) if closed else None
        coefficients = np.linalg.lstsq(line[distinct], values[distinct], rcond=None)[0]
        residual, once = values - line @ coefficients, float(np.linalg.norm(coefficients[1:]))
        return ErrorMotion(name, f"{name} error motion", unit, values, residual, once, strongest)

    radial, axial, tilt = deviations
    return AxisMotion(
        angle_deg,
        closed,
        radius_mm,
        motion("radial", "µm", radial, turn),
        motion("axial", "µm", axial, turn[:, :1]),
        motion("tilt", "µrad", tilt, turn),
    )


def points_on_axis(nominal_mm: Array) -> tuple[Array, Array]:
    """Compute the nominal points whose errors `axis_motion` needs, [n, 3] each, mm."""
    centre, _, normal = fit_circle(nominal_mm)
    shape = nominal_mm.shape
    return np.broadcast_to(centre, shape), np.broadcast_to(centre + LEVER_MM * normal, shape)


def times_a_turn(values: Array) -> int | None:
    """Find the strongest harmonic of a deviation over a full turn, the last equal to the first."""
    strength = np.abs(np.fft.rfft(values[:-1]))[1 : MOST_A_TURN + 1] * 2.0 / (len(values) - 1)
    if len(strength) == 0 or strength.max() < LEAST:
        return None
    return int(np.argmax(strength > strength.max() * (1.0 - 1e-9))) + 1


def fit_circle(points_mm: Array) -> tuple[Array, float, Array]:
    """Find centre, [3], radius and normal, [3], of points, [n, 3], that lie on a circle, mm."""
    middle = points_mm.mean(axis=0)
    _, _, axes = np.linalg.svd(points_mm - middle, full_matrices=False)
    flat, radius = fit_flat_circle((points_mm - middle) @ axes[:2].T)
    centre = middle + flat @ axes[:2]
    normal = np.cross(axes[0], axes[1])
    turning = np.cross(points_mm[:-1] - centre, points_mm[1:] - centre).sum(axis=0)
    return centre, radius, normal if turning @ normal >= 0.0 else -normal


def fit_flat_circle(points_mm: Array) -> tuple[Array, float]:
    """Fit centre, [2], and radius of a circle to points of a plane, [n, 2], mm.

    Algebraic least squares: x² + y² = 2·a·x + 2·b·y + c, about the mean of the points.
    """
    middle = points_mm.mean(axis=0)
    flat = points_mm - middle
    system = np.column_stack([2.0 * flat, np.ones(len(flat))])
    solution, *_ = np.linalg.lstsq(system, np.sum(flat**2, axis=-1), rcond=None)
    return middle + solution[:2], float(np.sqrt(solution[2] + solution[:2] @ solution[:2]))
