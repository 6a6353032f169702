"""Numbers, places, factors and conventions as pictures, pages and files spell them."""

import math
from collections.abc import Sequence

from warpspace.kinematics.conventions.convention import Convention
from warpspace.kinematics.model import Loop, Model
from warpspace.machine.tolerances import ToleranceSet
from warpspace.machine.travel import DIRECTION_WORDS, TravelDirection
from warpspace.picture.coordinates import MINUS, list_axes
from warpspace.scene.model import Scene
from warpspace.units import Array

TIMES = "\N{MULTIPLICATION SIGN}"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
LOOP_WORDS = {
    Loop.TOOL: "tool loop",
    Loop.WORKPIECE: "workpiece loop",
    Loop.RELATIVE: "tool relative to workpiece",
}

TOLERANCE_UNITS = {"translation": "µm", "rotation": "µrad", "squareness": "µrad"}


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


def tolerance_words(tolerances: ToleranceSet) -> str:
    """Spell the half widths of the classes of parameters."""
    return ", ".join(
        f"{name} ±{spell_short(value)} {TOLERANCE_UNITS[name]}"
        for name, value in tolerances.default.items()
    )


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


def spell_vector(point: Sequence[float] | Array) -> str:
    """Spell a point in whole millimetres, tenths below ten: ``(275, −225, −51)``."""
    parts = [f"{v:.0f}" if abs(v) >= 10.0 else f"{round(v, 1) + 0.0:g}" for v in point]
    return "(" + ", ".join(part.replace("-", MINUS) for part in parts) + ")"


def reference_words(scene: Scene) -> str:
    """Say what errors are referred to."""
    if scene.reference is None:
        return "absolute errors"
    return f"reference point {list_axes(scene.reference)}"


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


def convention_groups(model: Model) -> tuple[tuple[Convention, tuple[str, ...]], ...]:
    """Give the conventions that axes of a machine have, each with its axes."""
    axes = model.machine.axes
    return tuple(
        (model.convention(own[0]), own)
        for name in model.convention_names
        if (own := tuple(axis for axis in axes if model.convention(axis).name == name))
    )


def convention_words(scene: Scene) -> str:
    """Say where component errors act; where axes differ, those of which axes."""
    groups = convention_groups(scene.model)
    if len(groups) == 1:
        return groups[0][0].short_words
    parts = [f"{convention.place} of {' '.join(axes)}" for convention, axes in groups]
    return f"component errors {', '.join(parts)}"


def direction_words(scene: Scene) -> tuple[str, ...]:
    """Say for which direction of travel errors are drawn; nothing where none depends on it."""
    if not scene.errors.has_directions and scene.model.direction == TravelDirection.MEAN:
        return ()
    return (DIRECTION_WORDS[TravelDirection(scene.model.direction)],)


def convention_sentences(scene: Scene) -> tuple[str, ...]:
    """Say what the conventions of a scene mean, one sentence each."""
    groups = convention_groups(scene.model)
    if len(groups) == 1:
        return (groups[0][0].sentence,)
    return tuple(
        f"Component errors of {', '.join(axes)} {convention.meaning} ({convention.place})."
        for convention, axes in groups
    )


def quantity_words(component: str, unit: str = "µm") -> str:
    """Say what the colours of a map of position errors mean."""
    return f"|E|  [{unit}]" if component == "norm" else f"{component} component of E  [{unit}]"
