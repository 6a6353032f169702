"""
Circular test
=============

Circular test of ISO 230-4 on the model.

Run ``python examples/ballbar.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "ballbar.png"
write_figure(target, "ballbar", [load_scene("dvf5000_first")])
