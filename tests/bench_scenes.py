"""Scenes for tests of the bench: a machine without errors but those asked for."""

from dataclasses import replace

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
