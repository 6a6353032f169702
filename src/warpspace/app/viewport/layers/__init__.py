"""What is drawn in 3-D, one module per kind of thing.

A layer owns handles of viser's scene and mutates them in place. All points are handed over in mm
with a node scale of `SCENE_PER_MM`: one scene unit is 100 mm, since viser clips beyond 1000 units.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.tone_map import Rgb, line_colour
from warpspace.units import Array

SCENE_PER_MM = 0.01
NOTHING = np.zeros((1, 2, 3), np.float32)
"""A piece of line without length, for handles that have nothing to show: viser wants some."""


@lru_cache(maxsize=64)
def colour_bytes(rgb: Rgb) -> NDArray[np.uint8]:
    """Give the bytes of a line colour as viser's handles take them, [3], always the same array."""
    found = np.array(line_colour(rgb), dtype=np.uint8)
    found.flags.writeable = False
    return found


def pieces(points: Array, segments: NDArray[np.intp]) -> NDArray[np.float32]:
    """Look up the ends of pieces of line, [S, 2, 3]."""
    return points.reshape(-1, 3)[segments].astype(np.float32)


def polyline_pieces(lines: Sequence[Array] | Array) -> NDArray[np.float32]:
    """Cut polylines, [..., n, 3], into pieces, [S, 2, 3]."""
    cut: list[NDArray[np.float32]] = []
    for line in lines:
        ends = np.empty((*line.shape[:-2], line.shape[-2] - 1, 2, 3), np.float32)
        ends[..., 0, :], ends[..., 1, :] = line[..., :-1, :], line[..., 1:, :]
        cut.append(ends.reshape(-1, 2, 3))
    return np.concatenate(cut) if cut else np.zeros((0, 2, 3), np.float32)


class Layer(Protocol):
    """Something drawn that follows the picture."""

    def show(self, picture: LivePicture) -> None:
        """Draw a picture by changing handles in place."""
        ...
