"""Time of figures relative to a bare PyVista render, and growth of memory."""

import os
import tempfile
from pathlib import Path

import psutil
from table import Row, Section
from timing import Cost, commands_in_turns, in_turns

from warpspace import load_scene
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.exports.meshes import to_pyvista
from warpspace.outputs.figure_files import render_figure

PICTURES = 40
BARE = """
import os, sys
os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
import numpy as np
import pyvista as pv
from matplotlib.figure import Figure
nodes = np.meshgrid(*[np.linspace(0.0, 400.0, 21)] * 3, indexing="ij")
mesh = pv.StructuredGrid(*nodes)
mesh["norm_um"] = np.linalg.norm(mesh.points, axis=1)
plotter = pv.Plotter(off_screen=True, window_size=[1600, 1200])
plotter.add_mesh(mesh, scalars="norm_um", cmap="viridis")
image = plotter.screenshot(return_img=True)
plotter.close()
figure = Figure(figsize=(16, 12), dpi=100)
figure.add_axes((0, 0, 1, 1)).imshow(image)
figure.savefig(sys.argv[1])
"""
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


def picture_costs() -> tuple[Cost, Cost]:
    """Draw a picture by the command and by a bare script, in fresh processes."""
    with tempfile.TemporaryDirectory() as folder:
        script, target = Path(folder) / "bare.py", Path(folder) / "map.png"
        script.write_text(BARE, encoding="utf-8")
        command = ("-m", "warpspace", "draw", "dvf5000_first", "--force", "-o", target)
        return commands_in_turns(command, (script, Path(folder) / "bare.png"))


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
    ours, bare = picture_costs()
    baseline = "a bare script: PyVista, matplotlib, 21³"
    rows += [
        Row("draw", ours.processor_s, baseline, bare.processor_s, max_ratio=1.2),
        Row("draw, wall", ours.wall_s, baseline, bare.wall_s),
    ]
    process = psutil.Process()
    memory: list[float] = []
    for _ in range(PICTURES):
        draw("png")
        memory.append(process.memory_info().rss / 1e6)
    label = f"memory of {PICTURES} pictures, at most"
    rows.append(Row(label, max(memory), "after one", memory[0], "MB", max_ratio=1.1))
    text = "Bodies are drawn by PyVista, lines and words around them by matplotlib."
    return Section("Figures", text, rows)
