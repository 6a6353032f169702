"""
Error gains
===========

The largest error gains over the travel.

Run ``python examples/gains.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "gains.png"
write_figure(target, "gains", [load_scene("dvf5000_general")])
