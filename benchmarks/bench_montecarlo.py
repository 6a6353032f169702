"""Time of sampling, relative to the bare matrix products and to a line of NumPy."""

import numpy as np
from scipy import stats
from table import Growth, Row, Section
from timing import best, in_turns, python

import warpspace
from warpspace.analysis.commands.concepts import Concepts, compare_concepts
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.sampling.cases import Case, SamplingPlan, reduce_nodes
from warpspace.analysis.sampling.distribution import build_draws
from warpspace.analysis.sampling.machine_sampling import sample_chunks
from warpspace.kinematics.model import Loop

MACHINES, NODES = 100_000, 11
SAMPLES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
LIBRARY = (
    *("dvf5000_first", "machine_trunnion_ac", "machine_head_head_ca", "machine_bridge_cmm"),
    *("machine_gantry_mill", "machine_scara", "machine_printer_3d", "machine_lathe_mill"),
)
COUNTS = (1, 2, 4, 8)
MANY = """
import re, sys, warpspace
from pathlib import Path
warpspace.montecarlo(warpspace.load_scene("dvf5000_general"), samples=10_000_000)
found = re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())
print(f"peak {found[1]} kB", file=sys.stderr)
"""


def measure() -> Section:
    """Measure sampled machines."""
    scene = warpspace.load_scene("dvf5000_general")
    keys = loop_keys(scene.model, Loop.TOOL, scene.parameter_keys)
    draws = build_draws(scene.tolerances, keys, "uniform")
    case = Case(scene.model, draws, scene.workspace)
    gains = case.responses(case.spread(NODES))
    amplitudes = draws.draw(np.random.default_rng(0), MACHINES)
    out = np.empty((4096, gains.shape[2]))
    widths = np.ptp(amplitudes, axis=0) / 2.0
    one_node = np.ascontiguousarray(gains[:, :, 0].T)
    nodes = gains.shape[2]

    def products() -> None:
        for gain in gains:
            for start in range(0, MACHINES, len(out)):
                block = amplitudes[start : start + len(out)]
                np.matmul(block, gain, out=out[: len(block)])

    def engine(statistic: str) -> None:
        for _ in sample_chunks(
            lambda rng, count: reduce_nodes(draws.draw(rng, count), gains, statistic),
            SamplingPlan(samples=MACHINES),
        ):
            pass

    def numpy_line() -> object:
        rng = np.random.default_rng(0)
        drawn = rng.uniform(-widths, widths, (MACHINES, len(widths)))
        return np.percentile(np.linalg.norm(drawn @ one_node, axis=1), 95)

    def scipy_line() -> object:
        drawn = stats.uniform(-widths, 2.0 * widths).rvs((MACHINES, len(widths)), random_state=0)
        return np.percentile(np.linalg.norm(drawn @ one_node, axis=1), 95)

    def ours() -> object:
        return warpspace.montecarlo(scene, samples=MACHINES)

    rows = []
    for library, line in (("NumPy", numpy_line), ("SciPy", scipy_line)):
        took, floor = in_turns(ours, line, 3)
        baseline = f"one line of {library} at one node, P95 only"
        rows.append(
            Row(f"montecarlo, {MACHINES:,} machines at random points", took, baseline, floor)
        )
    baseline = f"the bare matrix products, {len(keys)} errors"
    for statistic in ("max", "mean"):
        took, floor = in_turns(lambda: engine(statistic), products, 2)  # noqa: B023
        label = f"drawing {MACHINES:,} machines, {statistic} over {nodes} nodes"
        rows.append(Row(label, took, baseline, floor, max_ratio=4.0))
    many = python("-c", MANY)
    floor = "the amplitudes of all machines at once"
    samples_mb = 10_000_000 * len(keys) * 8 / 2**20
    rows.append(
        Row(
            "memory for 10,000,000 machines",
            many.peak_mb,
            floor,
            samples_mb,
            "MB",
            max_value=1024.0,
        )
    )
    scenes = [warpspace.load_scene(name) for name in LIBRARY]
    plan = Concepts(samples=20_000)
    growth = [
        Growth(
            "montecarlo at random points",
            "samples",
            [*map(float, SAMPLES)],
            [best(lambda: warpspace.montecarlo(scene, samples=n), 2) for n in SAMPLES],  # noqa: B023
        ),
        Growth(
            "concepts side by side, 20,000 samples each",
            "machines",
            [*map(float, COUNTS)],
            [best(lambda: compare_concepts(scenes[:n], plan), 1) for n in COUNTS],  # noqa: B023
        ),
    ]
    text = (
        "Machines sampled from their tolerances. The lines of NumPy and SciPy draw the same number"
        " of machines at one node; ours draws a point for each machine too, keeps a histogram and"
        " streams, so that memory stays flat. Processor time of all threads together."
    )
    return Section("Monte Carlo", text, rows, growth)
