"""What a file of measured errors holds, whatever its format: the neutral form of an import."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpspace.machine.parameters import parameter
from warpspace.units import Array

FORWARD, BACKWARD, BOTH = 1, -1, 0
"""Direction of travel in which a value was taken; both where a file does not tell."""
REPEATABILITY = 4.0
"""ISO 230-2, 3.17: unidirectional repeatability in standard deviations."""
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Run:
    """One run over the positions of a series.

    Attributes
    ----------
    number : int
    direction : int
        1 forward, −1 backward, 0 where not told.
    values : tuple of float, (n,), µm or µrad
        Not a number where a position was left out.
    """

    number: int
    direction: int
    values: tuple[float, ...]


@dataclass(frozen=True)
class Series:
    """One error along its axis.

    Attributes
    ----------
    key : str
        Parameter.
    positions : tuple of float, (n,), mm or degrees
        Ascending.
    runs : tuple of Run
        At least one.
    uncertainty : tuple of float, (n,), µm or µrad
        Standard uncertainties (k = 1); empty where none are given.
    """

    key: str
    positions: tuple[float, ...]
    runs: tuple[Run, ...]
    uncertainty: tuple[float, ...] = ()

    def _runs(self, direction: int) -> Array:
        """Give the values of the runs in a direction, [runs, n]."""
        return np.array([run.values for run in self.runs if run.direction == direction])

    def mean(self, direction: int) -> Array | None:
        """Give the mean of the runs in one direction, [n]; None where there are none."""
        found = self._runs(direction)
        return np.nanmean(found, axis=0) if len(found) else None

    @property
    def forward(self) -> Array | None:
        """Mean of the forward runs, [n], µm or µrad (x̄ᵢ↑ of ISO 230-2)."""
        return self.mean(FORWARD)

    @property
    def backward(self) -> Array | None:
        """Mean of the backward runs, [n], µm or µrad (x̄ᵢ↓)."""
        return self.mean(BACKWARD)

    @property
    def values(self) -> Array:
        """Mean bidirectional error, [n], µm or µrad (x̄ᵢ); the mean of what there is otherwise."""
        means = [
            found for way in (FORWARD, BACKWARD, BOTH) if (found := self.mean(way)) is not None
        ]
        return np.mean(means, axis=0)

    @property
    def reversal(self) -> Array | None:
        """Reversal error, [n], µm or µrad (Bᵢ = x̄ᵢ↑ − x̄ᵢ↓); None where one direction is missing."""
        forward, backward = self.forward, self.backward
        return None if forward is None or backward is None else forward - backward

    def deviation(self, direction: int) -> Array | None:
        """Estimate the standard deviation in a direction, [n] (sᵢ); None below two runs."""
        found = self._runs(direction)
        return np.nanstd(found, axis=0, ddof=1) if len(found) > 1 else None

    @property
    def repeatability(self) -> Array | None:
        """Bidirectional repeatability, [n], µm or µrad (Rᵢ of ISO 230-2); None below two runs.

        The largest of 2·sᵢ↑ + 2·sᵢ↓ + |Bᵢ|, 4·sᵢ↑ and 4·sᵢ↓.
        """
        up, down, reversal = self.deviation(FORWARD), self.deviation(BACKWARD), self.reversal
        if up is None or down is None or reversal is None:
            return None
        half = REPEATABILITY / 2.0
        both = half * (up + down) + np.abs(reversal)
        return np.max([both, REPEATABILITY * up, REPEATABILITY * down], axis=0)


@dataclass(frozen=True)
class Plane:
    """One error over two axes.

    Attributes
    ----------
    key : str
    axes : tuple of str, (2,)
    first, second : tuple of float, mm or degrees
        Ascending positions of the two axes.
    values : tuple of tuple of float, (first, second), µm or µrad
        Forward values where `backward` is given.
    backward : tuple of tuple of float, (first, second), µm or µrad
        Values for travel of the first axis in the negative direction; empty where they are the
        same.
    """

    key: str
    axes: tuple[str, str]
    first: tuple[float, ...]
    second: tuple[float, ...]
    values: Matrix
    backward: Matrix = ()

    def table(self, direction: int) -> Array:
        """Give the values of a direction of travel, the mean of both for 0, (first, second)."""
        forward = np.array(self.values)
        backward = np.array(self.backward) if self.backward else forward
        return {FORWARD: forward, BACKWARD: backward, BOTH: (forward + backward) / 2.0}[direction]


def plane_by_direction(
    key: str,
    axes: tuple[str, str],
    positions: tuple[ArrayLike, ArrayLike],
    tables: Mapping[int, Array],
) -> Plane:
    """Build an error over two axes of its values in both directions of travel.

    Parameters
    ----------
    key : str
    axes : tuple of str, (2,)
    positions : tuple of array_like, (n,) and (m,), mm or degrees
        Ascending, of each axis.
    tables : mapping of int to ndarray, (first, second), µm or µrad
        By direction, 1 and −1.

    Returns
    -------
    Plane
        With one table where both are the same.
    """
    forward, backward = (
        tuple(tuple(row) for row in tables[way].tolist()) for way in (FORWARD, BACKWARD)
    )
    first, second = (tuple(np.asarray(at, dtype=float).tolist()) for at in positions)
    return Plane(key, axes, first, second, forward, () if backward == forward else backward)


@dataclass(frozen=True)
class Imported:
    """What a file holds.

    Attributes
    ----------
    format : str
        Name of its format.
    series : tuple of Series
    planes : tuple of Plane
    constants : mapping of str to float, µm or µrad
    uncertainty : mapping of str to float, µm or µrad
        Standard uncertainty of constants.
    units : tuple of str
        Units that the file has its numbers in.
    assumed : tuple of str
        What the file does not say and was taken for granted, a sentence each.
    notes : tuple of str
        What else a user should know.
    convention : mapping of str to str
        Where its component errors act, by kind of axis; empty where the file does not tell.
    curves : mapping of str to object
        Errors that no table but another spelling of a scene file holds: {"poly": […]}.
    """

    format: str
    series: tuple[Series, ...] = ()
    planes: tuple[Plane, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict[str, float])
    uncertainty: Mapping[str, float] = field(default_factory=dict[str, float])
    units: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    convention: Mapping[str, str] = field(default_factory=dict[str, str])
    curves: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @property
    def keys(self) -> tuple[str, ...]:
        """Parameters that it gives, each once."""
        own = [one.key for one in (*self.series, *self.planes)]
        return tuple(dict.fromkeys((*own, *self.constants, *self.curves)))

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that its errors belong to, each once."""
        own = [parameter(key).axis for key in self.keys]
        return tuple(dict.fromkeys((*own, *(axis for one in self.planes for axis in one.axes))))

    @property
    def size(self) -> int:
        """How many numbers it holds."""
        series = sum(len(run.values) for one in self.series for run in one.runs)
        planes = sum(
            len(one.first) * len(one.second) * (2 if one.backward else 1) for one in self.planes
        )
        return series + planes + len(self.constants)


def merge(parts: Sequence[Imported]) -> Imported:
    """Put the contents of several files together, all of one format.

    Parameters
    ----------
    parts : sequence of Imported
        At least one; no two give the same parameter.

    Returns
    -------
    Imported
    """
    constants: dict[str, float] = {}
    uncertainty: dict[str, float] = {}
    convention: dict[str, str] = {}
    curves: dict[str, Any] = {}
    for part in parts:
        constants |= part.constants
        uncertainty |= part.uncertainty
        convention |= part.convention
        curves |= part.curves
    return Imported(
        " + ".join(dict.fromkeys(part.format for part in parts)),
        tuple(one for part in parts for one in part.series),
        tuple(one for part in parts for one in part.planes),
        constants,
        uncertainty,
        _once(part.units for part in parts),
        _once(part.assumed for part in parts),
        _once(part.notes for part in parts),
        convention,
        curves,
    )


def _once(parts: Any) -> tuple[str, ...]:
    """Give every sentence of several lists once."""
    return tuple(dict.fromkeys(text for part in parts for text in part))
