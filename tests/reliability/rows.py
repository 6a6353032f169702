"""The rows of docs/reliability.md: what must hold stands there; how often, and how it is tried."""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from reliability import (
    comments,
    doors,
    failing,
    kills,
    lines,
    messages,
    proxy,
    surroundings,
    together,
)
from reliability.outcome import Outcome
from reliability.reading import read_many

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reliability.md"
SEED = 14
TABS, RATE, PAUSE_S = 20, 10.0, 15.0


def soak(count: int) -> Outcome:
    script = ROOT / "benchmarks" / "soak_app.py"
    command = [sys.executable, str(script), "--minutes", str(count), "--tabs", str(TABS)]
    pace = ["--rate", str(RATE), "--pause", str(PAUSE_S)]
    process = subprocess.run([*command, *pace], capture_output=True, text=True, check=False)
    said = process.stdout
    memory = re.search(r"memory .*", said)
    moves = re.search(r"(\d+) connections, (\d+) moves", said)
    if process.returncode or memory is None or moves is None:
        return Outcome(0, "", [(said + process.stderr)[-1500:]])
    connections, drags = (int(word) for word in moves.groups())
    return Outcome(
        count, f"{TABS} tabs, {connections:,} connections, {drags:,} slider moves; {memory[0]}"
    )


@dataclass(frozen=True)
class Row:
    full: int
    unit: str
    run: Callable[[int], Outcome]


ROWS = {
    "files": Row(100_000, "files", partial(read_many, "bytes", seed=SEED)),
    "scenes": Row(50_000, "scenes", partial(read_many, "hypothesis", seed=SEED)),
    "programs": Row(20_000, "programs", partial(read_many, "programs", seed=SEED)),
    "comments": Row(3_000, "titles", comments.run),
    "lines": Row(10_000, "lines", lines.run),
    "messages": Row(100_000, "messages", messages.run),
    "kills": Row(1_000, "kills", kills.run),
    "updates": Row(400, "notes", partial(together.run, "updates")),
    "sets": Row(2_000, "outputs", partial(together.run, "sets")),
    "surroundings": Row(160, "runs", surroundings.run),
    "soak": Row(60, "minutes", soak),
    "doors": Row(20_000, "attempts", doors.run),
    "proxy": Row(200, "visitors", proxy.run),
    "failing states": Row(2_000, "states", failing.run),
}


def put_row(text: str, name: str, outcome: Outcome, date: str) -> str:
    """Write count, date and result of a row; the count is what was run, of the full one."""
    held = f"held: {outcome.result}" if not outcome.faults else f"**fails**: {outcome.faults[0]}"
    clean = re.sub(r"\s+", " ", held).replace("|", "\\|")[:2000]
    count = f"{outcome.count:,} {ROWS[name].unit}"
    if outcome.count < ROWS[name].full:
        count += f" (of {ROWS[name].full:,})"
    line = re.compile(rf"^(\| `{name}` \| .*? \|) .*$", re.MULTILINE)
    return line.sub(lambda found: f"{found[1]} {count} | {date} | {clean} |", text)
