"""Runs tasks on any executor of `concurrent.futures` and gives their results in order."""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar, TypeVarTuple, Unpack

from warpspace.exceptions import WorkersLostError

Given = TypeVarTuple("Given")
Result = TypeVar("Result")


def run_in_order(
    function: Callable[[Unpack[Given]], Result],
    tasks: Iterable[tuple[*Given]],
    executor: Executor | None,
    in_flight: int,
) -> Iterator[tuple[tuple[*Given], Result]]:
    """Run a function for every task; tasks and results come out in the order of the tasks.

    Parameters
    ----------
    function : callable
        Where the executor works in other processes, one of a module's own level.
    tasks : iterable of tuple
        Its arguments; taken as they are needed.
    executor : concurrent.futures.Executor or None
        None runs one task after the other here.
    in_flight : int
        How many tasks are given to the executor ahead of the oldest one that is not done. No more
        results than that are held.

    Yields
    ------
    tuple of task and result

    Raises
    ------
    WorkersLostError
        If the executor gives up. What the function raises is raised as it is.
    """
    if executor is None:
        for task in tasks:
            yield task, function(*task)
        return
    pending: deque[tuple[tuple[*Given], Future[Result]]] = deque()
    try:
        for task in tasks:
            if len(pending) >= in_flight:
                yield _oldest(pending)
            pending.append((task, _submit(executor, function, task)))
        while pending:
            yield _oldest(pending)
    finally:
        for _, future in pending:
            future.cancel()


@contextmanager
def threads(workers: int) -> Generator[Executor | None]:
    """Start threads; None for one of them. Tasks not begun are dropped at the end."""
    if workers == 1:
        yield None
        return
    executor = ThreadPoolExecutor(workers)
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _submit(
    executor: Executor,
    function: Callable[[Unpack[Given]], Result],
    task: tuple[*Given],
) -> "Future[Result]":
    """Give a task to the executor."""
    try:
        return executor.submit(function, *task)
    except BrokenExecutor as error:
        raise _lost(error) from error


def _oldest(
    pending: "deque[tuple[tuple[*Given], Future[Result]]]",
) -> tuple[tuple[*Given], Result]:
    """Wait for the oldest task; it stays in the row until it is done, so that it can be stopped."""
    task, future = pending[0]
    try:
        result = future.result()
    except (BrokenExecutor, CancelledError) as error:
        raise _lost(error) from error
    pending.popleft()
    return task, result


def _lost(error: BaseException) -> WorkersLostError:
    """Say that the executor has given up."""
    return WorkersLostError(
        f"the workers are lost ({type(error).__name__}): a process was ended, ran out of memory, or"
        " the cluster was closed; run again, with fewer --workers where memory is short"
    )
