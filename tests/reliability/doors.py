"""Attacks on the doors of an app that asks for a token, from raw clients; see the app's guard.

Foreign origins and hosts, tokens guessed, cut, doubled and taken from another server, links and
uploads built to exhaust. What is let in, or costs an honest visitor a second, is a fault.
"""

import asyncio
import base64
import http.client
import itertools
import random
import secrets
import string
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from app.raw_client import App, Tab, running_app, upload
from reliability.lag import Lag
from reliability.row import Outcome

TOKEN = "kp3Zq8vN2xT7wR5yLd0m"
LONGEST_S = 1.0
MOST_MB = 200.0
UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": base64.b64encode(bytes(16)).decode(),
    "Sec-WebSocket-Version": "13",
}


@dataclass(frozen=True)
class Attempt:
    """One request."""

    kind: str
    path: str
    headers: dict[str, str]
    upgrade: bool = False
    expected: tuple[int, ...] = (403,)


@dataclass
class Tally:
    """What came of the attempts."""

    done: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest_s: float = 0.0
    lag: Lag = field(default_factory=Lag)


def attempts(port: int, chance: random.Random) -> Iterator[Attempt]:
    """Think of requests, without an end; `port` is the app's."""
    own = f"127.0.0.1:{port}"
    cookie = f"warpspace_token_{port}"
    valid = f"/?token={TOKEN}"
    for number in itertools.count():
        upgrade = number % 2 == 0
        host = _host(chance, port)
        yield Attempt("foreign host", valid, {"Host": host}, upgrade)
        yield Attempt(
            "foreign origin", valid, {"Host": own, "Origin": _origin(chance, port)}, upgrade
        )
        guess = _guess(chance)
        yield Attempt("token guessed", f"/?token={guess}", {"Host": own}, upgrade)
        yield Attempt("cookie guessed", "/", {"Host": own, "Cookie": f"{cookie}={guess}"}, upgrade)
        other = f"warpspace_token_{(port + 1 + number % 50) % 65536}={TOKEN}"
        yield Attempt("cookie of another server", "/", {"Host": own, "Cookie": other}, upgrade)
        path = chance.choice(("/", "/index.html", "/assets/../", "/%2e%2e/", "//", "/?x=1"))
        yield Attempt("no token", path, {"Host": own}, upgrade)
        away = chance.choice(("ws://evil.example", "http://evil.example/x", "//evil.example"))
        name = chance.choice(("websocket", "playbackPath"))
        yield Attempt("leads elsewhere", f"{valid}&{name}={away}", {"Host": own}, upgrade)
        # within the limits of a request line; beyond, the server closes before it looks
        huge = "A" * chance.choice((100, 4000, 9000, 100_000))
        yield Attempt(
            "oversized", f"/?token={huge}", {"Host": own}, upgrade, (403, 400, 414, 431, 0)
        )


def _host(chance: random.Random, port: int) -> str:
    """Think of a host that is not served."""
    name = "".join(chance.choices(string.ascii_lowercase, k=8))
    return chance.choice(
        (
            f"{name}.example", f"{name}.example:{port}", f"localhost.{name}.example:{port}",
            f"127.0.0.1.{name}.example", f"127.0.0.{chance.randrange(2, 255)}:{port}",
            f"10.0.0.{chance.randrange(255)}", "0.0.0.0", f"[::]:{port}", f"127.1:{port}",
            f"2130706433:{port}", f"localhost:{port}@{name}.example", "", "a b", "localhost\x00",
            f"[::ffff:10.0.0.{chance.randrange(255)}]:{port}", f"{name}:99999999",
        )
    )  # fmt: skip


def _origin(chance: random.Random, port: int) -> str:
    """Think of an origin that is not the app's own."""
    name = "".join(chance.choices(string.ascii_lowercase, k=8))
    return chance.choice(
        (
            f"http://{name}.example", f"https://{name}.example:{port}", "null", "file://", "",
            f"http://127.0.0.1:{port + chance.randrange(1, 500)}", f"http://127.0.0.1.{name}.com",
            f"http://localhost:{port}.{name}.example", f"http://{name}@127.0.0.1:{port + 1}",
            f"chrome-extension://{name}", f"http://[::1]:{port + 1}", "http://", "javascript:0",
            f"ftp://127.0.0.1:{port}", f"http://127.0.0.1:{port} http://{name}.example",
        )
    )  # fmt: skip


def _guess(chance: random.Random) -> str:
    """Think of a token that is near the right one."""
    at = chance.randrange(len(TOKEN))
    return chance.choice(
        (
            TOKEN[:at], TOKEN[at + 1 :], TOKEN + "0", TOKEN.swapcase(), TOKEN[::-1], TOKEN * 2,
            TOKEN[:at] + chance.choice("aB9_") * (TOKEN[at] not in "aB9_") + TOKEN[at + 1 :],
            f"%20{TOKEN}", f"{TOKEN}%00", f"{TOKEN}%0d%0aX:1", "%ff%fe", "é", "",
            secrets.token_urlsafe(16), f"[{TOKEN}]", f'"{TOKEN}"',
        )
    )  # fmt: skip


def try_one(port: int, attempt: Attempt, tally: Tally) -> None:
    """Make a request, and see that it is refused without a word of the page."""
    began = time.perf_counter()
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    try:
        connection.putrequest("GET", attempt.path, skip_host=True, skip_accept_encoding=True)
        for name, value in (attempt.headers | (UPGRADE if attempt.upgrade else {})).items():
            connection.putheader(name, value.encode("latin-1", "replace"))
        connection.endheaders()
        answer = connection.getresponse()
        status, body = answer.status, answer.read()
        cookie = answer.getheader("Set-Cookie")
    except (http.client.HTTPException, OSError, ValueError):
        status, body, cookie = 0, b"", None  # closed without an answer, or no request at all
    finally:
        connection.close()
    tally.slowest_s = max(tally.slowest_s, time.perf_counter() - began)
    tally.done[attempt.kind] += 1
    accepted = status not in (*attempt.expected, 400, 0)
    if accepted or cookie or TOKEN.encode() in body or b"<html" in body.lower():
        tally.faults.append(f"{attempt.kind}: {status} to {attempt.path[:80]} {attempt.headers}")


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
        b"\xff\xfe" * 500_000,
        b"\n" * 4_000_000,
        b"x = " + b"1_" * 900_000 + b"1",
    ]


async def _exhaust(app: App, count: int, tally: Tally) -> None:
    """Upload files that are built to exhaust; an honest tab works meanwhile."""
    async with Tab(app) as honest, Tab(app) as other:
        await honest.answer_s(20.0)
        before = app.memory_mb
        files = bombs()
        for number in range(count):
            content = files[number % len(files)]
            for message in upload(other.widgets["Open"], f"bomb{number}", content):
                await other.socket.send(message)
            waited = await honest.answer_s(number % 9 + 0.5)
            tally.slowest_s = max(tally.slowest_s, waited)
            tally.done["upload"] += 1
            tally.lag.measure()
            await asyncio.sleep(0.05)
        if app.memory_mb - before > MOST_MB:
            tally.faults.append(f"uploads cost {app.memory_mb - before:.0f} MB")


def run(count: int) -> Outcome:
    """Make so many attempts, a hundredth of them uploads."""
    chance, tally = random.Random(11), Tally()
    uploads = max(1, min(count // 100, 200))
    options = ("--token", TOKEN)
    with tempfile.TemporaryDirectory() as folder, running_app(Path(folder), *options) as app:
        port = int(app.url.rpartition(":")[2])
        before = 0.0
        requests = itertools.islice(attempts(port, chance), count - uploads)
        for number, attempt in enumerate(requests):
            if number == min(count // 4, 500):  # libraries are loaded by now
                before = app.memory_mb
            try_one(port, attempt, tally)
            if number % 20 == 0:
                tally.lag.measure()
        growth = app.memory_mb - before
        if growth > MOST_MB:
            tally.faults.append(f"requests cost {growth:.0f} MB")
        lines = len(app.log)
        if lines > 60:
            tally.faults.append(f"{lines} lines of log")
    with tempfile.TemporaryDirectory() as folder, running_app(Path(folder)) as app:
        asyncio.run(_exhaust(app, uploads, tally))
    tally.faults += tally.lag.judge(tally.slowest_s, LONGEST_S)
    spelt = ", ".join(f"{kind} {number:,}" for kind, number in sorted(tally.done.items()))
    return Outcome(
        sum(tally.done.values()),
        f"none let in, slowest answer {tally.slowest_s:.2f} s {tally.lag.words},"
        f" {growth:+.0f} MB ({spelt})",
        tally.faults[:20],
    )
