"""What came of a row, and how much of a delay is that of a machine with others to serve."""

import time
from dataclasses import dataclass, field

WORK = 200_000
"""Additions of one measurement, about 10 ms."""


@dataclass
class Outcome:
    count: int
    result: str
    faults: list[str] = field(default_factory=list)


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
