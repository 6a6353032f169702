"""Products of parameters: every pair of values in `make test`, the rest of the product nightly."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def pairwise(*factors: Sequence[Any], together: int | None = None) -> list[Any]:
    """Give the product of factors, marked nightly but for a few that hold every pair of values."""
    count = min(2, len(factors) - 1) if together is None else together
    wanted = {
        (places, values)
        for places in itertools.combinations(range(len(factors)), count)
        for values in itertools.product(*(range(len(factors[place])) for place in places))
    }

    def covers(point: tuple[int, ...]) -> set[Any]:
        groups: Iterable[tuple[int, ...]] = itertools.combinations(range(len(factors)), count)
        return {(places, tuple(point[place] for place in places)) for places in groups} & wanted

    points = [*itertools.product(*(range(len(factor)) for factor in factors))]
    chosen: set[tuple[int, ...]] = set()
    while wanted:
        best = max(points, key=lambda point: len(covers(point)))
        chosen.add(best)
        wanted -= covers(best)
    return [
        pytest.param(
            *(factor[at] for factor, at in zip(factors, point, strict=True)),
            marks=() if point in chosen else pytest.mark.nightly,
        )
        for point in points
    ]


def first(one: Any, *others: Any) -> list[Any]:
    """Give parameters of which all but the first are marked nightly."""
    return [one, *(pytest.param(other, marks=pytest.mark.nightly) for other in others)]
