"""What to repair: which errors to adjust, and to what, so that the volume gets better.

`repair.py` answers for a machine, `search.py` looks for the best sets, `solve.py` finds the best
values of one set, `volume.py` knows what any values give.
"""

from warpspace.analysis.repair.repair import (
    DEFAULT_COUNT,
    DEFAULT_LIMIT,
    Effect,
    Outcome,
    Repair,
    RepairPlan,
    Repairs,
    default_adjustable,
    find_repairs,
)
from warpspace.analysis.repair.solve import Objective

__all__ = [
    "DEFAULT_COUNT",
    "DEFAULT_LIMIT",
    "Effect",
    "Objective",
    "Outcome",
    "Repair",
    "RepairPlan",
    "Repairs",
    "default_adjustable",
    "find_repairs",
]
