"""Checks and limits around viser's server, for each request, connection and message."""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from warpspace.app.browser.incoming import Events, read_message
from warpspace.app.server.request_policy import Refusal, RequestPolicy, plain_address

logger = logging.getLogger(__name__)
HEADERS = {
    "X-Frame-Options": "DENY",
    # viser's page is one file of scripts and styles; it unpacks itself, runs the scripts it is sent
    # and starts workers. Scripts of another server would run as the app's own.
    "Content-Security-Policy": "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'"
    " blob:; worker-src 'self' blob:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:;"
    " font-src 'self' data:; connect-src 'self' data: blob:; object-src 'none'; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
}
"""Sent with each response: no other page may embed the app or learn its address."""


@dataclass(frozen=True)
class Limits:
    sessions: int = 64  # open tabs
    # largest message of a page: a picture of the view. A file has 15.5 MB at most.
    message_bytes: int = 16 * 2**20
    messages_per_second: float = 400.0  # of one connection, on average; a page sends 50
    burst: int = 2000  # messages that may come at once


LIMITS = Limits()
FAREWELL_S = 0.5  # for a page to close its connection; some do not read any more
MOST_EARLY = 4  # messages of a page that are stored until its session exists


class Rate:
    """Counts messages against a rate that may be exceeded for a moment."""

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self._limits, self._clock = limits, clock
        self._left, self._last = float(limits.burst), clock()

    def take(self) -> bool:
        """Count a message; False above the limit."""
        now = self._clock()
        refilled = self._left + (now - self._last) * self._limits.messages_per_second
        available, self._last = min(self._limits.burst, refilled), now
        is_taken = available >= 1.0
        self._left = available - is_taken
        return is_taken


class Guard:
    """Checks each request before viser answers it, and limits each connection."""

    def __init__(self, policy: RequestPolicy, limits: Limits = LIMITS) -> None:
        self.limits, self._policy = limits, policy
        self._logged: set[str] = set()

    def warn(self, kind: str, text: str, client: object) -> None:
        """Log the first refusal of its kind, so that no client can fill the log."""
        if kind not in self._logged:
            self._logged.add(kind)
            logger.warning("refused %s: %s (further ones are not logged)", client, text)

    def options(self, viser_options: dict[str, Any]) -> dict[str, Any]:

        def process_request(connection: ServerConnection, request: Request) -> Any:
            refusal = self._check(connection, request)
            if refusal is None:
                return viser_options["process_request"](connection, request)
            self.warn(refusal.kind, refusal.text, connection.remote_address)
            return connection.respond(refusal.status, refusal.text + "\n")

        def process_response(_: ServerConnection, request: Request, response: Response) -> None:
            response.headers.update(HEADERS)
            if response.status_code < HTTPStatus.BAD_REQUEST:
                cookie = self._policy.cookie(request)
                if cookie is not None:
                    response.headers["Set-Cookie"] = cookie

        def create_connection(*args: Any, **kwargs: Any) -> TabConnection:
            connection = TabConnection(*args, **kwargs)
            connection.start(self)
            return connection

        return {
            **viser_options,
            "process_request": process_request,
            "process_response": process_response,
            "create_connection": create_connection,
            "max_size": self.limits.message_bytes,
            "close_timeout": FAREWELL_S,
        }

    def _check(self, connection: ServerConnection, request: Request) -> Refusal | None:
        refusal = self._policy.check(request, plain_address(str(connection.local_address[0])))
        limit = self.limits.sessions
        if refusal is not None or len(connection.server.connections) < limit:
            return refusal
        return Refusal(
            "sessions",
            f"{limit} tabs are open, which is the limit: close one and try again.",
            HTTPStatus.SERVICE_UNAVAILABLE,
        )


class TabConnection(ServerConnection):
    """A websocket that validates the messages of a page and closes above the message rate.

    Events of the page's own scripts go to its session, all other valid messages to viser.
    """

    def start(self, guard: Guard) -> None:
        self._guard = guard
        self._rate = Rate(guard.limits)
        self._closing: asyncio.Task[None] | None = None
        self._early: list[Events] = []
        self._take: Callable[[Events], None] | None = None

    def listen(self, take: Callable[[Events], None]) -> None:
        """Pass events of the page's scripts to a callback, including those received so far."""
        self._take = take
        for events in self._early:
            take(events)

    async def recv(self, decode: bool | None = None) -> Any:
        while True:
            try:
                raw = await super().recv(decode)
            except ConnectionClosed as closed:
                if closed.sent is not None and closed.sent.code == CloseCode.MESSAGE_TOO_BIG:
                    reason = f"a message too large, {closed.sent}"
                    self._guard.warn("size", reason, self.remote_address)
                raise
            if self._closing is not None:
                continue  # until the other side has closed as well
            if not self._rate.take():
                reason = f"more than {self._guard.limits.messages_per_second:g} messages a second"
                self._guard.warn("rate", reason, self.remote_address)
                closing = self.close(CloseCode.POLICY_VIOLATION, reason)
                self._closing = asyncio.ensure_future(closing)
                continue
            message = read_message(raw)
            if not isinstance(message, Events):
                if message is not None:
                    return raw
            elif self._take is not None:
                self._take(message)
            elif len(self._early) < MOST_EARLY:
                self._early.append(message)
