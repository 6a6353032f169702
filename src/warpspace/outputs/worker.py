"""Figures drawn in a process of their own: a crash of the renderer loses that figure only."""

import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future

from warpspace.exceptions import (
    OptionError,
    RenderError,
    SceneError,
    UnknownNameError,
    WorkersLostError,
)
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.processes import ProcessPool
from warpspace.scene.model import Scene

PICTURES_PER_PROCESS = 100
"""A process is replaced after so many figures."""
TIMEOUT_S = 300.0
PROBE_TIMEOUT_S = 60.0
PACKAGES = "libegl1 libgl1-mesa-dri"
WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
WINDOWS = (
    "vtkEGLRenderWindow",
    "vtkOSOpenGLRenderWindow",
    "vtkXOpenGLRenderWindow",
    "vtkWin32OpenGLRenderWindow",
    "vtkCocoaRenderWindow",
)
"""What the variable may name."""
_PROBE = """
import faulthandler, os, sys
faulthandler.dump_traceback_later(60.0, exit=True)
if sys.platform == "linux":
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
import pyvista
plotter = pyvista.Plotter(off_screen=True)
plotter.screenshot(return_img=True)
sys.exit(0 if plotter.render_window.SupportsOpenGL() else 3)
"""


def probe_renderer() -> str:
    """Try to draw off screen in a process of its own, since a system without OpenGL may end it.

    Returns
    -------
    str
        Empty where it works, else what is wrong and which packages to install.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE],
            capture_output=True,
            timeout=PROBE_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"VTK hangs when it draws off screen. {_advice()}"
    if done.returncode == 0:
        return ""
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return f"VTK cannot draw off screen here. {_advice()}" + (f" ({lines[-1]})" if lines else "")


def _advice() -> str:
    """Say what to change or to install."""
    window = os.environ.get(WINDOW_VARIABLE)
    if window is not None and window not in WINDOWS:
        return f"The variable {WINDOW_VARIABLE} is {window!r}, which VTK does not know; unset it."
    if sys.platform == "linux":
        return f"Install the Debian packages {PACKAGES} (apt-get install {PACKAGES})."
    return "Check the OpenGL driver."


def _draw(name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str) -> bytes:
    """Draw one figure; runs in the process of the renderer."""
    from warpspace.outputs.save import render_figure

    try:
        return render_figure(name, scenes, settings, form)
    except (SceneError, UnknownNameError) as error:
        # these two do not travel between processes
        raise OptionError(str(error)) from None


class FigureWorker:
    """One renderer in a process of its own; requests from any thread queue up.

    Parameters
    ----------
    timeout_s : float, optional
        How long one figure may take.
    """

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
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
        """Draw a figure and wait for it.

        Parameters
        ----------
        name : str
            Name of the figure, see `warpspace.outputs.figures.catalogue`.
        scenes : sequence of Scene
        settings : FigureSettings, optional
        form : str, optional
            "png", "svg" or "pdf".

        Returns
        -------
        bytes
            The file's content.

        Raises
        ------
        RenderError
            If the renderer crashed or took too long; the next figure gets a new one.
        WarpspaceError
            Whatever drawing it in this process would have raised.
        """
        pool, future = self._submit(name, tuple(scenes), settings or FigureSettings(), form)
        try:
            return future.result(self._timeout_s)
        except (WorkersLostError, CancelledError):
            if pool.ended:
                raise RenderError(f"figure {name!r} was given up: its renderer was ended") from None
            self.close(wait=False)
            problem = probe_renderer()
            raise RenderError(
                f"figure {name!r} could not be drawn: "
                + (problem or "the renderer crashed; other figures are not affected")
            ) from None
        except TimeoutError:
            self.close(wait=False)
            raise RenderError(
                f"figure {name!r} was given up after {self._timeout_s:g} s; try a smaller one"
            ) from None

    def _submit(
        self, name: str, scenes: Sequence[Scene], settings: FigureSettings, form: str
    ) -> "tuple[ProcessPool, Future[bytes]]":
        """Hand a request to the process; start one where there is none."""
        with self._lock:
            if self._pool is None:
                self._pool = ProcessPool(1, tasks_per_process=PICTURES_PER_PROCESS)
            return self._pool, self._pool.submit(_draw, name, scenes, settings, form)

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
