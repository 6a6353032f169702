"""
Two machines compared
=====================

Two machines and their difference on one scale.

Run ``python examples/comparison.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "comparison.png"
write_figure(target, "comparison", [load_scene("dvf5000_first"), load_scene("dvf5000_second")])
