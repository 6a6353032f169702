"""Measurement of processor time, in turns with a baseline.

Processor time does not count what else a machine is busy with, and taking turns lets what is left
of it (caches, clock) meet both sides. The shortest of several runs is the one disturbed least.
"""

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from os import wait4

Run = Callable[[], object]
Command = Sequence[object]
"""Arguments of an interpreter."""
PEAK = """
import re, sys
from pathlib import Path
from warpspace.cli import main
try:
    main()
finally:
    found = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
    print(f"peak {found[1]} kB", file=sys.stderr)
"""


@dataclass(frozen=True)
class Cost:
    """Cost of a command: processor time in s, wall time in s, peak memory in MB."""

    processor_s: float
    wall_s: float
    peak_mb: float = 0.0


def processor_s(run: Run) -> float:
    """Processor time of one run, all threads together, s."""
    start = time.process_time()
    run()
    return time.process_time() - start


def best(run: Run, repeats: int = 5) -> float:
    """Shortest processor time of several runs, after one that warms up, s."""
    run()
    return min(processor_s(run) for _ in range(repeats))


def in_turns(ours: Run, baseline: Run, repeats: int = 5) -> tuple[float, float]:
    """Shortest processor times of two things that are run in turns, s."""
    ours()
    baseline()
    pairs = [(processor_s(ours), processor_s(baseline)) for _ in range(repeats)]
    return min(pair[0] for pair in pairs), min(pair[1] for pair in pairs)


def python(*arguments: object) -> Cost:
    """Run a fresh interpreter; what it loads was compiled by the first run, as a user's is."""
    start = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=_environment(),
    ) as process:
        errors = process.stderr.read().decode() if process.stderr else ""
        _, status, used = wait4(process.pid, 0)
        process.returncode = status
    if status:
        raise RuntimeError(f"{' '.join(map(str, arguments))}: {errors}")
    peak = [line.split()[1] for line in errors.splitlines() if line.startswith("peak ")]
    wall = time.perf_counter() - start
    return Cost(used.ru_utime + used.ru_stime, wall, float(peak[0]) / 1024.0 if peak else 0.0)


def warpspace(*arguments: object) -> Cost:
    """Run the command line in a fresh interpreter, its memory measured too."""
    return python("-c", PEAK, *arguments)


@cache
def _environment() -> dict[str, str]:
    folder = tempfile.mkdtemp(prefix="benchmarks-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": folder}


def commands_in_turns(ours: Command, baseline: Command, repeats: int = 3) -> tuple[Cost, Cost]:
    """Run two commands in turns, after a run of each that warms up; give the cheapest of each."""
    python(*ours)
    python(*baseline)
    pairs = [(python(*ours), python(*baseline)) for _ in range(repeats)]
    first, second = (
        min(costs, key=lambda cost: cost.processor_s) for costs in zip(*pairs, strict=True)
    )
    return first, second


def cheapest(run: Callable[[], Cost], repeats: int = 3) -> Cost:
    """Return the run with the least processor time."""
    return min((run() for _ in range(repeats)), key=lambda cost: cost.processor_s)
