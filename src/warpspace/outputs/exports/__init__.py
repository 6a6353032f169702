"""Exports: the deformed scene and its error field as files for other programs."""

from warpspace.outputs.exports.difference import Difference, subtract_drawings
from warpspace.outputs.exports.drawing import Drawing, draw_scene
from warpspace.outputs.exports.glb import write_glb
from warpspace.outputs.exports.table import write_csv
from warpspace.outputs.exports.vts import StoredField, load_stored_field, write_vts

__all__ = [
    "Difference",
    "Drawing",
    "StoredField",
    "draw_scene",
    "load_stored_field",
    "subtract_drawings",
    "write_csv",
    "write_glb",
    "write_vts",
]
