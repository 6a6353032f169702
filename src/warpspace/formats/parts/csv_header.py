"""The header of a measurement table: axes and errors with their units."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from warpspace.exceptions import near_miss
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD
from warpspace.formats.numbers import DEG_PER, MM_PER, UM_PER, URAD_PER, unit_factor
from warpspace.formats.source import Source, shown
from warpspace.machine.axes import is_axis_name, is_linear
from warpspace.machine.limits import MAX_CSV_COLUMNS
from warpspace.machine.parameters import PARAMETERS, parameter

SEPARATORS = (";", "\t", ",")
DIRECTIONS: Mapping[str, int] = {
    "": BOTH,
    "0": BOTH,
    "+": FORWARD,
    "1": FORWARD,
    "+1": FORWARD,
    "forward": FORWARD,
    "-": BACKWARD,
    "-1": BACKWARD,
    "−": BACKWARD,
    "backward": BACKWARD,
}
RUN, DIRECTION = "run", "direction"
_HEADING = re.compile(
    r"(?:(u)\s*\(\s*)?([A-Za-z0-9]+)\s*\)?\s*(?:\[\s*([^\]]+?)\s*\]|_([A-Za-zµμ°/]+))?"
)


@dataclass(frozen=True)
class Column:
    """One column of a table: what it holds, and the factor to µm, µrad, mm or degrees."""

    role: str
    name: str
    factor: float = 1.0
    unit: str = ""


def recognise(head: str, name: str) -> bool:
    """Tell it by a header that names an axis or an error with its unit."""
    del name
    line = next((text for text in head.splitlines() if is_content(text)), "")
    parts = [part.strip() for part in fields(line, separator_of(line))]
    found = [_HEADING.fullmatch(part) for part in parts]
    if not any(one and (one[2] in PARAMETERS) for one in found):
        return False
    return any(one and (one[3] or one[4]) for one in found)


def is_content(text: str) -> bool:
    """Tell a line from a comment or an empty one."""
    return bool(text.strip().strip(",;\t")) and not text.lstrip().startswith("#")


def separator_of(header: str) -> str:
    """Find what parts the columns."""
    return next((mark for mark in SEPARATORS if mark in header), ",")


def fields(text: str, mark: str) -> list[str]:
    """Split a line; a field may stand in quotes, as spreadsheets write it."""
    return next(csv.reader([text], delimiter=mark)) if '"' in text else text.split(mark)


def read_header(source: Source, line: int, parts: Sequence[str]) -> list[Column]:
    """Read the header."""
    found: list[Column] = []
    if len(parts) > MAX_CSV_COLUMNS:
        source.refuse(f"{len(parts)} columns; expected at most {MAX_CSV_COLUMNS}", line)
    for part in parts:
        lower = part.strip().lower()
        if lower in (RUN, DIRECTION):
            found.append(Column(lower, lower))
            continue
        matched = _HEADING.fullmatch(part.strip())
        if matched is None:
            expected = "expected headings such as X [mm], EXX [um], u(EXX) [um], run, direction"
            source.refuse(f"column {shown(part)}; {expected}", line)
        name, unit = matched[2].upper(), (matched[3] or matched[4] or "").strip()
        uncertain = bool(matched[1])
        if name in PARAMETERS:
            known = URAD_PER if parameter(name).is_rotation else UM_PER
            _need_unit(unit, name, known, source, line)
            role = "uncertainty" if uncertain else "error"
            found.append(Column(role, name, unit_factor(unit, known, source, line, name), unit))
        elif is_axis_name(name) and not uncertain:
            known = MM_PER if is_linear(name) else DEG_PER
            _need_unit(unit, name, known, source, line)
            factor = unit_factor(unit, known, source, line, name)
            found.append(Column("position", name, factor, unit))
        else:
            hint = near_miss(
                name, [*"XYZABCUVW", *(f"E{a}{b}" for a in "XYZABC" for b in "XYZABC")]
            )
            expected = "expected an axis, an error, u(error), run or direction"
            source.refuse(f"column {shown(part)}; {expected}{hint}", line)
    seen = [(one.role, one.name) for one in found]
    if twice := next((one for one in seen if seen.count(one) > 1), None):
        source.refuse(f"column {twice[1]} stands there twice; expected it once", line)
    return found


def _need_unit(unit: str, name: str, known: Mapping[str, float], source: Source, line: int) -> None:
    """Refuse a column without a unit: nothing is assumed."""
    if not unit:
        units = ", ".join(one for one in known if one.isascii())
        source.refuse(f"column {name} has no unit; expected {name} [unit], of {units}", line)
