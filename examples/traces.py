"""
Rotary traces
=============

What a wobbling rotary table does to points on it.

Run ``python examples/traces.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "traces.png"
write_figure(target, "traces", [load_scene("teach_wobbling_table")])
