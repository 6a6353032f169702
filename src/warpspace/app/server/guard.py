"""Puts the app's checks and limits around viser's server: each request, connection and message."""

import asyncio
import contextlib
import logging
import time
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.http11 import Request, Response

from warpspace.app.server.doors import Asked, Doors, Refusal, plain_address

logger = logging.getLogger(__name__)
HEADERS = {
    "X-Frame-Options": "DENY",
    # a page that talks to another server would run its scripts as the app's own
    "Content-Security-Policy": "frame-ancestors 'none'; connect-src 'self' data: blob:",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
}
"""Sent with each answer: no other page may show the app inside itself, or learn its address."""


@dataclass(frozen=True)
class Limits:
    """How much is taken at once.

    Parameters
    ----------
    sessions : int
        Tabs that are open at the same time.
    message_bytes : int
        Largest message of a page: a picture of the view. A part of an upload has 0.5 MB.
    messages_per_second : float
        Of one connection, on average. A page sends 20 a second for each group of widgets in use.
    burst : int
        Messages that may come at once.
    """

    sessions: int = 64
    message_bytes: int = 16 * 2**20
    messages_per_second: float = 400.0
    burst: int = 2000


LIMITS = Limits()


class Rate:
    """Counts messages against a rate that may be exceeded for a moment.

    Parameters
    ----------
    per_second : float
    burst : int
    clock : callable, optional
        Gives the time in seconds.
    """

    def __init__(
        self, per_second: float, burst: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_second, self._burst, self._clock = per_second, burst, clock
        self._left, self._last = float(burst), clock()

    def take(self) -> bool:
        """Count a message; False where it is one too many."""
        now = self._clock()
        self._left = min(self._burst, self._left + (now - self._last) * self._per_second)
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class OnceLog:
    """Logs the first of each kind of refusal, so that nobody can fill the log."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def warn(self, kind: str, text: str, who: object) -> None:
        """Log a refusal, if it is the first of its kind."""
        if kind not in self._known:
            self._known.add(kind)
            logger.warning("refused %s: %s (further ones are not logged)", who, text)


class LimitedConnection(ServerConnection):
    """A websocket that is closed, with a reason, when too much comes in by it."""

    _rate: Rate
    _log: OnceLog
    _closing: "asyncio.Task[None] | None" = None

    def limit(self, limits: Limits, log: OnceLog) -> None:
        """Set what is too much."""
        self._rate = Rate(limits.messages_per_second, limits.burst)
        self._log = log
        self._words = f"more than {limits.messages_per_second:g} messages a second"

    def abort(self) -> None:
        """Cut the connection: nothing more is sent, and nothing is waited for."""
        if hasattr(self, "transport"):  # it is there from the first byte on
            self.transport.abort()

    async def recv(self, decode: bool | None = None) -> Any:
        """Receive a message; one too many ends the connection."""
        try:
            while True:
                message = await super().recv(decode)
                if self._closing is None and self._rate.take():
                    return message
                if self._closing is None:
                    self._log.warn("rate", self._words, self.remote_address)
                    # what still arrives until the other side has closed as well is dropped
                    self._closing = asyncio.ensure_future(
                        self.close(CloseCode.POLICY_VIOLATION, self._words)
                    )
        except ConnectionClosed as closed:
            if closed.sent is not None and closed.sent.code == CloseCode.MESSAGE_TOO_BIG:
                self._log.warn("size", f"a message too large, {closed.sent}", self.remote_address)
            raise


class Guard:
    """Checks each request before viser answers it, and limits each connection.

    Parameters
    ----------
    doors : Doors
    limits : Limits, optional
    """

    def __init__(self, doors: Doors, limits: Limits = LIMITS) -> None:
        self._doors, self._limits = doors, limits
        self._log = OnceLog()
        self._connections = weakref.WeakSet[LimitedConnection]()

    def cut(self) -> None:
        """Cut the connections that there are; to be called from another thread than theirs."""
        for connection in tuple(self._connections):
            with contextlib.suppress(RuntimeError):  # the event loop has ended with all of them
                connection.loop.call_soon_threadsafe(connection.abort)

    def options(self, theirs: dict[str, Any]) -> dict[str, Any]:
        """Give the options that a server of `websockets` starts with, from those viser has.

        Parameters
        ----------
        theirs : dict
            Keyword arguments of `websockets.asyncio.server.serve`.
        """
        answer = theirs["process_request"]

        def process_request(connection: ServerConnection, request: Request) -> Any:
            refusal = self._check(connection, request)
            if refusal is None:
                return answer(connection, request)
            self._log.warn(refusal.kind, refusal.text, connection.remote_address)
            return connection.respond(refusal.status, refusal.text + "\n")

        def process_response(
            connection: ServerConnection, request: Request, response: Response
        ) -> None:
            for name, value in HEADERS.items():
                response.headers[name] = value
            if response.status_code < HTTPStatus.BAD_REQUEST:
                cookie = self._doors.cookie(_asked(connection, request))
                if cookie is not None:
                    response.headers["Set-Cookie"] = cookie

        def create_connection(*args: Any, **kwargs: Any) -> LimitedConnection:
            connection = LimitedConnection(*args, **kwargs)
            connection.limit(self._limits, self._log)
            self._connections.add(connection)
            return connection

        return {
            **theirs,
            "process_request": process_request,
            "process_response": process_response,
            "create_connection": create_connection,
            "max_size": self._limits.message_bytes,
        }

    def _check(self, connection: ServerConnection, request: Request) -> Refusal | None:
        """Tell why a request is refused."""
        refusal = self._doors.check(_asked(connection, request))
        if refusal is not None:
            return refusal
        if len(connection.server.connections) < self._limits.sessions:
            return None
        return Refusal(
            "sessions",
            f"{self._limits.sessions} tabs have the app open, which is all it takes at once:"
            " close one and try again.",
            HTTPStatus.SERVICE_UNAVAILABLE,
        )


def _asked(connection: ServerConnection, request: Request) -> Asked:
    """Read a request."""
    return Asked(request.path, request.headers, plain_address(str(connection.local_address[0])))
