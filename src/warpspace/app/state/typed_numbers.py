"""Numbers as people type and paste them: decimal commas, exponents, other signs, whole tables."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.picked import Picked
from warpspace.exceptions import OptionError
from warpspace.machine.axes import axis_order
from warpspace.machine.limits import MAX_TYPED_NUMBER
from warpspace.picture.words import IN_R

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
_SIGNS = str.maketrans({"−": "-", "–": "-", "\u00a0": " ", "\u202f": " "})
"""Signs and blanks that programs write in place of the plain ones."""
_SHOWN = 40  # characters of a line that a message shows


def read_typed(text: str, unit: str = "") -> float | None:
    """Read one number as it was typed."""
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
    """Spell a number as in its box: all digits that were given, none that are rounding."""
    return f"{value + 0.0:.12g}"


def read_rows(text: str) -> tuple[list[tuple[float, ...]], tuple[str, ...]]:
    """Read lines of numbers, typed or pasted from a spreadsheet."""
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
    cells = [cell.strip('"') for cell in re.split(r"[\s;|]+|,\s+", line) if cell.strip('"')]
    if len(cells) == 1 and "." in line and "," in line:
        return line.split(",")
    return cells


def _numbers(number: int, line: str) -> tuple[float, ...]:
    values = [read_typed(cell) for cell in _cells(line)]
    found = tuple(value for value in values if value is not None)
    if len(found) != len(values):
        raise OptionError(
            f"row {number}: {line[:_SHOWN]!r} holds what is no number; expected finite numbers"
        )
    return found


# --- A point that somebody types as positions of the axes -----------------------------------------

LONGEST = 200  # characters that are read
EXAMPLE = "X 275 Y -225 Z -480"
_POINT_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?"
# a digit belongs to the name where a number follows apart: C1 30, C1=30, but C30
_NAME = r"[a-z][0-9](?=\s*[=:]|\s+[-+.,0-9])|[a-z]"
_PAIR = re.compile(rf"({_NAME})\s*[=:]?\s*({_POINT_NUMBER})\s*(?:mm|°|deg)?", re.IGNORECASE)
_BETWEEN = re.compile(r"[\s,;·]*")


def read_positions(text: str) -> dict[str, float] | None:
    """Read positions of axes in any of the ways in which they are spelt on the page."""
    plain = text[:LONGEST].replace("\N{MINUS SIGN}", "-").partition(IN_R)[0].strip()
    plain = plain.removeprefix("--at").lstrip(" =").removeprefix("axes")
    found: dict[str, float] = {}
    at = 0
    while at < len(plain):
        between = _BETWEEN.match(plain, at)
        at = between.end() if between else at
        if at == len(plain):
            break
        pair = _PAIR.match(plain, at)
        if pair is None or pair[1].upper() in found:
            return None
        found[pair[1].upper()] = float(pair[2].replace(",", "."))
        at = pair.end()
    return found if found and all(map(math.isfinite, found.values())) else None


def with_typed_point(state: AppState, text: str) -> AppState:
    """Ask about the point that somebody has typed."""
    if not text.strip():
        return replace(state, picked=None, lever="")
    typed = read_positions(text)
    spans = linear_spans(state.scene)
    known = {*spans, *state.position_spans}
    if typed is None or not typed.keys() <= known:
        expected = f"expected positions of the axes {', '.join(_in_order(known))}"
        note = f"point {text.strip()[:40]!r}: {expected}, for instance {EXAMPLE}"
        return replace(state, notes=(*state.notes, note))
    for axis, value in typed.items():
        if axis in state.positions:
            state = state.with_position(axis, value)
    at = {axis: _present(state, axis) for axis in spans}
    notes = state.notes
    for axis, span in spans.items():
        if axis in typed:
            at[axis] = span.clamp(typed[axis], at[axis])
            if at[axis] != typed[axis]:
                unit = state.scene.machine.axes[axis].unit
                note = (
                    f"{axis} = {typed[axis]:g} {unit} is outside the travel, {span.low:g} to"
                    f" {span.high:g} {unit}; clamped to {at[axis]:g} {unit}"
                )
                notes = (*notes, note)
    return replace(state, picked=Picked(at), notes=notes)


def _in_order(axes: "set[str]") -> list[str]:
    return sorted(axes, key=axis_order)


def _present(state: AppState, axis: str) -> float:
    """Give where a linear axis stands at the point asked about, mm; else the middle."""
    picked: Mapping[str, float] = state.picked.at if state.picked is not None else {}
    return picked.get(axis, state.scene.workspace.positions.get(axis, 0.0))
