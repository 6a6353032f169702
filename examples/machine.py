"""
Machine
=======

The machine with its deformed bodies.

Run ``python examples/machine.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "machine.png"
write_figure(target, "machine", [load_scene("dvf5000_first")])
