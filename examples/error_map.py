"""
Error map
=========

The bent working volume of a measured machine.

Run ``python examples/error_map.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "error_map.png"
write_figure(target, "error-map", [load_scene("dvf5000_first")])
