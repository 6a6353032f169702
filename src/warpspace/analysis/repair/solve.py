"""The best values of a given set of errors: for RMS in closed form, for max as a convex problem."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.repair.volume import Volume
from warpspace.units import Array

CLOSE_UM = 1e-4
"""The largest error is found to within this of the least there can be, µm."""
NODES_AT_ONCE = 40
"""Worst nodes for which planes are added in one step."""
MOST_STEPS = 300


class Objective(StrEnum):
    """What is made as small as possible over the volume."""

    RMS = "rms"
    MAX = "max"


@dataclass(frozen=True, slots=True)
class Solution:
    """The best change of a set of errors.

    Attributes
    ----------
    indices : tuple of int
        Which errors, by their place in the basis.
    change : ndarray, [k], µm or µrad
        New minus present value.
    value_um : float, µm
        The objective then.
    """

    indices: tuple[int, ...]
    change: Array
    value_um: float


def least(
    volume: Volume,
    objective: Objective,
    indices: tuple[int, ...],
    bounds: Array,
    give_up_um: float = np.inf,
) -> Solution | None:
    """Find the change of some errors that makes the objective smallest.

    Parameters
    ----------
    volume : Volume
    objective : Objective
    indices : tuple of int, (k,)
        Errors that are adjusted, by their place in the basis.
    bounds : ndarray, [K, 2], µm or µrad
        Least and largest change of every error of the basis.
    give_up_um : float, optional, µm
        A value that is of no use any more.

    Returns
    -------
    Solution or None
        None where the least value is proven not to be below `give_up_um`.
    """
    if objective is Objective.RMS:
        return least_rms(volume, indices, bounds)
    return least_max(volume, indices, bounds, give_up_um)


def least_rms(volume: Volume, indices: tuple[int, ...], bounds: Array) -> Solution:
    """Make the root mean square of the volume smallest: weighted least squares within bounds."""
    from scipy.optimize import lsq_linear

    matrix, error = volume.triangle
    low, high = bounds[list(indices)].T
    change: Array = np.asarray(np.linalg.lstsq(matrix[:, indices], -error)[0], dtype=float)
    if np.any(change < low) or np.any(change > high):
        found = lsq_linear(matrix[:, indices], -error, (low, high), method="bvls", tol=1e-12)
        change = np.clip(np.asarray(found.x, dtype=float), low, high)
    return Solution(indices, change, volume.rms_um(indices, change))


def least_max(
    volume: Volume, indices: tuple[int, ...], bounds: Array, give_up_um: float = np.inf
) -> Solution | None:
    """Make the largest error of all nodes smallest; see `least` for the parameters.

    Notes
    -----
    min over x of max over nodes of |e + A x| is a convex (second-order cone) problem. The length of
    a vector is at least its part along any unit vector u, so that each node and each u give a plane
    u · (e + A x) ≤ t below the objective. A linear program with the planes found so far gives a
    lower bound and the next x; there the worst nodes give new planes, u being the direction of
    their error. It ends when the best x met is within `CLOSE_UM` of the lower bound, which is
    proof for all nodes at once.
    """
    from scipy.optimize import linprog

    chosen = volume.response[list(indices)]
    size = len(indices)
    change = least_rms(volume, indices, bounds).change
    ranges = [*map(tuple, bounds[list(indices)]), (0.0, None)]
    goal = np.zeros(size + 1)
    goal[-1] = 1.0
    planes: list[Array] = []
    offsets: list[Array] = []
    best, best_um = change, np.inf
    for _ in range(MOST_STEPS):
        error = volume.error_um + np.tensordot(change, chosen, 1)
        norm = np.sqrt(np.einsum("nc,nc->n", error, error))
        if (largest := float(norm.max())) < best_um:
            best, best_um = change, largest
        worst = _worst(norm)
        unit = error[worst] / np.maximum(norm[worst], np.finfo(float).tiny)[:, None]
        slopes = np.einsum("knc,nc->nk", chosen[:, worst], unit)
        planes.append(np.column_stack([slopes, -np.ones(len(worst))]))
        offsets.append(-np.einsum("nc,nc->n", volume.error_um[worst], unit))
        found = linprog(goal, np.concatenate(planes), np.concatenate(offsets), bounds=ranges)
        if found.status != 0:
            break
        if found.fun > give_up_um - CLOSE_UM:
            return None
        if best_um - found.fun < CLOSE_UM:
            break
        change = np.clip(found.x[:size], *bounds[list(indices)].T)
    return Solution(indices, best, best_um)


def _worst(norm: Array) -> NDArray[np.intp]:
    """Give the places of the worst nodes, [M]."""
    count = min(NODES_AT_ONCE, norm.size)
    return np.argpartition(norm, norm.size - count)[norm.size - count :]
