"""
Standard tests
==============

The figure of every standard test, run on models whose errors suit them; positioning with measured
readings drawn over the model's.

Run ``python examples/bench.py [FOLDER]``; it writes one PNG a test.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from warpspace import load_scene, run_test
from warpspace.bench.base import bench_names, find_test
from warpspace.bench.kinds.positioning import Positioning
from warpspace.machine.curves.simple import Directional
from warpspace.machine.errors import ErrorSet, Poly, Ramp
from warpspace.outputs.charts.result_charts import bench_chart
from warpspace.outputs.figure_files import write_chart

SPAN = (-275.0, 275.0)
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
first = load_scene("dvf5000_first")
# X is short by 6 µm, has a reversal of 3 µm and runs in an arc of 4 µm
curved = ErrorSet(
    {
        **first.errors.functions,
        "EXX": Directional(SPAN, Ramp(SPAN, -6.0), Poly(SPAN, (-6.0, -6.0 / 550.0))),
        "EYX": Poly(SPAN, (0.0, 2e-3, -4.0 / 275.0**2, 1.5e-7)),
    }
)
bent = replace(first, title="DVF5000 with a worn X axis", errors=curved)
scenes = {"rotary-axis": load_scene("teach_wobbling_table")}
for name in bench_names():
    if name == "positioning":
        continue
    worn = name in {"straightness", "circular"}
    scene = scenes.get(name, bent if worn else first)
    write_chart(bench_chart(run_test(scene, find_test(name)())), folder / f"test_{name}.png")

# Five runs to eleven targets, both ways, with a scatter of 0.4 µm.
scatter = np.random.default_rng(230)
targets = np.linspace(*SPAN, 11)
rows = ["run,direction,target_mm,deviation_um"]
for run in range(1, 6):
    for sign, step in (("+", 0.0), ("-", -3.4)):
        line = -5.2 * (targets + 275.0) / 550.0 + 0.9 * np.sin(targets / 60.0) + step
        noisy = line + scatter.normal(0.0, 0.4, targets.size)
        rows += [
            f"{run},{sign},{at:g},{value:.3f}" for at, value in zip(targets, noisy, strict=True)
        ]
with tempfile.TemporaryDirectory() as folder_name:
    data = Path(folder_name) / "positioning.csv"
    data.write_text("\n".join(rows), encoding="utf-8")
    result = run_test(bent, Positioning(axis="X"), data)
write_chart(bench_chart(result), folder / "test_positioning.png")
