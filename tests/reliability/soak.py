"""Twenty tabs for an hour: they come, drag, drop out and come back; see benchmarks/soak_app.py."""

import re
import subprocess
import sys
from pathlib import Path

from reliability.row import Outcome

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "soak_app.py"
TABS, RATE, PAUSE_S = 20, 10.0, 15.0


def run(count: int) -> Outcome:
    """Run so many minutes."""
    command = [sys.executable, str(SCRIPT), "--minutes", str(count), "--tabs", str(TABS)]
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
