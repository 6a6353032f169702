"""How far tolerances can be widened together: exact on a sample, without search.

The error of a sampled machine is base + t · move, where t widens all free tolerances in the same
ratio. |base + t · move| ≤ limit is a quadratic inequality, so that each machine keeps the limit on
one interval of t, and the widest t of a sample is found by sorting the ends of the intervals.
"""

import math

import numpy as np

from warpspace.units import Array


def scales_within(base_um: Array, move_um: Array, limit_um: float) -> Array:
    """Find the scales at which machines keep a limit.

    Parameters
    ----------
    base_um, move_um : ndarray, [3, S] or [3, S, N], µm
        Error of each machine at its point, or at N points: what stays, and what the scale
        multiplies.
    limit_um : float, µm

    Returns
    -------
    ndarray, [S, 2]
        Smallest and largest scale, 0 or above, at which |E| is within the limit at all points;
        the first is above the second where there is none.
    """
    a = np.einsum("c...,c...->...", move_um, move_um)
    b = np.einsum("c...,c...->...", base_um, move_um)
    c = np.einsum("c...,c...->...", base_um, base_um) - limit_um**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    moves = a > 0.0
    safe = np.where(moves, a, 1.0)
    low = np.where(moves, (-b - root) / safe, 0.0)
    high = np.where(moves, (-b + root) / safe, np.inf)
    never = np.where(moves, b * b - a * c, -c) < 0.0
    low, high = np.where(never, np.inf, low), np.where(never, -np.inf, high)
    if low.ndim == 2:
        low, high = low.max(axis=1), high.min(axis=1)
    return np.stack([np.maximum(low, 0.0), high], axis=1)


def largest_scale(within: Array, probability: float) -> float | None:
    """Give the largest scale at which enough machines keep the limit.

    Parameters
    ----------
    within : ndarray, [S, 2]
        See `scales_within`.
    probability : float
        Share of the machines, between 0 and 1.

    Returns
    -------
    float or None
        Infinite where the scale does not matter; None where no scale will do.
    """
    needed = math.ceil(probability * len(within) - 1e-9)
    valid = within[within[:, 0] <= within[:, 1]]
    low, high = np.sort(valid[:, 0]), np.sort(valid[:, 1])
    entered = np.searchsorted(low, high, side="right")
    left = np.searchsorted(high, high, side="left")
    enough = entered - left >= needed
    return float(high[enough].max()) if enough.any() else None
