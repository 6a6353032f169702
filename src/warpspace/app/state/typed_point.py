"""A point that somebody types as positions of the axes."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace

from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.picked import Picked
from warpspace.machine.axes import axis_order
from warpspace.picture.coordinates import IN_R

LONGEST = 200
"""Characters that are read."""
EXAMPLE = "X 275 Y -225 Z -480"
_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:e[-+]?\d+)?"
# a digit belongs to the name where a number follows apart: C1 30, C1=30, but C30
_NAME = r"[a-z][0-9](?=\s*[=:]|\s+[-+.,0-9])|[a-z]"
_PAIR = re.compile(rf"({_NAME})\s*[=:]?\s*({_NUMBER})\s*(?:mm|°|deg)?", re.IGNORECASE)
_BETWEEN = re.compile(r"[\s,;·]*")


def read_positions(text: str) -> dict[str, float] | None:
    """Read positions of axes in any of the ways in which they are spelt on the page.

    Parameters
    ----------
    text : str
        For instance ``X 275 Y -225 Z -480``, ``X=275,Y=-225,Z=-480`` or the whole of
        ``axes X 275 Y −225 Z −480 · in R x 275 y −225 z −51``; anything, since it is typed.

    Returns
    -------
    dict of str to float, mm or degrees, or None
        By letter of the axis; None where the text is anything else.
    """
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
    """Ask about the point that somebody has typed.

    Parameters
    ----------
    state : AppState
    text : str
        Axes that it leaves out stay where they were asked about, or in the middle of the volume;
        empty to ask about none.

    Returns
    -------
    AppState
        Positions beyond the travel are clamped, and `notes` says so; rotary axes are moved, since
        all of the volume is shown where they stand. What is no point changes nothing but `notes`.
    """
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
    """Sort axes as machines list them: X, Y, Z, A, B, C."""
    return sorted(axes, key=axis_order)


def _present(state: AppState, axis: str) -> float:
    """Give where a linear axis stands at the point asked about, mm; else the middle."""
    picked: Mapping[str, float] = state.picked.at if state.picked is not None else {}
    return picked.get(axis, state.scene.workspace.positions.get(axis, 0.0))
