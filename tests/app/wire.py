"""A client of viser without a browser: what a page sends, and what the app sends to it."""

import re
import secrets
from collections.abc import Callable
from typing import Any

import msgspec.msgpack
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

from warpspace.app.browser.arrivals import CARRIER
from warpspace.app.browser.opening import stage_script
from warpspace.app.server.viewer import Viewer
from warpspace.machine.parameters import PARAMETERS

OPEN = stage_script("open")
"""The script by which a page learns that it has all."""
PROTOCOL = f"viser-v{viser.__version__}"
HOW: dict[str, Any] = {"subprotocols": [PROTOCOL], "max_size": None, "compression": None}
"""How a page connects: arguments of `connect` of the package `websockets`."""
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (30.0, -30.0, 30.0),
    "fov": 0.4,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 900,
    "image_width": 1600,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
"""What a page says first, once it is connected: where its camera stands."""
pack = msgspec.msgpack.encode


def unpack(raw: str | bytes) -> list[dict[str, Any]]:
    """Read the messages of one frame: two sizes of eight bytes, then what zstandard has packed."""
    assert isinstance(raw, bytes)
    size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
    text = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
    return msgspec.msgpack.decode(text)["messages"]


def update(uuid: object, updates: object) -> dict[str, Any]:
    """Write the message by which a page changes a widget."""
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


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
        while not fine():
            try:
                raw = self._socket.recv(timeout=seconds)
            except TimeoutError:
                return False
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
