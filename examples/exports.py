"""
Exports
=======

Write a scene for other programs: GLB, VTS, CSV.

Run: python examples/exports.py [FOLDER]
"""

import sys
from pathlib import Path

import warpspace
from warpspace.outputs.exports.fields import write_csv, write_vts
from warpspace.outputs.exports.meshes import write_glb
from warpspace.picture.model import evaluate_picture


def main(folder: Path = Path()) -> None:
    """Write the three files into a folder."""
    scene = warpspace.load_scene("dvf5000_first")
    drawing = evaluate_picture(scene, exaggeration="auto", grid=21, loop="tool")
    write_glb(drawing, folder / "dvf5000_first.glb")
    write_vts(drawing, folder / "dvf5000_first.vts")
    write_csv(drawing, folder / "dvf5000_first.csv")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
