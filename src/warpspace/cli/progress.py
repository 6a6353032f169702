"""Progress of what takes longer than a second, on stderr.

Nothing is shown where stderr is no terminal, or where a program reads the output (``--json``).
"""

import sys
from collections.abc import Generator
from contextlib import contextmanager
from threading import Lock, Timer
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

DELAY_S = 1.0
"""What is done sooner shows nothing."""


class ProgressBar:
    """A bar that appears once the work has taken a while.

    Parameters
    ----------
    doing : str
        What is done, for instance "sampling".
    total : float or None
        How many steps there are; None where nobody knows.
    unit : str
        What is counted, for instance "machines".
    """

    def __init__(self, doing: str, total: float | None, unit: str) -> None:
        self._doing = doing
        self._total = total
        self._unit = unit
        self._done = 0.0
        self._lock = Lock()
        self._closed = False
        self._shown: tuple[Progress, TaskID] | None = None

    def advance(self, steps: float) -> None:
        """Count steps that are done."""
        with self._lock:
            self._done += steps
            if self._shown is not None:
                bar, task = self._shown
                bar.update(task, completed=self._done)

    def show(self) -> None:
        """Draw the bar from now on, unless the work is done."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        counted = "{task.completed:,.0f} of {task.total:,.0f} " + self._unit
        counts = [] if self._total is None else [TextColumn(counted, markup=False)]
        with self._lock:
            if self._closed:
                return
            bar = Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=None),
                *counts,
                TimeElapsedColumn(),
                console=Console(file=sys.stderr),
                transient=True,
                expand=True,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            task = bar.add_task(self._doing, total=self._total, completed=int(self._done))
            self._shown = bar, task
            bar.start()

    def close(self) -> None:
        """Wipe the bar away."""
        with self._lock:
            self._closed = True
            if self._shown is not None:
                self._shown[0].stop()


@contextmanager
def progress(
    doing: str, total: float | None = None, unit: str = "", *, silent: bool = False
) -> Generator[ProgressBar]:
    """Show how far some work is.

    Parameters
    ----------
    doing : str
        What is done, for instance "sampling".
    total : float, optional
        How many steps there are. Without it the bar only moves.
    unit : str, optional
        What is counted, for instance "machines".
    silent : bool, optional
        Whether a program reads the output, so that nothing is shown.

    Yields
    ------
    ProgressBar
        Its `advance` counts the steps; it does nothing where nothing is shown.
    """
    bar = ProgressBar(doing, total, unit)
    timer = Timer(DELAY_S, bar.show)
    timer.daemon = True
    if not silent and sys.stderr.isatty():
        timer.start()
    try:
        yield bar
    finally:
        timer.cancel()
        bar.close()
