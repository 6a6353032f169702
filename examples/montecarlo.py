"""
Monte Carlo
===========

Volumetric error of machines within tolerance.

Run ``python examples/montecarlo.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "montecarlo.png"
write_figure(target, "montecarlo", [load_scene("dvf5000_proposed")])
