"""A lock that serves in the order of asking.

`threading.Lock` lets anybody who comes by at the right moment overtake those who wait. Twenty tabs
that drag at once would then wait for very different times.
"""

import threading
from collections import deque
from types import TracebackType


class Turns:
    """Mutual exclusion, first come, first served; not reentrant."""

    def __init__(self) -> None:
        self._inner = threading.Lock()
        self._taken = False
        self._waiting: deque[threading.Lock] = deque()

    def ask(self) -> threading.Lock:
        """Stand in line; give a lock that can be acquired when it is one's turn."""
        mine = threading.Lock()
        with self._inner:
            if self._taken:
                mine.acquire()
                self._waiting.append(mine)
            self._taken = True
        return mine

    def __enter__(self) -> None:
        self.ask().acquire()  # until whoever has the turn hands it over

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.hand_on()

    def hand_on(self) -> None:
        """End one's turn."""
        with self._inner:
            if self._waiting:
                self._waiting.popleft().release()
            else:
                self._taken = False
