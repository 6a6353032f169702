"""What a test runs through: poses, the points that count there, and what is sensed."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpspace.units import Array

Whole = NDArray[np.intp]
NONE = -1
"""In place of the site that a reading is taken against: none."""
DEPENDENT = 1e-9
"""Share of a column of the set-up that others do not give, below which it is left out."""


@dataclass(frozen=True)
class Plan:
    """Path and sensing of a test on one machine.

    A site is a pose and a point that counts there. The error of a site is that of the tool against
    the workpiece (loop `relative`) at that point; a reading senses it in one direction, as it is or
    against that of another site.

    Attributes
    ----------
    coordinates : mapping of str to ndarray, [n], mm or degrees
        Commanded positions of all axes at each site.
    point_mm : ndarray, [n, 3], mm
        Nominal point in R.
    travel : mapping of str to ndarray, [n]
        +1 or −1 for the direction in which an axis has come, 0 where it stands.
    site : ndarray of int, [m]
        Site of each reading.
    direction : ndarray, [m, 3]
        Unit vector in R that is sensed along.
    against : ndarray of int, [m]
        Site whose error is subtracted, or `NONE`.
    gain : ndarray, [m]
        1 for readings in µm; 1000 / lever in mm for angles in µrad.
    length_mm : ndarray, [m], mm
        Length of a bar whose change is read; infinite where a sensor looks in a fixed direction.
    marks : mapping of str to ndarray, [m]
        What the test needs to tell its readings apart: targets, angles, runs, directions, channels.
    setup : mapping of str to ndarray, [m]
        Readings that one unit (µm, or µrad where the name says so) of an unknown of the set-up
        gives: the zero of a scale, the place of a ball. They are no errors of the machine.
    place : str
        Where it stands, in words.
    path : tuple of ndarray of int
        Sites of each stretch of the path, in order, for drawings.
    """

    coordinates: Mapping[str, Array]
    point_mm: Array
    travel: Mapping[str, Array]
    site: Whole
    direction: Array
    against: Whole
    gain: Array
    length_mm: Array
    marks: Mapping[str, Array]
    setup: Mapping[str, Array]
    place: str
    path: tuple[Whole, ...] = field(default_factory=tuple)

    @property
    def readings(self) -> int:
        """Number of readings."""
        return len(self.site)


def build_plan(
    coordinates: Mapping[str, Array],
    point_mm: Array,
    direction: Array,
    *,
    place: str,
    marks: Mapping[str, Array] | None = None,
    site: Whole | None = None,
    against: Whole | None = None,
    gain: Array | float = 1.0,
    length_mm: Array | float = np.inf,
    travel: Mapping[str, Array] | None = None,
    setup: Mapping[str, Array] | None = None,
    path: tuple[Whole, ...] | None = None,
) -> Plan:
    """Put a plan together; what is left out is the plainest there is.

    Parameters
    ----------
    coordinates : mapping of str to ndarray, [n] or scalar
    point_mm : ndarray, [n, 3], mm
    direction : ndarray, [m, 3] or [3]
    place : str
    marks, site, against, gain, length_mm, travel, setup, path : optional
        See `Plan`; by default each site gives one reading of a fixed direction, against none.

    Returns
    -------
    Plan
    """
    sites = len(point_mm)
    rows = np.arange(sites) if site is None else site
    count = len(rows)
    full = {name: np.broadcast_to(values, (sites,)) for name, values in coordinates.items()}
    return Plan(
        full,
        point_mm,
        travel or {},
        rows,
        np.broadcast_to(direction, (count, 3)),
        np.full(count, NONE) if against is None else against,
        np.broadcast_to(np.asarray(gain, dtype=float), (count,)),
        np.broadcast_to(np.asarray(length_mm, dtype=float), (count,)),
        marks or {},
        _independent(setup or {}),
        place,
        (np.arange(sites),) if path is None else path,
    )


def _independent(setup: Mapping[str, Array]) -> dict[str, Array]:
    """Leave out what the unknowns before it give as well, or what gives no reading at all."""
    kept: dict[str, Array] = {}
    basis: list[Array] = []
    for name, column in setup.items():
        rest = column.astype(float)
        for vector in basis:
            rest = rest - (vector @ rest) * vector
        size = float(np.linalg.norm(rest))
        if size > DEPENDENT * np.sqrt(len(column)):
            kept[name] = column
            basis.append(rest / size)
    return kept
