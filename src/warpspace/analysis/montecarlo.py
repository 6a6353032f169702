"""Volumetric errors of machines drawn from their tolerances.

Every parameter is drawn once per machine and holds everywhere: a component error is the value it
has at the point looked at, as in the thesis, not a curve along its axis.

Samples come in blocks, each with a random stream of its own, and are put together in order: the
same seed gives the same numbers whatever runs them, threads, processes or a cluster, and memory
does not grow with the number of samples.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass

from warpspace.analysis.cases import LEAST_BLOCKS, Case, Job, sample_blocks
from warpspace.analysis.distribution import Histogram, Part, Probability, Stream
from warpspace.analysis.draws import Draws
from warpspace.analysis.engine import run_in_order, threads
from warpspace.analysis.plan import (
    BLOCK,
    DEFAULT_NODES,
    DEFAULT_SAMPLES,
    MAX_SAMPLES,
    MIN_SAMPLES,
    Plan,
)
from warpspace.field.evaluate import View
from warpspace.field.grid import Workspace
from warpspace.kinematics.model import Model
from warpspace.machine.limits import LOCAL_WORKERS
from warpspace.units import Array

__all__ = [
    "BLOCK",
    "DEFAULT_NODES",
    "DEFAULT_SAMPLES",
    "MAX_SAMPLES",
    "MIN_SAMPLES",
    "Case",
    "Job",
    "MonteCarlo",
    "Plan",
    "Progress",
    "Take",
    "montecarlo",
    "montecarlo_each",
    "sample_chunks",
]

MOST_THREADS = 8
EXECUTOR_WORKERS = 32
"""Tasks at a time that an executor is taken for, where nobody says how many workers it has."""

Progress = Callable[[int], object]
Take = Callable[[int, Array], object]
"""Called with the number of a case and |E| of its next machines, [n], µm."""


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
    *,
    executor: Executor | None = None,
    take: Take | None = None,
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
    progress, executor, take : optional
        See `montecarlo_each`.

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
    case = Case(model, draws, workspace, view or View(), plan or Plan())
    (found,) = montecarlo_each(
        [case], workers=case.plan.workers, executor=executor, progress=progress, take=take
    )
    return found


def montecarlo_each(
    cases: Iterable[Case],
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    take: Take | None = None,
) -> Iterator[MonteCarlo]:
    """Sample the machines of many cases: a fleet, or the points of a sweep.

    Parameters
    ----------
    cases : iterable of Case
        Taken as they are needed.
    workers : int, optional
        Threads, one per core and at most 8 by default; of an executor, its workers.
    executor : concurrent.futures.Executor, optional
        Does the work instead of threads: a pool of processes, or of a cluster. A case is cut into
        tasks of 131,072 machines at least.
    progress : callable, optional
        Called with the number of machines done since the last call.
    take : callable, optional
        Called with the number of a case and |E| of its next machines, in order.

    Yields
    ------
    MonteCarlo
        Of each case, in order.

    Raises
    ------
    OptionError
        If a number of a plan is out of range.
    WorkersLostError
        If the executor gives up.
    """
    if executor is not None:
        in_flight = 2 * (workers or EXECUTOR_WORKERS)
        yield from _collect(_sent_tasks(cases, take), executor, in_flight, progress, take)
        return
    count = min(workers or min(os.cpu_count() or 1, MOST_THREADS), LOCAL_WORKERS[1])
    with threads(count) as pool:
        yield from _collect(_own_tasks(cases, take), pool, 2 * count, progress, take)


def sample_chunks(job: Job, plan: Plan) -> Iterator[Array]:
    """Run a job for every block on several threads and give the results in order.

    Parameters
    ----------
    job : callable
        Takes a random generator and a number of machines, gives their |E|, [n], µm.
    plan : Plan

    Yields
    ------
    ndarray, [n], µm
        At most a few blocks are held at a time.
    """

    def block(index: int) -> Array:
        return job(*plan.block(index))

    workers = min(plan.workers or min(os.cpu_count() or 1, MOST_THREADS), plan.blocks)
    with threads(workers) as pool:
        tasks = ((index,) for index in range(plan.blocks))
        for _, values in run_in_order(block, tasks, pool, 2 * workers):
            yield values


_Task = tuple[Case, int, int, bool, Job | None]
"""A case, its first block and the one after the last, whether samples are kept, and the job."""


def _own_tasks(cases: Iterable[Case], take: Take | None) -> Iterator[_Task]:
    """Cut cases into single blocks; what they go through is built once a case."""
    for case in cases:
        case.check()
        job = case.build_job()
        for index in range(case.plan.blocks):
            yield case, index, index + 1, take is not None, job


def _sent_tasks(cases: Iterable[Case], take: Take | None) -> Iterator[_Task]:
    """Cut cases into pieces that are worth sending."""
    for case in cases:
        case.check()
        size, blocks = case.task_blocks, case.plan.blocks
        for first in range(0, blocks, size):
            yield case, first, min(first + size, blocks), take is not None, None


def _run(case: Case, first: int, end: int, keep: bool, job: Job | None) -> Part | MonteCarlo:
    """Do a task; a case that is one task is evaluated to its end, which is much less to send."""
    part = sample_blocks(case, first, end, keep=keep, job=job)
    if keep or job is not None or case.plan.blocks > LEAST_BLOCKS:
        return part
    stream = Stream(case.plan.samples, case.plan.spec_um)
    stream.merge(part)
    return _finish(case, stream)


def _collect(
    tasks: Iterable[_Task],
    executor: Executor | None,
    in_flight: int,
    progress: Progress | None,
    take: Take | None,
) -> Iterator[MonteCarlo]:
    """Put the results of tasks together, one case after the other."""
    number, stream = 0, None
    for (case, _, end, _, _), found in run_in_order(_run, tasks, executor, in_flight):
        if isinstance(found, MonteCarlo):
            done, result = case.plan.samples, found
        else:
            stream = Stream(case.plan.samples, case.plan.spec_um) if stream is None else stream
            stream.merge(found)
            done = found.count
            result = _finish(case, stream) if end == case.plan.blocks else None
            if take is not None and found.values is not None:
                take(number, found.values)
        if progress is not None:
            progress(done)
        if result is not None:
            yield result
            number, stream = number + 1, None


def _finish(case: Case, stream: Stream) -> MonteCarlo:
    """Read the numbers of a case."""
    return MonteCarlo(
        case.plan,
        case.draws,
        case.view,
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
