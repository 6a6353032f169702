"""Statistics of an error field: over the volume it fills, or over points as they are."""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as attribute
from functools import cache

import numpy as np

from warpspace.exceptions import OptionError
from warpspace.field.basis import ErrorField
from warpspace.field.grid import Grid
from warpspace.units import Array

P95 = 0.95
CELLS = 40
"""About as many cells per axis a percentile is read from; a coarse grid is subdivided."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Summary of the length of the position error over a field.

    Attributes
    ----------
    mean_um, rms_um, p95_um, max_um : float, µm
        Mean, root mean square, 95th percentile and largest.
    max_at_mm : tuple of float, (3,), mm
        Nominal point in R of the largest.
    max_at_axes : mapping of str to float, mm or degrees
        Axis positions there; empty where the field came without any.
    """

    mean_um: float
    rms_um: float
    p95_um: float
    max_um: float
    max_at_mm: tuple[float, float, float]
    max_at_axes: Mapping[str, float] = attribute(default_factory=dict)


def volume_statistics(field: ErrorField, grid: Grid) -> Statistics:
    """Summarise the volume that a grid fills, whatever the number of its nodes.

    Each node counts for its share of the volume, so that corners and edges weigh less than the
    inside. Between the nodes the length of the error is interpolated.

    Parameters
    ----------
    field : ErrorField
        Errors of all nodes of the grid, of its shape or flat.
    grid : Grid

    Returns
    -------
    Statistics
        The largest error is that of the worst node.
    """
    norm = field.norm_um.reshape(grid.shape)
    weights = grid.weights
    cells = _cell_values(norm).reshape(-1)
    worst = np.unravel_index(int(np.argmax(norm)), grid.shape)
    x, y, z = (float(value) for value in grid.nominal_mm[worst])
    return Statistics(
        float(np.sum(weights * norm)),
        float(np.sqrt(np.sum(weights * norm * norm))),
        _percentile(cells, P95 * cells.size - 0.5),
        float(norm[worst]),
        (x, y, z),
        {
            name: float(np.broadcast_to(value, grid.shape)[worst])
            for name, value in grid.coordinates.items()
        },
    )


def statistics(field: ErrorField, axes: Mapping[str, Array] | None = None) -> Statistics:
    """Summarise points, each counted once.

    Parameters
    ----------
    field : ErrorField
    axes : mapping of str to ndarray, mm or degrees, optional
        Axis positions of the points, shaped to broadcast to them.

    Returns
    -------
    Statistics

    Raises
    ------
    OptionError
        If the field has no point.
    """
    shape = field.norm_um.shape
    norm = field.norm_um.reshape(-1)
    if norm.size == 0:
        raise OptionError("statistics of no points; expected at least one")
    worst = int(np.argmax(norm))
    place = np.unravel_index(worst, shape)
    x, y, z = (float(value) for value in field.nominal_mm[place])
    return Statistics(
        float(norm.mean()),
        float(np.sqrt(norm @ norm / norm.size)),
        _percentile(norm, P95 * (norm.size - 1)),
        float(norm[worst]),
        (x, y, z),
        {name: float(np.broadcast_to(value, shape)[place]) for name, value in (axes or {}).items()},
    )


def _cell_values(values: Array) -> Array:
    """Interpolate values at nodes to the middles of cells of equal volume, in any order."""
    for nodes in values.shape:
        values = np.tensordot(values, _to_cells(nodes), axes=(0, 1))
    return values


@cache
def _to_cells(nodes: int) -> Array:
    """Give the weights of nodes along an edge in the middles of its cells, [cells, nodes]."""
    if nodes == 1:
        return np.ones((1, 1))
    parts = max(1, round(CELLS / (nodes - 1)))
    share = (np.arange(parts) + 0.5) / parts
    weights = np.zeros((nodes - 1, parts, nodes))
    for cell in range(nodes - 1):
        weights[cell, :, cell], weights[cell, :, cell + 1] = 1.0 - share, share
    return weights.reshape(-1, nodes)


def _percentile(values: Array, place: float) -> float:
    """Interpolate between the two values beside a place in their order, counted from 0.

    `numpy.quantile` takes thrice the time for what the app works out with every move of a slider.
    """
    place = min(max(place, 0.0), values.size - 1.0)
    below = int(place)
    above = min(below + 1, values.size - 1)
    low, high = np.partition(values, (below, above))[[below, above]]
    return float(low + (place - below) * (high - low))
