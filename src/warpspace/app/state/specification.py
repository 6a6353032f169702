"""What a design is held against: a limit, where it holds, how tolerances are filled and traded."""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from warpspace.app.state.leaf import Unreadable, described, error_names
from warpspace.app.state.ranges import Span
from warpspace.machine.limits import COST, PROBABILITY
from warpspace.scene.files import parse_number

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

    limit_um: float = described(
        START_UM,
        "|E| allowed",
        span=LIMIT_UM,
        unit="µm",
        hint="The limit: the largest volumetric error that is accepted.",
    )
    over: str = described(
        MAX,
        "Evaluated at",
        choices={MAX: "everywhere", SAMPLED: "a random point"},
        hint="Where each sampled machine has to stay within the limit: everywhere in the volume, or"
        " at one random point (as in the thesis).",
    )
    distribution: str = described(
        UNIFORM,
        "Errors in their tolerance",
        choices={UNIFORM: "uniform", NORMAL: "normal, 3σ at the limits"},
        hint="How the errors of the machines are spread over their tolerances.",
    )
    percent: float = described(
        95.0,
        "Probability wanted",
        span=PERCENT,
        unit="%",
        hint="Share of the machines that is to stay within the limit once tolerances are"
        " allocated.",
    )
    fixed: frozenset[str] = described(
        frozenset[str](),
        "Fixed tolerances",
        one="Fixed tolerance of {}",
        choices=error_names,
        hint="Tolerances that are neither allocated nor scaled.",
    )
    costs: str = described(
        "",
        "Costs of tolerances",
        longest=MOST_COSTS_TEXT,
        hint="Cost of a tolerance where it is not 1, for instance EA0Z=4, EXX=0.5.",
    )


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
            cost = parse_number(words[1])
        except ValueError:
            raise Unreadable(f"{shown!r}: expected a number, for instance EA0Z=4") from None
        if not COST[0] <= cost <= COST[1]:
            raise Unreadable(f"{shown!r}: expected {COST[0]:g} to {COST[1]:g}")
        found[key] = cost
    return found


def spell_costs(costs: Mapping[str, float]) -> str:
    """Spell a list of costs; those of 1 are left out, since that is the cost of all others."""
    return ",".join(f"{key}={cost:g}" for key, cost in costs.items() if cost != 1.0)
