"""
Exports
=======

Write a scene for other programs, and read it back: GLB, VTS, CSV.

Run: python examples/exports.py [FOLDER]
"""

import sys
from pathlib import Path

import warpspace
from warpspace.outputs.exports import (
    load_stored_field,
    write_csv,
    write_glb,
    write_vts,
)
from warpspace.picture.scene_picture import evaluate_picture


def main(folder: Path = Path()) -> None:
    """Write the three files into a folder."""
    scene = warpspace.load_scene("dvf5000_first")
    drawing = evaluate_picture(scene, exaggeration="auto", grid=21, loop="tool")
    write_glb(drawing, folder / "dvf5000_first.glb")
    write_vts(drawing, folder / "dvf5000_first.vts")
    write_csv(drawing, folder / "dvf5000_first.csv")
    stored = load_stored_field(folder / "dvf5000_first.vts")
    print(f"{stored.scene.title}: mean {stored.field.norm_um.mean():.2f} µm, the same scene again")
    assert stored.scene == scene


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
