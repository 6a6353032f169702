"""Sudden ends: Ctrl-C, a request to terminate and a closed terminal clean up before they end."""

import os
import signal
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_PATIENCE_S = 1.0
"""A signal that comes again sooner is taken for the same one: some programs send it twice."""


class Ended(KeyboardInterrupt):
    """A signal that ends the program.

    A class of its own: where a plain KeyboardInterrupt has passed through `exec`, as it does while
    packages are imported, Python ends itself with SIGINT at last, whatever the exit status said.
    """


class Ending:
    """What a signal asked for.

    Attributes
    ----------
    number : int
        Of the first signal; 0 as long as there was none.
    """

    def __init__(self) -> None:
        self.number = 0
        self._since = 0.0

    @property
    def status(self) -> int:
        """Exit status of a process that a signal ended, as shells count."""
        return 128 + (self.number or signal.SIGINT)

    @property
    def word(self) -> str:
        """What the user is told."""
        return "interrupted" if self.number in (0, signal.SIGINT) else "terminated"

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Kill the renderers and leave the work begun; the second time end without cleaning up."""
        del frame
        if self.number:
            if time.monotonic() - self._since > _PATIENCE_S:
                os._exit(self.status)
            return
        self.number, self._since = number, time.monotonic()
        processes = sys.modules.get("warpspace.outputs.processes")
        if processes is not None:  # a command that draws nothing need not load it
            processes.kill_pools()
        raise Ended


@contextmanager
def handle_signals() -> Generator[Ending]:
    """Let signals that end the program raise `Ended`, so that files are cleaned up.

    Yields
    ------
    Ending
        Which signal came, if any.
    """
    ending = Ending()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            # nohup, and shells in front of a command in the background, have one ignored
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, ending.handle)
    try:
        yield ending
    finally:
        if not ending.number:
            for number, handler in before.items():
                signal.signal(number, handler)
