"""Clients of bad will: messages that mean nothing, events for nobody, floods, files in pieces."""

import asyncio
import base64
import contextlib
import secrets
from collections.abc import AsyncGenerator

import websockets

from page_client import CAMERA, App, dial, pack, said

TAG = "<img src=x onerror='window.taken=1'><script>window.taken=1</script>"
NAN, HUGE = float("nan"), 10**18
VALUES = (
    "", "NaN", "1e309", "-inf", "9" * 9999, "−1,5", "true", "[]", "{}", "null", "\0", TAG,
    "../../etc/passwd", "X=1e9", "x" * 20_000, "1 2 3\n" * 3000,
)  # fmt: skip
"""What an event may hold."""
PATHS = (
    "component", "exaggeration", "nodes", "positions.B", "positions.QQQ", "look.surface", "notes",
    "look.slices_mm.X", "shown.dark", "specification.limit_um", "machine.linear_mm.X", "scene",
    "__class__", "amplitudes.EXX", "page.task", "page.open", "", ".", "look.", "a." * 70,
)  # fmt: skip
WORDS = (
    "open", "close", "fold", "task", "undo", "redo", "toggle", "run", "cancel", "apply", "preview",
    "save", "report", "share", "link", "export", "view", "row", "only", "exclude", "find",
    "file", "set.value", "set.EXX", "set.QQQ", "set.__class__", "set.", "", ":", TAG,
)  # fmt: skip


def events(parts: list[str]) -> list[tuple[str, str]]:
    """Give events that no page sends: to every part every word, and every path, with any value."""
    names = [f"{part}:{word}" for part in (*parts, "nobody", TAG, "") for word in WORDS]
    names += [f"state:set.{path}" for path in PATHS]
    return [
        (name, VALUES[(number + turn) % len(VALUES)])
        for turn in range(3)
        for number, name in enumerate(names)
    ]


def carried() -> list[bytes]:
    """Give messages of events that no page sends."""
    events = [
        "", {}, None, [[]], [[1]], [[1, "page:undo", ""]], [["page:undo", None]], [[1, 2]],
        [[NAN, "page:undo"]], [["page:undo", [["page:undo", ""]]]], [["no colon", ""]],
        [[f"a:{'b' * 200}", ""]], [["errors:set.EXX", "9" * 20_001]], [["page:undo", ""]] * 17,
        [["page:undo", ""], ["page:undo"]],
    ]  # fmt: skip
    found = [pack({"type": "WarpspaceEvents", "events": one}) for one in events]
    return [*found, pack({"type": "WarpspaceEvents"}), pack({**said(("a:b", "")), "extra": 1})]


def camera(**fields: object) -> bytes:
    return pack({**CAMERA, **fields})


def nonsense() -> list[bytes]:
    """One message of every kind that the app has no use for."""
    vectors = ((NAN,) * 3, (1e300,) * 3, (0.0,) * 9, "x", None)
    return [
        *carried(),
        *(camera(position=value) for value in vectors),
        camera(fov=NAN), camera(image_width=HUGE), camera(image_height=-5), camera(extra=1),
        pack({"type": "ScenePointerMessage", "event_type": "click"}),
        pack({"type": "ScenePointerMessage", "event_type": "click", "ray_origin": None,
              "ray_direction": [NAN] * 3, "screen_pos": [], "modifier": {}}),
        pack({"type": "SceneNodeClickMessage", "name": []}),
        pack({"type": "SceneNodeDragMessage", "name": "/box", "phase": 3}),
        pack({"type": "GuiFormDirtyMessage", "uuid": "x" * 1000}),
        pack({"type": "GuiFormSubmitMessage", "uuid": []}),
        pack({"type": "GuiButtonHoldMessage", "uuid": "a", "frequency": NAN}),
        pack({"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": "x"}}),
        pack({"type": "CommandTriggerMessage", "uuid": {}}),
        pack({"type": "FileTransferStartUpload", "source_component_uuid": "a",
              "transfer_uuid": "b", "filename": "s.toml", "mime_type": "", "part_count": 1,
              "size_bytes": 900}),
        pack({"type": "FileTransferPart", "source_component_uuid": None, "transfer_uuid": "b",
              "part_index": 0, "content": b"text"}),
        pack({"type": "GetRenderResponseMessage", "payload": [], "render_uuid": 1}),
        pack({"type": "ShareUrlRequest"}), pack({"type": "RunJavascriptMessage", "source": "x"}),
        pack({"type": []}), pack({"type": "Message"}), pack({}), pack([]), pack(None), pack("type"),
        b"", b"\xc1", b"\xff" * 100, b"\x91" * 100_000, b"\x82\xa4type\xdd\xff\xff\xff\xff",
        camera()[:-9], secrets.token_bytes(1000),
    ]  # fmt: skip


def upload(name: str, content: bytes) -> tuple[str, str]:
    coded = base64.b64encode(content).decode()
    return "files:file", f"{len(content)}\n{name}\n{coded}"


@contextlib.asynccontextmanager
async def connected(app: App) -> AsyncGenerator[websockets.ClientConnection]:
    """Connect; leave without a word, also where the app has closed the connection before."""
    socket = await dial(app)
    try:
        with contextlib.suppress(websockets.ConnectionClosed):
            yield socket
    finally:
        socket.transport.abort()
        await socket.wait_closed()


async def send_all(app: App, messages: list[bytes]) -> None:
    """Send messages as fast as they are taken, over a new connection where the last was closed."""
    waiting = iter(messages)
    for message in waiting:
        async with connected(app) as socket:
            await socket.send(message)
            for later in waiting:
                await socket.send(later)


async def steadily(socket: websockets.ClientConnection, messages: list[bytes]) -> None:
    """Send messages no faster than a client may, so that the connection is kept."""
    for begin in range(0, len(messages), 30):
        for message in messages[begin : begin + 30]:
            await socket.send(message)
        await asyncio.sleep(0.12)
