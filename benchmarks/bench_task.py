"""One complete task, by the command and by a script that a competent user would write."""

import tempfile
from pathlib import Path

from table import Row, Section
from timing import cheapest, python, warpspace

PLAIN = Path(__file__).with_name("plain_map.py")
SCENE = Path(__file__).parents[1] / "scenes" / "machine_gantry_mill.toml"
RUN_PLAIN = f"""
import re, runpy, sys
from pathlib import Path
try:
    runpy.run_path({str(PLAIN)!r}, run_name="__main__")
finally:
    found = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
    print(f"peak {{found[1]}} kB", file=sys.stderr)
"""


def count_lines(path: Path) -> int:
    """Lines that say something: neither blank nor a comment."""
    lines = map(str.strip, path.read_text(encoding="utf-8").splitlines())
    return sum(bool(line) and not line.startswith("#") for line in lines)


def measure() -> Section:
    """Measure both in fresh processes."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "map.png"
        ours = cheapest(lambda: warpspace("draw", SCENE, "--force", "-o", target))
        plain = cheapest(lambda: python("-c", RUN_PLAIN, Path(folder) / "plain.png"))
    label, baseline = "a map of 21³ nodes as PNG", "benchmarks/plain_map.py"
    rows = [
        Row(f"{label}, CPU", ours.processor_s, baseline, plain.processor_s),
        Row(f"{label}, memory", ours.peak_mb, baseline, plain.peak_mb, "MB"),
        Row("lines that its author writes", count_lines(SCENE), baseline, count_lines(PLAIN), ""),
    ]
    text = (
        "The error map of a three-axis machine with 21 errors, from start to picture, with a"
        " slider: a scene file and `draw` or `view`, beside numpy and matplotlib. Both give a mean"
        " of 26.79 and a maximum of 67.92 µm. The script draws grid lines only, without hidden"
        " lines, and its slider moves one error."
    )
    return Section("One task beside a script", text, rows)
