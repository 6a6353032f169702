"""Cache of slow functions, and a lock for slow work, shared by all sessions."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Generator, Hashable
from contextlib import contextmanager
from typing import Generic, TypeVar

T = TypeVar("T")


class Cache(Generic[T]):
    """Latest results of slow functions, up to a number of bytes."""

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        self._items: OrderedDict[Hashable, tuple[T, int]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable, build: Callable[[], T], size: Callable[[T], int]) -> T:
        with self._lock:
            if key in self._items:
                self._items.move_to_end(key)
                return self._items[key][0]
        value = build()
        with self._lock:
            value, _ = self._items.setdefault(key, (value, size(value)))  # another may be first
            while (
                len(self._items) > 1 and sum(n for _, n in self._items.values()) > self.limit_bytes
            ):
                self._items.popitem(last=False)
        return value


# --- Slow work of all tabs: one job at a time, so that sliders stay responsive --------------------

POLL_S = 0.1
_TURN = threading.Lock()


@contextmanager
def exclusive_work(watch: Callable[[], object]) -> Generator[None]:
    """Wait for the end of other slow work; `watch` raises when the job is cancelled."""
    while not _TURN.acquire(timeout=POLL_S):
        watch()
    try:
        yield
    finally:
        _TURN.release()
