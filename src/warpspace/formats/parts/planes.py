"""Errors over two axes from their points."""

import math
from collections.abc import Sequence

import numpy as np

from warpspace.formats.measured import Plane
from warpspace.formats.source import Source

SAME = 1e-9
"""mm or degrees: positions nearer than this are one."""


def distinct(at: np.ndarray) -> np.ndarray:
    """Give the positions, each once, ascending."""
    ordered = np.sort(at)
    return ordered[np.concatenate([[True], np.diff(ordered) > SAME])]


def plane_of(
    key: str,
    axes: tuple[str, str],
    points: Sequence[tuple[int, float, float, float]],
    source: Source,
) -> Plane:
    """Build an error of two axes from its points: line, both positions, value.

    Raises
    ------
    SceneError
        If they are no full grid.
    """
    first = distinct(np.array([point[1] for point in points]))
    second = distinct(np.array([point[2] for point in points]))
    values = np.full((len(first), len(second)), math.nan)
    for line, one, other, value in points:
        i = int(np.abs(first - one).argmin())
        j = int(np.abs(second - other).argmin())
        if not math.isnan(values[i, j]):
            found = f"{axes[0]} {one:g}, {axes[1]} {other:g} stands there twice"
            source.refuse(f"{found}; expected every point once", line)
        values[i, j] = value
    if np.isnan(values).any():
        i, j = np.argwhere(np.isnan(values))[0]
        found = f"{key} has no value at {axes[0]} {first[i]:g}, {axes[1]} {second[j]:g}"
        source.refuse(f"{found}; expected a value at every point of the grid")
    rows = tuple(tuple(row) for row in values.tolist())
    return Plane(key, axes, tuple(first.tolist()), tuple(second.tolist()), rows)
