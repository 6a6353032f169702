"""Clients of bad will: messages that mean nothing, events for nobody, floods, files in pieces."""

import asyncio
import base64
import contextlib
import secrets
from collections.abc import AsyncGenerator, Iterable
from typing import Any, Literal, get_args, get_origin

import msgspec
import websockets

from page_client import CAMERA, App, dial, pack, said
from warpspace.app.browser import actions as do

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
TURNS = 12
FIELDS: dict[str, tuple[Any, ...]] = {
    "panel": ("files", "test", "part", "nobody", TAG, "__class__"),
    "option": ("fit", "x" * 41, TAG), "name": ("x.toml", TAG, "../../etc/passwd", "a.stl"),
    "token": ("", TAG),
    "key": ("EXX", "EQQ", "__class__", TAG), "path": PATHS, "index": (0, 9, 9_999_999),
    "card": (0, 7), "number": (0, 9), "size": (0, HUGE), "save": (True, False),
    "ray": ((0.0,) * 6, (1e9, 0, 0, 0, 0, 1)), "width": (120, 16_384), "height": (120, 16_384),
    "top": (0, 999_999), "bottom": (0, 999_999), "right": (0, 999_999),
    "content": ("", "²", "eA=="),
}  # fmt: skip
"""What a field may hold; of those that are not listed, and allow any text, `VALUES`."""


def actions(panels: Iterable[str] = FIELDS["panel"]) -> list[do.AnyAction]:
    """Give actions that pass the decoder and mean nothing: of every kind, with any values."""
    found: list[do.AnyAction] = [*do.Signal]
    of_panels = [(kind, {"panel": name}) for kind in do.PanelAction.__subclasses__()
                 for name in panels]  # fmt: skip
    others = {*do.Action.__subclasses__()} - {do.PanelAction, do.InputValue, do.SetLeaf}
    for turn in range(TURNS):
        of_value = [(turn + at, at) for at in range(len(PATHS))]
        found += [do.SetLeaf(PATHS[at], VALUES[of % len(VALUES)]) for of, at in of_value]
        found += [entry(VALUES[(turn + at) % len(VALUES)]) for at, entry in enumerate(do.Input)]
        rare = of_panels if turn % 4 == 0 else []
        for kind, given in (*rare, *((kind, {}) for kind in others)):
            values = {}
            for at, field in enumerate(msgspec.structs.fields(kind)):
                texts = [value[:40] if field.type is do.Name else value for value in VALUES]
                allowed = get_args(field.type) if get_origin(field.type) is Literal else texts
                choices = FIELDS.get(field.name, allowed)
                values[field.name] = choices[(turn + at) % len(choices)]
            found.append(kind(**values | given))
    return found


def carried() -> list[bytes]:
    """Give messages of actions that no page sends."""
    leaf = {"do": "SetLeaf", "path": "look.surface", "value": "grid"}
    wrong = [
        {**leaf, "do": "set_leaf"}, {**leaf, "do": ""}, {**leaf, "do": None}, {**leaf, "extra": 1},
        {**leaf, "path": "x" * 161}, {**leaf, "path": 1}, {**leaf, "path": None},
        {**leaf, "value": 1}, {**leaf, "value": ["grid"]}, {**leaf, "value": "9" * 20_001},
        {"do": "SetLeaf"}, {"path": "look.surface"}, {"do": "Action"}, {"do": "PanelAction"},
        {"do": "Run"}, {"do": "Run", "panel": TAG * 9}, {"do": "Apply", "panel": "adjust"},
        {"do": "Apply", "panel": "adjust", "card": -1}, {"do": "Apply", "panel": "a", "card": "0"},
        {"do": "Apply", "panel": "a", "card": 0.5}, {"do": "Apply", "panel": "a", "card": HUGE},
        {"do": "InputValue", "input": "undo"}, {"do": "InputValue", "input": TAG},
        {"do": "ShowMachine", "look": TAG}, {"do": "WriteReport", "ending": ".exe"},
        {"do": "ShowDrawing", "value": "<b>"}, {"do": "ViewFrom", "view": "<script>"},
        {"do": "ShowBox", "box": "<b>"}, {"do": "EditNote", "note": "a", "edit": "x"},
        {"do": "SaveResult", "panel": "gains", "format": "exe"},
        {"do": "PointAt", "ray": [1, 2, 3], "author": ""},
        {"do": "PointAt", "ray": [NAN, 0, 0, 0, 0, 1], "author": ""},
        {"do": "PointAt", "ray": [1e300, 0, 0, 1, 1, 1], "author": ""},
        {"do": "Resize", "width": 50, "height": 700, "top": 80, "bottom": 50, "right": 90},
        {"do": "Resize", "width": 900, "height": 700, "top": 80, "bottom": 50, "right": -5},
        {"do": "Resize", "width": NAN, "height": 700, "top": 80, "bottom": 50, "right": 90},
        {"do": "Resize", "width": HUGE, "height": 700, "top": 80, "bottom": 50, "right": 90},
        {"do": "Upload", "panel": "files", "name": "x", "size": -1, "content": ""},
        {"do": "TabHere", "token": "x" * 101},
        "no signal", "UNDO", "", 1, None, [], {}, ["undo", ""],
    ]  # fmt: skip
    events = ["", {}, None, [[]], ["undo"] * 17, *([one] for one in wrong), ["undo", *wrong[:1]]]
    found = [pack({"type": "WarpspaceEvents", "events": one}) for one in events]
    return [*found, pack({"type": "WarpspaceEvents"}), pack({**said("undo"), "extra": 1})]


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


def upload(name: str, content: bytes, panel: str = "files") -> do.Upload:
    return do.Upload(panel, name, len(content), base64.b64encode(content).decode())


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
