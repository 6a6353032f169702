"""What a design is held against: a limit, where it holds, how tolerances are filled and traded."""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from warpspace.app.state.ranges import Span
from warpspace.app.state.spelling import Unreadable, read_number
from warpspace.machine.limits import COST, PROBABILITY

LIMIT_UM = Span(1.0, 300.0, 0.5)
PERCENT = Span(100.0 * PROBABILITY[0], 100.0 * PROBABILITY[1], 0.1)
START_UM = 50.0
SAMPLED, MAX = "sampled", "max"
"""One random point of each machine (as in the thesis), or its worst point, which is the rule."""
UNIFORM, NORMAL = "uniform", "normal"
MOST_COSTS_TEXT = 2000  # characters of a list of costs


@dataclass(frozen=True, slots=True)
class Specification:
    """The specification of a review."""

    limit_um: float = START_UM  # largest |E| allowed
    over: str = MAX  # "sampled" or "max"
    distribution: str = UNIFORM  # "uniform", or "normal" with 3σ at the limits
    # %; share of the machines that is to keep the limit once tolerances are allocated
    percent: float = 95.0
    # parameters whose tolerance is neither allocated nor scaled
    fixed: frozenset[str] = frozenset()
    costs: str = ""  # cost of tolerances where it is not 1, for instance ``EA0Z=4,EXX=0.5``

    def with_limit(self, value: float) -> "Specification":
        """Set the limit, µm, within its range; what is no number changes nothing."""
        return replace(self, limit_um=LIMIT_UM.clamp(value, self.limit_um))

    def with_over(self, over: str) -> "Specification":
        """Choose where it holds; an unknown word changes nothing."""
        return replace(self, over=over) if over in (SAMPLED, MAX) else self

    def with_distribution(self, distribution: str) -> "Specification":
        """Choose how parameters fall into tolerance; an unknown word changes nothing."""
        known = distribution in (UNIFORM, NORMAL)
        return replace(self, distribution=distribution) if known else self

    def with_percent(self, value: float) -> "Specification":
        """Set the wanted share of the machines, %; what is no number changes nothing."""
        return replace(self, percent=PERCENT.clamp(value, self.percent))

    def with_fixed(self, key: str, fixed: bool) -> "Specification":
        """Fix the tolerance of a parameter, or free it."""
        keys = self.fixed | {key} if fixed else self.fixed - {key}
        return replace(self, fixed=keys)

    def with_costs(self, text: str, known: Collection[str]) -> "Specification":
        """Set the costs from a list as a user types it."""
        return replace(self, costs=spell_costs(read_costs(text, known)))


def read_costs(text: str, known: Collection[str]) -> dict[str, float]:
    """Read costs: pairs like ``EA0Z=4`` or ``EA0Z 4``, with commas or new lines between."""
    found: dict[str, float] = {}
    for part in re.split(r"[,;\n]", text[:MOST_COSTS_TEXT]):
        words = part.replace("=", " ").split()
        if not words:
            continue
        shown = part.strip()[:30]
        if len(words) != 2:
            raise Unreadable(f"{shown!r}: expected an error and a number, for instance EA0Z=4")
        key = words[0].upper()
        if key not in known:
            raise Unreadable(f"{shown!r}: no parameter of this machine")
        try:
            cost = read_number(words[1])
        except Unreadable:
            raise Unreadable(f"{shown!r}: expected a number, for instance EA0Z=4") from None
        if not COST[0] <= cost <= COST[1]:
            raise Unreadable(f"{shown!r}: expected {COST[0]:g} to {COST[1]:g}")
        found[key] = cost
    return found


def spell_costs(costs: Mapping[str, float]) -> str:
    """Spell a list of costs; those of 1 are left out, since that is the cost of all others."""
    return ",".join(f"{key}={cost:g}" for key, cost in costs.items() if cost != 1.0)
