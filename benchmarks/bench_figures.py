"""How long figures take, beside a bare PyVista render, and whether memory stays flat."""

import os
import tempfile
import time
from pathlib import Path

import psutil
from table import Row, Section
from timing import in_turns, python

from warpspace import load_scene
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.exports.multiblock import to_pyvista
from warpspace.outputs.save import render_figure

PICTURES = 40
SIZE = (1600, 1200)


def bare_render(mesh: object = None) -> None:
    """Draw a mesh, or nothing, with PyVista at twice the size of a figure, and read it back."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=[2 * SIZE[0], 2 * SIZE[1]])
    if mesh is not None:
        plotter.add_mesh(mesh, scalars="norm_um", cmap="viridis")
    plotter.screenshot(transparent_background=True, return_img=True)
    plotter.close()


def snapshot_wall_s() -> float:
    """Run the command in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "map.png"
        return python("-m", "warpspace", "snapshot", "dvf5000_first", "-o", target).wall_s


def measure() -> Section:
    """Measure the error map."""
    scenes = [load_scene("dvf5000_first")]
    settings = FigureSettings(size=SIZE)
    mesh = to_pyvista(scenes[0])["deformed"]

    def draw(*forms: str) -> None:
        for form in forms:
            render_figure("error-map", scenes, settings, form)

    took, other = in_turns(lambda: draw("png"), lambda: bare_render(mesh), 3)
    rows = [Row("error map 1600 × 1200, PNG", took, "PyVista with the same grid", other)]
    took, other = in_turns(lambda: draw("png", "svg", "pdf"), bare_render, 2)
    rows.append(Row("PNG, SVG and PDF", took, "PyVista, empty window", other))
    start = time.perf_counter()
    bare_render()
    window = time.perf_counter() - start
    wall = min(snapshot_wall_s() for _ in range(2))
    rows.append(Row("snapshot in a fresh process, wall", wall, "PyVista, empty window", window))
    process = psutil.Process()
    memory: list[float] = []
    for _ in range(PICTURES):
        draw("png")
        memory.append(process.memory_info().rss / 1e6)
    first, last = max(memory[: PICTURES // 4]), max(memory[-PICTURES // 4 :])
    what = f"memory in the last quarter of {PICTURES} pictures"
    rows.append(Row(what, last, "in the first quarter", first, "MB", most_ratio=1.05))
    text = "Bodies are drawn by PyVista, lines and words around them by matplotlib."
    return Section("Figures", text, rows)
