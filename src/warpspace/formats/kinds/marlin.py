"""Marlin: `M852` and the skew settings of Configuration.h.

Marlin documentation, M852 (I, J, K are the factors of XY, XZ, YZ; S that of XY), and
Marlin/src/inc/Conditionals_post.h, whose formula `skew.py` has.
"""

import re
from collections.abc import Sequence

from warpspace.formats.compensation.wanted import Wanted
from warpspace.formats.kind import Files, Format, ReadOptions, resolve_axis
from warpspace.formats.measured import Imported
from warpspace.formats.numbers import read_number, spell
from warpspace.formats.parts.skew import MOST, PLANES, factor_of, fitted_factors, skew_term
from warpspace.formats.source import Source
from warpspace.formats.table_errors import errors_of
from warpspace.formats.terms import Tables

DIGITS = 6
"""Behind the point of a factor, as the firmware reports it."""
LETTERS = {"I": "XY", "S": "XY", "J": "XZ", "K": "YZ"}
_WORD = re.compile(r"([A-Z])\s*([-+0-9.,eE]+)")
_DEFINE = re.compile(r"#define\s+(XY|XZ|YZ)_(DIAG_AC|DIAG_BD|SIDE_AD|SKEW_FACTOR)\s+(\S+)")


def recognise(head: str, name: str) -> bool:
    """Tell it by its command, or by a setting of Configuration.h."""
    del name
    return re.search(r"^\s*M852\b", head, re.MULTILINE) is not None or "SKEW_CORRECTION" in head


def read_tables(sources: Sequence[Source], options: ReadOptions) -> Tables:
    """Read the skew factors as the firmware holds them."""
    found: dict[str, tuple[int, float]] = {}
    defined: dict[str, dict[str, tuple[int, float]]] = {}
    for source in sources:
        for number, text in enumerate(source.lines, start=1):
            bare = text.split(";")[0].split("//")[0].strip()
            if re.match(r"M852\b", bare):
                for letter, value in _WORD.findall(bare[4:]):
                    if letter not in LETTERS:
                        source.refuse(f"M852 {letter}; expected I, J, K or S", number)
                    factor = read_number(value, source, number, f"M852 {letter}")
                    found[LETTERS[letter]] = (number, factor)
            elif matched := _DEFINE.match(bare):
                value = read_number(matched[3].rstrip("f"), source, number, matched[2])
                defined.setdefault(matched[1], {})[matched[2]] = (number, value)
        for plane, settings in defined.items():
            side = defined.get("XY", {}).get("SIDE_AD")
            if "SKEW_FACTOR" in settings:
                found[plane] = settings["SKEW_FACTOR"]
            elif {"DIAG_AC", "DIAG_BD"} <= settings.keys() and ("SIDE_AD" in settings or side):
                line, ac = settings["DIAG_AC"]
                _, ad = settings.get("SIDE_AD") or side or (line, 0.0)
                lengths = (ac, settings["DIAG_BD"][1], ad)
                found[plane] = (line, factor_of(lengths, source, line, plane))
            else:
                line = next(iter(settings.values()))[0]
                expected = f"expected {plane}_DIAG_AC, {plane}_DIAG_BD and a side"
                source.refuse(f"{plane}: {', '.join(settings)}; {expected}", line)
        for plane, (line, factor) in found.items():
            if abs(factor) > MOST:
                source.refuse(f"factor {factor:g} of {plane}; expected at most ±{MOST:g}", line)
            for axis in plane:
                resolve_axis(axis, source, line, options)
    if not found:
        sources[0].refuse("has no skew factors; expected M852 I… J… K… or XY_SKEW_FACTOR")
    factors = {plane: factor for plane, (_, factor) in found.items()}
    return Tables((skew_term(factors),), (), (), ("mm", "rad"))


def read(sources: Sequence[Source], options: ReadOptions) -> Imported:
    """Read squareness errors from skew factors."""
    return errors_of(read_tables(sources, options), FORMAT.name, sources[0], options)


def write(wanted: Wanted) -> Files:
    """Write the command that sets the factors."""
    factors = fitted_factors(wanted)
    words = [
        f"{letter}{spell(float(wanted.round(factors[plane])), DIGITS)}"
        for letter, plane in zip("IJK", PLANES, strict=True)
    ]
    return {
        "": f"; {wanted.title}\n; SKEW_CORRECTION_FOR_Z and SKEW_CORRECTION_GCODE must be enabled\n"
        f"M852 {' '.join(words)}\n"
    }


FORMAT = Format(
    name="marlin",
    title="Marlin skew correction, M852 and Configuration.h",
    source="Marlin documentation, M852 Bed Skew Compensation",
    endings=(".gcode", ".h"),
    holds="squareness in XY, XZ and YZ",
    units="mm/mm",
    grid="none: the same everywhere",
    limits="three factors of six decimals, at most ±1",
    recognise=recognise,
    read=read,
    tables=read_tables,
    write=write,
)
