"""Errors over two axes from their points."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Plane, plane_by_direction
from warpspace.formats.source import Source

SAME = 1e-9
"""mm or degrees: positions nearer than this are one."""
Point = tuple[int, float, float, float]
"""Line, position of both axes, value."""


def distinct(at: np.ndarray) -> np.ndarray:
    """Give the positions, each once, ascending."""
    ordered = np.sort(at)
    return ordered[np.concatenate([[True], np.diff(ordered) > SAME])]


def plane_of(
    key: str, axes: tuple[str, str], points: Sequence[Point], source: Source, where: str = ""
) -> Plane:
    """Build an error of two axes from its points.

    Parameters
    ----------
    key : str
    axes : tuple of str, (2,)
        That of the error first.
    points : sequence of tuple
        In any order.
    source : Source
    where : str, optional
        Which points they are, for messages.

    Raises
    ------
    SceneError
        If they are no full grid.
    """
    first = distinct(np.array([point[1] for point in points]))
    second = distinct(np.array([point[2] for point in points]))
    values = np.full((len(first), len(second)), math.nan)
    lines: dict[tuple[int, int], int] = {}
    for line, one, other, value in points:
        i = int(np.abs(first - one).argmin())
        j = int(np.abs(second - other).argmin())
        if (i, j) in lines:
            found = f"{axes[0]} {one:g}, {axes[1]} {other:g}{where} stands also in line"
            source.refuse(f"{found} {lines[i, j]}; expected every point once", line)
        lines[i, j] = line
        values[i, j] = value
    if np.isnan(values).any():
        i, j = (int(index) for index in np.argwhere(np.isnan(values))[0])
        found = f"{key} has no value at {axes[0]} {first[i]:g}, {axes[1]} {second[j]:g}{where}"
        source.refuse(f"{found}; expected a value at every point of the grid", lines.get((i, j)))
    rows = tuple(tuple(row) for row in values.tolist())
    return Plane(key, axes, tuple(first.tolist()), tuple(second.tolist()), rows)


def plane_by_ways(
    key: str, axes: tuple[str, str], points: Mapping[int, Sequence[Point]], source: Source
) -> Plane:
    """Build an error of two axes from its points by direction of travel, see `plane_of`.

    Raises
    ------
    SceneError
        If the points of one direction are no full grid, or not those of the other one.
    """
    words = {FORWARD: " forward", BACKWARD: " backward", BOTH: ""}
    planes = {way: plane_of(key, axes, own, source, words[way]) for way, own in points.items()}
    if len(planes) == 1:
        return next(iter(planes.values()))
    if set(planes) != {FORWARD, BACKWARD}:
        line = points[BOTH][0][0]
        source.refuse("has no direction; expected + or - in every row, or in none", line)
    there, back = planes[FORWARD], planes[BACKWARD]
    if (there.first, there.second) != (back.first, back.second):
        line = points[BACKWARD][0][0]
        source.refuse(f"{key} has other points backward than forward; expected the same", line)
    tables = {way: plane.table(BOTH) for way, plane in planes.items()}
    return plane_by_direction(key, axes, (there.first, there.second), tables)
