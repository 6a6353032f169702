"""Numbers as typed and pasted: decimal commas, typographic signs, tables, points, lists."""

import math
import re
from collections.abc import Sequence

from warpspace.app.state.leaf import MOST_TYPED, Span
from warpspace.exceptions import OptionError
from warpspace.machine.limits import MAX_TYPED_NUMBER
from warpspace.picture.formatting import IN_R

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_SIGNS = str.maketrans({"−": "-", "–": "-", "\u00a0": " ", "\u202f": " "})
"""Typographic signs and blanks."""
_MAX_QUOTED = 40  # characters of a line that a message shows


def read_typed(text: str, unit: str = "") -> float | None:
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
    """Format a number for its text box, without rounding noise."""
    return f"{value + 0.0:.12g}"


def read_rows(text: str) -> tuple[list[tuple[float, ...]], tuple[str, ...]]:
    lines = [line.split("#", 1)[0].translate(_SIGNS).strip(" \r") for line in text.splitlines()]
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    remarks: tuple[str, ...] = ()
    if len(numbered) > 1 and _is_heading(numbered[0][1]):
        heading = " ".join(numbered[0][1].split())[:_MAX_QUOTED]
        remarks = (f"Heading ignored: “{heading}”.",)
        del numbered[0]
    return [_numbers(number, line) for number, line in numbered], remarks


def comma_rows(text: str) -> str | None:
    """Replace the commas of a text without other separators by tabs; None for other texts.

    Otherwise ``-275,0`` is read as one number with a decimal comma.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if any("," not in line or re.search(r"[\s;|]", line) for line in lines[1:] or lines):
        return None
    return "\n".join(line.replace(",", "\t") for line in lines)


def _is_heading(line: str) -> bool:
    if re.search(r"[^\W\d_]", line) is None:
        return False
    cells = re.split(r"[\t;|]", line) if re.search(r"[\t;|]", line) else _cells(line)
    return all(read_typed(cell.strip(' "')) is None for cell in cells)


def _cells(line: str) -> Sequence[str]:
    cells = [cell.strip('"') for cell in re.split(r"[\s;|]+|,\s+", line) if cell.strip('"')]
    if len(cells) == 1 and "." in line and "," in line:
        return line.split(",")
    return cells


def _numbers(number: int, line: str) -> tuple[float, ...]:
    values = [read_typed(cell) for cell in _cells(line)]
    numbers = tuple(value for value in values if value is not None)
    if len(numbers) != len(values):
        raise OptionError(
            f"row {number}: {line[:_MAX_QUOTED]!r} contains an invalid number; expected finite"
            " numbers"
        )
    return numbers


# --- Positions of axes, and costs of tolerances ---------------------------------------------------

_POINT_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?"
# a digit belongs to the name where a separate number follows: C1 30, C1=30, but C30
_NAME = r"[a-z][0-9](?=\s*[=:]|\s+[-+.,0-9])|[a-z]"
_PAIR = re.compile(rf"({_NAME})\s*[=:]?\s*({_POINT_NUMBER})\s*(?:mm|°|deg)?", re.IGNORECASE)
_BETWEEN = re.compile(r"[\s,;·]*")
MOST_HELD = 8  # positions of one axis while another one rotates


def read_positions(text: str) -> dict[str, float] | None:
    """Parse positions of axes in any notation of the page."""
    plain = text[:MOST_TYPED].translate(_SIGNS).partition(IN_R)[0].strip()
    plain = plain.removeprefix("--at").lstrip(" =").removeprefix("axes")
    pairs = _PAIR.findall(plain)
    positions = {name.upper(): float(value.replace(",", ".")) for name, value in pairs}
    is_complete = len(positions) == len(pairs) and _BETWEEN.fullmatch(_PAIR.sub("", plain))
    is_finite = all(map(math.isfinite, positions.values()))
    return positions if positions and is_complete and is_finite else None


def read_list(text: str, span: Span) -> tuple[tuple[float, ...], str]:
    """Parse positions of a held axis, in any order; return them with a note on ignored texts."""
    wrong: list[str] = []
    positions: set[float] = set()
    for word in filter(None, re.split(r"[\s,;°]+", text[:MOST_TYPED])):
        at = read_typed(word)
        if at is None or not span.low <= at <= span.high:
            wrong.append(word[:20])
        else:
            positions.add(at)
    allowed = f"expected numbers from {span.low:g} to {span.high:g}"
    notes = [f"{', '.join(wrong[:4])} ignored; {allowed}"] if wrong else []
    if len(positions) > MOST_HELD:
        notes.append(f"{len(positions)} positions; only the first {MOST_HELD} are used")
    return tuple(sorted(positions)[:MOST_HELD]), "; ".join(notes)
