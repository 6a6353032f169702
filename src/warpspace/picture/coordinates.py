"""A point in both of its coordinates: positions of the axes, and the point of R they lead to."""

from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from warpspace.machine.axes import is_linear, is_rotary
from warpspace.scene.model import Scene
from warpspace.units import Array

MINUS = "\N{MINUS SIGN}"
IN_R = "in R"
"""What a point of the machine frame is introduced by."""
SEPARATOR = " · "
_DIGITS = 6
"""Decimals of a position in a command: a nanometre."""


def spell_coordinate(value: SupportsFloat) -> str:
    """Spell a coordinate to a tenth, with a true minus; zero has no sign."""
    return f"{round(float(value), 1) + 0.0:g}".replace("-", MINUS)


def list_axes(at: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of all axes that are given: ``X 275 Y −225 Z −480 B 0°``, mm and degrees."""
    units = {name: "" if is_linear(name) else "°" for name in at}
    return " ".join(f"{name} {spell_coordinate(q)}{units[name]}" for name, q in at.items())


def own_axes(scene: Scene, at: Mapping[str, float]) -> dict[str, float]:
    """Choose the axes that name a point: the linear ones, and those not at their scene's place."""
    placed = scene.workspace.positions
    return {
        name: value
        for name, value in at.items()
        if is_linear(name) or abs(value - placed.get(name, 0.0)) > 1e-9
    }


def spell_axes(axes: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes: ``axes X 275 Y −225 Z −480 B −30°``.

    Parameters
    ----------
    axes : mapping of str to float, mm or degrees

    Returns
    -------
    str
        Linear axes first. Rotary axes at zero are left out where there are others.
    """
    linear = {name: at for name, at in axes.items() if is_linear(name)}
    rotary = {name: float(at) for name, at in axes.items() if not is_linear(name)}
    turned = {name: at for name, at in rotary.items() if round(at, 1) != 0.0 or not linear}
    return f"axes {list_axes({**linear, **turned})}"


def spell_in_r(point_mm: Array | Sequence[float]) -> str:
    """Spell a point of the machine frame, mm: ``in R x 275 y −225 z −51``."""
    pairs = zip("xyz", point_mm, strict=True)
    return " ".join((IN_R, *(f"{name} {spell_coordinate(value)}" for name, value in pairs)))


def spell_point(axes: Mapping[str, SupportsFloat], point_mm: Array | Sequence[float]) -> str:
    """Spell a point in both coordinates.

    Parameters
    ----------
    axes : mapping of str to float, mm or degrees
        Where the axes stand; none where nobody knows.
    point_mm : ndarray or sequence of float, [3], mm
        The point in R, as it is drawn.

    Returns
    -------
    str
        For instance ``axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51``, to a tenth of a
        millimetre or degree.
    """
    return SEPARATOR.join((*([spell_axes(axes)] if axes else ()), spell_in_r(point_mm)))


def spell_at(axes: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes as the option ``--at`` of a command takes them.

    Parameters
    ----------
    axes : mapping of str to float, mm or degrees

    Returns
    -------
    str
        For instance ``X=275,Y=-225,Z=-480,B=0,C=0``, to a nanometre: linear axes first.
    """
    names = sorted(axes, key=is_rotary)
    return ",".join(f"{name}={_plain(float(axes[name]))}" for name in names)


def _plain(value: float) -> str:
    """Spell a number with as many digits as it has, no more than six decimals, never as −0."""
    return f"{round(value, _DIGITS) + 0.0:.{_DIGITS}f}".rstrip("0").rstrip(".")
