"""
One component, dark
===================

One signed component, seen from the front, on a dark ground.

Run ``python examples/error_map_component.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "error_map_component.png"
write_figure(
    target,
    "error-map",
    [load_scene("dvf5000_first")],
    FigureSettings(component="y", view="front", dark=True),
)
