"""A page without a browser on an app of this process, whose messages a test reads one by one."""

import secrets
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from websockets.sync.client import ClientConnection, connect

from page_client import CAMERA, HOW, Page, pack, said, unpack
from warpspace.app.browser import actions as do
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.scene.model import Scene


def dial(viewer: Viewer) -> ClientConnection:
    """Connect to the app, and say nothing yet."""
    return connect(viewer.url.replace("http", "ws", 1), **HOW)


class Wire(Page):
    """A page that shows nothing and remembers what it was sent."""

    def __init__(self, socket: ClientConnection, tab: str = "") -> None:
        super().__init__()
        self.socket = socket
        self.kinds: list[str] = []
        self.say(do.TabHere(tab or secrets.token_hex(16)))
        self.send(CAMERA)

    def send(self, message: dict[str, Any]) -> None:
        self.socket.send(pack(message))

    def say(self, action: object) -> None:
        self.send(said(action))

    def read_until(self, fine: Callable[[], bool], seconds: float = 20.0) -> bool:
        """Read until something holds; tell whether it did before nothing came any more."""
        heard = time.monotonic()
        while not fine():
            try:
                raw = self.socket.recv(timeout=0.1)
            except TimeoutError:  # what is waited for may come without a message
                if time.monotonic() - heard > seconds:
                    return fine()
                continue
            heard = time.monotonic()
            for message in unpack(raw):
                self.kinds.append(message["type"])
                self.take(message)
        return True

    @property
    def is_open(self) -> bool:
        return self.stage == "open"


def end_work(viewer: Viewer) -> None:
    """End what an app does for its pages: viser warns of what is done once it has stopped."""
    sessions = viewer.sessions
    for session in sessions:
        session.stop()
    for session in sessions:
        while session.worker.ident is None:  # a page may have come just now
            time.sleep(0.01)
        session.worker.join(60.0)


@contextmanager
def opened(scene: Scene, **how: Any) -> Generator[tuple[Wire, Session]]:
    """Open a page on an app of its own; give it and its session."""
    with Viewer(scene, **how) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: wire.is_open, seconds=60.0)
        (session,) = viewer.sessions
        yield wire, session
        end_work(viewer)
