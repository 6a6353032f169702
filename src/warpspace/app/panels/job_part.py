"""Work beside the session: how far it is, a way to cancel it, and what went wrong."""

import logging
from collections.abc import Callable
from typing import Any

from warpspace.app.browser.page import error_words
from warpspace.app.documents.jobs import Jobs, Progress, Work
from warpspace.app.documents.services import CancelledError
from warpspace.app.panels.context import PanelContext
from warpspace.exceptions import WarpspaceError

logger = logging.getLogger(__name__)


class JobPart:
    """One job at a time, with a progress bar and a button that cancels while it runs.

    A page that has gone cancels its job: nobody waits for it, and its widgets are gone.

    Parameters
    ----------
    context : PanelContext
    failed : callable
        Gets the name of a job and in words what went wrong; from other threads.
    hint : str
        Of the button that cancels.
    words : callable or None
        Says what is being done, above the bar; None for no such line.
    percent : callable, optional
        Tells how far it is; by default the estimate from the time it usually takes.
    kept : str, optional
        What is said of a job that was cancelled; its name by default.
    """

    def __init__(
        self,
        context: PanelContext,
        failed: Callable[[str, str], None],
        hint: str,
        words: Callable[[Progress], str] | None,
        percent: Callable[[Progress], float] = lambda progress: progress.percent,
        kept: str = "",
    ) -> None:
        gui = context.gui
        self._context, self._failed = context, failed
        self._words, self._percent, self._kept = words, percent, kept
        self._jobs = Jobs(self._report, self.fail)
        self._status: Any = None if words is None else gui.add_markdown("", visible=False)
        self._bar: Any = gui.add_progress_bar(0.0, visible=False, animated=True)
        self._cancel: Any = gui.add_button("Cancel", color="gray", visible=False, hint=hint)
        self._cancel.on_click(lambda _: self._jobs.cancel())

    def start(self, name: str, work: Work, usual_s: float) -> bool:
        """Start a job, see `Jobs.start`; False where another one is running."""
        return self._jobs.start(name, work, usual_s)

    def fail(self, name: str, error: Exception) -> None:
        """Hand over what went wrong, log what nobody foresaw."""
        if not isinstance(error, WarpspaceError):
            logger.error("%s", name, exc_info=error)
        if not self._context.page.is_open:
            return
        if isinstance(error, CancelledError):
            self._context.notify("Cancelled", self._kept or name, "gray")
        else:
            self._failed(name, error_words(error))

    def _report(self, progress: Progress | None) -> None:
        """Show how far the work is; from another thread."""
        if not self._context.page.is_open:
            self._jobs.cancel()
            return
        if progress is not None:
            if self._words is not None:
                self._status.content = self._words(progress)
            self._bar.value = self._percent(progress)
        busy = progress is not None
        for handle in (self._status, self._bar, self._cancel):
            if handle is not None and handle.visible != busy:
                handle.visible = busy
        self._context.client.flush()
