"""Adjusters: screws, shims and control parameters that change the errors of a machine."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from warpspace.units import UM_PER_MM, Array

FRAME = "frame"  # body of adjusters under the bed
ROW_MM = 1.0  # supports of a row are at most this far aside of it
COLLINEAR = 1e-6  # smallest singular value of a rigid body map, relative to the supports' distance
MAX_DENOMINATOR = 64  # of a fraction of a turn
Supports = tuple[tuple[int, ...], ...]


class AdjusterKind(StrEnum):
    """Kind of an adjuster."""

    FOOT = "levelling foot"
    JACK_SCREW = "jack screw"
    SHIM = "shim"
    GIB = "gib"
    RAIL_BOLT = "rail bolt"
    SCALE = "scale factor"
    OFFSET = "encoder offset"

    @property
    def is_parameter(self) -> bool:
        """True for a parameter of the control, which has no place."""
        return self in (AdjusterKind.SCALE, AdjusterKind.OFFSET)

    @property
    def pitches(self) -> tuple[bool, ...]:
        """Allowed: without a pitch (False), with one (True), or both."""
        if self in (AdjusterKind.FOOT, AdjusterKind.JACK_SCREW):
            return (True,)
        return (False, True) if self in (AdjusterKind.GIB, AdjusterKind.RAIL_BOLT) else (False,)


@dataclass(frozen=True, slots=True)
class Adjuster:
    """One adjuster; its numbers are changes from the present position."""

    name: str
    body: str  # axis whose guides (of a gib: whose carriage) it moves, or `FRAME` for the bed
    kind: AdjusterKind
    step: float  # smallest step: turns, mm, µm/m or µrad
    range: tuple[float, float]  # around 0, in the unit of the step
    at_mm: tuple[float, float, float] | None = None  # in R, all axes at 0
    direction: tuple[float, float, float] | None = None  # unit vector in R, of a positive change
    pitch_mm: float | None = None  # travel per turn of a screw
    groups: tuple[str, ...] = ()  # adjusters of a group are also changed together, as one act

    @property
    def unit(self) -> str:
        if self.kind.is_parameter:
            return "µm/m" if self.kind is AdjusterKind.SCALE else "µrad"
        return "turn" if self.pitch_mm else "mm"

    @property
    def travel_per_unit(self) -> float:
        """Travel of a change by one unit, µm; 1 for a parameter of the control."""
        return 1.0 if self.kind.is_parameter else UM_PER_MM * (self.pitch_mm or 1.0)

    @property
    def steps(self) -> tuple[int, int]:
        """Largest numbers of whole steps down and up."""
        low, high = (round(end / self.step, 9) for end in self.range)
        return int(np.ceil(low)), int(np.floor(high))

    @property
    def joint(self) -> tuple[str, str]:
        """Body and way in which it acts; adjusters of one joint act together."""
        is_own = self.kind in (AdjusterKind.GIB, AdjusterKind.RAIL_BOLT) or self.kind.is_parameter
        return self.body, str(self.kind) if is_own else "support"


def spell_act(adjuster: Adjuster, name: str, change: float) -> str:
    """Write a change of an adjuster or of a group: ``rear left foot + 1/8 turn (125 µm)``."""
    sign, size = "+" if change > 0.0 else "−", f"{abs(change):.6g}"
    um = "" if adjuster.kind.is_parameter else f" ({abs(change) * adjuster.travel_per_unit:.4g} µm)"
    if adjuster.unit == "turn":
        from fractions import Fraction  # few commands need it

        turns, fraction = divmod(Fraction(abs(change)).limit_denominator(MAX_DENOMINATOR), 1)
        if abs(float(turns + fraction) - abs(change)) < adjuster.step / 100.0:
            size = " ".join(str(number) for number in (turns, fraction) if number)
    return f"{name} {sign} {size} {adjuster.unit}{um}"


def rigid_map(adjusters: Sequence[Adjuster]) -> tuple[Array, Array]:
    """Compute the motion of a rigid body on supports from their travels.

    Returns
    -------
    motion : ndarray, [6, n], µm/µm and µrad/µm
        Shift of the centroid of the supports, and rotation vector, per travel of each support.
        Least squares on supports of equal stiffness; freedoms that the supports do not determine
        stay at zero.
    centre_mm : ndarray, [3]
        The centroid.
    """
    matrix, centre_mm, size_mm = _conditions(adjusters)
    motion: Array = np.asarray(np.linalg.pinv(matrix, rcond=COLLINEAR), dtype=float)
    motion[3:] *= UM_PER_MM / size_mm
    return motion, centre_mm


def rank_of(adjusters: Sequence[Adjuster]) -> int:
    """Count the freedoms of a rigid body that supports determine."""
    return int(np.linalg.matrix_rank(_conditions(adjusters)[0], COLLINEAR))


def _conditions(adjusters: Sequence[Adjuster]) -> tuple[Array, Array, float]:
    """Build the travels of supports, [n, 6], by shift and scaled rotation of the centroid."""
    at, along = (
        np.array([getattr(adjuster, name) for adjuster in adjusters], dtype=float).reshape(-1, 3)
        for name in ("at_mm", "direction")
    )
    lever = at - at.mean(axis=0)
    size_mm = float(np.sqrt(np.mean(np.sum(lever**2, axis=1)))) or 1.0
    return np.hstack([along, np.cross(lever / size_mm, along)]), at.mean(axis=0), size_mm


def support_rows(adjusters: Sequence[Adjuster]) -> tuple[Array, Supports] | None:
    """Sort supports of one direction into one or two rows; None where they form none.

    Returns
    -------
    axes : ndarray, [2, 3]
        Unit vectors along the rows and from one to the other, across the supports' direction.
    rows : tuple of tuple of int
        Indices of the supports of each row, along it.
    """
    at = np.array([adjuster.at_mm for adjuster in adjusters], dtype=float)
    normal = np.array(adjusters[0].direction, dtype=float)
    if any(np.cross(adjuster.direction or (), normal).any() for adjuster in adjusters):
        return None
    best: tuple[Array, Supports] | None = None
    for along in np.delete(np.eye(3), np.argmax(np.abs(normal)), axis=0):
        first = along - normal * (along @ normal)
        axes = np.array([first, np.cross(normal, first)]) / np.linalg.norm(first)
        s, t = axes @ at.T
        order = np.argsort(t, kind="stable")
        cuts = np.flatnonzero(np.diff(t[order]) > ROW_MM) + 1
        groups = [part[np.argsort(s[part])] for part in np.split(order, cuts)]
        rows = tuple(tuple(int(index) for index in group) for group in groups)
        is_fit = len(rows) <= 2 and min(map(len, rows)) > 1
        if is_fit and all(np.all(np.diff(s[list(row)]) > ROW_MM) for row in rows):
            best = (axes, rows) if best is None or len(rows) < len(best[1]) else best
    return best
