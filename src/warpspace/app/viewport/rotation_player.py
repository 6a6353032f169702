"""Play and pause of a rotation: a clock of its own that stops with its session."""

import threading
import time
from collections.abc import Callable

RATE_HZ = 8.0
"""Pictures a second: modest, since each is sent to the page."""
SPEED_DEG_S = 30.0
FULL_TURN_DEG = 360.0


class Player:
    """Turns an angle on while it plays.

    Parameters
    ----------
    ask : callable
        Called from the player's own thread when a picture is due; it must return at once.
    """

    def __init__(self, ask: Callable[[], None]) -> None:
        self._ask = ask
        self._lock = threading.Lock()
        self._cancel: threading.Event | None = None
        self._angle = 0.0

    @property
    def playing(self) -> bool:
        """Whether it turns."""
        return self._cancel is not None

    @property
    def angle_deg(self) -> float:
        """How far it has turned, degrees, 0 … 360."""
        return self._angle

    def play(self) -> None:
        """Turn on from where it was paused; one thread at a time."""
        with self._lock:
            if self._cancel is not None:
                return
            cancel = threading.Event()
            self._cancel = cancel
        threading.Thread(
            target=self._run, args=(cancel,), name="warpspace-rotation", daemon=True
        ).start()

    def pause(self) -> None:
        """Stand still."""
        with self._lock:
            cancel, self._cancel = self._cancel, None
        if cancel is not None:
            cancel.set()

    def rewind(self) -> bool:
        """Stand still where the play began; tell whether there was anything to take back."""
        moved = self.playing or self._angle != 0.0
        self.pause()
        self._angle = 0.0
        return moved

    def _run(self, cancel: threading.Event) -> None:
        """Turn at a steady rate until cancelled; time lost is skipped, not made up for."""
        before = time.monotonic()
        while not cancel.wait(1.0 / RATE_HZ):
            now = time.monotonic()
            self._angle = (self._angle + SPEED_DEG_S * min(now - before, 0.5)) % FULL_TURN_DEG
            before = now
            self._ask()
