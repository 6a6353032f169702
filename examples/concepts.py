"""
Machine concepts
================

Machine concepts within the same tolerances, side by side.

The axes are the same and stand in another order: the table of the second machine carries X and Y.
Run ``python examples/concepts.py [FILE]``; FILE ends in .png, .svg or .pdf.
"""

import sys

from warpspace.analysis.commands.concepts import Concepts
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.figure_files import write_figure
from warpspace.scene.starter import starter_scene

target = sys.argv[1] if len(sys.argv) > 1 else "concepts.png"
scenes = [starter_scene(chain) for chain in ("wFXYZt", "wXYFZt", "wCBFXYZt")]
settings = FigureSettings(loop="relative", concepts=Concepts(limit_um=30.0))
write_figure(target, "concepts", scenes, settings)
