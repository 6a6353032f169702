"""A program of five-axis blocks: read, run as a control does, traced; beside reading its lines."""

import numpy as np
from table import Growth, Row, Section
from timing import best

from warpspace import load_scene
from warpspace.analysis.description import ignore_progress
from warpspace.parts.gcode.control_settings import ControlSettings
from warpspace.parts.gcode.interpreter import read_program
from warpspace.parts.program import Program, trace_program

BLOCKS = 5600
GROWING = (700, 1400, 2800, 5600, 11200)
MENDED = (5000, 10_000, 20_000, 40_000)


def program(blocks: int) -> str:
    """Write a program of short blocks in which all five axes move."""
    turn = np.linspace(0.0, blocks / 100.0, blocks)
    places = zip(
        60.0 * np.cos(turn), 60.0 * np.sin(turn), -300.0 - turn, -30.0 - 10.0 * np.sin(3.0 * turn),
        np.rad2deg(turn), strict=True,
    )  # fmt: skip
    lines = (
        f"N{number} G1 X{x:.4f} Y{y:.4f} Z{z:.4f} B{b:.3f} C{c:.3f}\n"
        for number, (x, y, z, b, c) in enumerate(places)
    )
    return "G43.4 H1\n" + "".join(lines)


def measure() -> Section:
    """Measure 300 kB of it, with and without the tool centre point."""
    scene = load_scene("dvf5000_first")

    def trace(text: str, tcp: str = "program") -> None:
        read = read_program(scene, text.splitlines(), ControlSettings(tcp=tcp, length_mm=80.0))
        trace_program(read)

    text = program(BLOCKS)
    split = best(lambda: [line.split() for line in text.splitlines()])
    rows = [
        Row(
            f"{len(text) // 1000} kB, {words}",
            best(lambda: trace(text, tcp), 3),  # noqa: B023
            "splitting its lines into words",
            split,
            max_value=1.0,
        )
        for tcp, words in (("program", "tool centre point"), ("never", "axes in proportion"))
    ]
    texts = [program(blocks) for blocks in GROWING]
    costs = [best(lambda: trace(text), 3) for text in texts]  # noqa: B023
    growth = [Growth("program, tool centre point", "blocks", [*map(float, GROWING)], costs)]
    analyses = [Program(file="x", text=program(blocks)) for blocks in MENDED]
    ran = [one.run(scene, ignore_progress) for one in analyses]
    costs = [best(one.output_files, 2) for one in ran]
    growth.append(Growth("program mended", "blocks", [*map(float, MENDED)], costs))
    label = (
        "A program in G-code whose short blocks move five axes: read, its modal words followed,"
        " the path sampled so that it bends by 0.01 mm at most between samples, and the error of"
        " each sample, to first order."
    )
    return Section("A program of five-axis blocks", label, rows, growth)
