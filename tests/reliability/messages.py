"""Hostile messages, and tabs that drag without an end, while an honest tab goes on working."""

import asyncio
import itertools
import random
import tempfile
from pathlib import Path

from app.raw_client import (
    App,
    Tab,
    connected,
    nonsense,
    pack,
    running_app,
    send_all,
    steadily,
    update,
)
from page_protocol import CAMERA
from reliability.outcome import Lag, Outcome
from reliability.reading import mutate

LONGEST_S = 1.0
"""What the honest tab may wait for an answer."""
MOST_MB = 60.0
LOG_LINES = 40
SLOW = 4
"""Clients that read nothing of what they are sent."""
FLOOD = 5000
"""Messages of one flood: more than the app takes of one client at once."""
TABS = 4
"""Tabs that move all their sliders as often as a page may."""


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
    chance = random.Random(14)
    async with Tab(app) as honest, Tab(app) as hostile:
        kinds = nonsense(list(hostile.widgets.values())[:12])
        await honest.answer_s(20.0)
        before = app.memory_mb
        slow = [asyncio.create_task(_read_nothing(app, chance)) for _ in range(SLOW)]
        steady = count // 10
        drags = steady // TABS * TABS
        floods = max(1, count // 10 // FLOOD) if count >= 10 * FLOOD else 0
        rest = count - steady - drags - floods * FLOOD
        shuffled = [chance.choice(kinds) for _ in range(rest)]
        shuffled = [
            mutate([m], [], chance)[:20_000] if chance.random() < 0.6 else m for m in shuffled
        ]
        counts = {"flood": 0}
        work = [
            asyncio.create_task(steadily(hostile.socket, cycle(kinds, steady))),
            *(asyncio.create_task(_move_all(app, steady // TABS)) for _ in range(TABS)),
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
        return steady + drags + rest + counts["flood"], taken, app.memory_mb - before


def cycle(kinds: list[bytes], count: int) -> list[bytes]:
    """Take messages in turn."""
    return list(itertools.islice(itertools.cycle(kinds), count))


async def _flood(app: App, widget: str, times: int, counts: dict[str, int]) -> None:
    for _ in range(times):
        async with connected(app) as socket:
            await socket.send(pack(CAMERA))
            for number in range(FLOOD):
                await socket.send(update(widget, {"value": number % 20 / 2.0}))
                counts["flood"] += 1


async def _read_nothing(app: App, chance: random.Random) -> None:
    while True:
        async with connected(app) as socket:
            await socket.send(pack(CAMERA))
            socket.transport.pause_reading()
            await asyncio.sleep(chance.uniform(2.0, 5.0))


async def _move_all(app: App, count: int) -> None:
    async with Tab(app) as tab:
        sliders = list(tab.sliders.items())
        moves = (
            update(widget, {"value": low + (high - low) * (number * 0.377 % 1.0)})
            for number, (widget, (low, high)) in enumerate(itertools.cycle(sliders))
        )
        await steadily(tab.socket, list(itertools.islice(moves, count)))
