"""One case of a Monte Carlo run: a machine, its tolerances and a plan; small enough to be sent."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from warpspace.analysis.distribution import EXACT_SAMPLES, Part, summarise
from warpspace.analysis.draws import Draws
from warpspace.analysis.nodes import Over, node_gains, reduce_nodes
from warpspace.analysis.plan import Plan
from warpspace.analysis.points import (
    Places,
    choose_cylinder,
    extreme_places,
    random_places,
    spread_places,
)
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.units import Array

LEAST_BLOCKS, MOST_BLOCKS = 16, 4096
"""Blocks in one task of an executor: 131,072 machines at least, 33,554,432 at most."""
TASKS_ASKED = 4096
"""Tasks that a large run is cut into before they grow."""

Job = Callable[[np.random.Generator, int], Array]
"""Takes a random generator and a number of machines, gives their |E|, [n], µm."""


@dataclass(frozen=True, slots=True)
class Case:
    """What is sampled.

    Attributes
    ----------
    model : Model
    draws : Draws
        The parameters and their distributions, see `build_draws`.
    workspace : Workspace
    view : View
        Loop and reference.
    plan : Plan
    """

    model: Model
    draws: Draws
    workspace: Workspace
    view: View = field(default_factory=View)
    plan: Plan = field(default_factory=Plan)

    def check(self) -> None:
        """Refuse what cannot be sampled, before the work is handed out.

        Raises
        ------
        OptionError
            Naming the value and what was expected.
        """
        self.plan.check()
        if self.view.loop is Loop.WORKPIECE:
            choose_cylinder(self.model, self.plan.cylinder)

    @property
    def is_exact(self) -> bool:
        """Whether every sample is kept for the quantiles."""
        return self.plan.samples <= EXACT_SAMPLES

    @property
    def task_blocks(self) -> int:
        """Blocks in one task of an executor; follows from the plan alone."""
        if self.is_exact:
            return LEAST_BLOCKS
        return max(LEAST_BLOCKS, min(self.plan.blocks // TASKS_ASKED, MOST_BLOCKS))

    def machines(self, rng: np.random.Generator, count: int) -> Array:
        """Draw the amplitudes of machines, [count, K]."""
        return self.draws.draw(rng, count)

    def responses(self, places: Places) -> Array:
        """Give what each amplitude does at places, [3, K, N], µm per unit."""
        return node_gains(self.model, self.draws.keys, self.view, places)

    def build_job(self) -> Job:
        """Build what a block of machines goes through."""
        model, plan, workspace, loop = self.model, self.plan, self.workspace, self.view.loop
        cylinder = choose_cylinder(model, plan.cylinder) if loop is Loop.WORKPIECE else None
        over = Over(plan.over)
        if over is Over.SAMPLED:

            def one_point_each(rng: np.random.Generator, count: int) -> Array:
                amplitudes = self.machines(rng, count)
                places = random_places(model, loop, workspace, cylinder, rng, count)
                gains = self.responses(places)
                return np.sqrt(
                    sum((np.einsum("nk,kn->n", amplitudes, gain) ** 2) for gain in gains)
                )

            return one_point_each
        find = extreme_places if over is Over.MAX else spread_places
        places = find(model, loop, workspace, cylinder, plan.nodes)
        gains = self.responses(places)

        def all_points_each(rng: np.random.Generator, count: int) -> Array:
            return reduce_nodes(self.machines(rng, count), gains, over, places.weights)

        return all_points_each


def sample_blocks(case: Case, first: int, end: int, *, keep: bool, job: Job | None = None) -> Part:
    """Sample some blocks of a case.

    Parameters
    ----------
    case : Case
    first, end : int
        The first block, and the one after the last.
    keep : bool
        Whether the samples are asked for, even where quantiles need only their counts.
    job : callable, optional
        What `case.build_job` gives, where it is at hand.
    """
    do = case.build_job() if job is None else job

    def blocks() -> Iterator[Array]:
        for index in range(first, end):
            yield do(*case.plan.block(index))

    exact = case.is_exact
    return summarise(blocks(), case.plan.spec_um, keep=keep or exact, count=not exact)
