"""The answer to "why here?" as HTML: the error in numbers, and the contributions it is made of."""

from collections.abc import Callable

import numpy as np
from markupsafe import Markup

from warpspace.analysis.explain import Contribution
from warpspace.app.evaluation.budget import Answer
from warpspace.app.readouts.html import message, render
from warpspace.app.readouts.numbers import signed, small
from warpspace.machine.parameters import parameter
from warpspace.picture.words import spell_place, spell_positions
from warpspace.units import Array

ASK = message(
    "Click any point of the box or of a trace: its error appears here, taken apart into what"
    " causes it."
)
REFUSED = message(
    "A difference of two machines has no causes of its own. Show A or B in the tab Compare to ask"
    " why."
)
SHOWN = 14
"""Contributions listed one by one; the smaller ones are summed up in one row."""
Attributes = Callable[[str], Markup]


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
    total_um = _sum(found.contributions)
    length = float(np.linalg.norm(total_um))
    towards = total_um / length if length > 0.0 else np.zeros(3)
    ranked = sorted(found.contributions, key=lambda part: abs(part.along_um), reverse=True)
    listed, rest = _split(ranked, lever)

    def summed(
        name: str, error_um: Array, kind: str = "", spell: Callable[[float], str] = signed
    ) -> dict[str, object]:
        along_um = float(np.dot(error_um, towards))
        return {"name": name, "kind": kind, "cells": [spell(v) for v in (along_um, *error_um)]}

    return render(
        "why",
        place=spell_place(found.nominal_mm + answer.shift_mm),
        axes=spell_positions(answer.at),
        loop=answer.loop.value,
        tilt_urad=float(np.linalg.norm(found.orientation_urad)),
        error_um=found.error_um,
        length_um=float(np.linalg.norm(found.error_um)),
        listed=listed,
        largest=max((abs(part.along_um) for part in listed), default=0.0) or 1.0,
        chosen=lever,
        attributes=attributes,
        mechanism=_mechanism,
        lever_length=lambda part: float(np.linalg.norm(part.lever_mm)),
        rest=[summed(f"{len(rest)} smaller", _sum(rest))] if rest else [],
        sums=[
            summed("sum, first order", found.error_um - found.remainder_um, "ws-line"),
            summed("2nd-order rest", found.remainder_um, spell=small),
            summed("error, exact chain", found.error_um, "ws-strong"),
        ],
    )


def _mechanism(part: Contribution) -> str:
    """Say how a contribution comes about: a rotation times its arm, or a plain shift."""
    row = parameter(part.key)
    value = f"{signed(part.value, 1)} {row.unit}"
    if not row.is_rotation:
        return f"{value} along the direction drawn; a translation needs no lever"
    arm_mm = float(np.linalg.norm(np.cross(part.direction, part.lever_mm)))
    return f"{value} × {arm_mm:.0f} mm across the axis"


def _split(ranked: list[Contribution], lever: str) -> tuple[list[Contribution], list[Contribution]]:
    """Separate the parts listed from those summed up; the chosen one is always listed."""
    if len(ranked) <= SHOWN + 1:
        return ranked, []
    smaller = ranked[SHOWN:]
    listed = ranked[:SHOWN] + [part for part in smaller if part.key == lever]
    return listed, [part for part in smaller if part.key != lever]


def _sum(parts: tuple[Contribution, ...] | list[Contribution]) -> Array:
    """Add the errors of contributions, [3], µm."""
    return sum((part.error_um for part in parts), np.zeros(3))
