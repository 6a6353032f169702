"""A page without a browser that remembers what it is sent."""

import re
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from websockets.sync.client import ClientConnection, connect

from page_protocol import CAMERA, HOW, pack, unpack, update
from warpspace.app.browser.arrivals import CARRIER
from warpspace.app.browser.page import stage_script
from warpspace.app.server.session import Session
from warpspace.app.server.viewer import Viewer
from warpspace.machine.axes import PARAMETERS
from warpspace.scene.model import Scene

OPEN = stage_script("open")
"""The script by which a page learns that it has all."""


def dial(viewer: Viewer) -> ClientConnection:
    """Connect to the app, and say nothing yet."""
    return connect(viewer.url.replace("http", "ws", 1), **HOW)


class Wire:
    """A page that shows nothing and remembers what it was sent."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.kinds: list[str] = []
        self.labels: list[str] = []
        self.scripts: list[str] = []
        self.messages: list[dict[str, Any]] = []
        self.widgets: dict[str, str] = {}
        self.chosen: list[str] = []
        self.update(CARRIER, secrets.token_hex(16))
        self.send(CAMERA)

    def send(self, message: dict[str, Any]) -> None:
        self._socket.send(pack(message))

    def update(self, uuid: str, value: object) -> None:
        self.send(update(uuid, {"value": value}))

    def read_until(self, fine: Callable[[], bool], seconds: float = 20.0) -> bool:
        """Read until something holds; tell whether it did before nothing came any more."""
        heard = time.monotonic()
        while not fine():
            try:
                raw = self._socket.recv(timeout=0.1)
            except TimeoutError:  # what is waited for may come without a message
                if time.monotonic() - heard > seconds:
                    return fine()
                continue
            heard = time.monotonic()
            for message in unpack(raw):
                self._take(message)
        return True

    def _take(self, message: dict[str, Any]) -> None:
        self.messages.append(message)
        self.kinds.append(message["type"])
        label = message.get("props", {}).get("label") if "props" in message else None
        if isinstance(label, str):
            self.labels.append(label)
            self.widgets.setdefault(label.split(" ")[0], message["uuid"])
        if isinstance(value := message.get("updates", {}).get("value"), str):
            self.chosen.append(value)
        if isinstance(value := message.get("value"), str):
            self.chosen.append(value)
        if message["type"] == "RunJavascriptMessage":
            self.scripts.append(message["source"])

    @property
    def keys(self) -> set[str]:
        """Keys of the errors that have a slider; those of tolerances do not count."""
        return {label.split(" ")[0] for label in self.labels if "±" not in label} & set(PARAMETERS)

    @property
    def question(self) -> tuple[str, str]:
        """The latest question whether all is drawn: widget and number."""
        found = re.findall(
            r'requestAnimationFrame|uuid: "([^"]+)", updates: \{ value: "(\d+)" \}',
            "".join(self.scripts),
        )
        return [pair for pair in found if pair[0]][-1]


def end_work(viewer: Viewer) -> None:
    """End what an app does for its pages: viser warns of what is done once it has stopped."""
    sessions = viewer.sessions
    for session in sessions:
        session.stop()
    for session in sessions:
        session._worker._started.wait(60.0)  # a page may have come just now
        session._worker.join(60.0)


@contextmanager
def opened(scene: Scene, **how: Any) -> Iterator[tuple[Wire, Session, dict[str, Any]]]:
    """Open a page on an app of its own; give it, its session and its panels by their class."""
    with Viewer(scene, **how) as viewer, dial(viewer) as socket:
        wire = Wire(socket)
        assert wire.read_until(lambda: OPEN in wire.scripts, seconds=60.0)
        (session,) = viewer.sessions
        yield wire, session, {type(panel).__name__: panel for panel in session.display.panels}
        end_work(viewer)
