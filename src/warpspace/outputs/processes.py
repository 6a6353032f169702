"""Pools of processes that draw or compute; no such process outlives the one that started it."""

import os
import signal
import threading
from collections.abc import Generator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process, resource_tracker

from warpspace.exceptions import RenderError

_pools: set[ProcessPoolExecutor] = set()
"""The pools that are in use."""
_ending = threading.Event()
"""Set once this process has been told to end."""


def start_pool(processes: int, *, tasks_per_process: int | None = None) -> ProcessPoolExecutor:
    """Start a pool of processes.

    Parameters
    ----------
    processes : int
        How many there are at the most.
    tasks_per_process : int, optional
        A process is replaced after so many tasks.

    Returns
    -------
    ProcessPoolExecutor
        To be ended with `end_pool`.

    Raises
    ------
    RenderError
        If this process has been told to end.
    """
    if _ending.is_set():
        raise RenderError("nothing more is begun: the program ends")
    pool = ProcessPoolExecutor(
        processes,
        get_context("spawn"),
        initializer=_follow_parent,
        max_tasks_per_child=tasks_per_process,
    )
    _pools.add(pool)
    return pool


def is_in_use(pool: ProcessPoolExecutor) -> bool:
    """Tell whether nobody has ended a pool on purpose."""
    return pool in _pools


def end_pool(pool: ProcessPoolExecutor, *, wait: bool = True) -> None:
    """End a pool; tasks that have not begun are dropped.

    Parameters
    ----------
    pool : ProcessPoolExecutor
    wait : bool, optional
        Whether tasks that have begun are finished. Else their processes are killed.
    """
    _pools.discard(pool)
    if not wait:
        _kill(pool)
    # also after a kill, which takes no time: the interpreter must not end in the midst of it
    pool.shutdown(wait=True, cancel_futures=True)


def forget_pool(pool: ProcessPoolExecutor) -> None:
    """Leave a broken pool to its own thread, which ends its processes; to be called from it."""
    _pools.discard(pool)
    pool.shutdown(wait=False)


def kill_pools() -> None:
    """Kill the processes of all pools, and start none from now on; safe in a signal handler."""
    _ending.set()
    while _pools:
        _kill(_pools.pop())


@contextmanager
def interrupts_held_back() -> Generator[None]:
    """Keep Ctrl-C away from processes that this thread starts, until they ignore it themselves.

    A terminal sends it to all processes of a command. Only the first one is to answer it.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # starting the tracker lifts the block, so that it must be running before
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _kill(pool: ProcessPoolExecutor) -> None:
    """Kill the processes of a pool."""
    for process in list((pool._processes or {}).values()):  # noqa: SLF001 - no public way
        process.kill()


def _follow_parent() -> None:
    """Prepare a process of a pool: it ignores Ctrl-C, and ends as soon as its parent has ended.

    A thread waits for the end of the parent on every system. Linux could send a signal by itself
    (PR_SET_PDEATHSIG), but it does so already when the *thread* that started the process ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, name="end with parent", daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the end of the parent, then end this process at once."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
