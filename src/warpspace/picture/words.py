"""Numbers and text as figures spell them."""

import math
from collections.abc import Sequence

MINUS = "\N{MINUS SIGN}"
TIMES = "\N{MULTIPLICATION SIGN}"


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


def spell_short(value: float) -> str:
    """Spell a number without trailing zeros, with a true minus sign."""
    return f"{value:.6g}".replace("-", MINUS)


def spell_point(point: Sequence[float]) -> str:
    """Spell a point in whole millimetres, tenths below ten."""
    parts = [f"{v:.0f}" if abs(v) >= 10.0 else f"{round(v, 1) + 0.0:g}" for v in point]
    return "(" + ", ".join(part.replace("-", MINUS) for part in parts) + ")"


def spell_factor(value: float) -> str:
    """Spell an exaggeration, for instance ``×1000``."""
    if value == 1.0:
        return f"{TIMES}1, true scale"
    return f"{TIMES}{value:.6g}" if value < 1e6 else f"{TIMES}{value:,.0f}".replace(",", " ")
