"""A log that a client cannot fill: of lines of one kind the first is written, the rest counted."""

import logging
import threading
import time
import warnings
from collections.abc import Callable

EVERY_S = 60.0
MOST_KINDS = 256
LONGEST_LINE = 300
OURS = "warpspace"


class RepeatedLines(logging.Filter):
    """Lets one line of a kind pass a minute; the next one says how many were left out.

    A kind is a logger, the first line of a message before its values are put in, and the type of
    what was raised. Libraries' tracebacks become one line; those of the app are kept.

    Parameters
    ----------
    clock : callable, optional
        Gives the time, s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        self._known: dict[tuple[str, str, str], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether a line is written; shorten and complete it."""
        raised = record.exc_info[0] if record.exc_info else None
        name = raised.__name__ if raised is not None else ""
        kind = (record.name, str(record.msg).partition("\n")[0], name)
        now = self._clock()
        with self._lock:
            since, left_out = self._known.get(kind, (None, 0))
            if since is not None and now - since < EVERY_S:
                self._known[kind] = (since, left_out + 1)
                return False
            if len(self._known) >= MOST_KINDS:
                self._known.clear()
            self._known[kind] = (now, 0)
        if not record.name.startswith(OURS):
            line = record.getMessage().partition("\n")[0]
            record.msg, record.args = line[:LONGEST_LINE] + (f" ({name})" if name else ""), ()
            record.exc_info = record.exc_text = record.stack_info = None
        if left_out:
            record.msg, record.args = f"{record.getMessage()} ({left_out} more before it)", ()
        return True


def limit_log() -> None:
    """Have all that the program logs to the terminal limited."""
    # names the file that a page has sent: another line, and another entry of a register, each time
    warnings.filterwarnings("ignore", message=r"\[viser\] Dropping upload")
    limit = RepeatedLines()
    for handler in (logging.lastResort, *logging.getLogger().handlers):
        if handler is not None:
            handler.addFilter(limit)
