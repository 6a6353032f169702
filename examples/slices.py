"""
Slices
======

Three slices through the middle of the working volume.

Run ``python examples/slices.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "slices.png"
write_figure(target, "slices", [load_scene("dvf5000_first")])
