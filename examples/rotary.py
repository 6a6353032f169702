"""
Rotary error motions
====================

A wobbling rotary table tilts once and runs out twice a turn.

Run ``python examples/rotary.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "rotary.png"
write_figure(target, "rotary", [load_scene("teach_wobbling_table")])
