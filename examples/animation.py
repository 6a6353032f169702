"""
Animation
=========

Let the working volume bend from true scale to the display factor and back.

Run: python examples/animation.py [FOLDER]
"""

import sys
from pathlib import Path

import warpspace
from warpspace.outputs.animation import AnimationSettings, write_animation
from warpspace.outputs.drawing.settings import FigureSettings


def main(folder: Path = Path()) -> None:
    """Write the animation into a folder."""
    settings = AnimationSettings(frames=12, fps=8.0, figure=FigureSettings(size=(640, 480)))
    write_animation(warpspace.load_scene("dvf5000_first"), folder / "bend.webp", settings)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
