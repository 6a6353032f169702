"""Processes that draw or compute; none outlives the program that started it.

A crash of the renderer loses the figure in its process only.

Each has its own pipe. The processes of `concurrent.futures` share one: if one of them is killed
while it writes a large result, the reader waits for the remaining bytes forever.
"""

import gc
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from warpspace import exceptions
from warpspace.resources import GARBAGE_THRESHOLDS, RENDERER_MB, check_address_space

if TYPE_CHECKING:
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.scene.model import Scene

END_S = 5.0  # time for an idle process to end by itself

_spawn = get_context("spawn")
_pools: "set[ProcessPool]" = set()  # pools in use
_ending = threading.Event()  # set when this program is ending
_Task = tuple[Callable[..., Any], tuple[Any, ...], Mapping[str, Any]]


class ProcessPool(Executor):
    """A pool of processes, each of which runs one task after the other."""

    def __init__(
        self, processes: int, *, tasks_per_process: int | None = None, losses: int = 0
    ) -> None:
        if _ending.is_set():
            raise exceptions.RenderError("the program is ending: no process is started")
        self._tasks_per_process, self._may_lose = tasks_per_process, losses
        self.ended, self._lost = False, 0
        self._lock = threading.Lock()
        self._workers: set[_Worker] = set()
        self._idle: list[_Worker] = []
        # a thread waits for each process
        self._threads = ThreadPoolExecutor(processes, "process")
        _pools.add(self)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        """Submit a task to the pool: a module-level function and its arguments."""
        return self._threads.submit(self._do, (fn, args, kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their tasks; `wait` blocks until then."""
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)
        if not wait:
            return
        self.ended = True
        _pools.discard(self)
        while self._idle:
            self._retire(self._idle.pop())

    def kill(self) -> None:
        """Kill the processes during their tasks; tasks not started are dropped."""
        self.kill_processes()
        self.shutdown(cancel_futures=True)

    def kill_processes(self) -> None:
        """Kill the processes and start no others; safe in a signal handler."""
        self.ended = True
        for worker in list(self._workers):
            worker.process.kill()

    def _do(self, task: _Task) -> Any:
        while True:
            worker = self._find()
            try:
                result, error = worker.do(task)
            except (EOFError, OSError):  # the end of the pipe, which is that of the process
                self._retire(worker)
                with self._lock:
                    self._lost += not self.ended
                continue
            if worker.done == self._tasks_per_process:
                self._retire(worker)
            else:
                self._idle.append(worker)
            if error is not None:
                raise error
            return result

    def _find(self) -> "_Worker":
        with self._lock:
            if not self.ended and self._lost <= self._may_lose:
                if self._idle:
                    return self._idle.pop()
                worker = _Worker()
                self._workers.add(worker)
                if self.ended:  # in the meantime
                    worker.process.kill()
                return worker
        if self.ended:
            raise exceptions.WorkersLostError("the worker processes were ended")
        times = "once" if self._lost == 1 else f"{self._lost} times"
        raise exceptions.WorkersLostError(f"worker processes died {times} (out of memory?)")

    def _retire(self, worker: "_Worker") -> None:
        with self._lock:
            worker.end()
            self._workers.discard(worker)


class _Worker:
    """A process and the parent's end of its pipe."""

    def __init__(self) -> None:
        self._pipe, child_pipe = _spawn.Pipe()
        self.process = _spawn.Process(target=_work, args=(child_pipe,), daemon=True)
        self.done = 0
        with _interrupts_held_back():
            self.process.start()
        child_pipe.close()  # so that the pipe ends with the process

    def do(self, task: _Task) -> tuple[Any, BaseException | None]:
        try:
            self._pipe.send(task)
            self.done += 1
            return self._pipe.recv()
        except (EOFError, OSError):
            raise
        except Exception as error:  # noqa: BLE001 - something that cannot be sent
            return None, error

    def end(self) -> None:
        self._pipe.close()
        self.process.join(END_S)
        self.process.kill()
        self.process.join()


def kill_pools() -> None:
    """Kill the processes of all pools and start no others; safe in a signal handler."""
    _ending.set()
    while _pools:
        _pools.pop().kill_processes()


@contextmanager
def _interrupts_held_back() -> Generator[None]:
    """Block Ctrl-C for processes that this thread starts, until they ignore it themselves.

    A terminal sends it to all processes of a command. Only the first one responds.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # starting the tracker lifts the block: it must be running before
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(pipe: "Connection[Any, Any]") -> None:
    _follow_parent()
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):  # the parent has ended
            os._exit(0)  # at once: Python takes 0.3 s to take a renderer down
        except Exception as error:  # noqa: BLE001 - something that cannot be read
            outcome = None, error
        else:
            outcome = _outcome(*task)
        try:
            pipe.send(outcome)
        except OSError:
            return
        except Exception as error:  # noqa: BLE001 - something that cannot be sent
            pipe.send((None, error))
        del outcome


def _outcome(
    fn: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]
) -> tuple[Any, BaseException | None]:
    try:
        return fn(*args, **kwargs), None
    except Exception as error:  # noqa: BLE001 - raised again in the parent
        error.add_note("in a worker process:\n" + traceback.format_exc())
        return None, error


def _follow_parent() -> None:
    """Prepare a process of a pool: it ignores Ctrl-C, and ends as soon as its parent has ended.

    Neither it nor C libraries print anything: results and errors go through its pipe.
    A thread waits for the end of the parent on every system. Linux could send a signal by itself
    (PR_SET_PDEATHSIG), but it does so already when the *thread* that started the process ends.
    """
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_end_with_parent, name="end with parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


PICTURES_PER_PROCESS = 100  # after which a process is replaced
TIMEOUT_S = 300.0


def _draw(name: str, scenes: "Sequence[Scene]", settings: "FigureSettings", form: str) -> bytes:
    from warpspace.outputs.figure_files import render_figure

    gc.collect()
    gc.freeze()  # permanent objects are not searched for garbage before every figure
    try:
        return render_figure(name, scenes, settings, form)
    except (exceptions.SceneError, exceptions.UnknownNameError) as error:
        # these two cannot be pickled
        raise exceptions.OptionError(str(error)) from None


def _draw_chart(draw: str, form: str, *arguments: Any) -> bytes:
    from warpspace.outputs.figure_files import encode_figure

    return encode_figure(resolve_name(draw)(*arguments), form)


class FigureWorker:
    """One renderer in a separate process; requests from any thread are queued.

    The methods that begin a drawing return a function that waits for the bytes of the figure.
    """

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        check_address_space(RENDERER_MB, "drawing")
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._pool: ProcessPool | None = None

    def begin(
        self, name: str, scenes: "Sequence[Scene]", settings: "FigureSettings", form: str = "png"
    ) -> Callable[[], bytes]:
        """Begin to draw a figure."""
        return self.call(name, _draw, name, tuple(scenes), settings, form)

    def begin_chart(self, name: str, draw: str, form: str, *arguments: Any) -> Callable[[], bytes]:
        """Begin to draw a chart with "module:function", imported in the process."""
        return self.call(name, _draw_chart, draw, form, *arguments)

    def call(self, name: str, draw: Callable[..., bytes], *arguments: Any) -> Callable[[], bytes]:
        """Begin to draw with a module-level function."""
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPool(1, tasks_per_process=PICTURES_PER_PROCESS)
            pool = self._pool
            future: Future[bytes] = pool.submit(draw, *arguments)
        return lambda: self._wait(name, pool, future)

    def _wait(self, name: str, pool: ProcessPool, future: "Future[bytes]") -> bytes:
        try:
            return future.result(self._timeout_s)
        except (exceptions.WorkersLostError, CancelledError):
            if pool.ended:
                raise exceptions.RenderError(
                    f"figure {name!r} was stopped: its renderer was ended"
                ) from None
            self._abandon(pool)
            raise exceptions.RenderError(
                f"figure {name!r} could not be drawn: the renderer crashed; other figures are not"
                " affected"
            ) from None
        except TimeoutError:
            self._abandon(pool)
            raise exceptions.RenderError(
                f"figure {name!r} was stopped after {self._timeout_s:g} s; expected a smaller one"
            ) from None

    def _abandon(self, pool: ProcessPool) -> None:
        with self._lock:
            if self._pool is pool:
                self._pool = None
        pool.kill()

    def close(self, *, wait: bool = True) -> None:
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is not None and wait:
            pool.shutdown(cancel_futures=True)
        elif pool is not None:
            pool.kill()

    def __enter__(self) -> "FigureWorker":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the process; after a failure without waiting for its drawing."""
        self.close(wait=kind is None)
