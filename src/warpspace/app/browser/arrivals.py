"""Learning which tab a page is, and how wide, as soon as it is connected.

A page says so while it is still being put together; a session that asked for itself would have to
wait for an answer until the page has drawn what it got so far.
"""

import json
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import viser

from warpspace.app.browser.page import script_source
from warpspace.app.browser.viser_private import listen_to_all, send_script_to_all

CARRIER = "warpspace-tab-token"
"""Stands for a widget in the message of a page; viser knows none of this name."""
LEAST_WIDTH, MOST_WIDTH = 200, 20_000
"""Widths of pages that are believed, CSS pixels."""
MOST_KNOWN = 256
"""Pages that are remembered: one that says its token and never shows anything is forgotten."""


class Arrival:
    """Token and width of one page, once they are known."""

    def __init__(self) -> None:
        self._there = threading.Event()
        self._called: Callable[[], None] | None = None
        self.token = ""
        self.width: float | None = None

    def note(self, token: str, width: float | None = None) -> None:
        """Take note of a page; only the first time counts."""
        if self._there.is_set():
            return
        self.token, self.width = token, width
        self._there.set()
        if self._called is not None:
            self._called()

    @property
    def is_there(self) -> bool:
        """Whether the token is known."""
        return self._there.is_set()

    def wait(self, seconds: float, called: Callable[[], None]) -> bool:
        """Wait for the token."""
        self._called = called
        return self._there.wait(seconds)


class Arrivals:
    """What pages say of themselves on arrival."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._known: OrderedDict[int, Arrival] = OrderedDict()
        self._lock = threading.Lock()
        listen_to_all(server, self._take)
        send_script_to_all(server, ask_script(CARRIER))

    def expect(self, client_id: int) -> Arrival:
        """Give what is, or will be, known of a connection."""
        with self._lock:
            arrival = self._known.setdefault(client_id, Arrival())
            while len(self._known) > MOST_KNOWN:
                self._known.popitem(last=False)
        return arrival

    def forget(self, client_id: int) -> None:
        """Drop what is known of a connection that has ended."""
        with self._lock:
            self._known.pop(client_id, None)

    def _take(self, client_id: int, widget: str, said: Any) -> None:
        if widget != CARRIER or not isinstance(said, dict):
            return
        token, width = said.get("value"), said.get("width")
        if isinstance(token, str):
            if not isinstance(width, int | float) or not LEAST_WIDTH <= width <= MOST_WIDTH:
                width = None
            self.expect(client_id).note(token, width)


def ask_script(carrier: str) -> str:
    """Write the script that makes a page hand over its token, and its width in CSS pixels."""
    return f"{script_source('arrivals.js').rstrip()}({json.dumps(carrier)});"


def rename_script(token: str) -> str:
    """Write the script that gives a page another token (a duplicated tab comes with a copy)."""
    return f"warpspaceRename({json.dumps(token)});"
