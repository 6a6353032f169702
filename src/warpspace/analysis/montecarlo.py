"""Volumetric errors of machines drawn from their tolerances.

Every parameter is drawn once per machine and holds everywhere: a component error is the value it
has at the point looked at, as in the thesis, not a curve along its axis.

Samples come in chunks of fixed size, each with a random stream of its own (`SeedSequence.spawn`),
and are put together in order: the same seed gives the same numbers whatever the number of workers,
and memory does not grow with the number of samples.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from warpspace.analysis.distribution import Histogram, Probability, Stream
from warpspace.analysis.draws import Draws
from warpspace.analysis.nodes import Over, node_gains, reduce_nodes
from warpspace.analysis.points import (
    Cylinder,
    Places,
    choose_cylinder,
    extreme_places,
    random_places,
    spread_places,
)
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.limits import SAMPLES
from warpspace.units import Array

DEFAULT_SAMPLES = 100_000
MIN_SAMPLES, MAX_SAMPLES = SAMPLES
DEFAULT_NODES = 11
CHUNK = 8192
"""Machines per random stream; part of what a seed means, so not to be changed lightly."""
MAX_WORKERS = 8

Progress = Callable[[int], object]
Job = Callable[[np.random.Generator, int], Array]


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
        Threads; None for one per core, at most 8.
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
        if self.workers is not None and self.workers < 1:
            raise OptionError(f"workers: {self.workers}; expected 1 or more")


@dataclass(frozen=True, slots=True)
class MonteCarlo:
    """Distribution of |E| over sampled machines.

    Attributes
    ----------
    plan : Plan
    draws : Draws
        Which parameters were drawn, and how.
    view : View
    mean_um, rms_um, mode_um, median_um, p95_um, p99_um, max_um : float, µm
    histogram : Histogram
    probability : Probability or None
        Of staying within the specification.
    exact_quantiles : bool
        False beyond a million samples: quantiles are then good to 0.002 % of their value.
    """

    plan: Plan
    draws: Draws
    view: View
    mean_um: float
    rms_um: float
    mode_um: float
    median_um: float
    p95_um: float
    p99_um: float
    max_um: float
    histogram: Histogram
    probability: Probability | None
    exact_quantiles: bool


def montecarlo(
    model: Model,
    draws: Draws,
    workspace: Workspace,
    view: View | None = None,
    plan: Plan | None = None,
    progress: Progress | None = None,
) -> MonteCarlo:
    """Sample machines and collect the distribution of their volumetric error.

    Parameters
    ----------
    model : Model
    draws : Draws
        The parameters and their distributions, see `build_draws`.
    workspace : Workspace
    view : View, optional
        Loop and reference; the tool loop by default.
    plan : Plan, optional
    progress : callable, optional
        Called with the number of machines done since the last call.

    Returns
    -------
    MonteCarlo

    Raises
    ------
    OptionError
        If a number of the plan is out of range.

    Notes
    -----
    First order in the errors. Thesis, section 4.3, has `sampled`.
    """
    view, plan = view or View(), plan or Plan()
    plan.check()
    job = build_job(
        model,
        workspace,
        view,
        plan,
        draws.draw,
        lambda places: node_gains(model, draws.keys, view, places),
    )
    return collect(job, draws, view, plan, progress)


def collect(
    job: Job, draws: Draws, view: View, plan: Plan, progress: Progress | None = None
) -> MonteCarlo:
    """Sample machines with a job and collect the distribution of their |E|.

    Parameters
    ----------
    job : callable
        See `build_job`.
    draws : Draws
        What the result says was drawn.
    view : View
    plan : Plan
    progress : callable, optional

    Returns
    -------
    MonteCarlo
    """
    stream = Stream(plan.samples, plan.spec_um)
    for values in sample_chunks(job, plan):
        stream.add(values)
        if progress is not None:
            progress(len(values))
    return MonteCarlo(
        plan,
        draws,
        view,
        stream.mean_um,
        stream.rms_um,
        stream.mode_um(),
        stream.quantile(0.5),
        stream.quantile(0.95),
        stream.quantile(0.99),
        stream.max_um,
        stream.display_histogram(),
        stream.probability(),
        stream.exact_quantiles,
    )


def sample_chunks(job: Job, plan: Plan) -> Iterator[Array]:
    """Run a job for every chunk on several threads and give the results in order.

    Parameters
    ----------
    job : callable
        Takes a random generator and a number of machines, gives their |E|, [n], µm.
    plan : Plan

    Yields
    ------
    ndarray, [n], µm
        At most a few chunks are held at a time.
    """

    def chunk(index: int) -> Array:
        # The same stream as SeedSequence(seed).spawn(index + 1)[index], without the list.
        stream = np.random.SeedSequence(plan.seed, spawn_key=(index,))
        count = min(CHUNK, plan.samples - index * CHUNK)
        return job(np.random.default_rng(stream), count)

    chunks = range((plan.samples + CHUNK - 1) // CHUNK)
    workers = min(plan.workers or min(os.cpu_count() or 1, MAX_WORKERS), len(chunks))
    if workers == 1:
        yield from map(chunk, chunks)
        return
    pending: deque[Future[Array]] = deque()
    with ThreadPoolExecutor(workers) as executor:
        try:
            for index in chunks:
                if len(pending) >= 2 * workers:
                    yield pending.popleft().result()
                pending.append(executor.submit(chunk, index))
            while pending:
                yield pending.popleft().result()
        finally:
            executor.shutdown(wait=False, cancel_futures=True)


def build_job(
    model: Model,
    workspace: Workspace,
    view: View,
    plan: Plan,
    draw: Job,
    gains_at: Callable[[Places], Array],
) -> Job:
    """Build what a chunk of machines goes through.

    Parameters
    ----------
    model : Model
    workspace : Workspace
    view : View
    plan : Plan
    draw : callable
        Takes a random generator and a number n, gives values of machines, [n, K].
    gains_at : callable
        Gives what one unit of each value does at places, [3, K, N], µm.

    Returns
    -------
    callable
        Takes a random generator and a number n, gives |E| of machines, [n], µm.
    """
    cylinder = choose_cylinder(model, plan.cylinder) if view.loop is Loop.WORKPIECE else None
    over = Over(plan.over)
    if over is Over.SAMPLED:

        def one_point_each(rng: np.random.Generator, count: int) -> Array:
            values = draw(rng, count)
            places = random_places(model, view.loop, workspace, cylinder, rng, count)
            gains = gains_at(places)
            return np.sqrt(sum((np.einsum("nk,kn->n", values, gain) ** 2) for gain in gains))

        return one_point_each
    find = extreme_places if over is Over.MAX else spread_places
    places = find(model, view.loop, workspace, cylinder, plan.nodes)
    gains = gains_at(places)

    def all_points_each(rng: np.random.Generator, count: int) -> Array:
        return reduce_nodes(draw(rng, count), gains, over, places.weights)

    return all_points_each
