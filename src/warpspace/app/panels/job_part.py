"""Work beside the session: how far it is, a way to cancel it, and what went wrong."""

import logging
from collections.abc import Callable
from functools import partial
from typing import Any

from warpspace.app.browser.page import error_words
from warpspace.app.browser.uploads import read_refusal, size_message, size_script
from warpspace.app.documents.services import CancelledError, Jobs, Progress, Work
from warpspace.app.panels.context import PanelContext
from warpspace.exceptions import WarpspaceError

logger = logging.getLogger(__name__)


class JobPart:
    """One job at a time, with a progress bar and a button that cancels while it runs.

    A page that has gone cancels its job: nobody waits for it, and its widgets are gone.
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
        try:
            if self._context.page.is_open:
                self._show(progress)
                return
        except RuntimeError as error:  # viser removes the handles of a page before it says so
            if self._context.page.is_open and "removed" not in str(error):
                raise
        self._jobs.cancel()

    def _show(self, progress: Progress | None) -> None:
        if progress is not None:
            if self._words is not None:
                self._status.content = self._words(progress)
            self._bar.value = self._percent(progress)
        busy = progress is not None
        for handle in (self._status, self._bar, self._cancel):
            if handle is not None and handle.visible != busy:
                handle.visible = busy
        self._context.client.flush()


# --- A button that takes files up to a size: larger ones are refused before they are sent ---------


def add_upload(
    context: PanelContext,
    label: str,
    received: Callable[[str, bytes], None],
    refused: Callable[[str], None],
    spell: Callable[[str], str],
    *,
    endings: str,
    hint: str,
    most_bytes: int,
    what: str = "scene file",
) -> Any:
    """Add a button for uploads."""
    gui = context.gui
    button = gui.add_upload_button(label, mime_type=endings, hint=hint)
    context.uploads.watch(
        button,
        most_bytes,
        lambda name, content: context.act(partial(received, name, content)),
        lambda text: context.act(partial(refused, text)),
        what,
    )
    carrier = gui.add_text("", "", visible=False)

    def refuse() -> None:
        name, size = read_refusal(str(carrier.value))
        refused(size_message(spell(name), size, most_bytes, what))

    carrier.on_update(lambda _: context.act(refuse))
    context.page.run_script(size_script(button, carrier, most_bytes))
    return button
