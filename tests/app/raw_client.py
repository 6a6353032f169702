"""A client that speaks viser's protocol without a browser, honest or hostile."""

import asyncio
import contextlib
import os
import re
import secrets
import socket as sockets
import ssl
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import psutil
import websockets

import page_protocol
from page_protocol import CAMERA, HOW, pack, unpack


class App:
    """The app in a process of its own, reached directly or through a proxy."""

    def __init__(
        self,
        url: str,
        process: psutil.Process,
        log: Path,
        *,
        headers: Mapping[str, str] | None = None,
        trust: ssl.SSLContext | None = None,
        address: tuple[str, int] | None = None,
    ) -> None:
        self.url, self.process, self.path = url, process, log
        self.headers, self.trust, self.address = dict(headers or {}), trust, address

    @property
    def memory_mb(self) -> float:
        return self.process.memory_info().rss / 1e6

    @property
    def log(self) -> list[str]:
        return self.path.read_text("utf-8").splitlines()


@contextlib.contextmanager
def running_app(folder: Path, *options: str, port: int | None = None) -> Iterator[App]:
    """Run `warpspace view` with further options; its log lies in a folder."""
    with sockets.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = port or free.getsockname()[1]
    view = ["-m", "warpspace", "view", "--no-browser", "--port", str(port), *options]
    log = folder / "log"
    with log.open("wb") as stream:
        # what the C library keeps for threads that have ended, up to 64 MB each, is not counted
        environment = {**os.environ, "MALLOC_ARENA_MAX": "2"}
        process = subprocess.Popen(
            [sys.executable, *view], stdout=stream, stderr=stream, env=environment
        )
    try:
        for _ in range(300):
            with contextlib.suppress(OSError):
                sockets.create_connection(("127.0.0.1", port), 1).close()
                break
            time.sleep(0.1)
        yield App(f"ws://127.0.0.1:{port}", psutil.Process(process.pid), log)
    finally:
        process.terminate()
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise


class Tab:
    """A tab without a browser: learns its widgets, drags a slider, sees the mean change."""

    def __init__(self, app: App) -> None:
        self._app = app
        self.widgets: dict[str, str] = {}
        self.sliders: dict[str, tuple[float, float]] = {}
        self.mean = ""
        self.notices: list[str] = []
        self.is_open = False

    async def __aenter__(self) -> "Tab":
        self.socket = await dial(self._app)
        self._reader = asyncio.create_task(self._read())
        try:
            await self.socket.send(pack(CAMERA))
            await until(lambda: self.is_open and self.mean != "", 120.0)
        except BaseException:
            await self.__aexit__()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        self._reader.cancel()
        self.socket.transport.abort()
        await self.socket.wait_closed()

    async def answer_s(self, value: float) -> float:
        """Move a slider; give how long it takes until the mean is another."""
        before, began = self.mean, time.perf_counter()
        await self.socket.send(update(self.widgets["EAX"], {"value": value}))
        await until(lambda: self.mean != before, 60.0)
        return time.perf_counter() - began

    async def _read(self) -> None:
        with contextlib.suppress(websockets.ConnectionClosed):
            async for raw in self.socket:
                for message in unpack(raw):
                    await self._take(message)

    async def _take(self, message: dict[str, Any]) -> None:
        part = message.get("props") or message.get("updates") or {}
        if message["type"] == "GuiSliderMessage":
            self.sliders[message["uuid"]] = part["min"], part["max"]
        if message["type"].startswith("Notification"):
            self.notices.append(str(message))
        if isinstance(part.get("label"), str):
            self.widgets.setdefault(part["label"].split(" ")[0], message["uuid"])
        if 'data-value="mean"' in str(part.get("content")):
            self.mean = re.findall(r'data-value="mean"[^>]*>([^<]*)<', part["content"])[0]
        if message["type"] == "RunJavascriptMessage":
            self.is_open |= 'dataset.warpspace = "open"' in message["source"]
            asked = re.search(r'uuid: "([^"]+)", updates: \{ value: "(\d+)"', message["source"])
            if asked is not None:
                await self.socket.send(update(asked[1], {"value": asked[2]}))


async def dial(app: App) -> websockets.ClientConnection:
    through: dict[str, Any] = {}
    if app.address is not None:
        through = {"host": app.address[0], "port": app.address[1], "ssl": app.trust}
    return await websockets.connect(app.url, additional_headers=app.headers, **through, **HOW)


@contextlib.asynccontextmanager
async def connected(app: App) -> AsyncIterator[websockets.ClientConnection]:
    """Connect; leave without a word, also where the app has closed the connection before."""
    socket = await dial(app)
    try:
        with contextlib.suppress(websockets.ConnectionClosed):
            yield socket
    finally:
        socket.transport.abort()
        await socket.wait_closed()


async def until(fine: Callable[[], bool], seconds: float) -> None:
    end = time.monotonic() + seconds
    while not fine():
        assert time.monotonic() < end, f"did not come true within {seconds:g} s"
        await asyncio.sleep(0.005)


def update(uuid: object, updates: object) -> bytes:
    return pack(page_protocol.update(uuid, updates))


def camera(**fields: object) -> bytes:
    return pack({**CAMERA, **fields})


def nonsense(widgets: list[str]) -> list[bytes]:
    """One message of every kind that the app has no use for."""
    nan, huge = float("nan"), 10**18
    values = [
        [],
        {},
        None,
        "x",
        nan,
        float("inf"),
        huge,
        -1e300,
        b"\0",
        [1] * 99,
        [[[]]],
        "9" * 9999,
    ]
    names = ["uuid", "parent_container_id", "props", "removed", "update_cb", "gui_api", "value_"]
    known = [update(uuid, {name: []}) for uuid in widgets for name in names]
    known += [update(uuid, {"value": value}) for uuid in widgets for value in values]
    known += [update(uuid, {"value": 1.0, "uuid": "x"}) for uuid in widgets]
    return [
        *known,
        *(update(uuid, {"value": 1.0}) for uuid in ([], {}, None, 7, "unknown", "x" * 99_999)),
        *(update(widgets[0], updates) for updates in ([], None, "x", {"value": "x" * 2_000_000})),
        *(camera(position=value) for value in ((nan,) * 3, (1e300,) * 3, (0.0,) * 9, "x", None)),
        camera(fov=nan), camera(image_width=huge), camera(image_height=-5), camera(extra=1),
        pack({"type": "ScenePointerMessage", "event_type": "click"}),
        pack({"type": "ScenePointerMessage", "event_type": "click", "ray_origin": None,
              "ray_direction": [nan] * 3, "screen_pos": [], "modifier": {}}),
        pack({"type": "SceneNodeClickMessage", "name": []}),
        pack({"type": "SceneNodeDragMessage", "name": "/box", "phase": 3}),
        pack({"type": "GuiFormDirtyMessage", "uuid": "x" * 1000}),
        pack({"type": "GuiFormSubmitMessage", "uuid": []}),
        pack({"type": "GuiButtonHoldMessage", "uuid": widgets[0], "frequency": nan}),
        pack({"type": "CommandTriggerMessage", "uuid": {}}),
        pack({"type": "FileTransferStartUpload", "source_component_uuid": widgets[0],
              "transfer_uuid": [], "filename": 3, "mime_type": None, "part_count": -1,
              "size_bytes": huge}),
        pack({"type": "FileTransferPart", "source_component_uuid": None, "transfer_uuid": "no",
              "part_index": -1, "content": "text"}),
        pack({"type": "GetRenderResponseMessage", "payload": [], "render_uuid": 1}),
        pack({"type": "ShareUrlRequest"}), pack({"type": "RunJavascriptMessage", "source": "x"}),
        pack({"type": []}), pack({"type": "Message"}), pack({}), pack([]), pack(None), pack("type"),
        b"", b"\xc1", b"\xff" * 100, b"\x91" * 100_000, b"\x82\xa4type\xdd\xff\xff\xff\xff",
        camera()[:-9], secrets.token_bytes(1000),
    ]  # fmt: skip


async def send_all(app: App, messages: list[bytes]) -> None:
    """Send messages as fast as they are taken, over a new connection where the last was closed."""
    waiting = iter(messages)
    for message in waiting:
        async with connected(app) as socket:
            await socket.send(message)
            for later in waiting:
                await socket.send(later)


def upload(button: str, name: str, content: bytes) -> list[bytes]:
    """Give the messages by which a page uploads a file."""
    return [
        pack({"type": "FileTransferStartUpload", "source_component_uuid": button,
              "transfer_uuid": name, "filename": f"{name}.toml", "mime_type": "",
              "part_count": 1, "size_bytes": len(content)}),
        pack({"type": "FileTransferPart", "source_component_uuid": button, "transfer_uuid": name,
              "part_index": 0, "content": content}),
    ]  # fmt: skip


async def steadily(socket: websockets.ClientConnection, messages: list[bytes]) -> None:
    """Send messages no faster than a client may, so that the connection is kept."""
    for begin in range(0, len(messages), 30):
        for message in messages[begin : begin + 30]:
            await socket.send(message)
        await asyncio.sleep(0.12)
