"""Volumetric errors of machines drawn from their tolerances.

Every parameter is drawn once per machine and holds everywhere: a component error is the value it
has at the point looked at, as in the thesis, not a curve along its axis.

Samples come in blocks, each with a random stream of its own, and are put together in order: the
same seed gives the same numbers whatever runs them, threads, processes or a cluster, and memory
does not grow with the number of samples.
"""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar, TypeVarTuple, Unpack

from warpspace.analysis.sampling.cases import LEAST_BLOCKS, Case, Job, SamplingPlan, sample_blocks
from warpspace.analysis.sampling.distribution import (
    BinCounts,
    Draws,
    PartialSums,
    Probability,
    Stream,
)
from warpspace.analysis.statistics import Summary
from warpspace.exceptions import WorkersLostError
from warpspace.field.evaluate import View
from warpspace.machine.limits import LOCAL_WORKERS
from warpspace.units import Array

MOST_THREADS = 8
EXECUTOR_WORKERS = 32
"""Tasks at a time that an executor is taken for, where nobody says how many workers it has."""

Progress = Callable[[int], object]  # called with the number of machines done since the last call
Take = Callable[[int, Array], object]
"""Called with the number of a case and |E| of its next machines, [n], µm."""
Arguments = TypeVarTuple("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleStatistics(Summary):
    """Distribution of |E| over sampled machines."""

    plan: SamplingPlan
    draws: Draws  # which parameters were drawn, and how
    view: View
    mode_um: float
    median_um: float
    p99_um: float
    histogram: BinCounts
    probability: Probability | None  # of staying within the specification
    # false beyond a million samples: quantiles are then good to 0.002 % of their value
    exact_quantiles: bool


def montecarlo(
    case: Case,
    progress: Progress | None = None,
    *,
    executor: Executor | None = None,
    take: Take | None = None,
) -> SampleStatistics:
    (statistics,) = montecarlo_each(
        [case], workers=case.plan.workers, executor=executor, progress=progress, take=take
    )
    return statistics


def montecarlo_each(
    cases: Iterable[Case],
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    take: Take | None = None,
) -> Iterator[SampleStatistics]:
    if executor is not None:
        in_flight = 2 * (workers or EXECUTOR_WORKERS)
        yield from _collect(_tasks(cases, take, sent=True), executor, in_flight, progress, take)
        return
    count = min(workers or min(os.cpu_count() or 1, MOST_THREADS), LOCAL_WORKERS[1])
    with threads(count) as pool:
        yield from _collect(_tasks(cases, take, sent=False), pool, 2 * count, progress, take)


def sample_chunks(job: Job, plan: SamplingPlan) -> Iterator[Array]:
    """Run a job for every block on several threads and yield the results in order."""

    def block(index: int) -> Array:
        return job(*plan.block(index))

    workers = min(plan.workers or min(os.cpu_count() or 1, MOST_THREADS), plan.blocks)
    with threads(workers) as pool:
        tasks = ((index,) for index in range(plan.blocks))
        for _, values in run_in_order(block, tasks, pool, 2 * workers):
            yield values


_Task = tuple[Case, int, int, bool, Job | None]
"""A case, its first block and the one after the last, whether samples are kept, and the job."""


def _tasks(cases: Iterable[Case], take: Take | None, *, sent: bool) -> Iterator[_Task]:
    for case in cases:
        case.check()
        size, job = (case.task_blocks, None) if sent else (1, case.build_job())
        blocks = case.plan.blocks
        for first in range(0, blocks, size):
            yield case, first, min(first + size, blocks), take is not None, job


def _run(
    case: Case, first: int, end: int, keep: bool, job: Job | None
) -> PartialSums | SampleStatistics:
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
) -> Iterator[SampleStatistics]:
    number, stream = 0, None
    for (case, _, end, _, _), sums in run_in_order(_run, tasks, executor, in_flight):
        if isinstance(sums, SampleStatistics):
            done, result = case.plan.samples, sums
        else:
            stream = Stream(case.plan.samples, case.plan.spec_um) if stream is None else stream
            stream.merge(sums)
            done = sums.count
            result = _finish(case, stream) if end == case.plan.blocks else None
            if take is not None and sums.values is not None:
                take(number, sums.values)
        if progress is not None:
            progress(done)
        if result is not None:
            yield result
            number, stream = number + 1, None


def _finish(case: Case, stream: Stream) -> SampleStatistics:
    return SampleStatistics(
        plan=case.plan,
        draws=case.draws,
        view=case.view,
        mean_um=stream.mean_um,
        rms_um=stream.rms_um,
        mode_um=stream.mode_um(),
        median_um=stream.quantile(0.5),
        p95_um=stream.quantile(0.95),
        p99_um=stream.quantile(0.99),
        max_um=stream.max_um,
        histogram=stream.display_histogram(),
        probability=stream.probability(),
        exact_quantiles=stream.exact_quantiles,
    )


def run_in_order(
    function: Callable[[Unpack[Arguments]], Result],
    tasks: Iterable[tuple[*Arguments]],
    executor: Executor | None,
    in_flight: int,
) -> Iterator[tuple[tuple[*Arguments], Result]]:
    """Run a function for every task; yield tasks and results in order."""
    if executor is None:
        for task in tasks:
            yield task, function(*task)
        return
    pending: deque[tuple[tuple[*Arguments], Future[Result]]] = deque()
    try:
        for task in tasks:
            if len(pending) >= in_flight:
                yield _oldest(pending)
            pending.append((task, executor.submit(function, *task)))
        while pending:
            yield _oldest(pending)
    except (BrokenExecutor, CancelledError) as error:
        raise WorkersLostError(
            f"the workers are lost ({type(error).__name__}): a process was ended, ran out of"
            " memory, or the cluster was closed; run again, with fewer --workers where memory is"
            " short"
        ) from error
    finally:
        for _, future in pending:
            future.cancel()


@contextmanager
def threads(workers: int) -> Generator[Executor | None]:
    if workers == 1:
        yield None
        return
    executor = ThreadPoolExecutor(workers)
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _oldest(
    pending: "deque[tuple[tuple[*Arguments], Future[Result]]]",
) -> tuple[tuple[*Arguments], Result]:
    """Wait for the oldest task; it stays in the queue, so that it can be cancelled."""
    task, future = pending[0]
    result = future.result()
    pending.popleft()
    return task, result
