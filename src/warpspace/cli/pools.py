"""Who does the work of a command: threads, processes of this machine, or a Dask cluster."""

import os
import threading
from collections.abc import Callable, Generator
from concurrent.futures import Executor, Future, InvalidStateError
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import click

from warpspace.exceptions import OptionError, WorkersLostError
from warpspace.machine.limits import LOCAL_WORKERS

WORTH_A_POOL = 2_000_000
"""Machines: what takes about 10 s. Below, starting processes costs more than it saves."""
REPLACEMENTS = 3
"""How often one task may lose its process before it is given up."""
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
    from warpspace.outputs.processes import start_pool

    pool = LastingPool(lambda: start_pool(number))
    try:
        yield Workers(pool, number)
    finally:
        pool.shutdown(wait=False)


class LastingPool(Executor):
    """A pool of processes that is replaced when it loses one; what was not done is done again.

    Parameters
    ----------
    start : callable
        Gives a new pool.
    """

    def __init__(self, start: Callable[[], ProcessPoolExecutor]) -> None:
        self._start = start
        self._lock = threading.Lock()
        self._pool = start()
        self._ended = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Give a task to the pool."""
        outer: Future[Any] = Future()
        self._try(outer, partial(fn, *args, **kwargs), REPLACEMENTS)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002 - signature of Executor
        """End the processes; tasks not begun are dropped."""
        from warpspace.outputs.processes import end_pool

        with self._lock:
            self._ended = True
            end_pool(self._pool, wait=wait)

    def _try(self, outer: "Future[Any]", call: Callable[[], Any], left: int) -> None:
        """Hand a task to the pool that is there."""
        pool = self._pool
        try:
            inner = pool.submit(call)
        except BrokenProcessPool:
            self._again(outer, call, left, pool)
        else:
            inner.add_done_callback(partial(self._done, outer, call, left, pool))

    def _done(
        self,
        outer: "Future[Any]",
        call: Callable[[], Any],
        left: int,
        pool: ProcessPoolExecutor,
        inner: "Future[Any]",
    ) -> None:
        """Pass on what came of a task."""
        if inner.cancelled():
            outer.cancel()
            outer.set_running_or_notify_cancel()
            return
        if isinstance(inner.exception(), BrokenProcessPool):
            self._again(outer, call, left - 1, pool)
            return
        error = inner.exception()
        with suppress(InvalidStateError):  # dropped in this very moment
            if error is None:
                outer.set_result(inner.result())
            else:
                outer.set_exception(error)

    def _again(
        self, outer: "Future[Any]", call: Callable[[], Any], left: int, broken: ProcessPoolExecutor
    ) -> None:
        """Do a task again in another pool, unless it has lost too many."""
        from warpspace.outputs.processes import forget_pool

        if outer.cancelled():
            return
        with self._lock:
            if left <= 0 or self._ended:
                error = WorkersLostError(
                    f"processes were ended {REPLACEMENTS} times in the midst of one task, perhaps"
                    " for want of memory; run again with fewer --workers"
                )
                outer.set_exception(error)
                return
            if self._pool is broken:
                forget_pool(broken)
                self._pool = self._start()
        self._try(outer, call, left)


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
        yield Workers(client.get_executor(pure=False, retries=REPLACEMENTS), threads)
    except distributed.KilledWorker as error:
        raise WorkersLostError(f"--scheduler {address!r}: {error}") from None
    finally:
        client.close()
