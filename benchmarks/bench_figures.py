"""How long figures take, and whether memory stays flat: `python benchmarks/bench_figures.py`.

The floor is PyVista alone, drawing an empty window of the same size and reading it back.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import psutil

from warpspace import load_scene
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.save import render_figure

PICTURES = 200
SIZE = (1600, 1200)


def best_s(run: Callable[[], object], repeats: int = 5) -> float:
    """Give the shortest of several runs, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def empty_window() -> None:
    """Draw nothing with PyVista at twice the size of a figure, and read it back."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[2 * SIZE[0], 2 * SIZE[1]])
    plotter.screenshot(transparent_background=True, return_img=True)
    plotter.close()


def snapshot() -> None:
    """Run the command in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "map.png"
        command = [sys.executable, "-m", "warpspace", "snapshot", "dvf5000_first", "-o", target]
        subprocess.run(command, check=True, capture_output=True)


def main() -> None:
    """Print the table."""
    scenes = [load_scene("dvf5000_first")]
    settings = FigureSettings(size=SIZE)

    def draw(*forms: str) -> None:
        for form in forms:
            render_figure("error-map", scenes, settings, form)

    rows = [("snapshot, cold", best_s(snapshot, 3), 3.0)]
    draw("png")
    rows.append(("error map 1600x1200, warm", best_s(lambda: draw("png")), 0.6))
    rows.append(("png, svg and pdf", best_s(lambda: draw("png", "svg", "pdf"), 3), 3.0))
    rows.append(("floor: empty PyVista window", best_s(empty_window), 0.0))
    for name, seconds, target in rows:
        print(f"{name:<28} {seconds:6.2f} s" + (f"   target {target:g} s" if target else ""))

    start_cpu = time.process_time()
    draw("png")
    print(f"{'processor time of a map':<28} {time.process_time() - start_cpu:6.2f} s   busy or not")
    process = psutil.Process()
    memory: list[float] = []
    for _ in range(PICTURES):
        draw("png")
        memory.append(process.memory_info().rss / 1e6)
    start, end = max(memory[: PICTURES // 4]), max(memory[-PICTURES // 4 :])
    print(
        f"{PICTURES} pictures: {start:.0f} MB at most in the first quarter, {end:.0f} in the last"
    )


if __name__ == "__main__":
    main()
