"""What data can tell: which parameters they see, and which combinations look alike in them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.units import Array

BLIND = 2e-4
"""Share of its own effect below which what is left of a parameter counts as nothing.

With less, noise of a thousandth makes values that no machine has.
"""
SHARE = 1e-3
"""Of a combination, below which a parameter is not named as part of it."""


@dataclass(frozen=True, slots=True)
class Rank:
    """What can be told apart.

    Attributes
    ----------
    rank : int
        Independent combinations of the parameters that the readings show.
    kept : tuple of str
        Parameters that are determined once those left out are held.
    unseen : tuple of str
        Parameters without any effect on the readings, whatever the set-up.
    confounded : tuple of tuple of str
        Groups: the first of each group looks like a combination of the others (and of what the
        set-up leaves unknown). A group of one looks like the set-up alone.
    """

    rank: int
    kept: tuple[str, ...]
    unseen: tuple[str, ...]
    confounded: tuple[tuple[str, ...], ...]

    def is_identifiable(self, key: str) -> bool:
        """Tell whether the readings alone determine a parameter."""
        return key in self.kept and not any(key in group for group in self.confounded)


def find_rank(keys: Sequence[str], by_parameter: Array, by_unknown: Array) -> Rank:
    """Go through the parameters in order and see which adds something new.

    Parameters
    ----------
    keys : sequence of str, (K,)
        The likelier first: where two look alike the later one is left out.
    by_parameter : ndarray, [N, K]
        Change of each weighted reading per unit of each parameter.
    by_unknown : ndarray, [N, m]
        Likewise per unit of what the set-up leaves unknown.

    Returns
    -------
    Rank
    """
    set_up = _orthonormal(by_unknown)
    norms = np.linalg.norm(by_parameter, axis=0)
    largest = norms.max(initial=0.0)
    kept: list[int] = []
    basis: list[Array] = []
    unseen: list[str] = []
    groups: list[tuple[str, ...]] = []
    for at, key in enumerate(keys):
        if norms[at] <= BLIND * largest or not norms[at]:
            unseen.append(key)
            continue
        rest = _without(by_parameter[:, at] / norms[at], set_up)
        for _ in range(2):  # twice: the second pass takes what rounding left
            for direction in basis:
                rest = rest - direction * (direction @ rest)
        if np.linalg.norm(rest) > BLIND:
            kept.append(at)
            basis.append(rest / np.linalg.norm(rest))
            continue
        groups.append((key, *_partners(keys, at, kept, by_parameter, norms, set_up)))
    return Rank(len(kept), tuple(keys[at] for at in kept), tuple(unseen), tuple(groups))


def _partners(
    keys: Sequence[str],
    at: int,
    kept: Sequence[int],
    by_parameter: Array,
    norms: Array,
    set_up: Array,
) -> tuple[str, ...]:
    """Name the kept parameters whose combination looks like another one."""
    if not kept:
        return ()
    columns = np.stack([_without(by_parameter[:, one] / norms[one], set_up) for one in kept], -1)
    target = _without(by_parameter[:, at] / norms[at], set_up)
    if np.linalg.norm(target) <= BLIND:
        return ()
    shares, *_ = np.linalg.lstsq(columns, target, rcond=None)
    return tuple(keys[one] for one, share in zip(kept, shares, strict=True) if abs(share) > SHARE)


def _orthonormal(columns: Array) -> Array:
    """Give an orthonormal basis of columns, [N, r]."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > 1e-12 * values[0]]


def _without(column: Array, basis: Array) -> Array:
    """Take what lies in a basis out of a column; twice, for rounding."""
    once = column - basis @ (basis.T @ column)
    return once - basis @ (basis.T @ once)


def spell_rank(rank: Rank, slopes: Collection[str] = ()) -> tuple[str, ...]:
    """Say in words what cannot be told apart.

    Parameters
    ----------
    rank : Rank
    slopes : collection of str, optional
        Parameters of which a slope is looked for.

    Returns
    -------
    tuple of str
        One sentence each.
    """

    def name(key: str) -> str:
        return f"the slope of {key}" if key in slopes else key

    words: list[str] = []
    if rank.unseen:
        words.append(f"{', '.join(rank.unseen)}: no effect on these readings")
    alone = [name(group[0]) for group in rank.confounded if len(group) == 1]
    if alone:
        words.append(
            f"{', '.join(alone)}: cannot be told apart from the unknown place of the set-up"
        )
    for group in (group for group in rank.confounded if len(group) > 1):
        first, *others = map(name, group)
        joined = ", ".join(others[:-1]) + " and " + others[-1] if others[1:] else others[0]
        if others[1:]:
            words.append(f"{first} looks in these readings like a combination of {joined}")
        else:
            words.append(f"{first} and {joined} cannot be told apart by these readings")
    return tuple(words)
