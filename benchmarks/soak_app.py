"""The app for an hour: tabs come, drag, drop out, come back, leave; memory must not grow.

    python benchmarks/soak_app.py [--minutes 60] [--tabs 6] [--rate 10] [--pause 1]

The first twelve minutes, at most a third of the run, are warming up (caches, and the ten minutes
for which a tab that left is kept). Every five seconds the server collects its garbage, gives free
pages back (`malloc_trim`) and says what it holds. What counts is the Theil-Sen line through the
medians of twenty parts of the run with its interval of 2σ, since tabs that come and go take and
give back some megabytes each. The allocator is fixed (`ALLOCATOR`), so that pages kept for later do
not look like growth. CPU is that of the server since the line before, readings included, in percent
of one core.
"""

import argparse
import asyncio
import ctypes
import gc
import os
import random
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import psutil
from scipy.stats import theilslopes

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from page_client import App, Tab, running_app

MOVES_A_DRAG = 10
KEYS = ("EAX", "EAY", "ECY", "EAZ", "EC0Y", "EA0Z", "EB0Z")
MAX_MB_PER_HOUR = 10.0
PARTS = 20
READING_S = 5.0
WARM_S = 720.0
PATIENCE_S = 300.0  # for a page on a busy machine
ALLOCATOR = {
    "MALLOC_ARENA_MAX": "2",
    "MALLOC_MMAP_THRESHOLD_": "65536",
    "MALLOC_TRIM_THRESHOLD_": "65536",
    "NUMPY_MADVISE_HUGEPAGE": "0",
    "PYTHONMALLOC": "malloc",
}
"""Of the soaked server only, so that what is free leaves the process."""
MEMORY_LINE = "memory after collection, MB: "


def serve() -> None:
    """Be the server: the app, which prints every few seconds what it holds."""
    from warpspace.cli import main as start

    libc = ctypes.CDLL("libc.so.6")
    myself = psutil.Process()

    def tell() -> None:
        while True:
            time.sleep(READING_S)
            gc.collect()
            libc.malloc_trim(0)
            print(f"{MEMORY_LINE}{myself.memory_info().rss / 1e6:.3f}", flush=True)

    threading.Thread(target=tell, daemon=True).start()
    del sys.argv[1]
    start()


def next_reading(server: psutil.Popen) -> float:
    """Wait for the server's next reading; give it, MB."""
    for line in server.stdout:
        if line.startswith(MEMORY_LINE):
            return float(line.removeprefix(MEMORY_LINE))
    raise EOFError("the server has ended")


async def visit(
    app: App, until: float, options: argparse.Namespace, rng: random.Random, counts: dict[str, int]
) -> None:
    """Be one visitor after the other, who drags one slider, looks, and drags another."""
    while time.monotonic() < until:
        tab = Tab(app)
        for _ in range(rng.randint(1, 4)):  # connections of one visitor
            await tab.open(PATIENCE_S)
            counts["connections"] += 1
            counts["open"] += 1
            for _ in range(rng.randint(1, 6)):
                key, start = rng.choice(KEYS), time.monotonic()
                for move in range(1, MOVES_A_DRAG + 1):
                    value = round(rng.uniform(-10.0, 10.0), 1)
                    await tab.drag(key, value)
                    counts["moves"] += 1
                    await asyncio.sleep(max(0.0, start + move / options.rate - time.monotonic()))
                if time.monotonic() > until:
                    break
                await asyncio.sleep(options.pause * rng.uniform(0.5, 1.5))
            await asyncio.sleep(0.4)
            await tab.close()
            counts["open"] -= 1
            tab = Tab(app, tab.token)
            await asyncio.sleep(rng.uniform(0.0, 0.3))
            if time.monotonic() > until:
                return


async def check_return(app: App) -> bool:
    """Check that a tab that comes back finds its state."""
    tab = Tab(app)
    await tab.open()
    await tab.drag("EAX", 7.5)
    await asyncio.sleep(1.0)
    numbers = tab.pieces["error.EAX"]
    await tab.close()
    await asyncio.sleep(0.5)
    returned = Tab(app, tab.token)
    await returned.open()
    await asyncio.sleep(1.0)
    is_same = returned.pieces["error.EAX"] == numbers
    await returned.close()
    return is_same


def growth(memory: list[tuple[float, float]]) -> tuple[np.ndarray, float, float]:
    """Compute the median of each part, MB, and the slope with the half of its 2σ interval, MB/h."""
    parts = np.array_split(np.array(memory), min(PARTS, len(memory)))
    hours, sizes = np.array([np.median(part, axis=0) for part in parts]).T
    line = theilslopes(sizes, hours / 3600.0, alpha=0.9545)
    slope, low, high = (float(number) for number in (line.slope, line.low_slope, line.high_slope))
    return sizes, slope, max(high - slope, slope - low)


async def run(app: App, options: argparse.Namespace) -> bool:
    """Soak and print; return True if nothing grew."""
    seconds, process = 60.0 * options.minutes, app.process
    until = time.monotonic() + seconds
    counts = {"connections": 0, "moves": 0, "open": 0}
    memory: list[tuple[float, float]] = []
    visitors = [
        asyncio.create_task(visit(app, until, options, random.Random(seed), counts))
        for seed in range(options.tabs)
    ]
    start, next_line = time.monotonic(), 0.0
    cpu_s = process.cpu_times()
    process.cpu_percent()  # from here on
    while time.monotonic() < until:
        size = await asyncio.to_thread(next_reading, process)
        at = time.monotonic() - start
        memory.append((at, size))
        if options.readings:
            np.savetxt(options.readings, memory, "%.3f", ",", header="s,MB")
        if at >= next_line:
            print(
                f"{at / 60:6.1f} min  {size:7.1f} MB  {process.cpu_percent():4.0f} % CPU"
                f"  {process.num_threads():4d} threads  {process.num_fds():4d} files"
                f"  {counts['open']:3d} open of {counts['connections']} connections",
                flush=True,
            )
            next_line += max(60.0, seconds / 10.0)
    await asyncio.gather(*visitors)
    spent_s = sum(process.cpu_times()[:2]) - sum(cpu_s[:2])
    await asyncio.sleep(3.0)
    is_restored = await check_return(app)
    await asyncio.sleep(2.0)
    sizes, slope, error = growth([m for m in memory if m[0] > min(WARM_S, seconds / 3.0)])
    print(
        f"{counts['connections']} connections, {counts['moves']} moves in {options.minutes:g} min"
    )
    print(
        f"CPU {100.0 * spent_s / seconds:.0f} % of a core,"
        f" {1000.0 * spent_s / max(counts['moves'], 1):.1f} ms a move, connecting included"
    )
    print(
        f"memory {sizes[0]:.1f} → {sizes[-1]:.1f} MB,"
        f" growth {slope:+.1f} ± {error:.1f} MB per hour (at most {slope + error:+.1f})"
    )
    print(f"left open: {process.num_threads()} threads, {process.num_fds()} files")
    print(f"a tab that comes back finds its state: {'yes' if is_restored else 'NO'}")
    return is_restored and is_flat(slope, error, options.minutes / 60.0)


def is_flat(slope: float, error: float, hours: float) -> bool:
    """Check that growth is small and known well enough; a short run fails only on growth."""
    if hours < 1.0:
        return (slope - error) * hours <= MAX_MB_PER_HOUR
    return error <= MAX_MB_PER_HOUR and slope <= MAX_MB_PER_HOUR


def main() -> None:
    """Run from the command line; exit 1 where something grew."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--tabs", type=int, default=6, help="visitors at a time")
    parser.add_argument("--rate", type=float, default=10.0, help="moves per second of a drag")
    parser.add_argument("--pause", type=float, default=1.0, help="seconds between two drags, about")
    parser.add_argument("--readings", help="CSV file for every reading")
    options = parser.parse_args()
    process = {"env": {**os.environ, **ALLOCATOR}, "text": True}
    with running_app(launcher=(__file__, "serve"), stdout=subprocess.PIPE, **process) as app:
        fine = asyncio.run(run(app, options))
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    serve() if sys.argv[1:2] == ["serve"] else main()
