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

    def __enter__(self) -> None:
        with self._inner:
            if not self._taken:
                self._taken = True
                return
            mine = threading.Lock()
            mine.acquire()
            self._waiting.append(mine)
        mine.acquire()  # until whoever has the turn hands it over

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._inner:
            if self._waiting:
                self._waiting.popleft().release()
            else:
                self._taken = False
