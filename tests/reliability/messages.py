"""Hostile messages, and tabs that drag without an end, while an honest tab goes on working."""

import asyncio
import itertools
import random
import re
import sys
import tempfile
from pathlib import Path

from app.hostile import actions, connected, nonsense, send_all, steadily
from page_client import CAMERA, App, Tab, pack, running_app, said, until
from reliability.outcome import Lag, Outcome
from reliability.reading import HERE, mutate
from warpspace.app.browser import actions as do

LONGEST_S = 1.0
"""What the honest tab may wait for an answer."""
MOST_MB = 30.0
CACHE_BYTES = 40_000_000
"""Of each cache of the server here, full before memory is compared; else up to 400 MB."""
HELD = re.compile(r"memory after collection, MB: (.*)")
"""What the server of the soak test says every few seconds."""
LOG_LINES = 40
SLOW = 4
"""Clients that read nothing of what they are sent."""
FLOOD = 5000
"""Messages of one flood: more than the app takes of one client at once."""
ROUNDS = 4
TABS = 4
"""Tabs that move all their sliders as often as a page may."""


def run(count: int) -> Outcome:
    launcher = ("-m", "reliability.messages", "serve")
    with (
        tempfile.TemporaryDirectory() as folder,
        running_app(folder=Path(folder), launcher=launcher, cwd=HERE) as app,
    ):
        lag = Lag()
        # within the first rounds libraries are loaded, tabs kept, and the caches are full
        warm = count // (ROUNDS + 1)
        rounds = [warm] * ROUNDS + [count - ROUNDS * warm]
        found = [asyncio.run(_attack(app, part, lag)) for part in rounds]
        sent, sizes = sum(number for number, *_ in found), [size for *_, size in found]
        growth = sizes[-1] - max(sizes[:-1])
        taken = [one for _, answers, _ in found for one in answers]
        faults = lag.judge(max(taken), LONGEST_S)
        if growth > MOST_MB:
            faults.append(f"memory has grown by {growth:.0f} MB")
        log = [line for line in app.log if not HELD.match(line)]
        if len(log) > LOG_LINES or any("Traceback" in line for line in log):
            faults.append(f"{len(log)} lines of log: {log[:5]}")
    return Outcome(
        sent,
        f"the honest tab was answered {len(taken)} times, in {max(taken):.2f} s at most"
        f" {lag.words}; memory {growth:+.0f} MB",
        faults,
    )


async def _attack(app: App, count: int, lag: Lag) -> tuple[int, list[float], float]:
    chance = random.Random(14)
    async with Tab(app) as honest, Tab(app) as hostile:
        mixed = nonsense() + actions()
        chance.shuffle(mixed)
        kinds = [one if isinstance(one, bytes) else pack(said(one)) for one in mixed]
        await honest.answer_s(20.0)
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
            asyncio.create_task(_flood(app, floods, counts)),
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
    return steady + drags + rest + counts["flood"], taken, await _held_mb(app)


async def _held_mb(app: App) -> float:
    """Read what the server holds once tabs have left, MB; garbage and free pages do not count."""
    told = len(HELD.findall("\n".join(app.log)))
    await until(lambda: len(HELD.findall("\n".join(app.log))) > told + 1, 60.0)
    return float(HELD.findall("\n".join(app.log))[-1])


def cycle(kinds: list[bytes], count: int) -> list[bytes]:
    return list(itertools.islice(itertools.cycle(kinds), count))


async def _flood(app: App, times: int, counts: dict[str, int]) -> None:
    for _ in range(times):
        async with connected(app) as socket:
            await socket.send(pack(CAMERA))
            for number in range(FLOOD):
                await socket.send(pack(said(do.SetError("EAX", str(number % 20 / 2.0)))))
                counts["flood"] += 1


async def _read_nothing(app: App, chance: random.Random) -> None:
    while True:
        async with connected(app) as socket:
            await socket.send(pack(CAMERA))
            socket.transport.pause_reading()
            await asyncio.sleep(chance.uniform(2.0, 5.0))


async def _move_all(app: App, count: int) -> None:
    async with Tab(app) as tab:
        moves = (
            pack(said(do.SetError(key, f"{20.0 * (number * 0.377 % 1.0) - 10.0:g}")))
            for number, key in enumerate(itertools.cycle(tab.sliders))
        )
        await steadily(tab.socket, list(itertools.islice(moves, count)))


def _serve() -> None:
    sys.path.append(str(HERE.parent / "benchmarks"))
    import soak_app

    from warpspace.app.evaluation import live_model, scene_overlays
    from warpspace.app.panels import design

    for cache in (live_model.CACHE, scene_overlays.CACHE, design.ENSEMBLES):
        cache.limit_bytes = CACHE_BYTES
    soak_app.serve()


if __name__ == "__main__":
    _serve()
