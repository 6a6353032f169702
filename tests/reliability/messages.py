"""Hostile messages to the running app, while an honest tab goes on working."""

import asyncio
import contextlib
import itertools
import random
import tempfile
from pathlib import Path

import websockets

from app.raw_client import App, Tab, dial, nonsense, pack, running_app, send_all, steadily, update
from page_protocol import CAMERA
from reliability.lag import Lag
from reliability.row import Outcome

LONGEST_S = 1.0
"""What the honest tab may wait for an answer."""
MOST_MB = 60.0
LOG_LINES = 40
SLOW = 4
"""Clients that read nothing of what they are sent."""
FLOOD = 5000
"""Messages of one flood: more than the app takes of one client at once."""


def run(count: int) -> Outcome:
    """Send so many messages."""
    with tempfile.TemporaryDirectory() as folder, running_app(Path(folder)) as app:
        lag = Lag()
        warm = count // 4  # libraries are loaded then, and the heap has its size for so many
        first, taken, _ = asyncio.run(_attack(app, warm, lag))
        sent, later, growth = asyncio.run(_attack(app, count - warm, lag))
        sent, taken = first + sent, [*taken, *later]
        faults = lag.judge(max(taken), LONGEST_S)
        if growth > MOST_MB:
            faults.append(f"memory has grown by {growth:.0f} MB")
        if len(app.log) > LOG_LINES or any("Traceback" in line for line in app.log):
            faults.append(f"{len(app.log)} lines of log: {app.log[:5]}")
    return Outcome(
        sent,
        f"the honest tab was answered {len(taken)} times, in {max(taken):.2f} s at most"
        f" {lag.words}; memory {growth:+.0f} MB",
        faults,
    )


async def _attack(app: App, count: int, lag: Lag) -> tuple[int, list[float], float]:
    """Send in every way at once, and drag a slider meanwhile."""
    chance = random.Random(14)
    async with Tab(app) as honest, Tab(app) as hostile:
        kinds = nonsense(list(hostile.widgets.values())[:12])
        await honest.answer_s(20.0)
        before = app.memory_mb
        slow = [asyncio.create_task(_read_nothing(app, chance)) for _ in range(SLOW)]
        steady = count // 10
        floods = max(1, count // 10 // FLOOD) if count >= 10 * FLOOD else 0
        rest = count - steady - floods * FLOOD
        shuffled = [_bend(chance.choice(kinds), chance) for _ in range(rest)]
        counts = {"flood": 0}
        work = [
            asyncio.create_task(steadily(hostile.socket, _cycle(kinds, steady))),
            asyncio.create_task(send_all(app, shuffled)),
            asyncio.create_task(_flood(app, hostile.widgets["EAX"], floods, counts)),
        ]
        taken: list[float] = []
        for value in itertools.count(1):
            taken.append(await honest.answer_s(value % 10 + 0.5))
            lag.measure()
            if all(task.done() for task in work):
                break
            await asyncio.sleep(0.1)
        await asyncio.gather(*work)
        for task in slow:
            task.cancel()
        await asyncio.gather(*slow, return_exceptions=True)
        taken.append(await honest.answer_s(15.0))
        taken.append(await hostile.answer_s(12.0))
        return steady + rest + counts["flood"], taken, app.memory_mb - before


def _cycle(kinds: list[bytes], count: int) -> list[bytes]:
    """Take messages in turn."""
    return list(itertools.islice(itertools.cycle(kinds), count))


def _bend(message: bytes, chance: random.Random) -> bytes:
    """Leave a message as it is, cut it, or change some of its bytes."""
    if not message or chance.random() < 0.4:
        return message
    if chance.random() < 0.3:
        return message[: chance.randrange(len(message))]
    content = bytearray(message[:20_000])
    for _ in range(chance.choice((1, 2, 8))):
        content[chance.randrange(len(content))] = chance.randrange(256)
    return bytes(content)


async def _flood(app: App, widget: str, times: int, counts: dict[str, int]) -> None:
    """Send valid messages faster than they are taken; the app ends such a connection."""
    for _ in range(times):
        socket = await dial(app)
        with contextlib.suppress(websockets.ConnectionClosed):
            await socket.send(pack(CAMERA))
            for number in range(FLOOD):
                await socket.send(update(widget, {"value": number % 20 / 2.0}))
                counts["flood"] += 1
        socket.transport.abort()


async def _read_nothing(app: App, chance: random.Random) -> None:
    """Ask for the page and never take what comes."""
    while True:
        socket = await dial(app)
        with contextlib.suppress(websockets.ConnectionClosed):
            await socket.send(pack(CAMERA))
            socket.transport.pause_reading()
            await asyncio.sleep(chance.uniform(2.0, 5.0))
        socket.transport.abort()
