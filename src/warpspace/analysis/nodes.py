"""|E| of many machines at many nodes: the matrix products behind sampling."""

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from warpspace.analysis.points import Places
from warpspace.field.evaluate import View, build_basis
from warpspace.kinematics.model import Model
from warpspace.machine.errors import ErrorSet
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array

BLOCK_MULTIPLICATIONS = 900_000
"""Size of one matrix product: its result stays in the cache, and BLAS leaves it to one core."""


class Over(StrEnum):
    """What one number a machine gives is taken over."""

    SAMPLED = "sampled"
    MAX = "max"
    MEAN = "mean"


def node_gains(model: Model, keys: Sequence[str], view: View, places: Places) -> Array:
    """Compute the gains of parameters that hold everywhere.

    Parameters
    ----------
    model : Model
    keys : sequence of str, (K,)
    view : View
    places : Places

    Returns
    -------
    ndarray, [3, K, N], µm per µm or µrad
        One contiguous matrix per component of E.
    """
    model = replace(model, direction=TravelDirection.MEAN)  # gains have none
    basis = build_basis(model, ErrorSet(), keys, places.coordinates, view, places.point_mm)
    flat = basis.position.reshape(len(keys), -1, 3)
    return np.ascontiguousarray(np.moveaxis(flat, -1, 0))


def reduce_nodes(
    amplitudes: Array, gains: Array, over: Over | str, weights: Array | None = None
) -> Array:
    """Evaluate |E| of machines at all nodes and keep its largest or mean.

    Parameters
    ----------
    amplitudes : ndarray, [n, K], µm or µrad
    gains : ndarray, [3, K, N], µm per µm or µrad
    over : Over or str
        `max` or `mean`.
    weights : ndarray, [N], optional
        What each node counts for in the mean, adding up to 1; all alike by default.

    Returns
    -------
    ndarray, [n], µm

    Notes
    -----
    Three matrix products per block, each squared and added in place while it is in the cache; the
    [n, N] errors are never held as a whole.
    """
    machines, nodes = len(amplitudes), gains.shape[2]
    rows = int(np.clip(BLOCK_MULTIPLICATIONS // gains[0].size, 8, 256))
    total, part = np.empty((rows, nodes)), np.empty((rows, nodes))
    result = np.empty(machines)
    for start in range(0, machines, rows):
        block = amplitudes[start : start + rows]
        square, term = total[: len(block)], part[: len(block)]
        np.matmul(block, gains[0], out=square)
        np.multiply(square, square, out=square)
        for gain in gains[1:]:
            np.matmul(block, gain, out=term)
            np.multiply(term, term, out=term)
            np.add(square, term, out=square)
        if over == Over.MAX:
            result[start : start + rows] = np.sqrt(square.max(axis=1))
        elif weights is None:
            result[start : start + rows] = np.sqrt(square, out=square).mean(axis=1)
        else:
            result[start : start + rows] = np.sqrt(square, out=square) @ weights
    return result
