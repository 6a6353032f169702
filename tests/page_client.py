"""A page of the app without a browser, and an app for it to visit; for tests and benchmarks."""

import asyncio
import contextlib
import json
import os
import re
import secrets
import socket as sockets
import ssl
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec.msgpack
import psutil
import viser
import websockets
import zstandard

from warpspace.app.browser import actions as do

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
CALL = re.compile(r"^warpspace(\w+\.[\w.]+)\((.*)\);$", re.MULTILINE)
SLIDER = re.compile(r'data-set="[^"]*SetError[^"]*?(E\w+)&quot;}"')
pack = msgspec.msgpack.encode


def unpack(raw: str | bytes) -> list[dict[str, Any]]:
    """Read the messages of one frame: two sizes of eight bytes, then what zstandard has packed."""
    assert isinstance(raw, bytes)
    size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
    text = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
    return msgspec.msgpack.decode(text)["messages"]


def said(*actions: object) -> dict[str, Any]:
    """Write the message of actions, or of what takes their place."""
    return {"type": "WarpspaceEvents", "events": actions}


def selector(action: object, kind: str = "do") -> str:
    """Return the selector of the elements that send an action."""
    return f"[data-{kind}='{action}']"


class Page:
    """What a page knows: each function of its scripts that is called leaves its values here."""

    def __init__(self) -> None:
        self.pieces: dict[str, str] = {}  # HTML by the name of its place
        self.toasts: list[list[str]] = []
        self.latest: dict[str, list[Any]] = {}  # values of the latest call of each function
        self.calls = Counter[str]()  # of each function

    @property
    def stage(self) -> str:
        return self.latest.get("Page.stage", [""])[0]

    @property
    def sliders(self) -> list[str]:
        return [*dict.fromkeys(SLIDER.findall("".join(self.pieces.values())))]

    def take(self, message: dict[str, Any]) -> list[str]:
        """Note the calls of a message; return the names of the functions."""
        source = message["source"] if message["type"] == "RunJavascriptMessage" else ""
        names = []
        for name, arguments in CALL.findall(source):
            values = self.latest[name] = json.loads(f"[{arguments}]")
            names.append(name)
            if name == "Page.show":
                self.pieces |= values[0]
            elif name == "Page.toast":
                self.toasts.append(values)
        self.calls.update(names)
        return names


@dataclass(frozen=True)
class App:
    url: str
    process: psutil.Process
    path: Path | None = None  # of its log
    headers: Mapping[str, str] = field(default_factory=dict)
    trust: ssl.SSLContext | None = None
    address: tuple[str, int] | None = None

    @property
    def memory_mb(self) -> float:
        return self.process.memory_info().rss / 1e6

    @property
    def log(self) -> list[str]:
        return [] if self.path is None else self.path.read_text("utf-8").splitlines()


def free_port() -> int:
    with sockets.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def wait_for(port: int, process: psutil.Popen | subprocess.Popen[bytes]) -> None:
    """Wait until a process takes connections."""
    end = time.monotonic() + 300.0  # a busy machine takes its time
    while True:
        with contextlib.suppress(OSError):
            sockets.create_connection(("127.0.0.1", port), 5).close()
            return
        assert process.poll() is None, "the process has ended"
        assert time.monotonic() < end, "the process does not answer"
        time.sleep(0.1)


@contextlib.contextmanager
def running_app(
    *options: str,
    folder: Path | None = None,
    port: int | None = None,
    launcher: tuple[str, ...] = ("-m", "warpspace"),
    **how: Any,
) -> Generator[App]:
    port = port or free_port()
    view = [sys.executable, *launcher, "view", "--no-browser", "--port", str(port), *options]
    # what the C library keeps for threads that have ended, up to 64 MB each, is not counted
    how = {"env": {**os.environ, "MALLOC_ARENA_MAX": "2"}, "stdout": subprocess.DEVNULL, **how}
    log = None if folder is None else folder / "log"
    with contextlib.ExitStack() as stack:
        if log is not None:
            how["stdout"] = how["stderr"] = stack.enter_context(log.open("wb"))
        process = psutil.Popen(view, **how)
        try:
            wait_for(port, process)
            yield App(f"ws://127.0.0.1:{port}", process, log)
        finally:
            process.terminate()
            try:
                process.wait(60)
            except psutil.TimeoutExpired:
                process.kill()
                process.wait()
                raise


async def dial(app: App, **how: Any) -> websockets.ClientConnection:
    if app.address is not None:
        how |= {"host": app.address[0], "port": app.address[1], "ssl": app.trust}
    return await websockets.connect(app.url, additional_headers=app.headers, **how, **HOW)


async def until(fine: Callable[[], bool], seconds: float) -> None:
    end = time.monotonic() + seconds
    while not fine():
        assert time.monotonic() < end, f"did not come true within {seconds:g} s"
        await asyncio.sleep(0.005)


class Tab(Page):
    """A tab that moves sliders and sees which picture is shown; `token` says which tab it is."""

    def __init__(self, app: App, token: str = "") -> None:
        super().__init__()
        self.token = token or secrets.token_hex(16)
        self.seen: list[tuple[float, str]] = []  # when which points were shown
        self.bytes = 0
        self._app = app

    async def __aenter__(self) -> "Tab":
        await self.open()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def open(self, patience_s: float = 120.0) -> None:
        patience = {"open_timeout": patience_s, "ping_interval": None}  # slow is not gone
        self.socket = await dial(self._app, **patience)
        self._reader = asyncio.create_task(self._read())
        try:
            await self.send(said(do.TabHere(self.token)))
            await self.send(CAMERA)
            await until(lambda: self.stage == "open", patience_s)
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        """Drop the connection."""
        self._reader.cancel()
        self.socket.transport.abort()
        await self.socket.wait_closed()

    async def send(self, message: dict[str, Any]) -> None:
        await self.socket.send(pack(message))

    async def drag(self, key: str, value: float) -> None:
        await self.send(said(do.SetError(key, f"{value:g}")))

    async def answer_s(self, value: float, key: str = "EAX") -> float:
        place, began = f"error.{key}", time.perf_counter()
        before = self.pieces.get(place)
        await self.drag(key, value)
        await until(lambda: self.pieces.get(place) != before, 60.0)
        return time.perf_counter() - began

    async def _read(self) -> None:
        with contextlib.suppress(websockets.ConnectionClosed):
            async for raw in self.socket:
                self.bytes += len(raw)
                for message in unpack(raw):
                    await self._hear(message)

    async def _hear(self, message: dict[str, Any]) -> None:
        for name in self.take(message):
            if name == "Mesh.bend":
                self.seen.append((time.perf_counter(), self.latest[name][0]))
            elif name == "Page.drawn":
                await self.send(said(do.Signal.DRAWN))
