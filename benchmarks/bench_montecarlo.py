"""How long sampling takes: beside the bare matrix products, and beside a plain loop over nodes.

Floors are measured in the same run, so that a busy or slow machine shows as such.
"""

import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

import warpspace
from warpspace.analysis.draws import build_draws, loop_keys
from warpspace.analysis.montecarlo import Plan, sample_chunks
from warpspace.analysis.nodes import node_gains, reduce_nodes
from warpspace.analysis.points import spread_places
from warpspace.field.evaluate import View
from warpspace.kinematics.model import Loop

MACHINES, NODES = 100_000, 11
LOOP_MACHINES = 2_000
MANY = """
import resource, warpspace
warpspace.montecarlo(warpspace.load_scene("dvf5000_general"), samples=10_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def best(run: Callable[[], object], repeats: int = 3) -> float:
    """Give the shortest of several runs, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def plain_loop(amplitudes: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Largest |E| of every machine, node by node."""
    largest = np.zeros(len(amplitudes))
    for node in range(gains.shape[2]):
        error = np.stack([amplitudes @ gain[:, node] for gain in gains], -1)
        largest = np.maximum(largest, np.linalg.norm(error, axis=-1))
    return largest


def main() -> None:
    """Print the figures."""
    scene = warpspace.load_scene("dvf5000_general")
    keys = loop_keys(scene.model, Loop.TOOL, scene.parameter_keys)
    draws = build_draws(scene.tolerances, keys, "uniform")
    places = spread_places(scene.model, Loop.TOOL, scene.workspace, None, NODES)
    gains = node_gains(scene.model, keys, View(), places)
    plan = Plan(samples=MACHINES)
    amplitudes = draws.draw(np.random.default_rng(0), MACHINES)
    out = np.empty((4096, gains.shape[2]))

    def bare() -> None:
        for gain in gains:
            for start in range(0, MACHINES, len(out)):
                block = amplitudes[start : start + len(out)]
                np.matmul(block, gain, out=out[: len(block)])

    def engine(over: str) -> None:
        job = lambda rng, count: reduce_nodes(draws.draw(rng, count), gains, over)  # noqa: E731
        for _ in sample_chunks(job, plan):
            pass

    floor = best(bare)
    print(f"{MACHINES:,} machines × {NODES}³ nodes × {len(keys)} parameters")
    print(f"  bare matrix products                      {floor:8.3f} s")
    for over in ("max", "mean"):
        took = best(lambda: engine(over))  # noqa: B023 - called at once
        ratio = f"{took / floor:.2f} × (target ≤ 4, aim 2)"
        print(f"  drawing and {over:<4} over all nodes           {took:8.3f} s  {ratio}")
    for over in ("sampled", "max", "mean"):
        took = best(lambda: warpspace.montecarlo(scene, samples=MACHINES, over=over))  # noqa: B023
        print(f"  warpspace.montecarlo(over={over!r:<9})       {took:8.3f} s  {took / floor:.2f} ×")
    few = amplitudes[:LOOP_MACHINES]
    fast = best(lambda: reduce_nodes(few, gains, "max"))
    slow = best(lambda: plain_loop(few, gains), 1)
    ratio = f"{slow / fast:.1f} × the engine on one thread"
    print(f"  plain loop over nodes, {LOOP_MACHINES:,} machines      {slow:8.3f} s  {ratio}")
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", MANY], check=True, capture_output=True, text=True)
    megabytes = int(done.stdout) / 1024.0
    print(
        f"  10,000,000 machines sampled: {time.perf_counter() - start:.1f} s,"
        f" {megabytes:.0f} MiB at most (target < 1024)"
    )


if __name__ == "__main__":
    main()
