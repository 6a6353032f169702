"""What is written on a picture of the bent volume: corner arrows, the worst point, scale bars."""

from dataclasses import dataclass

import numpy as np

from warpspace.geometry.deform import deform, round_down
from warpspace.geometry.surfaces import Shape, corners
from warpspace.units import MM_PER_UM, Array

LABEL_GAP = 0.035
"""How far outside its arrow a number stands, as a part of the longest edge."""
BAR_FRACTION = 0.25
"""Longest scale bar, as a part of the longest edge."""


@dataclass(frozen=True, slots=True)
class CornerArrows:
    """Displacement of the corners of the volume.

    Attributes
    ----------
    start_mm, end_mm : ndarray, [n, 3], mm
        Nominal corner, and where it is drawn.
    label_mm : ndarray, [n, 3], mm
        Where its number stands, outside the volume.
    norm_um : ndarray, [n], µm
        Length of the error there.
    """

    start_mm: Array
    end_mm: Array
    label_mm: Array
    norm_um: Array

    @property
    def texts(self) -> tuple[str, ...]:
        """The numbers with their unit, one a corner."""
        return tuple(spell_micrometres(float(value)) for value in self.norm_um)


@dataclass(frozen=True, slots=True)
class WorstPoint:
    """The node where a value is largest in magnitude.

    Attributes
    ----------
    index : int
        Flat grid index.
    nominal_mm, drawn_mm : ndarray, [3], mm
    value : float
        In the unit of the values.
    """

    index: int
    nominal_mm: Array
    drawn_mm: Array
    value: float


@dataclass(frozen=True, slots=True)
class ScaleBar:
    """A bar of round length.

    Attributes
    ----------
    length : float
        In mm of geometry, or in µm of error.
    drawn_mm : float, mm
        How long it is in the picture.
    text : str
        Length and unit.
    """

    length: float
    drawn_mm: float
    text: str


def spell_micrometres(value_um: float) -> str:
    """Spell a displacement: ``23.6 µm``, from 10 mm up ``12.3 mm``."""
    if abs(value_um) >= 1e4:
        return f"{value_um * MM_PER_UM:.1f} mm".replace("-", "−")
    return f"{value_um:.1f} µm".replace("-", "−")


def corner_arrows(
    shape: Shape,
    nominal_mm: Array,
    error_um: Array,
    exaggeration: float,
    size_mm: float | None = None,
) -> CornerArrows:
    """Find the arrows from the nominal to the displaced corners.

    Parameters
    ----------
    shape : tuple of int, (3,)
        Nodes along the three axes.
    nominal_mm : ndarray, [nx, ny, nz, 3], mm
    error_um : ndarray, [nx, ny, nz, 3], µm
    exaggeration : float
    size_mm : float, mm, optional
        Length that the gap before a number is a part of; by default the longest edge.

    Returns
    -------
    CornerArrows
        Eight for a full volume.
    """
    chosen = corners(shape)
    nominal = nominal_mm.reshape(-1, 3)
    error = error_um.reshape(-1, 3)[chosen]
    start = nominal[chosen]
    end = deform(start, error, exaggeration)
    middle = (nominal.min(axis=0) + nominal.max(axis=0)) / 2.0
    size = float(np.ptp(nominal, axis=0).max()) if size_mm is None else size_mm
    # outside both ends of the arrow, away from the middle of the volume
    tip = np.where(
        (np.linalg.norm(end - middle, axis=-1) > np.linalg.norm(start - middle, axis=-1))[:, None],
        end,
        start,
    )
    outwards = np.sign(start - middle)
    return CornerArrows(start, end, tip + LABEL_GAP * size * outwards, _norm(error))


def _norm(vectors: Array) -> Array:
    """Length of vectors, [...]."""
    return np.linalg.norm(vectors, axis=-1)


def worst_point(values: Array, nominal_mm: Array, drawn_mm: Array) -> WorstPoint:
    """Find the node with the largest magnitude.

    Parameters
    ----------
    values : ndarray, [...]
    nominal_mm, drawn_mm : ndarray, [..., 3], mm

    Returns
    -------
    WorstPoint
    """
    flat = values.reshape(-1)
    index = int(np.argmax(np.abs(flat)))
    return WorstPoint(
        index, nominal_mm.reshape(-1, 3)[index], drawn_mm.reshape(-1, 3)[index], float(flat[index])
    )


def scale_bars(longest_mm: float, exaggeration: float) -> tuple[ScaleBar, ScaleBar]:
    """Choose the two scale bars of a picture: geometry in mm, displacement in µm.

    Parameters
    ----------
    longest_mm : float, mm
        Longest edge of the volume.
    exaggeration : float
        Display factor of displacements.

    Returns
    -------
    tuple of ScaleBar, (2,)
        Of round length (1, 2 or 5 × 10ⁿ), at most a quarter of the longest edge as drawn.
    """
    room = max(BAR_FRACTION * longest_mm, 1e-9)
    geometry = round_down(room)
    error_um = round_down(room / (exaggeration * MM_PER_UM))
    spelt = f"{error_um:g} µm" if error_um < 1e4 else f"{error_um * MM_PER_UM:g} mm"
    return (
        ScaleBar(geometry, geometry, f"{geometry:g} mm"),
        ScaleBar(error_um, error_um * MM_PER_UM * exaggeration, spelt),
    )
