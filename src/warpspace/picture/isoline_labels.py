"""Values written on isolines: where they stand, so that few of them say what each line means."""

from dataclasses import dataclass

import numpy as np

from warpspace.geometry.isolines import isoline_levels, isolines
from warpspace.picture.mesh import map_parts
from warpspace.picture.model import Picture
from warpspace.units import Array

LEAST_LENGTH = 0.2
"""Shortest line that carries its value, as a part of the longest edge."""
ALONG_SLICE = 0.3
"""Where along its line the value stands on a slice: in the middle another slice crosses it."""
MOST_LABELS = 60


@dataclass(frozen=True, slots=True)
class IsolineLabel:
    """The value of one line.

    Attributes
    ----------
    value : float
        In the unit of the picture's scale.
    at_mm : ndarray, [3], mm
        On the line, where it is drawn.
    outward : ndarray, [3]
        Direction that the face with the line looks to; of a slice one of the two.
    length_mm : float, mm
        Of the line.
    """

    value: float
    at_mm: Array
    outward: Array
    length_mm: float


def isoline_labels(picture: Picture) -> list[IsolineLabel]:
    """Choose where the lines of equal value carry their value: one on each face or slice.

    Parameters
    ----------
    picture : Picture

    Returns
    -------
    list of IsolineLabel
        The longest lines first, at most `MOST_LABELS`.
    """
    levels = isoline_levels(picture.scale)
    found: list[IsolineLabel] = []
    for part in map_parts(picture):
        nodes, values = part.drawn_mm.reshape(-1, 3), part.values.reshape(-1)
        normals = part.drawn_of.normals * part.ways
        for face, normal in zip(part.drawn_of.faces, normals, strict=True):
            longest: dict[float, IsolineLabel] = {}
            for value, line in isolines(face, nodes, values, levels):
                at, length = _part_way(line, ALONG_SLICE if picture.slices else 0.5)
                if length > (longest[value].length_mm if value in longest else 0.0):
                    longest[value] = IsolineLabel(value, at, normal, length)
            found += longest.values()
    least = LEAST_LENGTH * picture.size_mm
    kept = [label for label in found if label.length_mm >= least]
    return sorted(kept, key=lambda label: -label.length_mm)[:MOST_LABELS]


def _part_way(line: Array, share: float) -> tuple[Array, float]:
    """Find the point at a share of the length of a polyline, [n, 3], and that length."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = share * along[-1]
    return np.array([np.interp(at, along, line[:, k]) for k in range(3)]), float(along[-1])
