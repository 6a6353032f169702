"""
Error curves
============

Errors along each axis with their tolerance bands.

Run ``python examples/error_curves.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace import load_scene
from warpspace.outputs.figure_files import write_figure

target = sys.argv[1] if len(sys.argv) > 1 else "error_curves.png"
write_figure(target, "error-curves", [load_scene("dvf5000_proposed")])
