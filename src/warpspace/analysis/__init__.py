"""Analyses of a scene, each described once: options, computation, result (`description.py`).

The public names are those that a plug-in needs to define and register an analysis.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpspace.analysis.blocks import Bars, Column, Curve, Lines, Panel, Series, Table
    from warpspace.analysis.description import (
        Analysis,
        Change,
        ProgressCallback,
        Quantity,
        Result,
        ignore_progress,
    )
    from warpspace.analysis.options import Grammar, Keys, Limits, Place, option
    from warpspace.analysis.registry import find_analysis, register, unregister

_HOMES = ("blocks", "registry", "description", "options")

__all__ = [
    "Analysis",
    "Bars",
    "Change",
    "Column",
    "Curve",
    "Grammar",
    "Keys",
    "Limits",
    "Lines",
    "Panel",
    "Place",
    "ProgressCallback",
    "Quantity",
    "Result",
    "Series",
    "Table",
    "find_analysis",
    "ignore_progress",
    "option",
    "register",
    "unregister",
]


def __getattr__(name: str) -> Any:
    """Load a name from its module when it is first used."""
    for home in _HOMES if name in __all__ else ():
        module = import_module(f"{__name__}.{home}")
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
