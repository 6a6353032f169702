"""Numbers and units as files spell them, into µm and µrad, mm and degrees."""

import math
import re
from collections.abc import Mapping

from warpspace.formats.source import Source, shown
from warpspace.machine.limits import MAX_ERROR, MAX_LENGTH_MM

UM_PER: Mapping[str, float] = {
    "um": 1.0,
    "µm": 1.0,
    "μm": 1.0,
    "mm": 1e3,
    "nm": 1e-3,
    "m": 1e6,
    "in": 25_400.0,
    "inch": 25_400.0,
}
"""Micrometres in a unit of length."""
URAD_PER: Mapping[str, float] = {
    "urad": 1.0,
    "µrad": 1.0,
    "μrad": 1.0,
    "mrad": 1e3,
    "rad": 1e6,
    "arcsec": math.pi / 180.0 / 3600.0 * 1e6,
    "deg": math.pi / 180.0 * 1e6,
    "°": math.pi / 180.0 * 1e6,
    "um/m": 1.0,
    "µm/m": 1.0,
    "mm/m": 1e3,
}
"""Microradians in a unit of angle."""
MM_PER: Mapping[str, float] = {unit: size * 1e-3 for unit, size in UM_PER.items()}
DEG_PER: Mapping[str, float] = {
    "deg": 1.0,
    "°": 1.0,
    "rad": 180.0 / math.pi,
    "arcsec": 1.0 / 3600.0,
}
MM_TO_UM = 1e3
RAD_TO_URAD = 1e6
DEG_TO_URAD = URAD_PER["deg"]
_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


def read_number(text: str, source: Source, line: int, what: str, *, comma: bool = False) -> float:
    """Read one finite number.

    Parameters
    ----------
    text : str
    source : Source
    line : int
        Where it stands, from 1.
    what : str
        What it is, for messages.
    comma : bool, optional
        Whether a comma may stand for the decimal point.

    Returns
    -------
    float

    Raises
    ------
    SceneError
    """
    text = text.strip()
    if _COMMA.fullmatch(text):
        if not comma:
            expected = "expected a decimal point (a comma only where semicolons or tabs part)"
            source.refuse(f"{what} {shown(text)} has a decimal comma; {expected}", line)
        text = text.replace(",", ".")
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        source.refuse(f"{what} {shown(text)}; expected a finite number", line)
    return value


def read_whole(text: str, source: Source, line: int, what: str, low: int, high: int) -> int:
    """Read one whole number within limits.

    Raises
    ------
    SceneError
    """
    value = read_number(text, source, line, what)
    if value != int(value) or not low <= value <= high:
        source.refuse(f"{what} {shown(text)}; expected a whole number {low} … {high}", line)
    return int(value)


def unit_factor(
    unit: str, known: Mapping[str, float], source: Source, line: int, what: str
) -> float:
    """Give the factor of a unit.

    Parameters
    ----------
    unit : str
    known : mapping of str to float
    source : Source
    line : int
    what : str
        What has it, for messages.

    Raises
    ------
    SceneError
        Naming the units that there are.
    """
    if unit not in known:
        units = ", ".join(name for name in known if name.isascii())
        source.refuse(f"{what} in {shown(unit)}; expected one of the units {units}", line)
    return known[unit]


def check_error(value: float, source: Source, line: int, what: str) -> float:
    """Refuse an error that no rigid-body model holds, µm or µrad.

    Raises
    ------
    SceneError
    """
    if abs(value) > MAX_ERROR:
        found = f"{what} {value:g} µm or µrad; expected at most ±{MAX_ERROR:g} (is the unit right?)"
        source.refuse(found, line)
    return value


def check_position(value: float, source: Source, line: int, what: str) -> float:
    """Refuse a position that no machine reaches, mm or degrees.

    Raises
    ------
    SceneError
    """
    if abs(value) > MAX_LENGTH_MM:
        source.refuse(f"{what} {value:g}; expected at most ±{MAX_LENGTH_MM:g} mm or degrees", line)
    return value


def spell(value: float, digits: int) -> str:
    """Spell a number with at most so many digits behind the point, without needless zeros."""
    text = f"{value:.{digits}f}"
    if "." in text:
        whole, _, part = text.partition(".")
        text = f"{whole}.{part.rstrip('0') or '0'}"
    return "0.0" if text in {"-0.0", "-0"} else text
