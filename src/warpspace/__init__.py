"""warpspace: see and steer how a machine tool's geometric errors bend the space it works in.

Names are loaded when first used, so that ``import warpspace`` costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from warpspace.bench.ballbar import ballbar
    from warpspace.bench.run import run_test
    from warpspace.calibration.calibrate import calibrate
    from warpspace.exceptions import SceneError, WarpspaceError
    from warpspace.field.basis import ErrorField
    from warpspace.outputs.exports.multiblock import to_pyvista
    from warpspace.scene.library import load_scene, scene_names
    from warpspace.scene.model import Scene
    from warpspace.scene.pipeline import evaluate
    from warpspace.scene.sweeps import sweep
    from warpspace.scene.verbs import (
        allocate,
        contributions,
        gains,
        measured,
        montecarlo,
        thesis,
    )

_HOME = {
    "ErrorField": "warpspace.field.evaluate",
    "Scene": "warpspace.scene.model",
    "SceneError": "warpspace.exceptions",
    "WarpspaceError": "warpspace.exceptions",
    "evaluate": "warpspace.scene.pipeline",
    "allocate": "warpspace.scene.verbs",
    "ballbar": "warpspace.bench.ballbar",
    "calibrate": "warpspace.calibration.calibrate",
    "contributions": "warpspace.scene.verbs",
    "gains": "warpspace.scene.verbs",
    "measured": "warpspace.scene.verbs",
    "run_test": "warpspace.bench.run",
    "montecarlo": "warpspace.scene.verbs",
    "sweep": "warpspace.scene.sweeps",
    "thesis": "warpspace.scene.verbs",
    "to_pyvista": "warpspace.outputs.exports.multiblock",
    "load_scene": "warpspace.scene.library",
    "scene_names": "warpspace.scene.library",
}

__all__ = [
    "ErrorField",
    "Scene",
    "SceneError",
    "WarpspaceError",
    "__version__",
    "allocate",
    "ballbar",
    "calibrate",
    "contributions",
    "evaluate",
    "gains",
    "load_scene",
    "measured",
    "montecarlo",
    "run_test",
    "scene_names",
    "sweep",
    "thesis",
    "to_pyvista",
]


def __getattr__(name: str) -> Any:
    """Load a public name from its module."""
    if name not in _HOME:
        raise AttributeError(f"module 'warpspace' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
