"""How controllers evaluate their compensation tables: what each adds to the commanded position.

A term gives, for commanded positions of the axes, the correction of each axis it acts on: the
interpolation, the behaviour at the ends and the direction of travel are those of the controller.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from warpspace.kinematics.model import Coordinates
from warpspace.units import Array

HELD, MODULO, EXTENDED = "held", "modulo", "extended"
"""What a table does beyond its ends: its end values, its period, or its last straight line."""


class Term(Protocol):
    """A part of a controller's compensation."""

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Give what is added to the commanded positions, mm or degrees, by axis."""
        ...

    @property
    def size(self) -> int:
        """How many numbers it takes in the controller."""
        ...


@dataclass(frozen=True)
class Line:
    """A table of one axis that corrects one axis.

    Attributes
    ----------
    source, target : str
        The axis whose position is looked up, and the one that is corrected.
    positions : tuple of float, (n,), mm or degrees
        Ascending.
    values : tuple of float, (n,), mm or degrees
        What is added to the commanded position of the target. Forward values where `backward` is
        given.
    ends : str
        "held", "modulo" (the period is that of the table) or "extended".
    backward : tuple of float, (n,)
        Values for travel in the negative direction; empty where they are the same.
    direction : int
        1 or −1 where it acts in one direction of travel only, else 0.
    """

    source: str
    target: str
    positions: tuple[float, ...]
    values: tuple[float, ...]
    ends: str = HELD
    backward: tuple[float, ...] = ()
    direction: int = 0

    @property
    def size(self) -> int:
        """How many numbers it takes."""
        return len(self.values) + len(self.backward)

    @property
    def is_directed(self) -> bool:
        """Whether it depends on the direction of travel."""
        return bool(self.direction or self.backward)

    def at(self, position: Array, direction: int = 0) -> Array:
        """Interpolate linearly, [...]; without a direction of travel the mean of both."""
        if self.backward and direction == 0:
            return (self.at(position, 1) + self.at(position, -1)) / 2.0
        if self.direction and self.direction != direction:
            own = self.at(position, self.direction)
            return own / 2.0 if direction == 0 else np.zeros_like(own)
        values = self.backward if self.backward and direction < 0 else self.values
        return interpolate(np.asarray(position, dtype=float), self.positions, values, self.ends)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Give the correction of its target."""
        return {self.target: self.at(coordinates[self.source], direction)}


@dataclass(frozen=True)
class Product:
    """Two tables whose values are multiplied; the product is added to the target of the first.

    Attributes
    ----------
    first, second : Line
        Their own corrections are no part of it.
    sign : float
        Of the product: −1 where the controller subtracts what its tables say.
    """

    first: Line
    second: Line
    sign: float = 1.0

    @property
    def size(self) -> int:
        """None of its own: both tables count already."""
        return 0

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Give the correction of the target of the first table."""
        first, second = (np.asarray(coordinates[line.source]) for line in (self.first, self.second))
        return {self.first.target: self.at(first, second, direction)}

    def at(self, first: Array, second: Array, direction: int = 0) -> Array:
        """Multiply both tables at positions of their axes; without a direction the mean of both."""
        if direction == 0 and (self.first.is_directed or self.second.is_directed):
            return (self.at(first, second, 1) + self.at(first, second, -1)) / 2.0
        return self.sign * self.first.at(first, direction) * self.second.at(second, direction)


@dataclass(frozen=True)
class Grid3:
    """Corrections of three axes at the points of a grid, trilinear between them.

    Attributes
    ----------
    axes : tuple of str, (3,)
    positions : tuple of tuple of float, (3, n)
        Ascending, of each axis.
    values : ndarray, [n1, n2, n3, 3], mm
        Added to the commanded positions. Beyond the grid its border is held.
    """

    axes: tuple[str, str, str]
    positions: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
    values: Array

    @property
    def size(self) -> int:
        """How many numbers it takes."""
        return int(self.values.size)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Give the corrections of its three axes."""
        del direction
        points = np.broadcast_arrays(*(coordinates[axis] for axis in self.axes))
        found = trilinear(points, self.positions, self.values)
        return {axis: found[..., index] for index, axis in enumerate(self.axes)}


@dataclass(frozen=True)
class Affine:
    """Corrections that are linear in the commanded positions.

    Attributes
    ----------
    axes : tuple of str, (n,)
    matrix : tuple of tuple of float, (n, n)
        Correction of the axis of the row per position of the axis of the column.
    """

    axes: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]

    @property
    def size(self) -> int:
        """How many numbers it takes."""
        return sum(1 for row in self.matrix for value in row if value)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> dict[str, Array]:
        """Multiply the matrix with the positions."""
        del direction
        at = [np.asarray(coordinates[axis], dtype=float) for axis in self.axes]
        return {
            axis: sum((weight * q for weight, q in zip(row, at, strict=True)), np.zeros(()))
            for axis, row in zip(self.axes, self.matrix, strict=True)
        }


def interpolate(position: Array, at: Sequence[float], values: Sequence[float], ends: str) -> Array:
    """Interpolate linearly in a table.

    Parameters
    ----------
    position : ndarray, [...], mm or degrees
    at, values : sequence of float, (n,)
        Positions ascend.
    ends : str
        "held", "modulo" or "extended".

    Returns
    -------
    ndarray, [...]
    """
    places, found = np.asarray(at, dtype=float), np.asarray(values, dtype=float)
    if ends == MODULO and len(places) > 1:
        period = places[-1] - places[0]
        position = places[0] + np.mod(position - places[0], period)
    inside = np.interp(position, places, found)
    if ends != EXTENDED or len(places) < 2:
        return inside
    low = (found[1] - found[0]) / (places[1] - places[0])
    high = (found[-1] - found[-2]) / (places[-1] - places[-2])
    below = np.minimum(position - places[0], 0.0) * low
    return inside + below + np.maximum(position - places[-1], 0.0) * high


def trilinear(
    points: Sequence[Array], positions: Sequence[Sequence[float]], values: Array
) -> Array:
    """Interpolate in a grid of three axes: the documented sum over the eight corners of a cell.

    Parameters
    ----------
    points : sequence of ndarray, (3,) of [...], mm
    positions : sequence of sequence of float, (3, n)
    values : ndarray, [n1, n2, n3, k]

    Returns
    -------
    ndarray, [..., k]
        Beyond the grid the values of its border.
    """
    cells: list[NDArray[np.intp]] = []
    shares: list[Array] = []
    for point, along in zip(points, positions, strict=True):
        places = np.asarray(along, dtype=float)
        cell = np.clip(np.searchsorted(places, point, side="right") - 1, 0, len(places) - 2)
        share = (point - places[cell]) / (places[cell + 1] - places[cell])
        cells.append(cell)
        shares.append(np.clip(share, 0.0, 1.0))
    total = np.zeros((*np.shape(points[0]), values.shape[-1]))
    for corner in np.ndindex(2, 2, 2):
        weight = np.ones(np.shape(points[0]))
        for share, up in zip(shares, corner, strict=True):
            weight = weight * (share if up else 1.0 - share)
        i, j, k = (cell + up for cell, up in zip(cells, corner, strict=True))
        total += weight[..., None] * values[i, j, k]
    return total


@dataclass(frozen=True)
class Tables:
    """What a controller holds after it has read its file.

    Attributes
    ----------
    terms : tuple of Term
        All corrections add up.
    assumed, notes : tuple of str
    units : tuple of str
    """

    terms: tuple[Term, ...]
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    units: tuple[str, ...] = field(default=("mm",))

    @property
    def size(self) -> int:
        """How many numbers the controller holds."""
        return sum(term.size for term in self.terms)

    def corrections(self, coordinates: Coordinates, direction: int = 0) -> Mapping[str, Array]:
        """Add up all corrections, mm or degrees, by axis."""
        total: dict[str, Array] = {}
        for term in self.terms:
            for axis, value in term.corrections(coordinates, direction).items():
                total[axis] = total[axis] + value if axis in total else np.asarray(value)
        return total
