"""What an allocation is asked for, and what it gives."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpspace.analysis.distribution import Probability
from warpspace.analysis.draws import Draws
from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.limits import COST, LIMIT_UM, MAX_HALF_WIDTH, PROBABILITY
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class Wish:
    """What an allocation is to keep, and what it may change.

    Attributes
    ----------
    limit_um : float, µm
        Largest |E| accepted.
    probability : float
        Share of the machines that has to keep it.
    costs : mapping of str to float
        Cost by parameter, 1 where absent: a half width w costs cost/w.
    fixed : frozenset of str
        Parameters whose tolerance stays.
    widest : float, µm or µrad
        Largest half width that is given.
    """

    limit_um: float
    probability: float = 0.95
    costs: Mapping[str, float] = field(default_factory=dict[str, float])
    fixed: frozenset[str] = frozenset()
    widest: float = MAX_HALF_WIDTH

    def check(self, known: tuple[str, ...]) -> None:
        """Refuse what cannot be wished for.

        Parameters
        ----------
        known : tuple of str
            Parameters of the machine.

        Raises
        ------
        OptionError, UnknownNameError
            Naming the value and what was expected.
        """
        if not LIMIT_UM[0] <= self.limit_um <= LIMIT_UM[1]:
            raise OptionError(
                f"limit: {self.limit_um:g} µm; expected {LIMIT_UM[0]:g} to {LIMIT_UM[1]:g}"
            )
        if not PROBABILITY[0] <= self.probability <= PROBABILITY[1]:
            raise OptionError(
                f"probability: {self.probability:g}; expected {PROBABILITY[0]:g} to"
                f" {PROBABILITY[1]:g}, for instance 0.95"
            )
        for key in (*self.costs, *self.fixed):
            if key not in known:
                raise UnknownNameError("error parameter", key, known)
        for key, cost in self.costs.items():
            if not COST[0] <= cost <= COST[1]:
                raise OptionError(f"cost of {key}: {cost:g}; expected {COST[0]:g} to {COST[1]:g}")
        if both := sorted(self.fixed.intersection(self.costs)):
            raise OptionError(f"{both[0]}: has a cost and is fixed; expected one of both")


@dataclass(frozen=True, slots=True)
class Allocation:
    """Tolerances that keep a limit, and how sure that is.

    Attributes
    ----------
    wish : Wish
    draws : Draws
        The tolerances before.
    half_width : ndarray, [K], µm or µrad
        After, in the order of `draws.keys`.
    free : ndarray of bool, [K]
        Which of them were allocated.
    before, after : Probability
        Of keeping the limit, on the same new machines, drawn for this check alone; with its 95 %
        confidence interval.
    cost_before, cost_after : float
        Σ cost/w over the allocated tolerances; infinite where one was zero.
    samples, seed : int
        Of the check.
    """

    wish: Wish
    draws: Draws
    half_width: Array
    free: NDArray[np.bool_]
    before: Probability
    after: Probability
    cost_before: float
    cost_after: float
    samples: int
    seed: int

    @property
    def tolerances(self) -> dict[str, float]:
        """Half width by parameter, µm or µrad, of those that were allocated."""
        return {
            key: float(width)
            for key, width, free in zip(self.draws.keys, self.half_width, self.free, strict=True)
            if free
        }

    @property
    def at_widest(self) -> tuple[str, ...]:
        """Parameters that got the largest half width there is."""
        return tuple(key for key, w in self.tolerances.items() if w >= self.wish.widest)
