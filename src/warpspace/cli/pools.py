"""Who does the work of a command: threads, processes of this machine, or a Dask cluster."""

import os
from collections.abc import Generator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import click

from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.machine.limits import LOCAL_WORKERS

WORTH_A_POOL = 2_000_000
"""Machines: what takes about 10 s. Below, starting processes costs more than it saves."""
LOSSES = 5
"""How many worker processes a command may lose: each is replaced and its task done again."""
RETRIES = 3
"""How often a cluster does a task again that has lost its worker."""
CONNECT_S = 10

workers_option = click.option(
    "--workers",
    type=int,
    help="Processes, from 2 million machines on; below, threads. The numbers do not depend on it."
    "  [one per core]",
)
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Let the workers of a Dask cluster do the work, for instance tcp://host:8786. Needs the"
    " extra `cluster`.",
)


@dataclass(frozen=True)
class Workers:
    """Who does the work.

    Attributes
    ----------
    executor : concurrent.futures.Executor or None
        None means threads.
    number : int or None
        How many tasks are worked on at a time.
    """

    executor: Executor | None = None
    number: int | None = None


@contextmanager
def find_workers(scheduler: str | None, workers: int | None, machines: int) -> Generator[Workers]:
    """Choose who does the work.

    Parameters
    ----------
    scheduler : str or None
        Address of a Dask scheduler.
    workers : int or None
        How many, as the user says it.
    machines : int
        How many are sampled altogether.

    Raises
    ------
    OptionError
        If there is no such cluster, or dask is not installed.
    WorkersLostError
        If too many workers died.
    """
    if scheduler is not None:
        if workers is not None:
            raise OptionError(
                "--workers and --scheduler exclude each other: a cluster has its own workers"
            )
        with _cluster(scheduler) as found:
            yield found
        return
    if workers is not None and not LOCAL_WORKERS[0] <= workers <= LOCAL_WORKERS[1]:
        low, high = LOCAL_WORKERS
        raise OptionError(f"workers: {workers}; expected {low} to {high}")
    number = workers or os.cpu_count() or 1
    if number == 1 or machines < WORTH_A_POOL:
        yield Workers(None, workers)
        return
    from warpspace.outputs.processes import ProcessPool

    pool = ProcessPool(number, losses=LOSSES)
    try:
        yield Workers(pool, number)
    except WorkersLostError as error:
        raise WorkersLostError(f"{error}; run again with fewer --workers") from None
    finally:
        pool.kill()


@contextmanager
def _cluster(address: str) -> Generator[Workers]:
    """Connect to a Dask cluster."""
    try:
        import distributed
    except ImportError:
        raise OptionError(
            "--scheduler needs dask and distributed: pip install 'warpspace[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
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
        yield Workers(client.get_executor(pure=False, retries=RETRIES), threads)
    except distributed.KilledWorker as error:
        raise WorkersLostError(f"--scheduler {address!r}: {error}") from None
    finally:
        client.close()
