"""What is written on a picture of the bent volume: corner arrows, the worst point, scale bars."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpspace.geometry.surfaces import Shape, corners, deform, round_down
from warpspace.units import MM_PER_UM, Array

BAR_FRACTION = 0.25  # longest scale bar, as a part of the longest edge


@dataclass(frozen=True, slots=True)
class CornerArrows:
    """Displacement of the corners of the volume."""

    start_mm: Array  # [n, 3]; nominal corner, and where it is drawn
    end_mm: Array
    norm_um: Array  # [n]; length of the error there

    @property
    def texts(self) -> tuple[str, ...]:
        """The numbers with their unit, one a corner."""
        return tuple(spell_micrometres(float(value)) for value in self.norm_um)


@dataclass(frozen=True, slots=True)
class WorstPoint:
    """The node where a value is largest in magnitude."""

    index: int  # flat grid index
    nominal_mm: Array  # [3]
    drawn_mm: Array
    value: float  # in the unit of the values


@dataclass(frozen=True, slots=True)
class ScaleBar:
    """A bar of round length."""

    length: float  # in mm of geometry, or in µm of error
    drawn_mm: float  # how long it is in the picture
    text: str  # length and unit


def spell_micrometres(value_um: float) -> str:
    """Spell a displacement: ``23.6 µm``, from 10 mm up ``12.3 mm``."""
    if abs(value_um) >= 1e4:
        return f"{value_um * MM_PER_UM:.1f} mm".replace("-", "−")
    return f"{value_um:.1f} µm".replace("-", "−")


def corner_arrows(
    shape: Shape, nominal_mm: Array, error_um: Array, exaggeration: float
) -> CornerArrows:
    """Find the arrows from the nominal to the displaced corners, eight for a full volume.

    Points and errors are [nx, ny, nz, 3], mm and µm.
    """
    chosen = corners(shape)
    start, error = nominal_mm.reshape(-1, 3)[chosen], error_um.reshape(-1, 3)[chosen]
    return CornerArrows(start, deform(start, error, exaggeration), np.linalg.norm(error, axis=-1))


def worst_point(values: Array, nominal_mm: Array, drawn_mm: Array) -> WorstPoint:
    """Find the node with the largest magnitude of values [...], points being [..., 3], mm."""
    flat = values.reshape(-1)
    index = int(np.argmax(np.abs(flat)))
    return WorstPoint(
        index, nominal_mm.reshape(-1, 3)[index], drawn_mm.reshape(-1, 3)[index], float(flat[index])
    )


def scale_bars(longest_mm: float, exaggeration: float) -> tuple[ScaleBar, ScaleBar]:
    """Choose the two scale bars of a picture: geometry in mm, displacement in µm."""
    room = max(BAR_FRACTION * longest_mm, 1e-9)
    geometry = round_down(room)
    error_um = round_down(room / (exaggeration * MM_PER_UM))
    spelt = f"{error_um:g} µm" if error_um < 1e4 else f"{error_um * MM_PER_UM:g} mm"
    return (
        ScaleBar(geometry, geometry, f"{geometry:g} mm"),
        ScaleBar(error_um, error_um * MM_PER_UM * exaggeration, spelt),
    )


# --- Arrows as meshes -----------------------------------------------------------------------------

SIDES = 10
_HEAD_PART = 0.7  # longest head, as a part of the arrow


def _across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to each other and to unit vectors, [n, 3] each."""
    helper = np.eye(3)[np.argmin(np.abs(direction), axis=-1)]
    sideways: Array = np.cross(direction, helper)
    first: Array = sideways / np.linalg.norm(sideways, axis=-1, keepdims=True)
    second: Array = np.cross(direction, first)
    return first, second


def build_arrows(
    start_mm: Array, end_mm: Array, radius_mm: float, head_mm: float
) -> tuple[Array, NDArray[np.intp]]:
    """Build arrows with a round shaft and a conical head.

    Parameters
    ----------
    start_mm, end_mm : ndarray, [n, 3], mm
    radius_mm : float, mm
        Of the shaft; the head is three times as wide.
    head_mm : float, mm
        Length of the head; short arrows get a smaller one of the same shape.

    Returns
    -------
    vertices_mm : ndarray, [n·(3·10 + 2), 3], mm
        An arrow without length shrinks to a point.
    triangles : ndarray, [T, 3]
        Counter-clockwise seen from outside; the same for every place of the arrows.
    """
    vector = end_mm - start_mm
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = np.where(
        length > 0.0, vector / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0)
    )
    first, second = _across(direction)
    head = np.minimum(head_mm, _HEAD_PART * length)
    size = head / head_mm
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = (
        np.cos(turn)[:, None] * first[:, None, :] + np.sin(turn)[:, None] * second[:, None, :]
    ) * (radius_mm * size)[:, None, :]
    neck = (end_mm - head * direction)[:, None, :]
    rings = [start_mm[:, None, :] + ring, neck + ring, neck + 3.0 * ring]
    vertices = np.concatenate([*rings, start_mm[:, None, :], end_mm[:, None, :]], axis=1)
    one = _triangles()
    count = 3 * SIDES + 2
    offsets = count * np.arange(len(start_mm))[:, None, None]
    return vertices.reshape(-1, 3), (one + offsets).reshape(-1, 3)


def _triangles() -> NDArray[np.intp]:
    here = np.arange(SIDES)
    there = (here + 1) % SIDES
    foot, tip = 3 * SIDES, 3 * SIDES + 1
    parts = [np.stack([np.full(SIDES, foot), there, here], -1)]
    for low in (0, SIDES):
        high = low + SIDES
        parts.append(np.stack([low + here, low + there, high + there], -1))
        parts.append(np.stack([low + here, high + there, high + here], -1))
    parts.append(np.stack([2 * SIDES + here, 2 * SIDES + there, np.full(SIDES, tip)], -1))
    return np.concatenate(parts)
