"""What an import would bring, before it is applied: errors, curves with their scatter, units."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpspace.app.readouts.html import render
from warpspace.formats.measured import BACKWARD, BOTH, FORWARD, Series, summaries
from warpspace.formats.registry import Reading
from warpspace.machine.axes import is_linear, parameter
from warpspace.units import Array, spell_short

MOST_CURVES, MOST_DOTS = 12, 400
WIDTH, HEIGHT, EDGE = 400.0, 90.0, 6.0
COLOURS = {FORWARD: "#1f6fb2", BACKWARD: "#c8283c", BOTH: "#2f8f5b"}
WORDS = {FORWARD: "forward", BACKWARD: "backward", BOTH: "mean"}


@dataclass(frozen=True)
class Line:
    """One line of a small chart."""

    points: str
    colour: str


@dataclass(frozen=True)
class Curve:
    """A small chart of one error: lines of means, dots of runs."""

    caption: str
    zero: float
    lines: tuple[Line, ...]
    dots: tuple[tuple[float, float, str], ...]


def preview_html(
    reading: Reading,
    names: Sequence[str],
    machine: str,
    notes: Sequence[str],
    *,
    stale: bool = False,
) -> str:
    """Show what an import would bring."""
    found = reading.found
    return render(
        "import_preview",
        format=reading.format.title,
        recognised=reading.recognised,
        names=names,
        machine=machine,
        stale=stale,
        units=found.units,
        rows=summaries(found),
        curves=[_curve(one) for one in found.series[:MOST_CURVES]],
        more=max(len(found.series) - MOST_CURVES, 0),
        assumed=found.assumed,
        notes=(*found.notes, *notes),
    )


def _curve(one: Series) -> Curve:
    at = np.array(one.positions)
    means = {way: mean for way in COLOURS if (mean := one.mean(way)) is not None}
    readings = np.array([run.values for run in one.runs])
    low, high = min(float(np.nanmin(readings)), 0.0), max(float(np.nanmax(readings)), 0.0)
    reach = max(high - low, 1e-9)
    span = max(float(at[-1] - at[0]), 1e-9)

    def across(position: Array) -> Array:
        return EDGE + (WIDTH - 2.0 * EDGE) * (position - at[0]) / span

    def up(value: Array) -> Array:
        return HEIGHT - EDGE - (HEIGHT - 2.0 * EDGE) * (value - low) / reach

    keep = max(1, len(at) // MOST_DOTS)
    lines = tuple(
        Line(_points(across(at[::keep]), up(mean[::keep])), COLOURS[way])
        for way, mean in means.items()
    )
    dots: list[tuple[float, float, str]] = []
    if len(one.runs) > len(means):
        for run in one.runs:
            height = up(np.array(run.values))
            dots += [
                (float(x), float(y), COLOURS[run.direction])
                for x, y in zip(across(at), height, strict=True)
                if np.isfinite(y)
            ]
    axis, unit = parameter(one.key).axis, parameter(one.key).unit
    place = "mm" if is_linear(axis) else "°"
    ways = ", ".join(WORDS[way] for way in means)
    caption = (
        f"{one.key}, {parameter(one.key).name}: {ways}; {spell_short(low)} … {spell_short(high)}"
        f" {unit} over {axis} {at[0]:g} … {at[-1]:g} {place}"
    )
    zero = float(up(np.array(0.0)))
    return Curve(caption, zero, lines, tuple(dots[:: max(1, len(dots) // MOST_DOTS)]))


def _points(x: Array, y: Array) -> str:
    return " ".join(f"{one:.1f},{other:.1f}" for one, other in zip(x, y, strict=True))
