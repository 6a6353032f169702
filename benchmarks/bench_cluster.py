"""Rates of Monte Carlo per core, and bytes a task sends: what docs/cluster.md extrapolates from.

    python benchmarks/bench_cluster.py [--blocks 16]

Times are those of the processor, so that a machine with other work gives the same rates.
"""

import argparse
import pickle
import time

import warpspace
from warpspace.analysis.commands.montecarlo import sweep
from warpspace.analysis.sampling.cases import BLOCK, MOST_BLOCKS, Case, SamplingPlan, sample_blocks
from warpspace.analysis.sampling.machine_sampling import montecarlo_each, scene_draws

TRILLION = 10**12
FLEET = 100_000
SAMPLES = 100_000
TASK_S = 1e-3
"""Time of a Dask scheduler for a task: up to 1 ms (Dask documentation, "Best Practices")."""


def case(scene: warpspace.Scene, statistic: str, samples: int) -> Case:
    """Build a case of the tool loop."""
    view = scene.view()
    draws = scene_draws(scene, view.loop, "uniform", clip=False)
    return Case(
        scene.model, draws, scene.workspace, view, SamplingPlan(samples, reduction=statistic)
    )


def main() -> None:
    """Measure and extrapolate."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blocks", type=int, default=16, help="of 8,192 machines")
    blocks = parser.parse_args().blocks
    scene = warpspace.load_scene("dvf5000_general")
    print(f"{'over':8} {'machines/s of a core':>22} {'MB of a task':>14} {'core h of 10^12':>17}")
    for statistic in ("sampled", "max", "mean"):
        of = case(scene, statistic, TRILLION)
        job = of.build_job()
        sample_blocks(of, 0, 1, keep=False, job=job)
        began = time.process_time()
        part = sample_blocks(of, 0, blocks, keep=False, job=job)
        rate = part.count / (time.process_time() - began)
        size = len(pickle.dumps(part)) / 1e6
        print(f"{statistic:8} {rate:22,.0f} {size:14.2f} {TRILLION / rate / 3600.0:17,.0f}")
    tasks = TRILLION / (MOST_BLOCKS * BLOCK)
    of = case(scene, "max", TRILLION)
    large = sample_blocks(of, 0, 1024, keep=False)
    print(f"10^12 machines: {tasks:,.0f} tasks; of 8 million machines a task sends"
          f" {len(pickle.dumps(large)) / 1e6:.2f} MB")  # fmt: skip
    small = case(scene, "sampled", SAMPLES)
    began = time.process_time()
    (sampled,) = montecarlo_each([small], workers=1)
    spent = time.process_time() - began
    sent, received = len(pickle.dumps(small)), len(pickle.dumps(sampled))
    began = time.process_time()
    for name in 20 * ["dvf5000_general"]:
        warpspace.load_scene(name)
    loading = (time.process_time() - began) / 20.0
    began = time.process_time()
    for _ in sweep([scene] * 50, samples=1, workers=1):
        pass
    pickling_s = (time.process_time() - began) / 50.0
    print(
        f"a machine of a fleet ({SAMPLES:,} samples): {spent:.2f} s, {sent:,} bytes sent,"
        f" {received:,} back; read {1e3 * loading:.1f} ms, the rest {1e3 * pickling_s:.1f} ms\n"
        f"{FLEET:,} machines: {FLEET * spent / 3600.0:,.0f} core h,"
        f" {FLEET * (sent + received) / 1e9:.2f} GB, {FLEET * (loading * 2 + TASK_S):,.0f} s of"
        " the client and the scheduler"
    )


if __name__ == "__main__":
    main()
