"""Comparing and drawing beside the session: a progress bar and a way to cancel."""

import threading
import time
from collections.abc import Callable
from functools import partial
from math import exp
from typing import TYPE_CHECKING, Any

from warpspace.app.documents.jobs import Jobs, Progress
from warpspace.app.documents.services import ConceptRequest
from warpspace.app.evaluation.concepts import Answer, Question, answer
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.concepts import cut_strip

if TYPE_CHECKING:
    from warpspace.app.state.concept_choice import ConceptChoice

COMPARING, SHEET = "Comparing machines", "Sheet of all machines"
SAMPLED = 45.0
"""Per cent of the bar when all machines are sampled; the rest are pictures."""
STRIP_PX = (480, 340)
"""Size of each picture; it is shown about half as large, sharp on fine screens too."""
DRAWING_S, SHEET_S = 6.0, 8.0
"""How long pictures usually take."""


class ConceptWork:
    """One comparison or one sheet at a time.

    Parameters
    ----------
    context : PanelContext
    found : callable
        Gets an answer and the choice it answers; on the session.
    drawn : callable
        Gets the answer and a picture of each of its machines; on the session.
    failed : callable
        Gets what was being done and what it raised.
    """

    def __init__(
        self,
        context: PanelContext,
        found: "Callable[[Answer, ConceptChoice], None]",
        drawn: Callable[[Answer, list[str]], None],
        failed: Callable[[str, Exception], None],
    ) -> None:
        self._context, self._found, self._drawn = context, found, drawn
        self._jobs = Jobs(self._report, failed)
        self._share, self._drawing_since = 0.0, 0.0

    def add_progress(self) -> None:
        """Add what says how far the work is, and ends it."""
        gui = self._context.gui
        self._status: Any = gui.add_markdown("", visible=False)
        self._bar: Any = gui.add_progress_bar(0.0, visible=False, animated=True)
        self._cancel: Any = gui.add_button(
            "Cancel", color="gray", visible=False, hint="Give it up; what was shown stays."
        )
        self._cancel.on_click(lambda _: self._jobs.cancel())

    def compare(self, question: Question, choice: "ConceptChoice", *, dark: bool) -> bool:
        """Compare machines, then draw them; False where something runs already."""
        draw = self._context.services.draw_concepts

        def progress(share: float) -> None:
            self._share = share

        def work(cancelled: threading.Event) -> None:
            found = answer(question, cancelled, progress)
            if found is None or cancelled.is_set():
                return
            self._context.act(partial(self._found, found, choice))
            if draw is None:
                return
            self._drawing_since = time.monotonic()
            strip = draw(_request(question, dark, STRIP_PX), cancelled)
            pictures = cut_strip(strip, len(question.scenes))
            if not cancelled.is_set():
                self._context.act(partial(self._drawn, found, pictures))

        self._share, self._drawing_since = 0.0, 0.0
        return self._jobs.start(COMPARING, work, DRAWING_S)

    def draw_sheet(self, question: Question, *, dark: bool) -> bool:
        """Draw one sheet and have the browser save it; False where something runs already."""
        draw, client = self._context.services.draw_concepts, self._context.client
        if draw is None:
            return True

        def work(cancelled: threading.Event) -> None:
            content = draw(_request(question, dark), cancelled)
            if not cancelled.is_set():
                client.send_file_download("concepts.png", content, save_immediately=True)
                client.flush()

        return self._jobs.start(SHEET, work, SHEET_S)

    def _report(self, progress: Progress | None) -> None:
        """Show how far the work is; from another thread."""
        if not self._context.page.is_open:  # nobody waits for it any more, the widgets are gone
            self._jobs.cancel()
            return
        busy = progress is not None
        if progress is not None:
            sampling = progress.name == COMPARING and not self._drawing_since
            self._status.content = "Drawing …" if not sampling else "Sampling machines …"
            self._bar.value = self._percent(progress)
        for handle in (self._status, self._bar, self._cancel):
            if handle.visible != busy:
                handle.visible = busy
        self._context.client.flush()

    def _percent(self, progress: Progress) -> float:
        """Put sampling, which counts its machines, and drawing, which does not, on one bar."""
        if progress.name != COMPARING:
            return progress.percent
        if not self._drawing_since:
            return SAMPLED * min(self._share, 1.0)
        drawn = 1.0 - exp(-(time.monotonic() - self._drawing_since) / DRAWING_S)
        return SAMPLED + (100.0 - SAMPLED) * drawn


def _request(
    question: Question, dark: bool, strip_px: tuple[int, int] | None = None
) -> ConceptRequest:
    """Ask for the pictures alone, or for a sheet with words."""
    return ConceptRequest(question.scenes, question.plan(), question.loop, dark, strip_px)
