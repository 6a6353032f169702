"""Options and output of `concepts` and `montecarlo` that only the command line has."""

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import click

from warpspace.cli import shared_options
from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.machine.limits import LOCAL_WORKERS

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from warpspace.analysis.commands.concepts import Concepts, ConceptsResult
    from warpspace.analysis.commands.montecarlo import MonteCarlo, MonteCarloResult
    from warpspace.analysis.description import ProgressCallback
    from warpspace.analysis.sampling.machine_sampling import Take
    from warpspace.scene.model import Scene
    from warpspace.units import Array

    Workers = tuple[Executor | None, int | None]
    """Executor, None for threads, and the number of concurrent tasks."""

WORTH_A_POOL = 2_000_000
"""Machines that take about 10 s; below, starting processes costs more than it saves."""
LOSSES = 5  # worker processes that a command may lose; each is replaced and its task repeated
RETRIES = 3  # of a task whose cluster worker was lost
CONNECT_S = 10
MOST_CSV_ROWS = 10_000_000
NAMED = ("scene", "title")
COUNTED = ("samples", "seed")


def run_concepts(
    concepts: "Concepts",
    scenes: "Sequence[Scene]",
    watch: "ProgressCallback",
    *,
    size: tuple[int, int],
    plot: str | None,
    force: bool,
    **_names: object,
) -> "ConceptsResult":
    from warpspace.outputs.drawing.settings import FigureSettings

    settings = FigureSettings(size=size, loop=str(concepts.loop), concepts=concepts)
    if plot is not None and len(scenes) < 2:
        raise OptionError("--plot draws machines side by side; expected two scenes or more")
    comparison = concepts.run_all(scenes, watch)
    if plot is not None:
        shared_options.draw_figure_file(
            "concepts", scenes, settings, plot, force=force, silent=True
        )
    return comparison


def run_montecarlo(
    montecarlo: "MonteCarlo",
    scenes: "Sequence[Scene]",
    watch: "ProgressCallback",
    *,
    names: Sequence[str],
    workers: int | None,
    scheduler: str | None,
    output: str | None,
    plot: str | None,
    force: bool,
) -> "MonteCarloResult":
    """Sample on threads, processes or a cluster; write |E| of each machine, or the rows."""
    montecarlo.check_against(len(scenes))
    if plot is not None and (len(scenes) > 1 or montecarlo.in_rows):
        raise OptionError("--plot draws one machine; expected one scene")
    machines = montecarlo.machines(len(scenes))
    streamed = None if montecarlo.in_rows else output
    if streamed is not None and streamed.lower().endswith(".csv") and machines > MOST_CSV_ROWS:
        raise OptionError(
            f"{streamed}: {machines:,} rows; expected at most {MOST_CSV_ROWS:,} in a CSV file"
            " (.parquet holds any number)"
        )
    with (
        find_workers(scheduler, workers, machines) as (executor, number),
        _machine_table(streamed, names, force=force) as take,
    ):
        result = montecarlo.run_all(scenes, watch, executor=executor, workers=number, take=take)
    if output is not None and montecarlo.in_rows:
        from warpspace.outputs.exports.fields import write_rows

        kinds = {
            name: "text" if name in NAMED else "integer" if name in COUNTED else "number"
            for name in result.rows[0]
        }
        with write_rows(output, kinds, overwrite=force) as append:
            append({name: [row[name] for row in result.rows] for name in kinds})
    return result


@contextmanager
def find_workers(scheduler: str | None, workers: int | None, machines: int) -> "Generator[Workers]":
    if scheduler is not None:
        if workers is not None:
            raise OptionError(
                "--workers and --scheduler exclude each other: a cluster has its own workers"
            )
        with _cluster(scheduler) as cluster_workers:
            yield cluster_workers
        return
    if workers is not None and not LOCAL_WORKERS[0] <= workers <= LOCAL_WORKERS[1]:
        low, high = LOCAL_WORKERS
        raise OptionError(f"workers: {workers}; expected {low} to {high}")
    number = workers or os.cpu_count() or 1
    if number == 1 or machines < WORTH_A_POOL:
        yield None, workers
        return
    from warpspace.outputs.processes import ProcessPool

    pool = ProcessPool(number, losses=LOSSES)
    try:
        yield pool, number
    except WorkersLostError as error:
        raise WorkersLostError(f"{error}; run again with fewer --workers") from None
    finally:
        pool.kill()


@contextmanager
def _cluster(address: str) -> "Generator[Workers]":
    try:
        import distributed
    except ImportError:
        raise OptionError(
            "--scheduler needs dask and distributed: pip install 'warpspace[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError, AssertionError) as error:
        raise OptionError(
            f"--scheduler {address!r}: {error}; expected the address of a Dask scheduler, for"
            " instance tcp://127.0.0.1:8786"
        ) from None
    try:
        cores = cast("dict[str, int]", client.ncores())
        threads = sum(cores.values())
        if not threads:
            raise OptionError(f"--scheduler {address!r}: the cluster has no worker")
        # a task that has lost its worker runs again elsewhere; `pure` would hash its arguments
        yield client.get_executor(pure=False, retries=RETRIES), threads
    except distributed.KilledWorker as error:
        raise WorkersLostError(f"--scheduler {address!r}: {error}") from None
    finally:
        client.close()


@contextmanager
def _machine_table(
    output: str | None, names: Sequence[str], *, force: bool
) -> "Generator[Take | None]":
    import numpy as np

    from warpspace.outputs.exports.fields import write_rows

    if output is None:
        yield None
        return
    kinds = {"scene": "text", "machine": "integer", "error_um": "number"}
    at, done = 0, 0
    with write_rows(output, kinds, overwrite=force) as append:

        def take(case: int, values: "Array") -> None:
            nonlocal at, done
            if case != at:
                at, done = case, 0
            machine = np.arange(done, done + len(values))
            done += len(values)
            scene = [names[case]] * len(values)
            append({"scene": scene, "machine": machine, "error_um": values})

        yield take


EXTRA_OPTIONS: dict[str, tuple[tuple[Callable[..., Any], ...], Callable[..., Any]]] = {
    "concepts": (
        (
            shared_options.plot_option("machines side by side"),
            shared_options.size_option("1600x1200", "Width and height of the picture in px."),
        ),
        run_concepts,
    ),
    "montecarlo": (
        (
            click.option(
                "--workers",
                type=int,
                help="Number of processes, from 2 million machines on; below, threads. It does not"
                " affect the numbers.  [one per core]",
            ),
            click.option(
                "--scheduler",
                metavar="ADDRESS",
                help="Run on the workers of a Dask cluster, for instance tcp://host:8786."
                " Needs the extra `cluster`.",
            ),
            shared_options.output_option(
                "|E| of every machine as a table, or the rows of all combinations: .parquet or"
                " .csv.",
                *shared_options.ROWS,
                required=False,
            ),
        ),
        run_montecarlo,
    ),
}
