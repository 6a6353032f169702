"""Long work of a part beside its session: one at a time, with progress, and cancellable."""

import logging
import threading
import time
from collections.abc import Callable
from functools import partial

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, join, number, tag
from warpspace.app.documents.services import CancelledError
from warpspace.app.tasks.parts import Part
from warpspace.exceptions import WarpspaceError

logger = logging.getLogger(__name__)
TICK_S = 0.25  # how often progress is shown


class Job(threading.Event):
    """One piece of work; set once nobody waits for it any more."""

    def __init__(self, name: str, again: Callable[[], None]) -> None:
        super().__init__()
        self.name, self.share = name, 0.0
        self._again, self._told_at = again, time.monotonic()

    def tell(self, share: float) -> None:
        """Say how much is done; raises where nobody waits for it any more."""
        if self.is_set():
            raise CancelledError(f"{self.name}: cancelled")
        self.share = share
        if time.monotonic() - self._told_at > TICK_S:
            self._told_at = time.monotonic()
            self._again()


class Jobs:
    """Runs the work of a part in threads of its own; what is called back runs in the session."""

    def __init__(
        self, part: Part, again: Callable[[], None], failed: Callable[[Exception], None]
    ) -> None:
        self._part, self._failed = part, failed
        self._again = partial(part.context.act, again)
        self._job: Job | None = None

    @property
    def busy(self) -> bool:
        """Whether something runs."""
        return self._job is not None

    def start(self, name: str, work: Callable[[Job], None]) -> bool:
        """Start work; give whether there was room. For the session, as all but the work itself."""
        if self._job is not None:
            return False
        self._job = job = Job(name, self._again)
        self._part.context.jobs.add(job)
        run = partial(self._run, job, work)
        threading.Thread(target=run, name="warpspace-work", daemon=True).start()
        self._again()
        return True

    def cancel(self) -> None:
        """Cancel what runs; its result is not delivered any more."""
        if self._job is not None:
            self._job.set()
            self._end(self._job, None)

    def html(self) -> Markup:
        """Say what runs, and how much of it is done where that is known."""
        job = self._job
        if job is None:
            return EMPTY
        share = number(100.0 * job.share, 0) if job.share else None
        bar = tag("progress", "", max=100, value=share, aria_label=job.name)
        words = tag("span", f"{job.name}: {share} %" if share else f"{job.name} …")
        cancel = button("Cancel", f"{self._part.name}:cancel")
        return tag("div", join((bar, words, cancel)), class_="ws-actions ws-run")

    def _run(self, job: Job, work: Callable[[Job], None]) -> None:
        error = None
        try:
            work(job)
        except Exception as raised:  # noqa: BLE001 - handed to the session, which shows it
            error = raised
        self._part.context.act(partial(self._end, job, error))

    def _end(self, job: Job, error: Exception | None) -> None:
        self._part.context.jobs.discard(job)
        if self._job is not job:  # it has been cancelled, and there may be another
            return
        self._job = None
        self._again()
        if error is not None and not isinstance(error, CancelledError):
            if not isinstance(error, WarpspaceError):
                logger.error("%s", job.name, exc_info=error)
            self._failed(error)
