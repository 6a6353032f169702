"""Long work of a part beside its session: one at a time, with progress, and cancellable."""

import logging
import math
import threading
import time
from collections.abc import Callable
from functools import partial

from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, join, number, tag
from warpspace.app.documents.services import CancelledError
from warpspace.app.tasks.context import Context
from warpspace.exceptions import WarpspaceError

logger = logging.getLogger(__name__)
TICK_S = 0.25


class Job(threading.Event):
    """One piece of work; set once it is cancelled."""

    def __init__(self, name: str, usual_s: float, quiet_s: float) -> None:
        super().__init__()
        self.name, self.quiet_s = name, quiet_s
        self.share = 0.0  # how much is done, where the work says so itself
        self._usual_s, self._began = usual_s, time.monotonic()

    @property
    def lasted_s(self) -> float:
        """How long it has been at it."""
        return time.monotonic() - self._began

    @property
    def percent(self) -> float:
        """How far it is, estimated from the time it usually takes; 100 only when done."""
        return 100.0 * (self.share or 1.0 - math.exp(-1.5 * self.lasted_s / self._usual_s))


class Jobs:
    """Runs the work of a part in threads of its own; what is called back runs in the session."""

    def __init__(
        self,
        context: Context,
        part: str,
        again: Callable[[], None],
        failed: Callable[[str, Exception], None],
    ) -> None:
        self._context, self._part = context, part
        self._again, self._failed = again, failed
        self._lock = threading.Lock()
        self._job: Job | None = None

    @property
    def busy(self) -> bool:
        """Whether something runs."""
        return self._job is not None

    def start(
        self, name: str, work: Callable[[Job], None], usual_s: float, quiet_s: float = 0.0
    ) -> bool:
        """Start work that is shown once it has lasted `quiet_s`; give whether there was room."""
        with self._lock:
            if self._job is not None:
                return False
            job = self._job = Job(name, usual_s, quiet_s)
        watch = partial(self._watch, job, work)
        threading.Thread(target=watch, name="warpspace-job", daemon=True).start()
        return True

    def cancel(self) -> None:
        """Cancel what runs; its result is not delivered any more."""
        if (job := self._job) is not None:
            job.set()

    def html(self) -> Markup:
        """Say how far it is; nothing where nothing runs that has lasted long enough."""
        job = self._job
        if job is None or job.lasted_s < job.quiet_s:
            return EMPTY
        bar = tag("progress", "", max=100, value=f"{job.percent:.0f}", aria_label=job.name)
        words = tag("span", f"{job.name}: {number(job.percent, 0)} %")
        cancel = button("Cancel", f"{self._part}:cancel")
        return tag("div", join((bar, words, cancel)), class_="ws-actions ws-run")

    def _watch(self, job: Job, work: Callable[[Job], None]) -> None:
        raised: list[Exception] = []
        done = threading.Event()

        def run() -> None:
            try:
                work(job)
            except Exception as error:  # noqa: BLE001 - handed to the session, which shows it
                raised.append(error)
            done.set()

        threading.Thread(target=run, name="warpspace-work", daemon=True).start()
        self._context.act(self._again)
        while not done.wait(TICK_S) and not job.is_set():
            if not self._context.page.is_open:
                job.set()
            self._context.act(self._again)
        self._job = None
        self._context.act(self._again)
        errors = [CancelledError(f"{job.name}: cancelled")] if job.is_set() else raised
        for error in errors:
            if not isinstance(error, WarpspaceError):
                logger.error("%s", job.name, exc_info=error)
            self._context.act(partial(self._failed, job.name, error))
