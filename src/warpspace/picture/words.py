"""Numbers, places, factors and conventions as pictures, pages and files spell them."""

import math
from collections.abc import Mapping, Sequence
from typing import SupportsFloat

from warpspace.kinematics.conventions.registry import find_convention
from warpspace.kinematics.model import Loop
from warpspace.machine.parameters import LINEAR_AXES
from warpspace.scene.model import Scene
from warpspace.units import Array

MINUS = "\N{MINUS SIGN}"
TIMES = "\N{MULTIPLICATION SIGN}"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
LOOP_WORDS = {
    Loop.TOOL: "tool loop",
    Loop.WORKPIECE: "workpiece loop",
    Loop.RELATIVE: "tool relative to workpiece",
}


def spell(value: float, digits: int = 3) -> str:
    """Spell a number with a few significant digits, never in powers of ten where that is avoidable.

    Parameters
    ----------
    value : float
    digits : int, optional
        Significant digits of a fraction; whole digits are all kept.

    Returns
    -------
    str
        With a true minus sign, for instance ``−43.7``, ``1230`` or ``0.00412``.
    """
    if value == 0.0 or not math.isfinite(value):
        return "0" if value == 0.0 else str(value)
    size = int(f"{value:.{digits - 1}e}".rpartition("e")[2])  # of the rounded number
    if size >= 7 or size < -5:
        text = f"{value:.{digits - 1}e}"
    else:
        text = f"{value:.{max(0, digits - 1 - size)}f}"
    return text.replace("-", MINUS)


def spell_signed(value: float, digits: int = 3) -> str:
    """Spell a change with its sign: ``+3.24``, ``−17.1``, ``0``."""
    return ("+" if value > 0.0 else "") + spell(value, digits)


def spell_short(value: float) -> str:
    """Spell a number without trailing zeros, with a true minus sign."""
    return f"{value:.6g}".replace("-", MINUS)


def spell_count(number: int) -> str:
    """Spell a whole number, its digits in groups of three from 10 000 up."""
    return f"{number:,}".replace(",", THIN_SPACE) if abs(number) >= 10_000 else str(number)


def spell_factor(value: float) -> str:
    """Spell an exaggeration: ``×1000``, ``×20 000``, at most four digits of it."""
    if value == 1.0:
        return f"{TIMES}1, true scale"
    rounded = float(f"{value:.4g}")
    if rounded >= 10_000.0:
        return TIMES + f"{rounded:,.10g}".replace(",", THIN_SPACE)
    return f"{TIMES}{rounded:.10g}"


def spell_point(point: Sequence[float] | Array) -> str:
    """Spell a point in whole millimetres, tenths below ten: ``(275, −225, −51)``."""
    parts = [f"{v:.0f}" if abs(v) >= 10.0 else f"{round(v, 1) + 0.0:g}" for v in point]
    return "(" + ", ".join(part.replace("-", MINUS) for part in parts) + ")"


def spell_coordinate(value: SupportsFloat) -> str:
    """Spell a coordinate to a tenth, with a true minus; zero has no sign."""
    return f"{round(float(value), 1) + 0.0:g}".replace("-", MINUS)


def spell_place(point_mm: Array | Sequence[float]) -> str:
    """Spell a point of R by its coordinates: ``X 275, Y −225, Z −51 mm``."""
    pairs = zip("XYZ", point_mm, strict=True)
    return ", ".join(f"{name} {spell_coordinate(value)}" for name, value in pairs) + " mm"


def spell_positions(at: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes.

    Parameters
    ----------
    at : mapping of str to float, mm or degrees

    Returns
    -------
    str
        Linear axes first: ``X 275, Y −225, Z −480 mm · B 0°``.
    """
    linear = ", ".join(
        f"{name} {spell_coordinate(q)}" for name, q in at.items() if name in LINEAR_AXES
    )
    rotary = [f"{name} {spell_coordinate(q)}°" for name, q in at.items() if name not in LINEAR_AXES]
    return " · ".join((*([f"{linear} mm"] if linear else ()), *rotary))


def spell_axes(at: Mapping[str, SupportsFloat]) -> str:
    """Spell positions of axes in a short way: ``X 275 Y −225 Z −480 B 30°``, mm and degrees."""
    units = {name: "" if name in LINEAR_AXES else "°" for name in at}
    return " ".join(f"{name} {spell_coordinate(q)}{units[name]}" for name, q in at.items())


def spell_both(at: Mapping[str, SupportsFloat], point_mm: Array | Sequence[float]) -> str:
    """Spell a point in both ways it is given: as axis positions and as a point of R.

    Parameters
    ----------
    at : mapping of str to float, mm or degrees
        Positions of the axes that are named.
    point_mm : ndarray or sequence of float, (3,), mm

    Returns
    -------
    str
        ``axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51 mm``.
    """
    pairs = zip("xyz", point_mm, strict=True)
    point = " ".join(f"{name} {spell_coordinate(value)}" for name, value in pairs)
    return f"axes {spell_axes(at)} · in R {point} mm" if at else f"in R {point} mm"


def own_axes(scene: Scene, at: Mapping[str, float]) -> dict[str, float]:
    """Choose the axes that name a point: the linear ones, and those not at their scene's place."""
    placed = scene.workspace.positions
    return {
        name: value
        for name, value in at.items()
        if name in LINEAR_AXES or abs(value - placed.get(name, 0.0)) > 1e-9
    }


def at_argument(at: Mapping[str, float]) -> str:
    """Spell axis positions as commands take them: ``--at X=275,Y=-225,Z=-480``."""
    return "--at " + ",".join(f"{name}={value + 0.0:.10g}" for name, value in at.items())


def reference_words(scene: Scene) -> str:
    """Say what errors are referred to."""
    if scene.reference is None:
        return "absolute errors"
    return f"reference point {spell_axes(scene.reference)}"


def exclusion_words(excluded: Sequence[str], only: Sequence[str] = ()) -> tuple[str, ...]:
    """Say which errors a picture leaves out: ``excluded: EA0Z``, ``only: EAX``.

    Parameters
    ----------
    excluded, only : sequence of str
        Keys that do not take part; keys that alone do, where there are any.
    """
    found = [f"only: {', '.join(only)}"] if only else []
    return (*found, *([f"excluded: {', '.join(excluded)}"] if excluded else []))


def range_words(low: float, high: float, unit: str) -> str:
    """Say that colours end where somebody chose: ``range fixed 0–50 µm``."""
    between = "–" if low >= 0.0 else " to "
    return f"range fixed {spell_short(low)}{between}{spell_short(high)} {unit}"


def convention_words(scene: Scene) -> str:
    """Say where component errors act."""
    return find_convention(scene.model.component_errors).short_words


def quantity_words(component: str, unit: str = "µm") -> str:
    """Say what the colours of a map of position errors mean."""
    return f"|E|  [{unit}]" if component == "norm" else f"{component} component of E  [{unit}]"
