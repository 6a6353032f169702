"""Units, the factors between them, and the formatting of numbers.

Lengths are millimetres, errors micrometres, small angles microradians. Rotary positions are degrees
in files and on screen and radians inside. A millimetre times a microradian is a nanometre.
"""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]  # array of doubles; the shape is given in each docstring
Integers: TypeAlias = NDArray[np.int64]

UM_PER_MM = 1e3
MM_PER_UM = 1e-3
RAD_PER_URAD = 1e-6
URAD_PER_RAD = 1e6
UM_PER_MM_URAD = 1e-3  # displacement in µm of a lever of 1 mm turned by 1 µrad

MICROMETRE = "µm"
MICRORADIAN = "µrad"

MINUS = "\N{MINUS SIGN}"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"


def spell(value: float, digits: int = 3) -> str:
    """Format a number with a few significant digits, without powers of ten where possible."""
    if value == 0.0 or not math.isfinite(value):
        return "0" if value == 0.0 else str(value)
    size = int(f"{value:.{digits - 1}e}".rpartition("e")[2])  # of the rounded number
    if size >= 7 or size < -5:
        text = f"{value:.{digits - 1}e}"
    else:
        text = f"{value:.{max(0, digits - 1 - size)}f}"
    return text.replace("-", MINUS)


def spell_fixed(value: float, digits: int = 1) -> str:
    """Format a result for people: µm and µrad with one decimal, a true minus; zero has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", MINUS)


def spell_change(value: float, digits: int = 1) -> str:
    """Format the change of a result with its sign; zero has none."""
    text = spell_fixed(value, digits)
    return f"+{text}" if round(value, digits) > 0.0 else text


def spell_signed(value: float, digits: int = 3) -> str:
    """Format a change with its sign: ``+3.24``, ``−17.1``, ``0``."""
    return ("+" if value > 0.0 else "") + spell(value, digits)


def spell_short(value: float) -> str:
    """Format a number without trailing zeros, with a true minus sign."""
    return f"{value:.6g}".replace("-", MINUS)


def spell_count(number: int) -> str:
    """Format a whole number, its digits in groups of three from 10 000 up."""
    return f"{number:,}".replace(",", THIN_SPACE) if abs(number) >= 10_000 else str(number)
