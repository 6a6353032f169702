"""
Orientation map
===============

How far the tool axis leans, over the working volume.

Run ``python examples/orientation_map.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "orientation_map.png"
write_figure(target, "orientation-map", [load_scene("dvf5000_first")])
