"""Error motions of a rotary axis as a traced point has them: radial, axial and tilt (ISO 230-7)."""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.circles import fit_circle
from warpspace.units import Array

LEVER_MM = 1000.0
"""Distance along the axis of the second point that the tilt is taken from: 1 µm there is 1 µrad."""
MOST_A_TURN = 36
"""Highest harmonic that is looked for; at most half the samples."""
LEAST = 1e-6
"""Deviations below it, µm or µrad, are none."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One deviation over the turn.

    Attributes
    ----------
    name : str
        "radial", "axial" or "tilt".
    iso : str
        What ISO 230-7 calls it.
    unit : str
        µm or µrad.
    values : ndarray, [n], µm or µrad
        Actual − nominal at every position.
    about_line : ndarray, [n], µm or µrad
        What remains about the axis average line.
    times_a_turn : int or None
        Strongest harmonic of the deviation; None where it does not vary, or the axis does not go
        round.
    """

    name: str
    iso: str
    unit: str
    values: Array
    about_line: Array
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
    """How an axis carries one point round.

    Attributes
    ----------
    angle_deg : ndarray, [n], degrees
        Position of the axis.
    closed : bool
        Whether that is a full turn.
    radius_mm : float, mm
        Distance of the point from the axis.
    radial, axial, tilt : Motion
        Of the axis at the height of the point: towards the point, along the axis, and as the
        inclination of the axis towards the point.
    """

    angle_deg: Array
    closed: bool
    radius_mm: float
    radial: Motion
    axial: Motion
    tilt: Motion

    @property
    def motions(self) -> tuple[Motion, Motion, Motion]:
        """All three."""
        return self.radial, self.axial, self.tilt


def axis_motion(
    nominal_mm: Array, angle_deg: Array, on_axis_um: Array, above_um: Array, *, closed: bool
) -> AxisMotion:
    """Take the error motion of a rotating body apart, in the direction of one of its points.

    Parameters
    ----------
    nominal_mm : ndarray, [n, 3], mm
        Nominal circle or arc of the point, at least five places and not all in one line.
    angle_deg : ndarray, [n], degrees
        Position of the axis there, rising.
    on_axis_um, above_um : ndarray, [n, 3], µm
        Error of the body where the axis meets the plane of the circle, and `LEVER_MM` above that
        along the axis (see `points_on_axis`).
    closed : bool
        Whether the first place is the last one.

    Returns
    -------
    AxisMotion

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
    return _assemble(angle_deg, radius, (radial, on_axis_um @ normal, tilt), closed=closed)


def subtract_motions(one: AxisMotion, other: AxisMotion) -> AxisMotion:
    """Subtract the deviations of two axes that carry the same point, one − other."""
    radial, axial, tilt = (
        a.values - b.values for a, b in zip(one.motions, other.motions, strict=True)
    )
    return _assemble(one.angle_deg, one.radius_mm, (radial, axial, tilt), closed=one.closed)


def _assemble(
    angle_deg: Array, radius_mm: float, deviations: tuple[Array, Array, Array], *, closed: bool
) -> AxisMotion:
    """Find what remains of each deviation about the axis average line."""
    theta = np.deg2rad(angle_deg)
    kept = slice(None, -1 if closed else None)  # the last place of a turn is the first one
    once = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], -1)

    def motion(name: str, unit: str, values: Array, line: Array) -> Motion:
        strongest = times_a_turn(values) if closed else None
        fitted = line @ np.linalg.lstsq(line[kept], values[kept], rcond=None)[0]
        return Motion(name, f"{name} error motion", unit, values, values - fitted, strongest)

    radial, axial, tilt = deviations
    return AxisMotion(
        angle_deg,
        closed,
        radius_mm,
        motion("radial", "µm", radial, once),
        motion("axial", "µm", axial, once[:, :1]),
        motion("tilt", "µrad", tilt, once),
    )


def points_on_axis(nominal_mm: Array) -> tuple[Array, Array]:
    """Give the nominal points whose errors `axis_motion` needs.

    Parameters
    ----------
    nominal_mm : ndarray, [n, 3], mm
        Nominal circle or arc.

    Returns
    -------
    tuple of ndarray, [n, 3], mm
        The centre of the circle, and the point `LEVER_MM` above it, each at all places.
    """
    centre, _, normal = fit_circle(nominal_mm)
    shape = nominal_mm.shape
    return np.broadcast_to(centre, shape), np.broadcast_to(centre + LEVER_MM * normal, shape)


def times_a_turn(values: Array) -> int | None:
    """Find how often a deviation comes back in a turn.

    Parameters
    ----------
    values : ndarray, [n]
        Over a full turn, the last equal to the first.

    Returns
    -------
    int or None
        Number of the strongest harmonic; None where nothing varies.
    """
    strength = np.abs(np.fft.rfft(values[:-1]))[1 : MOST_A_TURN + 1] * 2.0 / (len(values) - 1)
    if len(strength) == 0 or strength.max() < LEAST:
        return None
    return int(np.argmax(strength > strength.max() * (1.0 - 1e-9))) + 1
