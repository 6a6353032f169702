"""Exports: the deformed scene and its error field as files for other programs."""

from warpspace.outputs.exports.glb import write_glb
from warpspace.outputs.exports.table import write_csv
from warpspace.outputs.exports.vts import StoredField, load_stored_field, write_vts

__all__ = [
    "StoredField",
    "load_stored_field",
    "write_csv",
    "write_glb",
    "write_vts",
]
