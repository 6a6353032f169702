"""Volumetric errors of machines drawn from their tolerances.

Every parameter is drawn once per machine and holds everywhere: a component error is the value it
has at the point looked at, as in the thesis, not a curve along its axis.

Samples come in blocks, each with a random stream of its own, and are put together in order: the
same seed gives the same numbers whatever runs them, threads, processes or a cluster, and memory
does not grow with the number of samples.
"""

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from typing import Annotated, Literal, TypedDict, TypeVar, TypeVarTuple, Unpack

from warpspace.analysis.description import Analysis
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.options import LOOP_HELP, LOOP_UNSET, Grammar, option
from warpspace.analysis.sampling import cases
from warpspace.analysis.sampling.cases import Case, Cylinder, Job, Reduction, SamplingPlan
from warpspace.analysis.sampling.distribution import (
    BinCounts,
    Distribution,
    Draws,
    PartialSums,
    Probability,
    Stream,
    build_draws,
)
from warpspace.analysis.statistics import Summary
from warpspace.exceptions import WorkersLostError
from warpspace.kinematics.model import Loop
from warpspace.machine.limits import LOCAL_WORKERS, SAMPLES
from warpspace.scene.model import Scene
from warpspace.scene.text_files import parse_number
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

    case: Case
    mode_um: float
    median_um: float
    p99_um: float
    histogram: BinCounts
    probability: Probability | None  # of staying within the specification
    # false beyond a million samples: quantiles are then good to 0.002 % of their value
    exact_quantiles: bool

    @property
    def interval(self) -> tuple[float | None, float | None, float | None]:
        """Probability and both ends of its interval; None without a specification."""
        share = self.probability
        return (share.probability, share.low, share.high) if share else (None, None, None)


class Execution(TypedDict, total=False):
    """Workers of a run, and who is informed of its progress; see `sweep`."""

    executor: Executor | None
    workers: int | None
    progress: Progress | None
    take: Take | None


def montecarlo(case: Case, **execution: Unpack[Execution]) -> SampleStatistics:
    execution.setdefault("workers", case.plan.workers)
    (statistics,) = montecarlo_each([case], **execution)
    return statistics


def montecarlo_each(
    runs: Iterable[Case], **execution: Unpack[Execution]
) -> Iterator[SampleStatistics]:
    executor, workers = execution.get("executor"), execution.get("workers")
    progress, take = execution.get("progress"), execution.get("take")
    count = (workers or EXECUTOR_WORKERS) if executor else _threads(workers)
    tasks = _tasks(runs, keep=take is not None, sent=executor is not None)
    number, stream = 0, None
    with (
        nullcontext(executor) if executor else ThreadPoolExecutor(count) as pool,
        closing(run_in_order(_run, tasks, pool, 2 * count)) as results,
    ):
        for (case, _, end, _, _), sums in results:
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


def _threads(workers: int | None) -> int:
    return min(workers or min(os.cpu_count() or 1, MOST_THREADS), LOCAL_WORKERS[1])


def sample_chunks(job: Job, plan: SamplingPlan) -> Iterator[Array]:
    """Run a job for every block on several threads and yield the results in order."""
    workers = min(_threads(plan.workers), plan.blocks)
    tasks = ((index,) for index in range(plan.blocks))
    with (
        ThreadPoolExecutor(workers) as pool,
        closing(run_in_order(lambda i: job(*plan.block(i)), tasks, pool, 2 * workers)) as chunks,
    ):
        yield from (values for _, values in chunks)


_Task = tuple[Case, int, int, bool, Job | None]
"""A case, its first block and the one after the last, whether samples are kept, and the job."""


def _tasks(runs: Iterable[Case], *, keep: bool, sent: bool) -> Iterator[_Task]:
    for case in runs:
        case.check()
        size, job = (case.task_blocks, None) if sent else (1, case.build_job())
        blocks = case.plan.blocks
        for first in range(0, blocks, size):
            yield case, first, min(first + size, blocks), keep, job


def _run(
    case: Case, first: int, end: int, keep: bool, job: Job | None
) -> PartialSums | SampleStatistics:
    part = cases.sample_blocks(case, first, end, keep=keep, job=job)
    if keep or job is not None or case.plan.blocks > cases.LEAST_BLOCKS:
        return part
    stream = Stream(case.plan.samples, case.plan.spec_um)
    stream.merge(part)
    return _finish(case, stream)


def _finish(case: Case, stream: Stream) -> SampleStatistics:
    return SampleStatistics(
        case=case,
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
    executor: Executor,
    in_flight: int,
) -> Generator[tuple[tuple[*Arguments], Result]]:
    """Run a function for every task; yield tasks and results in order."""
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


def _oldest(
    pending: "deque[tuple[tuple[*Arguments], Future[Result]]]",
) -> tuple[tuple[*Arguments], Result]:
    """Wait for the oldest task; it stays in the queue, so that it can be cancelled."""
    task, future = pending[0]
    result = future.result()
    pending.popleft()
    return task, result


def read_cylinder(text: str, _scene: Scene | None = None) -> Cylinder:
    first, _, second = text.lower().replace("×", "x").partition("x")
    try:
        return Cylinder(parse_number(first), parse_number(second))
    except ValueError:
        raise ValueError("expected diameter x height in mm, as in 550x450") from None


def scene_draws(scene: Scene, loop: Loop, distribution: Distribution | str, *, clip: bool) -> Draws:
    keys = loop_keys(scene.model, loop, scene.parameter_keys)
    return build_draws(scene.tolerances, keys, distribution, clip=clip, source=scene.name)


@dataclass(frozen=True, kw_only=True)
class Sampled(Analysis):
    """An analysis of machines within tolerance."""

    loop: Loop | None = option(None, LOOP_HELP, unset=LOOP_UNSET)
    distribution: Distribution | None = option(
        None,
        "uniform over the tolerance, or normal with 3σ = half width",
        unset="uniform",
    )
    clip: bool = option(
        False,
        "Whether the normal distribution ends at the tolerance limits",
        flag="--clip/--no-clip",
        label="Ends at the limits",
    )
    cylinder: Annotated[Cylinder | None, Grammar("DIAMETERxHEIGHT", read_cylinder)] = option(
        None,
        "Workpiece loop: largest workpiece in mm, over whose volume the points are spread",
        unset="the one whose top rim the scene's workpiece point lies on: 550x450 on the DVF5000",
    )
    seed: int = option(
        0, "Seed of the random numbers; the same seed gives the same numbers", low=0, high=2**63 - 1
    )

    @property
    def drawn(self) -> Distribution:
        return self.distribution or Distribution.UNIFORM

    def draws(self, scene: Scene) -> Draws:
        return scene_draws(scene, scene.view(self.loop).loop, self.drawn, clip=self.clip)

    def case(self, scene: Scene, plan: SamplingPlan) -> Case:
        return Case(scene.model, self.draws(scene), scene.workspace, scene.view(self.loop), plan)


@dataclass(frozen=True, kw_only=True)
class SampledMachines(Sampled):
    """An analysis of a sample of machines within tolerance."""

    samples: int = option(
        cases.DEFAULT_SAMPLES,
        "Number of machines drawn from the tolerances",
        low=SAMPLES[0],
        high=SAMPLES[1],
    )

    def plan(
        self, reduction: Reduction, limit_um: float | None, nodes: int = cases.DEFAULT_NODES
    ) -> SamplingPlan:
        return SamplingPlan(self.samples, self.seed, reduction, nodes, limit_um, self.cylinder)


def limit_or_that_of(scenes: Sequence[Scene], limit_um: float | None) -> float | None:
    """Return a limit, else the one that all scenes state."""
    stated = {scene.limit_um for scene in scenes}
    return stated.pop() if limit_um is None and len(stated) == 1 else limit_um


@dataclass(frozen=True, kw_only=True)
class KeptLimit(SampledMachines):
    """An analysis of the share of machines within a limit."""

    over: Literal["max", "sampled"] = option(
        "max",
        "|E| of a machine: the largest in the volume (max), so that a limit is kept everywhere, or"
        " at one random point (sampled)",
    )
    workers: int | None = option(
        None,
        "Threads; the result does not depend on it",
        low=LOCAL_WORKERS[0],
        high=LOCAL_WORKERS[1],
        unset="one per core",
    )

    @property
    def where(self) -> str:
        return "everywhere" if self.over == "max" else "at a random point"

    def plan_of(self, limit_um: float | None) -> SamplingPlan:
        return replace(self.plan(Reduction(self.over), limit_um), workers=self.workers)
