"""Which errors to adjust: the best set of one, of two, and so on."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import comb

import numpy as np

from warpspace.analysis.repair.solve import Objective, Solution, least
from warpspace.analysis.repair.volume import Volume
from warpspace.units import Array

MOST_SETS = {Objective.RMS: 4000, Objective.MAX: 300}
"""Sets of one size that are all tried; of more, a path through them is followed."""


def best_sets(
    volume: Volume,
    objective: Objective,
    candidates: Sequence[int],
    bounds: Array,
    count: int,
) -> Iterator[tuple[Solution, bool]]:
    """Find the best set of one adjustment, of two, up to a number of them.

    Parameters
    ----------
    volume : Volume
    objective : Objective
    candidates : sequence of int
        Errors that may be adjusted, by their place in the basis.
    bounds : ndarray, [K, 2], µm or µrad
        Least and largest change of every error of the basis.
    count : int
        Largest number of adjustments.

    Yields
    ------
    solution : Solution
    proven : bool
        Whether all sets of this size were compared. Where there are too many, the set before is
        extended by its best partner, and members are then swapped for others as long as that helps.
    """
    before: Solution | None = None
    for size in range(1, min(count, len(candidates)) + 1):
        proven = comb(len(candidates), size) <= MOST_SETS[objective]
        if proven or before is None:
            sets = (_joined(group) for group in combinations(candidates, size))
            found = _best(volume, objective, sets, bounds)
        else:
            found = _extended(volume, objective, before, candidates, bounds)
        if found is None:
            return
        yield found, proven
        before = found


def _best(
    volume: Volume,
    objective: Objective,
    sets: Iterator[tuple[int, ...]],
    bounds: Array,
    start: Solution | None = None,
) -> Solution | None:
    """Give the best of some sets; None where none is better than the start."""
    best = start
    for indices in sets:
        limit = np.inf if best is None else best.value_um
        found = least(volume, objective, indices, bounds, limit)
        if found is not None and (best is None or found.value_um < best.value_um - 1e-9):
            best = found
    return None if best is start else best


def _extended(
    volume: Volume,
    objective: Objective,
    before: Solution,
    candidates: Sequence[int],
    bounds: Array,
) -> Solution | None:
    """Add the best partner to a set, then swap members for others as long as that helps."""
    others = [index for index in candidates if index not in before.indices]
    sets = (_joined((*before.indices, index)) for index in others)
    best = _best(volume, objective, sets, bounds)
    while best is not None:
        members = best.indices
        swaps = (
            _joined((*(index for index in members if index != old), new))
            for old in members
            for new in candidates
            if new not in members
        )
        better = _best(volume, objective, swaps, bounds, best)
        if better is None:
            return best
        best = better
    return best


def _joined(indices: Sequence[int]) -> tuple[int, ...]:
    """Give a set in the order of the parameter table."""
    return tuple(sorted(indices))
