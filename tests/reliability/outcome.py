"""What came of a row, and how much of a delay is that of a machine with others to serve."""

import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

WORK = 200_000
"""Additions of one measurement, about 10 ms."""


@dataclass
class Outcome:
    count: int
    result: str
    faults: list[str] = field(default_factory=list)


def run_module(module: str, *arguments: str) -> tuple[str, list[str]]:
    """Run a module of this folder in a process of its own; give its last line and its faults."""
    process = subprocess.run(
        [sys.executable, "-m", f"reliability.{module}", *arguments],
        cwd=Path(__file__).resolve().parents[1], capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = process.stdout.splitlines()
    if process.returncode or not lines:
        return "", [process.stderr[-2000:]]
    return lines[-1], [line[6:] for line in lines if line.startswith("fault ")]


class Lag:
    def __init__(self) -> None:
        self.most = 1.0

    def measure(self) -> None:
        clock, own = time.perf_counter(), time.process_time()
        sum(range(WORK))
        clock, own = time.perf_counter() - clock, time.process_time() - own
        self.most = max(self.most, clock / max(own, 1e-4))

    def judge(self, slowest_s: float, longest_s: float) -> list[str]:
        if slowest_s <= longest_s * self.most:
            return []
        return [f"an answer took {slowest_s:.2f} s; the machine was {self.most:.1f} × slowed down"]

    @property
    def words(self) -> str:
        return f"on a machine slowed down up to {self.most:.1f} × by other work"
