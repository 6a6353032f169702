"""The answer to "why here?" as HTML: the error in numbers, and the contributions it is made of."""

import html
from collections.abc import Callable

import numpy as np

from warpspace.analysis.explain import Contribution
from warpspace.app.evaluation.budget import Answer
from warpspace.machine.parameters import parameter
from warpspace.picture.words import spell_coordinate, spell_place, spell_positions
from warpspace.units import Array

ASK = (
    '<div style="padding:6px 14px 12px;line-height:1.5;font-size:13px">Click any point of the box'
    " or of a trace: its error appears here, taken apart into what causes it.</div>"
)
REFUSED = (
    '<div style="padding:6px 14px 12px;line-height:1.5;font-size:13px">A difference of two machines'
    " has no causes of its own. Show A or B in the tab Compare to ask why.</div>"
)
SHOWN = 14
"""Contributions listed one by one; the smaller ones are summed up in one row."""
BAR_PX = 36
Attributes = Callable[[str], str]
_CELL = (
    'style="text-align:right;padding:2px 0 2px 3px;white-space:nowrap;'
    'font-variant-numeric:tabular-nums"'
)


def number(value: float, digits: int = 2) -> str:
    """Spell a signed number with a proper minus; zero has no sign."""
    text = f"{value:+.{digits}f}"
    if float(text) == 0.0:
        text = f"{0.0:.{digits}f}"
    return text.replace("-", "−")


def small(value: float) -> str:
    """Spell a signed number that may be tiny: three digits."""
    if value == 0.0:
        return "0"
    return (f"{value:+.4f}" if abs(value) >= 5e-5 else f"{value:+.0e}").replace("-", "−")


def answer_html(answer: Answer, lever: str, attributes: Attributes) -> str:
    """Spell an answer.

    Parameters
    ----------
    answer : Answer
    lever : str
        Key of the chosen contribution, empty for none.
    attributes : callable
        Gives the attributes that make a row clickable, by key.

    Returns
    -------
    str
        HTML.
    """
    found = answer.explanation
    towards = _unit(sum((part.error_um for part in found.contributions), np.zeros(3)))
    largest = max((abs(part.along_um) for part in found.contributions), default=0.0)
    ranked = sorted(found.contributions, key=lambda part: abs(part.along_um), reverse=True)
    listed, rest = _split(ranked, lever)
    rows = [_row(part, largest, part.key == lever, attributes) for part in listed]
    if rest:
        error = sum((part.error_um for part in rest), np.zeros(3))
        rows.append(_sum_row(f"{len(rest)} smaller", error, towards))
    first = found.error_um - found.remainder_um
    closing = [
        _sum_row("sum, first order", first, towards, line=True),
        _sum_row("2nd-order rest", found.remainder_um, towards, tiny=True),
        _sum_row("error, exact chain", found.error_um, towards, strong=True),
    ]
    head = "".join(
        f"<th {_CELL.replace('2px 0', '0 0')}>{name}</th>" for name in ("along E", "x", "y", "z")
    )
    return (
        f'<div style="padding:2px 12px 10px;line-height:1.4">{_point(answer)}'
        '<table style="width:100%;border-collapse:collapse;font-size:11px;margin-top:6px">'
        f'<tr style="opacity:.65"><th></th><th></th>{head}</tr>{"".join(rows)}{"".join(closing)}'
        "</table>"
        '<div style="font-size:11px;opacity:.65;margin-top:4px">µm; parts along E add up to its'
        " length. Click a row to see its axis and lever.</div></div>"
    )


def _point(answer: Answer) -> str:
    """Spell where the point is and what its error is."""
    found = answer.explanation
    x, y, z = (number(value) for value in found.error_um)
    tilt = float(np.linalg.norm(found.orientation_urad))
    length = float(np.linalg.norm(found.error_um))
    return (
        f'<div data-value="why at" style="font-size:12px">'
        f"{spell_place(found.nominal_mm + answer.shift_mm)}</div>"
        '<div style="font-size:12px;opacity:.75" data-value="why axes">'
        f"axes at {spell_positions(answer.at)}</div>"
        '<div style="font-size:12px;opacity:.75">'
        f"{html.escape(answer.loop.value)} loop · tilt of the tool axis {tilt:.1f} µrad</div>"
        '<div style="margin-top:3px"><span style="font-size:17px;font-weight:650">'
        f'|E| <span data-value="why norm">{length:.2f} µm</span></span>'
        '<span data-value="why error" style="font-size:12px;margin-left:8px;white-space:nowrap;'
        f'font-variant-numeric:tabular-nums">{x}, {y}, {z} µm</span></div>'
    )


def _row(part: Contribution, largest: float, chosen: bool, attributes: Attributes) -> str:
    """Spell one contribution; the chosen one with its axis and lever."""
    row = parameter(part.key)
    mark = "background:rgba(194,24,91,.12);" if chosen else ""
    cells = "".join(f"<td {_CELL}>{number(value)}</td>" for value in part.error_um)
    line = (
        f'<tr data-contribution="{part.key}" title="{html.escape(row.name)}"'
        f' aria-pressed="{str(chosen).lower()}" style="cursor:pointer;{mark}"'
        f" {attributes(part.key)}>"
        f'<td style="padding:2px 4px 2px 2px;font-weight:600">{part.key}</td>'
        f"<td>{_bar(part.along_um, largest)}</td>"
        f"<td {_CELL}><b>{number(part.along_um)}</b></td>{cells}</tr>"
    )
    return line + (_lever_row(part) if chosen else "")


def _lever_row(part: Contribution) -> str:
    """Say how the chosen contribution comes about."""
    row = parameter(part.key)
    value = f"{number(part.value, 1)} {row.unit}"
    if row.is_rotation:
        arm = float(np.linalg.norm(np.cross(part.direction, part.lever_mm)))
        how = f"{value} × {arm:.0f} mm across the axis"
    else:
        how = f"{value} along the direction drawn; a translation needs no lever"
    place = ", ".join(spell_coordinate(value) for value in part.origin_mm)
    return (
        '<tr style="background:rgba(194,24,91,.12)"><td colspan="6" data-value="lever"'
        f' style="padding:0 2px 5px;font-size:11.5px">{html.escape(row.name)}: {how}.<br>Frame of'
        f" {row.axis} at {place} mm; lever {np.linalg.norm(part.lever_mm):.0f} mm.</td></tr>"
    )


def _sum_row(
    name: str,
    error: Array,
    towards: Array,
    *,
    line: bool = False,
    strong: bool = False,
    tiny: bool = False,
) -> str:
    """Spell a sum: its name, its part along a direction and its components."""
    along = float(np.dot(error, towards))
    spell = small if tiny else number
    style = "border-top:1px solid rgba(128,128,128,.6);" if line else ""
    style += "font-weight:650;" if strong else ""
    cells = "".join(f"<td {_CELL}>{spell(float(value))}</td>" for value in (along, *error))
    return (
        f'<tr data-sum="{name}" style="{style}"><td colspan="2" style="padding:2px">{name}</td>'
        f"{cells}</tr>"
    )


def _bar(value: float, largest: float) -> str:
    """Draw a bar from the middle: to the right what adds to the error, to the left what lessens."""
    half = BAR_PX / 2.0
    width = 0.0 if largest == 0.0 else abs(value) / largest * half
    left = half if value >= 0.0 else half - width
    fill = "currentColor" if value >= 0.0 else "transparent"
    return (
        f'<div style="position:relative;width:{BAR_PX}px;height:10px;'
        "background:linear-gradient(90deg,transparent calc(50% - .5px),rgba(128,128,128,.6) 0,"
        'rgba(128,128,128,.6) calc(50% + .5px),transparent 0)">'
        f'<div style="position:absolute;top:1px;height:8px;box-sizing:border-box;opacity:.75;'
        f"left:{left:.1f}px;width:{width:.1f}px;background:{fill};"
        'border:1px solid currentColor"></div></div>'
    )


def _split(parts: list[Contribution], lever: str) -> tuple[list[Contribution], list[Contribution]]:
    """Separate the parts listed from those summed up; the chosen one is always listed."""
    if len(parts) <= SHOWN + 1:
        return parts, []
    listed = [p for number, p in enumerate(parts) if number < SHOWN or p.key == lever]
    return listed, [p for number, p in enumerate(parts) if number >= SHOWN and p.key != lever]


def _unit(vector: Array) -> Array:
    """Give the direction of a vector, [3]; zero for none."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.zeros(3)
