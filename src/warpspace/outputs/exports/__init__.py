"""Exports: the deformed scene and its error field as files for other programs."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpspace.outputs.exports.glb import write_glb
    from warpspace.outputs.exports.table import write_csv
    from warpspace.outputs.exports.vts import StoredField, load_stored_field, write_vts

_HOME = {
    "StoredField": "vts",
    "load_stored_field": "vts",
    "write_csv": "table",
    "write_glb": "glb",
    "write_vts": "vts",
}
__all__ = ["StoredField", "load_stored_field", "write_csv", "write_glb", "write_vts"]


def __getattr__(name: str) -> Any:
    """Load a name from its module, so that listing the formats loads no library."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
