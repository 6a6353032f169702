"""Scenes and readings for tests of bench and calibration: machines with the errors asked for."""

from dataclasses import replace

import numpy as np

from warpspace.calibration.readings import Readings
from warpspace.kinematics.relative_motion import relative_point
from warpspace.machine.errors import Constant, ErrorSet, Ramp
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene


def scene_with(name: str = "dvf5000_nominal", **errors: object) -> Scene:
    scene = load_scene(name)
    functions = {}
    for key, value in errors.items():
        if isinstance(value, tuple):
            axis = key[2:].lstrip("0")
            functions[key] = Ramp(scene.axis_span(axis), value[1])
        elif isinstance(value, (int, float)):
            functions[key] = Constant((0.0, 1.0), float(value))
        else:
            functions[key] = value
    return replace(scene, errors=ErrorSet(functions))


THREE_AXES = """[machine]
chain = "wFXYZt"
[workspace]
X = [-275, 275]
Y = [-225, 225]
Z = [-480, -80]
"""
MACHINE = """[machine]
chain = "wFXYZt"
[machine.offset_mm]
t = [0, 0, -300]
[workspace]
X = [-100, 300]
Y = [-100, 100]
Z = [-200, 0]
"""


def vectors(scene: Scene, poses: dict, error_um: np.ndarray, session: str = "", **more) -> Readings:
    """Read error vectors, [n, 3], at poses; axes without positions stand at zero."""
    count = len(error_um)
    at = {axis: np.asarray(poses.get(axis, np.zeros(count))) for axis in scene.machine.axes}
    tip, lines = relative_point(scene.model, at), tuple(range(count))
    readings = Readings(
        "points", at, tip, 1e-3 * error_um, None, (session,) * count, lines, "r.csv"
    )
    return replace(readings, **more)
