"""Hearing which tab a page is, and how wide, as soon as it is connected.

A page says so while it is still being put together; a session that asked for itself would have to
wait for an answer until the page has drawn what it got so far.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import viser
from viser import _messages as messages

from warpspace.app.server.tab_memory import ask_script

CARRIER = "warpspace-tab-token"
"""Stands for a widget in the message of a page; viser knows none of this name."""
LEAST_WIDTH, MOST_WIDTH = 200, 20_000
"""Widths of pages that are believed, CSS pixels."""
MOST_HEARD = 256
"""Pages that are remembered: one that says its token and never shows anything is forgotten."""


class Arrival:
    """Token and width of one page, once they are heard.

    Attributes
    ----------
    token : str
    width : float or None
        CSS pixels, whatever stands beside the drawing by now; None where the page does not say.
    """

    def __init__(self) -> None:
        self._there = threading.Event()
        self._told: Callable[[], None] | None = None
        self.token = ""
        self.width: float | None = None

    def hear(self, token: str, width: float | None = None) -> None:
        """Take note of a page; only the first time counts."""
        if self._there.is_set():
            return
        self.token, self.width = token, width
        self._there.set()
        if self._told is not None:
            self._told()

    @property
    def is_there(self) -> bool:
        """Whether the token is heard."""
        return self._there.is_set()

    def wait(self, seconds: float, told: Callable[[], None]) -> bool:
        """Wait for the token.

        Parameters
        ----------
        seconds : float
        told : callable
            Called when it comes later.

        Returns
        -------
        bool
            Whether it is heard.
        """
        self._told = told
        return self._there.wait(seconds)


class Arrivals:
    """What pages say of themselves on arrival.

    Parameters
    ----------
    server : viser.ViserServer
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._known: OrderedDict[int, Arrival] = OrderedDict()
        self._lock = threading.Lock()
        # viser hands on what widgets say only once the page has told of its camera
        connections: Any = server._websock_server  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
        connections.register_handler(messages.GuiUpdateMessage, self._hear)
        connections.queue_message(messages.RunJavascriptMessage(source=ask_script(CARRIER)))

    def expect(self, client_id: int) -> Arrival:
        """Give what is, or will be, known of a connection."""
        with self._lock:
            arrival = self._known.setdefault(client_id, Arrival())
            while len(self._known) > MOST_HEARD:
                self._known.popitem(last=False)
        return arrival

    def forget(self, client_id: int) -> None:
        """Drop what is known of a connection that has ended."""
        with self._lock:
            self._known.pop(client_id, None)

    def _hear(self, client_id: int, message: messages.GuiUpdateMessage) -> None:
        """Take the token out of a message, if it is one of these; a browser may send anything."""
        if message.uuid != CARRIER:
            return
        said: Any = message.updates
        if not isinstance(said, dict):
            return
        token, width = said.get("value"), said.get("width")
        if isinstance(token, str):
            if not isinstance(width, int | float) or not LEAST_WIDTH <= width <= MOST_WIDTH:
                width = None
            self.expect(client_id).hear(token, width)
