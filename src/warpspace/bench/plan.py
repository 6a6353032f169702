"""What a test runs through, and what it comes to: poses, what is sensed there, its numbers."""

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
    """

    coordinates: Mapping[str, Array]  # [n], mm or degrees; of all axes at each site, commanded
    point_mm: Array  # [n, 3]; nominal points in R
    travel: Mapping[str, Array]  # [n]; ±1: direction in which an axis has come, 0 where it stands
    site: Whole  # [m]; of each reading
    direction: Array  # [m, 3]; unit vectors in R that are sensed along
    against: Whole  # [m]; site whose error is subtracted, or `NONE`
    gain: Array  # [m]; 1 for readings in µm, 1000 / lever in mm for angles in µrad
    # [m]; of a bar whose change is read; infinite where a sensor looks in a fixed direction
    length_mm: Array
    # [m]; what tells readings apart: targets, angles, runs, directions, channels
    marks: Mapping[str, Array]
    # [m]; readings that one unit (µm, or µrad where the name says so) of an unknown of the set-up
    # gives: the zero of a scale, the place of a ball. They are no errors of the machine.
    setup: Mapping[str, Array]
    place: str  # where it stands, in words
    path: tuple[Whole, ...] = ()  # sites of each stretch of the path, in order, for drawings

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
    """Put a plan together; by default each site gives one reading of a fixed direction.

    Coordinates may be scalars, and all readings may share a direction, gain and length.
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


@dataclass(frozen=True, slots=True)
class Quantity:
    """One number of a standard."""

    key: str  # in JSON; ends in its unit
    name: str  # in words
    value: float
    unit: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What readings come to."""

    quantities: tuple[Quantity, ...]  # the most important first
    # what else JSON has: lists of numbers, ready to be spelled
    details: Mapping[str, object] = field(default_factory=dict[str, object])

    def __getitem__(self, key: str) -> float:
        """Give a number by its key."""
        return next(quantity.value for quantity in self.quantities if quantity.key == key)
