"""
A plotter of your own
=====================

Draw a scene with a plotter of your own.

Run: python examples/own_plotter.py [FILE.png]
"""

import sys

import pyvista as pv

import warpspace


def main(path: str = "own_plotter.png") -> None:
    """Draw the bent volume, the nominal one around it, and the traces of the table."""
    blocks = warpspace.to_pyvista(warpspace.load_scene("dvf5000_first"), exaggeration=1000)
    plotter = pv.Plotter(off_screen=True)
    plotter.add_mesh(blocks["surface"], scalars="norm_um", cmap="viridis", lighting=False)
    plotter.add_mesh(blocks["nominal"].outline(), color="grey")
    plotter.add_mesh(blocks["traces"], color="crimson", line_width=3)
    plotter.screenshot(path)
    plotter.close()


if __name__ == "__main__":
    main(*sys.argv[1:2])
