"""Spelling where a point is: as the drawing's axes have it, and where the machine's axes stand."""

from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from warpspace.machine.parameters import LINEAR_AXES
from warpspace.units import Array


def plain(value: SupportsFloat) -> str:
    """Spell a coordinate to a tenth, with a proper minus; zero has no sign."""
    return f"{round(float(value), 1) + 0.0:g}".replace("-", "−")


def spell_point(point_mm: Array | Sequence[float]) -> str:
    """Spell a point of the drawing, [3], mm."""
    pairs = zip("XYZ", point_mm, strict=True)
    return ", ".join(f"{name} {plain(value)}" for name, value in pairs) + " mm"


def spell_positions(at: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes.

    Parameters
    ----------
    at : mapping of str to float, mm or degrees

    Returns
    -------
    str
        Linear axes first.
    """
    linear = ", ".join(f"{name} {plain(q)}" for name, q in at.items() if name in LINEAR_AXES)
    rotary = [f"{name} {plain(q)}°" for name, q in at.items() if name not in LINEAR_AXES]
    return " · ".join((*([f"{linear} mm"] if linear else ()), *rotary))
