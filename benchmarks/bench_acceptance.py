"""Time and memory of the search for the worst machine that passes acceptance tests."""

import numpy as np
from table import Growth, Row, Section
from timing import best, python

import warpspace
from warpspace.acceptance_tests.acceptance import Acceptance, find_worst_machine
from warpspace.acceptance_tests.plans import load_plan

KNOTS = (2, 3, 5, 9)
PLAN = "iso_5_axes_bc"
ONCE = """
import re, sys, warpspace
from pathlib import Path
warpspace.acceptance(warpspace.load_scene("dvf5000_general"))
found = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
print(f"peak {found[1]} kB", file=sys.stderr)
"""


def measure() -> Section:
    """Measure the search with knots and tests."""
    scene = warpspace.load_scene("dvf5000_general")
    tests = load_plan(PLAN, scene)
    counts = [int(count) for count in np.linspace(2, len(tests), 4)]

    def search(count: int, knots: int = 5) -> float:
        request = Acceptance(knots=knots)
        return best(lambda: find_worst_machine(scene, tests[:count], request), 1)

    label, floor = f"dvf5000_general, {len(tests)} tests", "without tests"
    rows = [
        Row(label, search(len(tests)), floor, search(0), max_value=10.0),
        Row("its memory", python("-c", ONCE).peak_mb, "target", 500.0, "MB", max_value=500.0),
    ]
    growth = [
        Growth("worst machine", "knots", [*map(float, KNOTS)],
               [search(len(tests), knots) for knots in KNOTS]),
        Growth("worst machine", "tests", [*map(float, counts)], [search(n) for n in counts]),
    ]  # fmt: skip
    text = "Linear programs over all machines within tolerance that pass a plan of tests."
    return Section("Acceptance tests", text, rows, growth)
