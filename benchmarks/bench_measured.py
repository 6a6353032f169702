"""What was measured: inspection reports are read, and the causes of readings are ranked."""

import io
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pandas as pd
from table import Row, Section
from timing import best, in_turns

from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.bench.plan import simulate
from warpspace.calibration.registry import TestReadings
from warpspace.diagnosis.diagnose import Diagnose
from warpspace.parts.inspection_report import MAX_HOLES, load_report
from warpspace.units import MM_PER_UM, Array

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))

NAMES = ("hole", "nominal x", "nominal y", "measured x", "measured y")
PEERS: dict[str, Callable[[io.BytesIO], object]] = {
    ".txt": partial(pd.read_csv, sep="\t"),
    ".csv": pd.read_csv,
    ".xlsx": partial(pd.read_excel, engine="calamine"),
}
MACHINES = {"machine_trunnion_ac": 100, "machine_gantry_mill": 150}  # radius of the circles


def write_report(path: Path) -> None:
    """Write a report of as many holes as one may have."""
    random = np.random.default_rng(0)
    nominal = random.uniform(-300.0, 300.0, (MAX_HOLES, 2)).round(3)
    measured = (nominal + random.normal(0.0, 0.01, nominal.shape)).round(4)
    table = pd.DataFrame(np.hstack([nominal, measured]), columns=NAMES[1:])
    table.insert(0, NAMES[0], [f"H{number}" for number in range(MAX_HOLES)])
    if path.suffix == ".xlsx":
        from workbooks import xlsx

        path.write_bytes(xlsx([NAMES, *table.itertuples(index=False, name=None)]))
    else:
        table.to_csv(path, index=False, sep="\t" if path.suffix == ".txt" else ",")


def report_row(path: Path) -> Row:
    """Compare the reading of a report with that of its bytes by pandas."""
    write_report(path)
    content = path.read_bytes()
    ours, peer = in_turns(
        lambda: load_report(path), lambda: PEERS[path.suffix](io.BytesIO(content))
    )
    label = f"inspection report of {MAX_HOLES:,} holes, {path.suffix}"
    return Row(label, ours, "pandas reads the same bytes", peer, max_value=0.15)


def diagnose_row(name: str, radius_mm: int) -> Row:
    """Compare a diagnosis of three circles and a plate with the inversion of its matrices."""
    scene = load_scene(name)
    kinds = [f"circular:plane={plane}:radius={radius_mm}:points=18" for plane in ("XY", "XZ", "YZ")]
    sets = []
    for kind in (*kinds, "ball-plate"):
        planned = TestReadings(kind).plan_readings(scene)
        read_mm = simulate(scene, planned.plan).reshape(planned.observed_mm.shape) * MM_PER_UM
        sets.append(replace(planned, observed_mm=read_mm, source=kind))
    invert, matrices = np.linalg.inv, list[Array]()

    def record(matrix: Array) -> Array:
        matrices.append(matrix.copy())
        return invert(matrix)

    def diagnose() -> object:
        return Diagnose().diagnose(sets, scene, ignore_progress)

    with patch("numpy.linalg.inv", record):
        diagnose()
    cost, floor = best(diagnose, 3), best(lambda: [invert(matrix) for matrix in matrices], 3)
    label = f"diagnose, three circles and a plate, {name}"
    return Row(label, cost, f"inverting its {len(matrices):,} matrices", floor, max_value=2.0)


def measure() -> Section:
    """Measure the reading of reports, and a diagnosis on two machines."""
    with TemporaryDirectory() as folder:
        rows = [report_row(Path(folder) / f"report{ending}") for ending in PEERS]
    rows += [diagnose_row(*machine) for machine in MACHINES.items()]
    label = (
        "Reports of the largest size that is read, checked cell by cell, the line of each known."
        " A diagnosis ranks all causes and pairs of them, and the checks that separate them."
    )
    return Section("Measured parts and machines", label, rows)
