"""What a Monte Carlo run samples, and the random stream of each of its blocks.

Samples come in blocks of fixed size, each with a random stream that follows from the seed and the
number of the block. Whoever evaluates a block, and when, does not change its numbers.
"""

from dataclasses import dataclass

import numpy as np

from warpspace.analysis.nodes import Over
from warpspace.analysis.points import Cylinder
from warpspace.exceptions import OptionError
from warpspace.machine.limits import SAMPLES, WORKERS

DEFAULT_SAMPLES = 100_000
MIN_SAMPLES, MAX_SAMPLES = SAMPLES
MIN_WORKERS, MAX_WORKERS = WORKERS
DEFAULT_NODES = 11
BLOCK = 8192
"""Machines per random stream; part of what a seed means, so not to be changed lightly."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What is sampled and how.

    Attributes
    ----------
    samples, seed : int
    over : Over
        |E| at one random point per machine, or its largest or mean over the points of a machine.
    nodes : int
        Nodes per axis for `max` and `mean`.
    spec_um : float or None
        Specification whose probability is asked for, µm.
    cylinder : Cylinder or None
        Largest workpiece; None takes it from the model's workpiece point.
    workers : int or None
        Threads; None for one per core, at most 8. With an executor, tasks that run at a time.
    """

    samples: int = DEFAULT_SAMPLES
    seed: int = 0
    over: Over | str = Over.SAMPLED
    nodes: int = DEFAULT_NODES
    spec_um: float | None = None
    cylinder: Cylinder | None = None
    workers: int | None = None

    def check(self) -> None:
        """Refuse what cannot be sampled.

        Raises
        ------
        OptionError
            Naming the value and what was expected.
        """
        if not MIN_SAMPLES <= self.samples <= MAX_SAMPLES:
            raise OptionError(f"samples: {self.samples}; expected 1 to {MAX_SAMPLES:,}")
        if self.seed < 0:
            raise OptionError(f"seed: {self.seed}; expected a whole number, 0 or above")
        if self.over not in [*Over]:
            raise OptionError(f"over {self.over!r}; expected one of {', '.join(Over)}")
        if self.spec_um is not None and not 0.0 <= self.spec_um < np.inf:
            raise OptionError(f"specification: {self.spec_um:g} µm; expected 0 or above")
        if self.workers is not None and not MIN_WORKERS <= self.workers <= MAX_WORKERS:
            raise OptionError(f"workers: {self.workers}; expected 1 to {MAX_WORKERS:,}")

    @property
    def blocks(self) -> int:
        """How many blocks the samples come in; the last one may be shorter."""
        return -(-self.samples // BLOCK)

    def block(self, index: int) -> tuple[np.random.Generator, int]:
        """Give the random stream of a block, and how many machines it has."""
        # the same stream as SeedSequence(seed).spawn(index + 1)[index], without the list
        stream = np.random.SeedSequence(self.seed, spawn_key=(index,))
        return np.random.default_rng(stream), min(BLOCK, self.samples - index * BLOCK)
