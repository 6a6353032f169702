"""Attacks on the doors of an app that asks for a token, from raw clients; see the app's guard."""

import asyncio
import itertools
import socket
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from app.hostile import upload
from page_client import PROTOCOL, App, Tab, running_app, said
from reliability.outcome import Lag, Outcome

TOKEN = "kp3Zq8vN2xT7wR5yLd0m"
LONGEST_S = 1.0
MOST_MB = 200.0
UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Protocol": PROTOCOL,
}
HOSTS = (
    "evil.example", "evil.example:{port}", "localhost.evil.example:{port}", "127.0.0.7:{port}",
    "127.0.0.1.evil.example", "192.0.2.7:{port}", "0.0.0.0", "[::]:{port}", "127.1:{port}",
    "2130706433", "2130706433:{port}", "[::ffff:10.0.0.7]:{port}", "evil@127.0.0.1", "[::1",
    "localhost:{port}@evil.example", "127.0.0.1:port", "evil.example:99999999", "a b", "",
)  # fmt: skip
"""Hosts that are not served; `{port}` is the app's."""
ORIGINS = (
    "http://evil.example", "https://evil.example:{port}", "null", "", "file://", "http://",
    "http://127.0.0.1:1", "http://127.0.0.1", "https://127.0.0.1:1@127.0.0.1:{port}",
    "http://localhost:{port}", "http://127.0.0.1:{port}.evil.example", "http://[::1]:1",
    "http://evil@127.0.0.1:1", "chrome-extension://abcdef", "javascript:0",
    "ftp://127.0.0.1:{port}", "http://127.0.0.1:{port} http://evil.example",
)  # fmt: skip
"""Origins that are not the app's own page."""
GUESSES = (
    "", TOKEN[:-1], TOKEN[1:], TOKEN + "0", TOKEN.swapcase(), TOKEN[::-1], TOKEN * 2,
    TOKEN.replace("Z", "_"), f"%20{TOKEN}", f"{TOKEN}%00", f"{TOKEN}%0d%0aX:1", "%ff%fe", "é",
    f"[{TOKEN}]", f'"{TOKEN}"',
)  # fmt: skip
"""Tokens that are near the right one."""
PATHS = ("/", "/index.html", "/assets/../", "/%2e%2e/", "//", "/?x=1")
AWAY = ("ws://evil.example", "http://evil.example/x", "//evil.example")


@dataclass
class Tally:
    done: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest_s: float = 0.0
    lag: Lag = field(default_factory=Lag)


def attempts(port: int) -> Iterator[tuple[str, str, dict[str, str]]]:
    valid, own = f"/?token={TOKEN}", {"Host": f"127.0.0.1:{port}"}
    for host in HOSTS:
        yield "foreign host", valid, {"Host": host.format(port=port)}
    for origin in ORIGINS:
        yield "foreign origin", valid, {**own, "Origin": origin.format(port=port)}
    for guess in GUESSES:
        yield "token guessed", f"/?token={guess}", own
        yield "cookie guessed", "/", {**own, "Cookie": f"warpspace_token_{port}={guess}"}
    for other in range(1, 20):
        yield "token as cookie", "/", {**own, "Cookie": f"warpspace_token_{other}={TOKEN}"}
    for path in PATHS:
        yield "no token", path, own
    for name, away in itertools.product(("websocket", "playbackPath"), AWAY):
        yield "leads elsewhere", f"{valid}&{name}={away}", own
    # within the limits of a request line; beyond, the server closes before it looks
    for length in (100, 4000, 9000, 100_000):
        yield "oversized", f"/?token={'A' * length}", own


def ask(port: int, path: str, headers: Mapping[str, str]) -> tuple[int, dict[str, str], str]:
    """Send a request as it stands; give status, headers (in lower case) and the text after them."""
    lines = [f"{name}: {value}" for name, value in headers.items()]
    with closing(socket.create_connection(("127.0.0.1", port), timeout=20.0)) as raw:
        raw.sendall("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode("latin-1"))
        answer = b""
        while b"\r\n\r\n" not in answer or (b" 101 " not in answer and len(answer) < 5000):
            part = raw.recv(65536)
            if not part:
                break
            answer += part
    head, _, text = answer.partition(b"\r\n\r\n")
    first, *rest = head.decode("latin-1").split("\r\n")
    pairs = (line.partition(": ") for line in rest)
    found = {name.lower(): value for name, _, value in pairs}
    return int(first.split()[1]), found, text.decode("utf-8", "replace")


def try_one(port: int, kind: str, path: str, headers: dict[str, str], tally: Tally) -> None:
    began = time.perf_counter()
    try:
        status, found, text = ask(port, path, headers)
    except (OSError, IndexError):
        status, found, text = 0, {}, ""  # closed without an answer
    tally.slowest_s = max(tally.slowest_s, time.perf_counter() - began)
    tally.done[kind] += 1
    refused = (403, 400, 0, 414, 431) if kind == "oversized" else (403, 400, 0)
    if status not in refused or "set-cookie" in found or TOKEN in text or "<html" in text.lower():
        tally.faults.append(f"{kind}: {status} to {path[:80]} {headers}")


def bombs() -> list[bytes]:
    """Files that are small and cost much: keys of many parts, deep nesting, many keys."""
    dotted = ".".join("a" * 20_000)
    return [
        f"{dotted} = 1".encode(),
        b"x = " + b"[" * 100_000,
        b"x = " + b"{a=" * 50_000,
        "\n".join(f"k{number} = 1" for number in range(200_000)).encode(),
        b'title = "' + b"\\u00e9" * 600_000,
        b"[" + b"[a." * 30_000,
        zlib.compress(bytes(40_000_000)),
        # no larger than a scene may be
        *(f"x = [{entry}]".encode() for entry in ("1," * 900_000, "[]," * 300_000, "\n" * 900_000)),
        b"\xff\xfe" * 500_000,
        b"\n" * 4_000_000,
        b"x = " + b"1_" * 900_000 + b"1",
    ]


async def _exhaust(app: App, count: int, tally: Tally) -> None:
    async with Tab(app) as honest, Tab(app) as other:
        await honest.answer_s(20.0)
        before = app.memory_mb
        for number, content in enumerate(itertools.islice(itertools.cycle(bombs()), count)):
            await other.send(said(upload(f"bomb{number}.toml", content)))
            waited = await honest.answer_s(number % 9 + 0.5)
            tally.slowest_s = max(tally.slowest_s, waited)
            tally.done["upload"] += 1
            tally.lag.measure()
            await asyncio.sleep(0.05)
        if app.memory_mb - before > MOST_MB:
            tally.faults.append(f"uploads cost {app.memory_mb - before:.0f} MB")


def run(count: int) -> Outcome:
    tally, uploads, before = Tally(), max(1, min(count // 100, 200)), 0.0
    options = ("--token", TOKEN)
    with tempfile.TemporaryDirectory() as folder, running_app(*options, folder=Path(folder)) as app:
        port = int(app.url.rpartition(":")[2])
        ways = itertools.product(({}, UPGRADE), attempts(port))
        tried = itertools.islice(itertools.cycle(ways), count - uploads)
        for number, (upgrade, (kind, path, headers)) in enumerate(tried):
            if number == min(count // 4, 500):  # libraries are loaded by now
                before = app.memory_mb
            try_one(port, kind, path, headers | upgrade, tally)
            if number % 20 == 0:
                tally.lag.measure()
        growth = app.memory_mb - before
        if growth > MOST_MB:
            tally.faults.append(f"requests cost {growth:.0f} MB")
        if len(app.log) > 60:
            tally.faults.append(f"{len(app.log)} lines of log")
    with tempfile.TemporaryDirectory() as folder, running_app(folder=Path(folder)) as app:
        asyncio.run(_exhaust(app, uploads, tally))
    tally.faults += tally.lag.judge(tally.slowest_s, LONGEST_S)
    spelt = ", ".join(f"{kind} {number:,}" for kind, number in sorted(tally.done.items()))
    return Outcome(
        sum(tally.done.values()),
        f"none let in, slowest answer {tally.slowest_s:.2f} s {tally.lag.words},"
        f" {growth:+.0f} MB ({spelt})",
        tally.faults[:20],
    )
