"""Questions about a scene, each described once: options, computation, result (`description.py`).

What stands here is what an analysis of one's own needs; it is registered with `register`. Numbers
drawn from error fields and Jacobians stand in the other modules.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpspace.analysis.blocks import Bars, Column, Curve, Lines, Panel, Series, Table
    from warpspace.analysis.catalogue import find_analysis, register, unregister
    from warpspace.analysis.description import Analysis, Change, Quantity, Result, Watch, silent
    from warpspace.analysis.options import Grammar, option
    from warpspace.analysis.typed import Keys, Limits, Place

_HOME = {
    "blocks": ("Bars", "Column", "Curve", "Lines", "Panel", "Series", "Table"),
    "catalogue": ("find_analysis", "register", "unregister"),
    "description": ("Analysis", "Change", "Quantity", "Result", "Watch", "silent"),
    "options": ("Grammar", "option"),
    "typed": ("Keys", "Limits", "Place"),
}

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
    "Quantity",
    "Result",
    "Series",
    "Table",
    "Watch",
    "find_analysis",
    "option",
    "register",
    "silent",
    "unregister",
]


def __getattr__(name: str) -> Any:
    """Load a name from its module when it is first used."""
    for home, names in _HOME.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
