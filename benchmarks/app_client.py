"""A tab without a browser: speaks viser's protocol, drags sliders, reads the numbers shown."""

import asyncio
import contextlib
import re
import secrets
import subprocess
import sys
import time
import urllib.request
from dataclasses import dataclass, field
from pathlib import Path

import psutil
import websockets

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from page_protocol import CAMERA, HOW, pack, unpack, update

NUMBERS = re.compile(r'data-value="(mean|RMS|P95|max)"[^>]*>([^<]*)<')
Shown = tuple[tuple[str, str], ...]


@dataclass
class Tab:
    """One connection to the app.

    Attributes
    ----------
    url : str
        Address of the page.
    token : str
        What the page keeps in its `sessionStorage`.
    """

    url: str
    token: str = field(default_factory=lambda: secrets.token_hex(16))

    def __post_init__(self) -> None:
        self.widgets: dict[str, str] = {}
        self.values: dict[str, float] = {}
        self.shown: Shown = ()
        self.seen: list[tuple[float, Shown]] = []
        self.bytes = 0
        self.problems: list[str] = []
        self._open = False
        self._reader: asyncio.Task[None] | None = None

    async def open(self, patience_s: float = 30.0) -> None:
        """Connect and wait until all of the page is there."""
        url = self.url.replace("http", "ws", 1)
        patience = {"open_timeout": patience_s, "ping_interval": None}  # slow is not gone
        self._socket = await websockets.connect(url, **patience, **HOW)
        self._reader = asyncio.create_task(self._read())
        await self._send(CAMERA)
        for _ in range(round(patience_s / 0.05)):
            if self.shown and self._open:
                return
            await asyncio.sleep(0.05)
        raise TimeoutError(f"the app has shown nothing for {patience_s:g} s")

    async def close(self) -> None:
        """Drop the connection."""
        if self._reader is not None:
            self._reader.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._reader
        await self._socket.close()

    async def drag(self, label: str, value: float) -> None:
        """Set the slider whose label begins with a word."""
        await self._update(self.widgets[label], value)

    async def _update(self, widget: str, value: object) -> None:
        await self._send(update(widget, {"value": value}))

    async def _send(self, message: dict[str, object]) -> None:
        await self._socket.send(pack(message))

    async def _read(self) -> None:
        with contextlib.suppress(websockets.ConnectionClosed):
            async for raw in self._socket:
                self.bytes += len(raw)
                for message in unpack(raw):
                    await self._take(message)

    async def _run(self, source: str) -> None:
        """Do what a script asks a page for: its token, and whether it has drawn everything."""
        asked = re.search(r'uuid: "([^"]+)",\s+updates: \{ value: (?:token\b|"(\d+)")', source)
        if asked is not None:
            await self._update(asked[1], asked[2] or self.token)
        elif 'dataset.warpspace = "open"' in source:
            self._open = True

    async def _take(self, message: dict[str, object]) -> None:
        kind = message["type"]
        if kind == "GuiSliderMessage":
            key = message["props"]["label"].split(" ")[0]
            self.widgets.setdefault(key, message["uuid"])
            self.values.setdefault(key, message["value"])
        elif kind == "RunJavascriptMessage":
            await self._run(message["source"])
        elif kind == "NotificationShowMessage":
            self.problems.append(f"{message['props']['title']}: {message['props']['body']}")
        elif kind in {"GuiHtmlMessage", "GuiUpdateMessage"}:
            part = message["props"] if kind == "GuiHtmlMessage" else message["updates"]
            content = part.get("content")
            if isinstance(content, str) and 'data-value="mean"' in content:
                self.shown = tuple(NUMBERS.findall(content))
                self.seen.append((time.perf_counter(), self.shown))


@contextlib.contextmanager
def running_app(*options: str, launcher: tuple[str, ...] = ("-m", "warpspace"), **how: object):
    """Run the app in a process of its own; give its address and process."""
    port = 8600 + secrets.randbelow(300)
    url = f"http://127.0.0.1:{port}"
    command = [sys.executable, *launcher, "view", "--no-browser", "--port", str(port)]
    process = psutil.Popen([*command, *options], **{"stdout": subprocess.DEVNULL, **how})
    try:
        until = time.monotonic() + 300.0  # a busy machine takes its time
        while True:
            with contextlib.suppress(OSError), urllib.request.urlopen(url, timeout=5):
                break
            if process.poll() is not None or time.monotonic() > until:
                raise TimeoutError(f"the app does not answer at {url}")
            time.sleep(0.1)
        yield url, process
    finally:
        process.terminate()
        process.wait(60)


def rss_mb(process: psutil.Process) -> float:
    """Memory that a process holds, MB."""
    return process.memory_info().rss / 1e6
