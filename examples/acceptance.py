"""
Acceptance tests
================

The worst machine that passes acceptance tests, with their paths; and how it shrinks with each test.

Run: python examples/acceptance.py [FOLDER]
"""

import io
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

import warpspace
from warpspace.acceptance_tests.acceptance import find_worst_machine
from warpspace.acceptance_tests.plans import PlannedTest, load_plan
from warpspace.outputs.drawing.map3d import GHOST_DASHES, Stage, draw_map, fit_map
from warpspace.outputs.drawing.settings import SAVE_RC, SIZES, FigureSettings, evaluate_for
from warpspace.outputs.drawing.sheet import line_entry, start_sheet
from warpspace.outputs.figure_files import figure_bytes
from warpspace.picture.model import ScenePicture

MIDDLE = {"X": 0.0, "Y": 0.0, "Z": -280.0}
"""Errors are relative to the middle of the volume, through which circles and lines pass."""
STAGES = {"no tests": 0, "three circles": 3, "+ lines": 12, "+ diagonals": 13}
"""Tests of the bundled plan for three axes, from its start."""
EXAGGERATION, TOP_UM = 500.0, 350.0  # of all machines
FIGURE, FILM = (800, 600), (480, 360)
STEPS, STEP_MS, HOLD_MS = 6, 70, 850  # between two stages
COLOURS, QUALITY = 256, 55


def evaluate(scene: warpspace.Scene, tests: Sequence[PlannedTest]) -> list[ScenePicture]:
    """Evaluate the worst machine of each stage, with one exaggeration and one scale of colours.

    The tolerances are symmetric: of a machine and its opposite, the one nearer to the machine
    before is drawn.
    """
    settings = FigureSettings(exaggeration=EXAGGERATION, range_top=TOP_UM)
    pictures: list[ScenePicture] = []
    for count in STAGES.values():
        machine = find_worst_machine(scene, tests[:count]).machine
        picture = evaluate_for(settings, machine)
        if pictures and np.sum(picture.field.error_um * pictures[-1].field.error_um) < 0.0:
            picture = blend(picture, picture, -1.0, 0.0)
        pictures.append(picture)
    return pictures


def blend(first: ScenePicture, second: ScenePicture, a: float, b: float) -> ScenePicture:
    """Combine two machines linearly; their errors are linear in their curves."""
    error_um = a * first.field.error_um + b * second.field.error_um
    return replace(first, field=replace(first.field, error_um=error_um))


def trace_paths(tests: Sequence[PlannedTest], scene: warpspace.Scene) -> list[np.ndarray]:
    """Return the paths of tests, mm, without the ways between them."""
    paths: list[np.ndarray] = []
    for planned in tests:
        points = planned.test.plan(scene).point_mm
        step = np.linalg.norm(np.diff(points, axis=0), axis=-1)
        paths += np.split(points, np.flatnonzero(step > 3.0 * np.median(step)) + 1)
    return paths


def draw(
    picture: ScenePicture,
    all_pictures: Sequence[ScenePicture],
    heading: str,
    tests: Sequence[PlannedTest],
    size: tuple[int, int],
) -> Image.Image:
    """Draw one machine with the paths of its tests, on the camera of all."""
    scene = picture.scene
    settings = FigureSettings(size=size, printed=True)
    legend = [
        line_entry("nominal volume", lambda theme: theme.ghost, dashes=GHOST_DASHES),
        line_entry("paths of the tests", lambda theme: theme.accent, SIZES.bold),
    ]
    sheet = start_sheet("acceptance", settings, heading, [], [scene], legend, exact=True)
    canvas, (x_left, bottom, right, top) = sheet.canvas, sheet.content
    head = canvas.px(2.6 * SIZES.heading)
    content = (x_left, bottom, right, top - head)
    camera = fit_map(canvas, all_pictures, content, "iso", labels=False)
    paths = [camera.project(path) for path in trace_paths(tests, scene)]

    def draw_paths(_: Stage) -> None:
        canvas.lines(paths, width=SIZES.bold, colour=canvas.theme.accent, zorder=5.0)

    drawn = draw_map(
        canvas, picture, content, "iso", labels=False, projection=camera, annotate=draw_paths
    )
    largest = float(picture.values.max())
    canvas.text(canvas.px(14.0), top, heading, size=1.3 * SIZES.heading, weight="bold", va="top")
    bars = (camera.px_per_mm, picture.exaggeration)
    sheet.draw_panel(picture.scale, "|E|  [µm]", [("max", largest)], [], bars)
    with mpl.rc_context(SAVE_RC):
        data = figure_bytes(sheet.finish(picture.exaggeration, [drawn]), "png")
    return Image.open(io.BytesIO(data)).convert("RGB")


def write_film(pictures: Sequence[ScenePicture], tests: Sequence[PlannedTest], path: Path) -> None:
    """Write the film: each stage stays, then changes into the next one."""
    frames: list[Image.Image] = []
    durations: list[int] = []
    for number, (stage, count) in enumerate(STAGES.items()):
        before, after = pictures[max(number - 1, 0)], pictures[number]
        heading = f"{stage}: |E| up to {after.values.max():.0f} µm"
        for step in range(1 if number > 1 else STEPS, STEPS + 1):  # the circles change nothing
            share = step / STEPS
            machine = blend(after, before, share, 1.0 - share)
            frames.append(draw(machine, pictures, heading, tests[:count], FILM))
            durations.append(HOLD_MS if step == STEPS else STEP_MS)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=durations, loop=0,
        quality=QUALITY, method=6,
    )  # fmt: skip


def main(folder: Path = Path()) -> None:
    """Write the figure and the film into a folder."""
    scene = replace(warpspace.load_scene("dvf5000_first"), reference=MIDDLE)
    tests = load_plan("iso_3_axes", scene)
    pictures = evaluate(scene, tests)
    worst = pictures[-1]
    heading = f"Passes all {len(tests)} tests: |E| up to {worst.values.max():.0f} µm"
    figure = draw(worst, [worst], heading, tests, FIGURE)
    palette = figure.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=1)
    figure.quantize(COLOURS, palette=palette).save(folder / "acceptance.png", optimize=True)
    write_film(pictures, tests, folder / "acceptance.webp")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
