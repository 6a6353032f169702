"""
Best adjustment
===============

Before and after the best adjustments, and what each error does to the volume.

Run ``python examples/adjust.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "adjust.png"
write_figure(target, "adjust", [load_scene("dvf5000_first")])
