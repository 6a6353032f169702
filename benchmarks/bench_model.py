"""How long the model takes: a slider move, a new basis, and the start of the command line.

Each figure stands beside a floor measured in the same run, so that a busy or slow machine shows as
such: the ratio is what to compare between machines.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpspace import load_scene
from warpspace.field.evaluate import amplitudes_of
from warpspace.field.grid import build_grid
from warpspace.scene.pipeline import grid_basis

NODES = 21


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    ms: float
    floor: str
    floor_ms: float
    target: str


def best_ms(run: Callable[[], object], repeats: int) -> float:
    """Give the shortest of several runs, ms: the one that was disturbed least."""
    run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def python(*arguments: str) -> Callable[[], object]:
    """Give a run of a fresh interpreter."""
    return lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True)


def measure() -> list[Row]:
    """Measure everything once."""
    scene = load_scene("dvf5000_first")
    grid = build_grid(scene.model, scene.workspace, NODES)
    basis = grid_basis(scene, grid)
    amplitudes = amplitudes_of(scene.errors, basis.keys)
    flat = np.random.default_rng(0).standard_normal((len(basis.keys), grid.nominal_mm.size))
    product = best_ms(lambda: amplitudes @ flat, 50)
    written = best_ms(lambda: np.zeros(basis.position.shape) + 1.0, 10)
    tilted = scene.workspace.moved({"B": -30.0, "C": 45.0})

    def new_basis(loop: str, nodes: int = NODES) -> Callable[[], object]:
        from warpspace.kinematics.model import Loop

        return lambda: grid_basis(
            scene, build_grid(scene.model, tilted, nodes), scene.view(Loop(loop))
        )

    floor = f"one product {flat.shape[0]} × {flat.shape[1]}"
    write = "filling one array of its size"
    return [
        Row(
            "slider move (position and tilt)",
            best_ms(lambda: basis.evaluate(amplitudes), 50),
            floor,
            product,
            "≤ 5 ms with geometry",
        ),
        *(
            Row(
                f"basis for new B, C: {loop} loop",
                best_ms(new_basis(loop), 5),
                write,
                written,
                "≤ 100 ms",
            )
            for loop in ("tool", "workpiece", "relative")
        ),
        Row(
            "basis for another density (11³)",
            best_ms(new_basis("tool", 11), 5),
            write + " (21³)",
            written,
            "≤ 100 ms",
        ),
        Row(
            "warpspace -h",
            best_ms(python("-m", "warpspace", "-h"), 5),
            "python -c pass",
            best_ms(python("-c", "pass"), 5),
            "≤ 300 ms",
        ),
    ]


def main() -> None:
    """Print the table."""
    print(f"nodes {NODES}³ = {NODES**3}; best of several runs; ratio = time / floor\n")
    print(f"{'what':<34}{'ms':>9}  {'floor':<40}{'ms':>9}{'ratio':>8}  target")
    for row in measure():
        print(
            f"{row.what:<34}{row.ms:>9.2f}  {row.floor:<40}{row.floor_ms:>9.2f}"
            f"{row.ms / row.floor_ms:>8.1f}  {row.target}"
        )


if __name__ == "__main__":
    main()
