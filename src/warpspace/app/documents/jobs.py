"""Long work beside a session: one at a time, with progress, and cancellable."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from warpspace.app.documents.services import CancelledError

TICK_S = 0.25
Work = Callable[[threading.Event], None]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a job is.

    Attributes
    ----------
    name : str
        What is being done.
    percent : float
        Estimated from the time it usually takes; 100 only when done.
    """

    name: str
    percent: float


class Jobs:
    """Runs one job at a time in threads of its own.

    Parameters
    ----------
    report : callable
        Called with the progress, and with None when nothing runs any more; from other threads.
    failed : callable
        Called with what a job has raised, `CancelledError` included.
    """

    def __init__(
        self, report: Callable[[Progress | None], None], failed: Callable[[str, Exception], None]
    ) -> None:
        self._report, self._failed = report, failed
        self._lock = threading.Lock()
        self._cancelled: threading.Event | None = None

    @property
    def busy(self) -> bool:
        """Whether something runs."""
        with self._lock:
            return self._cancelled is not None

    def start(self, name: str, work: Work, usual_s: float) -> bool:
        """Start a job.

        Parameters
        ----------
        name : str
            What is being done, for people.
        work : callable
            Gets an event that is set when it is cancelled, and delivers its result itself.
        usual_s : float
            How long it usually takes, s.

        Returns
        -------
        bool
            False where another one is running.
        """
        with self._lock:
            if self._cancelled is not None:
                return False
            cancelled = self._cancelled = threading.Event()
        threading.Thread(
            target=self._watch,
            args=(name, work, cancelled, usual_s),
            name="warpspace-job",
            daemon=True,
        ).start()
        return True

    def cancel(self) -> None:
        """Cancel what runs; its result is not delivered any more."""
        with self._lock:
            cancelled = self._cancelled
        if cancelled is not None:
            cancelled.set()

    def _watch(self, name: str, work: Work, cancelled: threading.Event, usual_s: float) -> None:
        """Report until the work is done, has failed or is cancelled."""
        done = threading.Event()
        raised: list[Exception] = []

        def run() -> None:
            try:
                work(cancelled)
            except Exception as error:  # noqa: BLE001 - handed to the session, which shows it
                raised.append(error)
            done.set()

        started = time.monotonic()
        threading.Thread(target=run, name="warpspace-work", daemon=True).start()
        finished = False
        while not finished and not cancelled.is_set():
            part = 1.0 - math.exp(-1.5 * (time.monotonic() - started) / usual_s)
            self._report(Progress(name, 100.0 * part))
            finished = done.wait(TICK_S)
        with self._lock:
            self._cancelled = None
        self._report(None)
        if cancelled.is_set():
            self._failed(name, CancelledError(f"{name}: cancelled"))
        elif raised:
            self._failed(name, raised[0])
