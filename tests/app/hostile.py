"""Clients of bad will: messages that mean nothing, events for nobody, floods, files in pieces."""

import asyncio
import base64
import contextlib
import json
import secrets
from collections.abc import AsyncGenerator

import websockets

from page_client import CAMERA, App, dial, pack, update

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


def carried(widget: str) -> list[bytes]:
    """Give messages that the carrier of events may not hold."""
    texts = [
        "", "[]", "{}", "null", "[[]]", "[[1]]", '[[1, "page:undo"]]', '[["1", "page:undo", ""]]',
        '[[1, "page:undo", null]]', '[[1, 2, 3]]', '[[NaN, "page:undo", ""]]', "[" * 100_000,
        '[[1e309, "page:undo", ""]]', '[[-1, "page:undo", ""]]',
        json.dumps([[1, "no colon", ""]]), json.dumps([[1, f"a:{'b' * 200}", ""]]),
        json.dumps([[1, "errors:set.EXX", "9" * 20_001]]), '[[1, "page:undo", ""]',
    ]  # fmt: skip
    return [pack(update(widget, {"value": text})) for text in texts]


def camera(**fields: object) -> bytes:
    """Write a message of a camera."""
    return pack({**CAMERA, **fields})


def nonsense(widgets: list[str]) -> list[bytes]:
    """One message of every kind that the app has no use for."""

    def set_(uuid: object, updates: object) -> bytes:
        return pack(update(uuid, updates))

    values = [
        [], {}, None, "x", NAN, float("inf"), HUGE, -1e300, b"\0", [1] * 99, [[[]]], "9" * 9999,
    ]  # fmt: skip
    names = ["uuid", "parent_container_id", "props", "removed", "update_cb", "gui_api", "value_"]
    known = [set_(uuid, {name: []}) for uuid in widgets for name in names]
    known += [set_(uuid, {"value": value}) for uuid in widgets for value in values]
    known += [set_(uuid, {"value": 1.0, "uuid": "x"}) for uuid in widgets]
    return [
        *known,
        *(set_(uuid, {"value": 1.0}) for uuid in ([], {}, None, 7, "unknown", "x" * 99_999)),
        *(set_(widgets[0], updates) for updates in ([], None, "x", {"value": "x" * 7_000_000})),
        *(camera(position=value) for value in ((NAN,) * 3, (1e300,) * 3, (0.0,) * 9, "x", None)),
        camera(fov=NAN), camera(image_width=HUGE), camera(image_height=-5), camera(extra=1),
        pack({"type": "ScenePointerMessage", "event_type": "click"}),
        pack({"type": "ScenePointerMessage", "event_type": "click", "ray_origin": None,
              "ray_direction": [NAN] * 3, "screen_pos": [], "modifier": {}}),
        pack({"type": "SceneNodeClickMessage", "name": []}),
        pack({"type": "SceneNodeDragMessage", "name": "/box", "phase": 3}),
        pack({"type": "GuiFormDirtyMessage", "uuid": "x" * 1000}),
        pack({"type": "GuiFormSubmitMessage", "uuid": []}),
        pack({"type": "GuiButtonHoldMessage", "uuid": widgets[0], "frequency": NAN}),
        pack({"type": "CommandTriggerMessage", "uuid": {}}),
        pack({"type": "FileTransferStartUpload", "source_component_uuid": widgets[0],
              "transfer_uuid": [], "filename": 3, "mime_type": None, "part_count": -1,
              "size_bytes": HUGE}),
        pack({"type": "FileTransferPart", "source_component_uuid": None, "transfer_uuid": "no",
              "part_index": -1, "content": "text"}),
        pack({"type": "GetRenderResponseMessage", "payload": [], "render_uuid": 1}),
        pack({"type": "ShareUrlRequest"}), pack({"type": "RunJavascriptMessage", "source": "x"}),
        pack({"type": []}), pack({"type": "Message"}), pack({}), pack([]), pack(None), pack("type"),
        b"", b"\xc1", b"\xff" * 100, b"\x91" * 100_000, b"\x82\xa4type\xdd\xff\xff\xff\xff",
        camera()[:-9], secrets.token_bytes(1000),
    ]  # fmt: skip


def upload(name: str, content: bytes) -> tuple[str, str]:
    """Give the event by which a page sends a file."""
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
