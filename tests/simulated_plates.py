"""Simulated plates: 82 holes within a circle of 650 mm, drilled by a planted machine and measured.

The layout is drawn at random, as that of the drilled plates; the positions of the holes follow from
the exact chain of the machine, not from the first-order model that a comparison uses.
"""

from dataclasses import replace

import numpy as np

from warpspace.bench.placing import follow
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, Ramp
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene, evaluate

MACHINE = """title = "drilling machine"
machine = "gantry_mill"
[workspace]
X = [-400, 400]
Y = [-400, 400]
Z = [-100, 100]
[errors]
"""
HEADER = "    Meas X    Meas Y     Nom X     Nom Y     Err X     Err Y  Meas D   Nom D   Round"


def layout(count: int = 82, seed: int = 0, radius_mm: float = 320.0) -> np.ndarray:
    """Return nominal holes, [count, 2], mm, at least 15 mm apart."""
    rng, holes = np.random.default_rng(seed), np.zeros((0, 2))
    while len(holes) < count:
        hole = rng.uniform(-radius_mm, radius_mm, 2).round(3)
        if np.hypot(*hole) < radius_mm and np.all(np.hypot(*(holes - hole).T) > 15.0):
            holes = np.vstack([holes, hole])
    return holes


def drilled(scene: Scene, holes: np.ndarray, place=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the actual holes, [n, 2], mm, in the frame of a plate shifted by `place`."""
    points = np.column_stack([holes, np.zeros(len(holes))]) + place
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    axes = follow(scene.model, stand, points)
    field = evaluate(scene, at=axes, loop=Loop.RELATIVE, frame="workpiece", exact=True)
    return holes + 1e-3 * field.error_um[:, :2]


def measured(actual: np.ndarray, rng, noise_um: float = 5.0, session_u: float = 10.0) -> np.ndarray:
    """Measure a plate: another part of its own shape, placed at random on the measuring machine."""
    scale_x, scale_y, square = rng.normal(0.0, session_u * 1e-6, 3)
    x, y = actual.T
    own = np.column_stack([x * (1.0 + scale_x) - square * y, y * (1.0 + scale_y)])
    turn = rng.normal(0.0, 3e-4)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    noise = rng.normal(0.0, noise_um * 1e-3, own.shape)
    return own @ rotation.T + rng.normal(0.0, 0.2, 2) + noise


def report_text(holes: np.ndarray, read: np.ndarray, number: int = 1, digits: int = 3) -> str:
    """Write a report as the measuring shop does: title, date, a table with Windows line ends."""
    lines = [f"Plug Plate: {number}", "Date: 2026-10-14", "Units: mm", "", HEADER]
    for at, (nominal, actual) in enumerate(zip(holes, read, strict=True)):
        error = actual - nominal
        cells = (*actual, *nominal, *error)
        rest = (2.174, 2.167, 0.003 + 0.001 * (at % 5))
        lines.append(
            "".join(f"{v:{digits + 7}.{digits}f}" for v in cells)
            + "".join(f"{v:8.3f}" for v in rest)
        )
    return "\r\n".join([*lines, ""])


def bundled_plates() -> dict[str, str]:
    """Write the plates of `assets/measurements/simulated_plates`, by file name."""
    scene = load_scene("dvf5000_nominal")
    curves: dict[str, ErrorFunction] = {
        "EXX": Ramp(scene.axis_span("X"), 6.0),
        "EYY": Ramp(scene.axis_span("Y"), -4.0),
        "EC0Y": Constant((0.0, 1.0), 60.0),
    }
    machine = replace(scene, errors=ErrorSet(curves))
    holes, rng = layout(60, 1, 200.0), np.random.default_rng(11)
    actual = drilled(machine, holes, (0.0, 0.0, 120.0))
    return {
        f"plate_{number}.txt": report_text(holes, measured(actual, rng, 3.0, 8.0), number)
        for number in (1, 2, 3)
    }
