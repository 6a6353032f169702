"""The error budget of a point as HTML: the error in numbers, and the contributions to it."""

from collections.abc import Callable, Collection, Mapping

import numpy as np
from markupsafe import Markup

from warpspace.analysis.contributions import Contribution
from warpspace.app.evaluation.budget import Answer
from warpspace.app.readouts.html import message, render, signed, small
from warpspace.machine.axes import parameter
from warpspace.picture.words import spell_axes
from warpspace.units import Array

ASK = message(
    "Click any point of the box or of a trace, enter the positions of its axes above, or press W"
    " for the worst point: its error appears here, taken apart into what contributes to it."
)
REFUSED = message(
    "A difference of two machines has no causes of its own. Show A or B in the tab Compare for its"
    " error budget."
)
SHOWN = 14  # contributions listed one by one; the smaller ones are summed up in one row
AT, EDIT, EXCLUDE, INCLUDE, LEVER = "at", "edit", "exclude", "include", "lever"
"""First words of what a click sends; a point as typed, or the key of an error, follows."""
Attributes = Callable[[str], Markup]


def field_html(at: Mapping[str, float] | None, attributes: Markup) -> str:
    """Spell the field in which a point is typed."""
    text = "" if at is None else spell_axes(at).removeprefix("axes ")
    return render("point_field", text=text, attributes=attributes)


def answer_html(
    answer: Answer,
    lever: str,
    attributes: Attributes,
    button: Attributes | None = None,
    excluded: Collection[str] = (),
) -> str:
    """Spell an answer."""
    found = answer.explanation
    total_um = _sum(found.contributions)
    length = float(np.linalg.norm(total_um))
    towards = total_um / length if length > 0.0 else np.zeros(3)
    ranked = sorted(found.contributions, key=lambda part: abs(part.along_um), reverse=True)
    listed, rest = _split(ranked, lever)

    # bars fill the column from the one that lessens most to the one that adds most
    lessens = max((0.0, *(-part.along_um for part in listed)))
    width = lessens + max((0.0, *(part.along_um for part in listed))) or 1.0

    def summed(
        name: str, error_um: Array, kind: str = "", spell: Callable[[float], str] = signed
    ) -> dict[str, object]:
        along_um = float(np.dot(error_um, towards))
        return {"name": name, "kind": kind, "cells": [spell(v) for v in (along_um, *error_um)]}

    return render(
        "why",
        left_um=float(np.linalg.norm(answer.drawn_um)) if answer.is_corrected else None,
        at=answer.at,
        point_mm=found.nominal_mm + answer.shift_mm,
        loop=answer.loop.value,
        tilt_urad=float(np.linalg.norm(found.orientation_urad)),
        error_um=found.error_um,
        length_um=float(np.linalg.norm(found.error_um)),
        listed=listed,
        width=width,
        zero=lessens / width,
        chosen=lever,
        attributes=attributes,
        button=button,
        excluded=sorted(excluded),
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
    row = parameter(part.key)
    value = f"{signed(part.value, 1)} {row.unit}"
    if not row.is_rotation:
        return f"{value} along the direction drawn; a translation needs no lever"
    arm_mm = float(np.linalg.norm(np.cross(part.direction, part.lever_mm)))
    return f"{value} × {arm_mm:.0f} mm across the axis"


def _split(ranked: list[Contribution], lever: str) -> tuple[list[Contribution], list[Contribution]]:
    if len(ranked) <= SHOWN + 1:
        return ranked, []
    smaller = ranked[SHOWN:]
    listed = ranked[:SHOWN] + [part for part in smaller if part.key == lever]
    return listed, [part for part in smaller if part.key != lever]


def _sum(parts: tuple[Contribution, ...] | list[Contribution]) -> Array:
    """Add the errors of contributions, [3], µm."""
    return sum((part.error_um for part in parts), np.zeros(3))
