"""Figures drawn in a process of their own: a crash of the renderer loses that figure only."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from pkgutil import resolve_name
from typing import Any

from warpspace.exceptions import (
    OptionError,
    RenderError,
    SceneError,
    UnknownNameError,
    WorkersLostError,
)
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.processes import ProcessPool
from warpspace.resources import check_address_space
from warpspace.scene.model import Scene

PICTURES_PER_PROCESS = 100
"""A process is replaced after so many figures."""
TIMEOUT_S = 300.0
LEAST_MB = 1600
"""Address space that the renderer takes for a picture."""


def _draw(name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str) -> bytes:
    from warpspace.outputs.save import render_figure

    try:
        return render_figure(name, scenes, settings, form)
    except (SceneError, UnknownNameError) as error:
        # these two do not travel between processes
        raise OptionError(str(error)) from None


def _draw_chart(draw: str, form: str, *arguments: Any) -> bytes:
    from warpspace.outputs.save import encode_figure

    return encode_figure(resolve_name(draw)(*arguments), form)


class FigureWorker:
    """One renderer in a process of its own; requests from any thread queue up."""

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        check_address_space(LEAST_MB, "drawing")
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._pool: ProcessPool | None = None

    def render(
        self,
        name: str,
        scenes: Sequence[Scene],
        settings: FigureSettings | None = None,
        form: str = "png",
    ) -> bytes:
        """Draw a figure and wait for it."""
        return self.begin(name, scenes, settings or FigureSettings(), form)()

    def begin(
        self, name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str
    ) -> Callable[[], bytes]:
        """Begin to draw a figure; what is given waits for it."""
        return self._begin(name, _draw, name, tuple(scenes), settings, form)

    def begin_chart(self, name: str, draw: str, form: str, *arguments: Any) -> Callable[[], bytes]:
        """Begin to draw the chart that "module:function" gives; the module is imported there."""
        return self._begin(name, _draw_chart, draw, form, *arguments)

    def _begin(self, name: str, draw: Callable[..., bytes], *arguments: Any) -> Callable[[], bytes]:
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPool(1, tasks_per_process=PICTURES_PER_PROCESS)
            pool = self._pool
            future: Future[bytes] = pool.submit(draw, *arguments)
        return lambda: self._wait(name, pool, future)

    def _wait(self, name: str, pool: ProcessPool, future: "Future[bytes]") -> bytes:
        try:
            return future.result(self._timeout_s)
        except (WorkersLostError, CancelledError):
            if pool.ended:
                raise RenderError(f"figure {name!r} was given up: its renderer was ended") from None
            self._give_up(pool)
            raise RenderError(
                f"figure {name!r} could not be drawn: the renderer crashed; other figures are not"
                " affected"
            ) from None
        except TimeoutError:
            self._give_up(pool)
            raise RenderError(
                f"figure {name!r} was given up after {self._timeout_s:g} s; try a smaller one"
            ) from None

    def _give_up(self, pool: ProcessPool) -> None:
        """End the process of a figure; others that waited for it may be begun again."""
        with self._lock:
            if self._pool is pool:
                self._pool = None
        pool.kill()

    def close(self, *, wait: bool = True) -> None:
        """End the process; the next request starts a new one."""
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is None:
            return
        if wait:
            pool.shutdown(cancel_futures=True)
        else:
            pool.kill()

    def __enter__(self) -> "FigureWorker":
        """Use the worker in a with statement."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the process; after a failure without waiting for what it draws."""
        self.close(wait=kind is None)
