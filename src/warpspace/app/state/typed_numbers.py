"""Numbers as people type and paste them: decimal commas, exponents, other signs, whole tables."""

import math
import re
from collections.abc import Sequence

from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_TYPED_NUMBER

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_SIGNS = str.maketrans({"−": "-", "–": "-", "\u00a0": " ", "\u202f": " "})
"""Signs and blanks that programs write in place of the plain ones."""
_SHOWN = 40
"""Characters of a line that a message shows."""


def read_typed(text: str, unit: str = "") -> float | None:
    """Read one number as it was typed.

    Parameters
    ----------
    text : str
        With a decimal point or a decimal comma, and an exponent if wanted: ``87.3``, ``1,5e2``,
        ``−3``.
    unit : str, optional
        May stand behind it.

    Returns
    -------
    float or None
        None where it is no finite number: also where both comma and point are in it, since that
        would be read differently in different countries.
    """
    if len(text) > MAX_TYPED_NUMBER:
        return None
    plain = text.translate(_SIGNS).strip()
    if unit:
        plain = plain.replace("\u03bc", "µ").removesuffix(unit).strip()
    if _NUMBER.fullmatch(plain) is None:
        return None
    value = float(plain.replace(",", "."))
    return value if math.isfinite(value) else None


def spell_typed(value: float) -> str:
    """Spell a number as it stands in its box: all digits that were given, none that are rounding.

    Parameters
    ----------
    value : float

    Returns
    -------
    str
        What `read_typed` reads.
    """
    return f"{value + 0.0:.12g}"


def read_rows(text: str) -> tuple[list[tuple[float, ...]], tuple[str, ...]]:
    """Read lines of numbers, typed or pasted from a spreadsheet.

    Parameters
    ----------
    text : str
        Tabs, semicolons, bars or blanks between the numbers of a line, a comma with a blank as
        well; ``#`` starts a remark. Where a line has nothing else between its numbers, and
        points in them, commas divide them. A first line without any number is a heading.

    Returns
    -------
    rows : list of tuple of float
    remarks : tuple of str
        What was left out.

    Raises
    ------
    OptionError
        Naming the row and what it holds.
    """
    lines = [line.split("#", 1)[0].translate(_SIGNS).strip(" \r") for line in text.splitlines()]
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    remarks: tuple[str, ...] = ()
    if len(numbered) > 1 and _is_heading(numbered[0][1]):
        heading = " ".join(numbered[0][1].split())[:_SHOWN]
        remarks = (f"Heading left out: “{heading}”.",)
        del numbered[0]
    return [_numbers(number, line) for number, line in numbered], remarks


def comma_rows(text: str) -> str | None:
    """Give a text whose only separators are commas with blanks in their place, else None.

    Read the other way, ``-275,0`` is one number with a decimal comma.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if any("," not in line or re.search(r"[\s;|]", line) for line in lines[1:] or lines):
        return None
    return "\n".join(line.replace(",", "\t") for line in lines)


def _is_heading(line: str) -> bool:
    """Tell whether a line has letters, and none of its cells is a number."""
    if re.search(r"[^\W\d_]", line) is None:
        return False
    cells = re.split(r"[\t;|]", line) if re.search(r"[\t;|]", line) else _cells(line)
    return all(read_typed(cell.strip(' "')) is None for cell in cells)


def _cells(line: str) -> Sequence[str]:
    """Cut a line into what stands between its separators."""
    cells = [cell.strip('"') for cell in re.split(r"[\s;|]+|,\s+", line) if cell.strip('"')]
    if len(cells) == 1 and "." in line and "," in line:
        return line.split(",")
    return cells


def _numbers(number: int, line: str) -> tuple[float, ...]:
    """Read the numbers of one line."""
    values = [read_typed(cell) for cell in _cells(line)]
    found = tuple(value for value in values if value is not None)
    if len(found) != len(values):
        raise OptionError(
            f"row {number}: {line[:_SHOWN]!r} holds what is no number; expected finite numbers"
        )
    return found
