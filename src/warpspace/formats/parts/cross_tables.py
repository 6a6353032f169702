"""Tables of one axis that correct another, and products of two: what a scene needs of them.

A table holds the mean of the correction over the other axes. What two axes do together beyond that,
such as an angle times a lever, is a sum of products of two tables. Where errors depend on the
direction of travel, two tables act in one direction each, the values around their mean.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from warpspace.formats.compensation.wanted import Wanted
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

MOST_PRODUCTS = 3
"""Pairs of tables for one axis over two others."""
LEAST_MM = 1e-5
"""A product of tables below it is not worth two tables."""
Needed = Mapping[tuple[str, ...], Mapping[str, Array]]
"""Corrections over some axes, by corrected axis."""


@dataclass(frozen=True)
class CrossTable:
    """One table to write.

    Attributes
    ----------
    along, target : str
        Axis looked up, and corrected axis.
    values : ndarray, (n,)
    direction : int
        1 or −1 where it acts in one direction of travel of the axis looked up only.
    number : int
        How many tables further the other factor of a product stands, 0 for none.
    """

    along: str
    target: str
    values: Array
    direction: int = 0
    number: int = 0


def cross_tables(wanted: Wanted, factor: float, most: int) -> list[CrossTable]:
    """Give the tables that correct all axes over all axes.

    Parameters
    ----------
    wanted : Wanted
    factor : float
        From a correction to a number of a table.
    most : int
        Tables that the controller has; where they are not enough, what directions of travel do over
        two axes is left out.

    Returns
    -------
    list of CrossTable
        A table of zeros where there is nothing to correct.
    """
    needed = _needed(wanted.toward(TravelDirection.MEAN), wanted.axes)
    reversals = {axis: _half_reversals(wanted, axis) for axis in wanted.directed}
    tables = _planned(wanted, factor, needed, reversals, MOST_PRODUCTS)
    return tables if len(tables) <= most else _planned(wanted, factor, needed, reversals, 0)


def _needed(wanted: Wanted, axes: Sequence[str]) -> Needed:
    """Give the corrections over no axis, over each and over each two, by corrected axis."""
    groups = [(), *((axis,) for axis in axes), *combinations(axes, 2)]
    return {group: wanted.averaged(group) for group in groups}


def _half_reversals(wanted: Wanted, axis: str) -> Needed:
    """Give half the difference that the direction of one axis makes: over it, and it and another.

    The first axis of each group is that one.
    """
    base = wanted.toward(TravelDirection.MEAN)
    ways = [base.toward(way, axis) for way in (TravelDirection.FORWARD, TravelDirection.BACKWARD)]
    found: dict[tuple[str, ...], Mapping[str, Array]] = {}
    for other in ("", *wanted.axes):
        if other == axis:
            continue
        group = tuple(name for name in wanted.axes if name in (axis, other))
        there, back = (way.averaged(group) for way in ways)
        half = {target: (there[target] - back[target]) / 2.0 for target in there}
        if other and group[0] != axis:
            half = {target: values.T for target, values in half.items()}
        found[(axis, other) if other else (axis,)] = half
    return found


def _planned(
    wanted: Wanted,
    factor: float,
    needed: Needed,
    reversals: Mapping[str, Needed],
    most_products: int,
) -> list[CrossTable]:
    """Give all tables, with so many products for what directions of travel do over two axes."""
    tables: list[CrossTable] = []
    for target in wanted.corrector.moved:
        found = {group: table[target] for group, table in needed.items()}
        halves = {
            axis: {group: table[target] for group, table in groups.items()}
            for axis, groups in reversals.items()
        }
        tables += _tables_for(wanted, factor, target, found, halves, most_products)
    if tables:
        return tables
    axis = wanted.axes[0]  # nothing to correct: a table of zeros
    return [CrossTable(axis, wanted.corrector.moved[0], np.zeros(len(wanted.places(axis))))]


def _tables_for(
    wanted: Wanted,
    factor: float,
    target: str,
    needed: Mapping[tuple[str, ...], Array],
    halves: Mapping[str, Mapping[tuple[str, ...], Array]],
    most_products: int,
) -> list[CrossTable]:
    """Give the tables that correct one axis."""
    axes = wanted.axes
    mean = float(needed[()])
    along = {axis: needed[axis,] - mean for axis in axes}
    home = target if target in axes else axes[0]
    along[home] = along[home] + mean
    products: list[CrossTable] = []
    for first, second in combinations(axes, 2):
        for one, other in _factors(factor * _interaction(needed[first, second]), MOST_PRODUCTS):
            # both tables also act by themselves: their axis' own table takes that back
            along[first] = along[first] - factor * one
            along[second] = along[second] - factor * other
            products += [
                CrossTable(first, target, one, number=1),
                CrossTable(second, target, other),
            ]
    half = {axis: groups[axis,] for axis, groups in halves.items()}
    for axis, groups in halves.items():
        for (_, second), both in ((group, v) for group, v in groups.items() if len(group) == 2):
            rest = both - groups[axis,][:, None]
            for one, other in _factors(factor * rest, most_products):
                half[axis] = half[axis] - factor * one
                along[second] = along[second] - factor * other
                products += [
                    CrossTable(axis, target, one, 1, number=2),
                    CrossTable(axis, target, -one, -1, number=1),
                    CrossTable(second, target, other),
                ]
    own: list[CrossTable] = []
    for axis, values in along.items():
        turned = half.get(axis, np.zeros(()))
        if np.abs(turned).max() > LEAST_MM / 100.0:
            own += [
                CrossTable(axis, target, factor * (values + way * turned), way) for way in (1, -1)
            ]
        else:
            own.append(CrossTable(axis, target, factor * values))
    kept = [table for table in own if np.abs(table.values).max() > LEAST_MM / 100.0]
    return [*kept, *products]


def _factors(both: Array, most: int) -> Iterator[tuple[Array, Array]]:
    """Give the tables whose products add up to a table of two axes, the largest first."""
    left, sizes, right = np.linalg.svd(both)
    for rank, size in enumerate(sizes[:most].tolist()):
        one, other = left[:, rank] * np.sqrt(size), right[rank] * np.sqrt(size)
        if np.abs(one).max() * np.abs(other).max() < LEAST_MM:
            return
        yield one, other


def _interaction(both: Array) -> Array:
    """Take out of a table of two axes what depends on one of them alone, [n1, n2]."""
    one, other = (_shares(count) for count in both.shape)
    first, second = both @ other, one @ both
    return both - first[:, None] - second + one @ first


def _shares(count: int) -> Array:
    """Give the share of an axis that belongs to each of its points, trapezoidal, [n]."""
    shares = np.ones(count)
    shares[[0, -1]] = 0.5
    return shares / shares.sum()
