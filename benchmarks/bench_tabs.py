"""Five tabs drag a slider each at 20 Hz beside fifteen idle ones: latency, stale values, memory.

    python benchmarks/bench_tabs.py [--tabs 5] [--idle 15] [--seconds 60] [--rate 20]

Latency is from sending a slider's position until the numbers of that position, or of a later one,
have come back: everything but the browser. The load of the machine stands beside it.
"""

import argparse
import asyncio
import os
import sys
import time

import numpy as np
from app_client import NUMBERS, Tab, rss_mb, running_app

from warpspace import load_scene
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.readouts import summary as legend
from warpspace.app.state.app_state import start_state

KEY = "EAY"
POSITIONS = 61
SETTLED_S = 10.0
FINAL_S = 10.0
"""How long the last value may take to be shown before it counts as stale."""


def expected() -> tuple[np.ndarray, dict[tuple, int]]:
    """Give the positions of the drag and the numbers that each must show."""
    values = np.linspace(-90.0, 90.0, POSITIONS).round(1)
    live, state = LiveModel(), start_state(load_scene("dvf5000_first"))
    shown = {
        tuple(NUMBERS.findall(legend.summary(live.evaluate(state.with_amplitude(KEY, v))))): i
        for i, v in enumerate(values.tolist())
    }
    assert len(shown) == POSITIONS, "positions cannot be told apart by their numbers"
    return values, shown


async def drag(tab: Tab, values: np.ndarray, seconds: float, rate: float) -> list[tuple]:
    """Drag to and fro; give when which position was sent."""
    sent, start, tick = [], time.perf_counter(), 0
    # tabs are not in step with each other
    await asyncio.sleep(np.random.default_rng(id(tab)).uniform(0.0, 1.0 / rate))
    while time.perf_counter() - start < seconds:
        at = tick % (2 * POSITIONS - 2)
        index = at if at < POSITIONS else 2 * POSITIONS - 2 - at
        sent.append((time.perf_counter(), index))
        await tab.drag(KEY, float(values[index]))
        tick += 1
        await asyncio.sleep(max(0.0, start + tick / rate - time.perf_counter()))
    return sent


def latencies(sent: list[tuple], seen: list[tuple], shown: dict[tuple, int]) -> list[float]:
    """Give the time until each position sent, or a later one, was answered, s."""
    found, done = [], 0
    for at, numbers in seen:
        index = shown.get(numbers)
        # the latest position sent before with these numbers
        newest = next(
            (
                i
                for i in range(len(sent) - 1, done - 1, -1)
                if sent[i][0] < at and sent[i][1] == index
            ),
            None,
        )
        if newest is None:
            continue
        found += [at - sent[i][0] for i in range(done, newest + 1)]
        done = newest + 1
    return found


async def run(url: str, process, options: argparse.Namespace) -> bool:
    """Measure and print; give whether all targets are met."""
    values, shown = expected()
    every = [Tab(url) for _ in range(options.tabs + options.idle)]
    tabs = every[: options.tabs]
    start = time.perf_counter()
    for tab in every:
        await tab.open()
    print(
        f"{len(every)} tabs open after {time.perf_counter() - start:.1f} s,"
        f" {len(tabs)} of them drag"
    )
    for tab in tabs:
        tab.seen.clear()
        tab.bytes = 0
    process.cpu_percent()
    memory: list[tuple[float, float]] = []

    async def watch() -> None:
        begin = time.perf_counter()
        while True:
            memory.append((time.perf_counter() - begin, rss_mb(process)))
            await asyncio.sleep(0.5)

    watcher = asyncio.create_task(watch())
    sent = await asyncio.gather(*(drag(tab, values, options.seconds, options.rate) for tab in tabs))
    cpu = process.cpu_percent()
    pictures = sum(len(tab.seen) for tab in tabs)
    moved = sum(tab.bytes for tab in tabs) / max(sum(len(tab.seen) for tab in tabs), 1)
    end = time.perf_counter()
    while True:
        await asyncio.sleep(0.1)
        pairs = zip(tabs, sent, strict=True)
        stale = sum(shown.get(tab.shown) != out[-1][1] for tab, out in pairs)
        if not stale or time.perf_counter() - end > FINAL_S:
            break
    final = time.perf_counter() - end
    watcher.cancel()
    times = [
        t for tab, out in zip(tabs, sent, strict=True) for t in latencies(out, tab.seen, shown)
    ]
    for tab in every:
        await tab.close()
    p50, p95, worst = 1e3 * np.quantile(times, (0.5, 0.95, 1.0))
    settled = [mb for at, mb in memory if at >= min(SETTLED_S, options.seconds / 2)]
    growth = np.mean(settled[-4:]) - np.mean(settled[:4])
    load = os.getloadavg()[0]
    print(f"positions sent       {sum(map(len, sent))}, answered {len(times)}")
    print(
        f"latency              median {p50:.1f} ms, p95 {p95:.1f} ms (≤ 50), worst {worst:.0f} ms"
    )
    each = 10 * cpu * options.seconds / pictures
    print(f"pictures             {pictures}, {each:.2f} ms of a core each")
    print(f"bytes per picture    {moved / 1e3:.1f} kB (≤ 200)")
    print(f"stale final values   {stale} (0), all shown after {final:.1f} s")
    print(f"memory               {settled[-1]:.0f} MB, {growth:+.1f} MB after settling (flat)")
    print(f"server               {cpu:.0f} % of a core; load of the machine {load:.1f}")
    print(f"messages             {sorted({p for tab in tabs for p in tab.problems}) or 'none'}")
    return p95 <= 50.0 and stale == 0 and growth < 10.0 and moved <= 200e3


def main() -> None:
    """Run from the command line; exit 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tabs", type=int, default=5, help="tabs that drag")
    parser.add_argument("--idle", type=int, default=15, help="tabs that are open beside them")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=20.0, help="positions per second and tab")
    options = parser.parse_args()
    with running_app() as (url, process):
        fine = asyncio.run(run(url, process, options))
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
