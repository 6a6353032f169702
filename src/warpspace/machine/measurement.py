"""What was measured of an error: single readings in runs along its axis, which show scatter."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpspace.units import Array

FORWARD, BACKWARD, UNKNOWN = "+", "-", ""
RUN_DIRECTIONS = (FORWARD, BACKWARD, UNKNOWN)
"""Towards growing positions, towards falling ones, not known."""


@dataclass(frozen=True, slots=True)
class Run:
    """Readings of one travel along an axis.

    Attributes
    ----------
    direction : str
        "+" towards growing positions, "-" towards falling ones, empty where it is not known.
    points : tuple of tuple of float, (n, 2)
        Position in mm or degrees and reading in µm or µrad, in the order they were taken.
    """

    direction: str
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Measurement:
    """All runs of one error.

    Attributes
    ----------
    runs : tuple of Run
    """

    runs: tuple[Run, ...]

    @cached_property
    def scatter(self) -> dict[str, Array]:
        """Readings by direction, [n, 2]: position in mm or degrees, value in µm or µrad."""
        found: dict[str, list[tuple[float, float]]] = {}
        for run in self.runs:
            found.setdefault(run.direction, []).extend(run.points)
        return {way: np.array(points) for way, points in found.items()}

    @property
    def count(self) -> int:
        """Number of readings."""
        return sum(len(run.points) for run in self.runs)
