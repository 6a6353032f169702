"""Where the tool point and the slices are, in positions of the axes and in R, as HTML."""

from collections.abc import Mapping, Sequence

from warpspace.app.readouts.html import render
from warpspace.picture.model import Slice
from warpspace.picture.words import SEPARATOR, spell_axes, spell_coordinate
from warpspace.units import Array


def tool_point_html(axes: Mapping[str, float], point_mm: Array) -> str:
    """Spell where the tool point of the machine stands."""
    return render("tool_point", axes=axes, point_mm=point_mm)


def slices_html(slices: Sequence[Slice]) -> str:
    """Spell where slices lie; empty for none."""
    return render("slices", lines=[spell_slice(one) for one in slices]) if slices else ""


def spell_slice(drawn: Slice) -> str:
    """Spell where a slice lies: ``axes Z −480 · in R z −51``."""
    across = drawn.grid.nominal_mm[..., "XYZ".index(drawn.axis)]
    ends = dict.fromkeys(spell_coordinate(value) for value in (across.min(), across.max()))
    axes = spell_axes({drawn.axis: drawn.position_mm})
    return f"{axes}{SEPARATOR}in R {drawn.axis.lower()} {' … '.join(ends)}"
