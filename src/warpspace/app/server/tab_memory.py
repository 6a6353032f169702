"""Which browser tab is which: what a dropped tab leaves behind, and how it is known again.

viser numbers connections, not tabs: after a dropped connection the page connects anew and counts as
a new client. The page therefore keeps a random token in its `sessionStorage`, which belongs to one
tab and survives a reload, and hands it over after connecting. What a tab leaves behind is kept for
a while under its token.

Limits: a page whose browser forbids `sessionStorage`, and a tab that was closed and opened anew,
start afresh; after `KEPT_SECONDS`, or when more than `KEPT_TABS` tabs have left, the oldest are
forgotten; a restarted server knows no one. What the page itself keeps (`tab_keeper.py`) then helps.
"""

import re
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from warpspace.app.drawing.camera import CameraMemory
from warpspace.app.state.store import StateStore

KEPT_SECONDS = 600.0
KEPT_TABS = 64
_TOKEN = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True, slots=True)
class TabRecord:
    """What a tab leaves behind."""

    store: StateStore  # state and history
    camera: CameraMemory | None


class TabMemory:
    """Keeps what tabs leave behind, bounded in time and number; usable from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._cache: OrderedDict[str, tuple[float, TabRecord]] = OrderedDict()
        self._lock = threading.Lock()

    def keep(self, token: str, left: TabRecord) -> None:
        """Keep what a tab leaves behind."""
        if not is_token(token):
            return
        with self._lock:
            self._cache.pop(token, None)
            self._cache[token] = (self._clock() + KEPT_SECONDS, left)
            while len(self._cache) > KEPT_TABS:
                self._cache.popitem(last=False)
            self._forget()

    def take(self, token: str) -> TabRecord | None:
        """Give back what a tab has left behind, once; None where there is nothing."""
        with self._lock:
            self._forget()
            found = self._cache.pop(token, None)
        return None if found is None else found[1]

    def __len__(self) -> int:
        """Count the tabs that are remembered."""
        with self._lock:
            self._forget()
            return len(self._cache)

    def _forget(self) -> None:
        now = self._clock()
        for token in [token for token, (until, _) in self._cache.items() if until < now]:
            del self._cache[token]


def new_token() -> str:
    """Make a token that nobody guesses."""
    return secrets.token_hex(16)


def is_token(text: str) -> bool:
    """Tell whether a text that a browser has sent may be a token."""
    return _TOKEN.fullmatch(text) is not None
