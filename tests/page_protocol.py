"""What a page of the app and its server say to each other; for tests and benchmarks."""

from typing import Any

import msgspec.msgpack
import viser
import zstandard

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
