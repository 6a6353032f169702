"""What is drawn in 3-D, one module per kind of thing.

A layer owns handles of viser's scene and mutates them in place. All points are handed over in mm
with a node scale of `SCENE_PER_MM`: one scene unit is 100 mm, since viser clips beyond 1000 units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Palette:
    """Quiet colours around the map, sRGB."""

    edge: Rgb
    grid: Rgb
    ghost: Rgb
    trace_nominal: Rgb
    trace_actual: Rgb
    trace_elsewhere: Rgb
    axis: Rgb


LIGHT = Palette(
    edge=(24, 32, 46),
    grid=(24, 32, 46),
    ghost=(140, 150, 165),
    trace_nominal=(196, 202, 211),
    trace_actual=(45, 55, 72),
    trace_elsewhere=(150, 158, 171),
    axis=(110, 120, 135),
)
DARK = Palette(
    edge=(215, 220, 228),
    grid=(20, 24, 32),
    ghost=(130, 138, 150),
    trace_nominal=(90, 98, 110),
    trace_actual=(205, 212, 222),
    trace_elsewhere=(118, 126, 138),
    axis=(150, 158, 170),
)


def palette(picture: LivePicture) -> Palette:
    """Choose the colours for the ground a picture is drawn on."""
    return DARK if picture.state.shown.dark else LIGHT


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
