"""A mesh of a million vertices: read, made and summed up; a slider move of a tenth of it."""

import tracemalloc
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh
from table import Growth, Row, Section
from timing import best

from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.parts.part import Part
from warpspace.parts.workpiece import evaluate_points, load_workpiece, point_basis

CIRCUMFERENCE = 1000  # vertices of a million
GROWING = (400, 566, 800, 1000)  # above what features are looked for in
MEGABYTE = 1e6


def ball(circumference: int) -> trimesh.Trimesh:
    """Make a closed ball of around × around vertices and two poles."""
    height, turn = np.linspace(0.0, np.pi, circumference + 2)[1:-1], np.arange(circumference)
    turn = turn * 2.0 * np.pi / circumference
    rings = np.stack(np.broadcast_arrays(
        np.sin(height)[:, None] * np.cos(turn), np.sin(height)[:, None] * np.sin(turn),
        np.cos(height)[:, None],
    ), axis=-1)  # fmt: skip
    points = np.concatenate([rings.reshape(-1, 3), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    number = np.arange(circumference * circumference).reshape(circumference, circumference)
    neighbour = np.roll(number, -1, axis=1)
    top, bottom = (np.full(circumference, circumference * circumference + pole) for pole in (0, 1))
    quads = number[:-1], number[1:], neighbour[:-1], neighbour[:-1], number[1:], neighbour[1:]
    triangles = np.concatenate([
        np.stack(quads, axis=-1).reshape(-1, 3),
        np.stack([top, number[0], neighbour[0]], axis=-1),
        np.stack([bottom, neighbour[-1], number[-1]], axis=-1),
    ])  # fmt: skip
    return trimesh.Trimesh(80.0 * points, triangles, process=False)


def measure() -> Section:
    """Measure a part of a million vertices, and how time grows with them."""
    scene = load_scene("dvf5000_first")
    with TemporaryDirectory() as folder:
        files = [Path(folder) / f"{around}.ply" for around in GROWING]
        for circumference, path in zip(GROWING, files, strict=True):
            ball(circumference).export(path)
        costs = [
            best(lambda: Part(file=str(path)).run(scene, ignore_progress), 3)  # noqa: B023
            for path in files
        ]
        files.append(files[-1].with_suffix(".stl"))
        ball(CIRCUMFERENCE).export(files[-1])
        costs.append(best(lambda: Part(file=str(files[-1])).run(scene, ignore_progress), 3))
        rows = list[Row]()
        for path, cost, max_s in zip(files[-2:], costs[-2:], (1.0, 2.0), strict=True):
            of, baseline = path.suffix[1:].upper(), "reading and copying it"
            copied = best(lambda: trimesh.load_mesh(path, process=False).copy(), 3)  # noqa: B023
            tracemalloc.start()
            made = Part(file=str(path)).run(scene, ignore_progress).workpiece
            peak_mb = tracemalloc.get_traced_memory()[1] / MEGABYTE
            tracemalloc.stop()
            mesh_mb = (made.vertices_mm.nbytes + made.triangles.nbytes) / MEGABYTE
            about = f"memory for it, {of}", peak_mb, "its vertices and triangles", mesh_mb, "MB"
            rows.append(Row(f"part of 10⁶ vertices, {of}", cost, baseline, copied, max_value=max_s))
            rows.append(Row(*about, max_ratio=8.0))
    small = load_workpiece("ball.ply", data=ball(316).export(file_type="ply"))
    basis = point_basis(scene, evaluate_points(scene, small.vertices_mm))
    values = np.array([scene.errors.amplitude(key) for key in basis.keys])
    moved = best(lambda: basis.evaluate(values))
    copied_small = best(basis.position.copy)
    labels = "slider move, 10⁵ vertices", moved, "copying their responses", copied_small
    rows.append(Row(*labels, max_value=0.06))
    counts = [float(around * around + 2) for around in GROWING]
    label = (
        "A closed mesh, read, checked, clamped, moved vertex by vertex by the relative error, and"
        " summed up as it is and after the best fit. The memory is the most that was held at once."
    )
    growth = [Growth("part as it is cut", "vertices", counts, costs[:-1])]
    return Section("A part as it is cut", label, rows, growth)
