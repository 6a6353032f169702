"""The app for an hour: tabs come, drag, drop out, come back, leave; memory must not grow.

    python benchmarks/soak_app.py [--minutes 60] [--tabs 6] [--rate 10] [--pause 1]

A fifth of the run is warming up (caches, allocator). Then the line through the least memory of ten
parts of the run is what counts: tabs that come and go take and give back some megabytes each, so
that growth is said with its uncertainty. So is what stays behind of threads and open files. CPU is
that of the server since the line before, in percent of one core.
"""

import argparse
import asyncio
import random
import sys
import time

import numpy as np
from app_client import Tab, rss_mb, running_app

MOVES_A_DRAG = 10
KEYS = ("EAX", "EAY", "ECY", "EAZ", "EC0Y", "EA0Z", "EB0Z")
MAX_MB_PER_HOUR = 20.0
PARTS = 10


async def visit(
    url: str, until: float, options: argparse.Namespace, rng: random.Random, counts: dict[str, int]
) -> None:
    """Be one visitor after the other, who drags one slider, looks, and drags another."""
    while time.monotonic() < until:
        tab = Tab(url)
        for _ in range(rng.randint(1, 4)):  # connections of one visitor
            await tab.open()
            counts["connections"] += 1
            counts["open"] += 1
            expected = tab.values
            for _ in range(rng.randint(1, 6)):
                key, start = rng.choice(KEYS), time.monotonic()
                for move in range(1, MOVES_A_DRAG + 1):
                    value = round(rng.uniform(-10.0, 10.0), 1)
                    await tab.drag(key, value)
                    expected[key] = value
                    counts["moves"] += 1
                    await asyncio.sleep(max(0.0, start + move / options.rate - time.monotonic()))
                await asyncio.sleep(options.pause * rng.uniform(0.5, 1.5))
            await asyncio.sleep(0.4)
            await tab.close()
            counts["open"] -= 1
            again = Tab(url, tab.token)
            again.values = {}
            tab = again
            await asyncio.sleep(rng.uniform(0.0, 0.3))
            if time.monotonic() > until:
                return


async def check_return(url: str) -> bool:
    """Tell whether a tab that comes back finds its state."""
    tab = Tab(url)
    await tab.open()
    await tab.drag("EAX", 7.5)
    await asyncio.sleep(1.0)
    numbers = tab.shown
    await tab.close()
    await asyncio.sleep(0.5)
    back = Tab(url, tab.token)
    await back.open()
    await asyncio.sleep(1.0)
    found = back.shown == numbers
    await back.close()
    return found


def growth(memory: list[tuple[float, float]]) -> tuple[np.ndarray, float, float]:
    """Give the least memory of each part, MB, and its slope with twice the standard error, MB/h."""
    parts = [np.array(part) for part in np.array_split(np.array(memory), PARTS)]
    hours = np.array([part[:, 0].mean() for part in parts]) / 3600.0
    least = np.array([part[:, 1].min() for part in parts])
    (slope, _), covariance = np.polyfit(hours, least, 1, cov=True)
    return least, float(slope), float(2.0 * np.sqrt(covariance[0, 0]))


async def run(url: str, process, options: argparse.Namespace) -> bool:
    """Soak and print; give whether nothing grew."""
    seconds = 60.0 * options.minutes
    until = time.monotonic() + seconds
    counts = {"connections": 0, "moves": 0, "open": 0}
    memory: list[tuple[float, float]] = []
    visitors = [
        asyncio.create_task(visit(url, until, options, random.Random(seed), counts))
        for seed in range(options.tabs)
    ]
    start, next_line = time.monotonic(), 0.0
    cpu_s = process.cpu_times()
    process.cpu_percent()  # from here on
    while time.monotonic() < until:
        at = time.monotonic() - start
        memory.append((at, rss_mb(process)))
        if at >= next_line:
            print(
                f"{at / 60:6.1f} min  {memory[-1][1]:7.1f} MB  {process.cpu_percent():4.0f} % CPU"
                f"  {process.num_threads():4d} threads  {process.num_fds():4d} files"
                f"  {counts['open']:3d} open of {counts['connections']} connections",
                flush=True,
            )
            next_line += max(60.0, seconds / 10.0)
        await asyncio.sleep(1.0)
    await asyncio.gather(*visitors)
    spent_s = sum(process.cpu_times()[:2]) - sum(cpu_s[:2])
    await asyncio.sleep(3.0)
    found = await check_return(url)
    await asyncio.sleep(2.0)
    sizes, slope, error = growth([m for m in memory if m[0] > seconds / 5.0])
    print(
        f"{counts['connections']} connections, {counts['moves']} moves in {options.minutes:g} min"
    )
    print(
        f"CPU {100.0 * spent_s / seconds:.0f} % of a core,"
        f" {1000.0 * spent_s / max(counts['moves'], 1):.1f} ms a move, connecting included"
    )
    print(f"memory {sizes[0]:.1f} → {sizes[-1]:.1f} MB, {slope:+.1f} ± {error:.1f} MB per hour")
    print(f"left open: {process.num_threads()} threads, {process.num_fds()} files")
    print(f"a tab that comes back finds its state: {'yes' if found else 'NO'}")
    return found and (slope - error) * options.minutes / 60.0 < MAX_MB_PER_HOUR


def main() -> None:
    """Run from the command line; exit 1 where something grew."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--tabs", type=int, default=6, help="visitors at a time")
    parser.add_argument("--rate", type=float, default=10.0, help="moves per second of a drag")
    parser.add_argument("--pause", type=float, default=1.0, help="seconds between two drags, about")
    options = parser.parse_args()
    with running_app() as (url, process):
        fine = asyncio.run(run(url, process, options))
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
