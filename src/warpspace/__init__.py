"""warpspace: visualise how the geometric errors of a machine tool distort its working volume.

Names are loaded when first used, so that ``import warpspace`` costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpspace.analysis.commands.allocate import AllocateResult
    from warpspace.analysis.commands.contributions import ContributionsResult
    from warpspace.analysis.commands.gains import GainsResult
    from warpspace.analysis.commands.montecarlo import MonteCarloResult, sweep
    from warpspace.analysis.registry import Verb
    from warpspace.analysis.statistics import measured
    from warpspace.app.documents.notebook import show
    from warpspace.bench.base import run_test
    from warpspace.calibration.calibrate import calibrate
    from warpspace.exceptions import SceneError, WarpspaceError
    from warpspace.field.evaluate import ErrorField
    from warpspace.outputs.exports.meshes import to_pyvista
    from warpspace.resources import __version__
    from warpspace.scene.library import load_scene, scene_names
    from warpspace.scene.model import Scene, evaluate
    from warpspace.thesis_example.rows import thesis

    allocate: Verb[AllocateResult]
    contributions: Verb[ContributionsResult]
    gains: Verb[GainsResult]
    montecarlo: Verb[MonteCarloResult]

_HOME = {
    "__version__": "warpspace.resources",
    "ErrorField": "warpspace.field.evaluate",
    "Scene": "warpspace.scene.model",
    "SceneError": "warpspace.exceptions",
    "WarpspaceError": "warpspace.exceptions",
    "evaluate": "warpspace.scene.model",
    "calibrate": "warpspace.calibration.calibrate",
    "measured": "warpspace.analysis.statistics",
    "run_test": "warpspace.bench.base",
    "show": "warpspace.app.documents.notebook",
    "sweep": "warpspace.analysis.commands.montecarlo",
    "thesis": "warpspace.thesis_example.rows",
    "to_pyvista": "warpspace.outputs.exports.meshes",
    "load_scene": "warpspace.scene.library",
    "scene_names": "warpspace.scene.library",
}
"""Where a name comes from; any other is looked for among the analyses."""

__all__ = [
    "ErrorField",
    "Scene",
    "SceneError",
    "WarpspaceError",
    "__version__",
    "allocate",
    "calibrate",
    "contributions",
    "evaluate",
    "gains",
    "load_scene",
    "measured",
    "montecarlo",
    "run_test",
    "scene_names",
    "show",
    "sweep",
    "thesis",
    "to_pyvista",
]


def __getattr__(name: str) -> Any:
    """Load a public name from its module, or return an analysis as a function."""
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if not name.startswith("_"):
        from warpspace.analysis.registry import entries, verb

        if any(entry.name == name for entry in entries()):
            return verb(name)
    raise AttributeError(f"module 'warpspace' has no attribute {name!r}")
