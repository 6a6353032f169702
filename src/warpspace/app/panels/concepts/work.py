"""Comparing and drawing beside the session: a progress bar and a way to cancel."""

import threading
import time
from collections.abc import Callable
from functools import partial
from math import exp
from typing import TYPE_CHECKING

from warpspace.app.documents.jobs import Progress
from warpspace.app.documents.services import ConceptRequest
from warpspace.app.evaluation.concepts import Answer, Question, answer
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart
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
        Gets what was being done and in words what went wrong; from other threads.
    """

    def __init__(
        self,
        context: PanelContext,
        found: "Callable[[Answer, ConceptChoice], None]",
        drawn: Callable[[Answer, list[str]], None],
        failed: Callable[[str, str], None],
    ) -> None:
        self._context, self._found, self._drawn = context, found, drawn
        self._share, self._drawing_since = 0.0, 0.0
        self._job = JobPart(
            context,
            failed,
            "Give it up; what was shown stays.",
            lambda progress: "Sampling machines …" if self._samples(progress) else "Drawing …",
            self._percent,
            "What was shown stays.",
        )

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
        return self._job.start(COMPARING, work, DRAWING_S)

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

        return self._job.start(SHEET, work, SHEET_S)

    def _samples(self, progress: Progress) -> bool:
        """Tell whether machines are being sampled."""
        return progress.name == COMPARING and not self._drawing_since

    def _percent(self, progress: Progress) -> float:
        """Put sampling, which counts its machines, and drawing, which does not, on one bar."""
        if progress.name != COMPARING:
            return progress.percent
        if self._samples(progress):
            return SAMPLED * min(self._share, 1.0)
        drawn = 1.0 - exp(-(time.monotonic() - self._drawing_since) / DRAWING_S)
        return SAMPLED + (100.0 - SAMPLED) * drawn


def _request(
    question: Question, dark: bool, strip_px: tuple[int, int] | None = None
) -> ConceptRequest:
    """Ask for the pictures alone, or for a sheet with words."""
    return ConceptRequest(question.scenes, question.plan(), question.loop, dark, strip_px)
