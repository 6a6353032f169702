"""What is always in view, as HTML: the heading, and colour bar, numbers and key of the map."""

from functools import cache

import numpy as np
from markupsafe import Markup

from warpspace.analysis.statistics import volume_statistics
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.palette import palette
from warpspace.app.evaluation.rotation import moved_traces
from warpspace.app.readouts.html import message, render, thousands
from warpspace.app.state.app_state import AppState
from warpspace.app.state.comparison import SHOWN
from warpspace.app.state.table import table_words
from warpspace.field.evaluate import ErrorField, placed_words
from warpspace.geometry.colour import ColourScale, colour_table
from warpspace.geometry.surfaces import round_down
from warpspace.picture.words import direction_words, spell_factor, spell_point
from warpspace.units import MICROMETRE, MM_PER_UM, spell_short

BAR_PX = 190  # height of the colour bar, CSS pixels; the style sheet has it too
LINE_PX = 12  # least distance of two names beside the colour bar
_BAR_MM = 100.0
_PX_PER_MM = 0.9
_STOPS = 32


@cache
def colour_stops(*, diverging: bool) -> str:
    """Spell the colours of a scale from the bottom up as the stops of a CSS gradient."""
    table = colour_table(diverging=diverging)
    last = len(table) - 1
    stops = [table[round(i * last / _STOPS)] for i in range(_STOPS + 1)]
    return ",".join(f"rgb({r},{g},{b})" for r, g, b in stops)


def colour_bar(picture: LivePicture) -> str:
    """Draw the colour bar with ticks, unit, and marks at mean, P95 and max of what is coloured."""
    scale = picture.scale
    return render(
        "colour_bar",
        label=scale.label,
        unit=scale.unit,
        colours=colour_stops(diverging=scale.diverging),
        ticks=[(_height(scale, tick), spell_short(tick)) for tick in scale.ticks],
        marks=_marks(picture),
    )


def _marked(picture: LivePicture) -> dict[str, float]:
    found, values = picture.statistics, picture.values
    if picture.scale.diverging:
        # the length of the error says nothing of a signed component: its own ends do
        return {
            "min": float(values.min()),
            "mean": float(np.sum(picture.grid.weights * values.reshape(picture.shape))),
            "max": float(values.max()),
        }
    if picture.scale.unit != MICROMETRE:
        # the length of the tilt is summarised as that of the position error is
        tilt = picture.field.orientation_urad
        field = ErrorField(picture.field.nominal_mm, tilt, tilt)
        found = volume_statistics(field, picture.grid)
    return {"mean": found.mean_um, "P95": found.p95_um, "max": found.max_um}


def _height(scale: ColourScale, value: float) -> float:
    part = (value - scale.low) / (scale.high - scale.low)
    return min(max(part, 0.0), 1.0) * BAR_PX


def _marks(picture: LivePicture) -> list[tuple[str, str, float, float]]:
    """Place what is marked: name, value, height of its arrow and of its name, pixels.

    Names are moved up where they would overlap.
    """
    placed: list[tuple[str, str, float, float]] = []
    lowest = -100.0
    for name, value in _marked(picture).items():
        arrow = _height(picture.scale, value)
        lowest = max(arrow, lowest + LINE_PX)
        placed.append((name, spell_short(round(value, 2)), arrow, lowest))
    return placed


def _key_to_lines(picture: LivePicture) -> list[tuple[str, str, str]]:
    colours, shown = palette(picture), picture.state.shown
    rows = [("solid", colours.edge, "deformed working volume")]
    if shown.ghost:
        rows.append(("dashed", colours.ghost, "nominal working volume"))
    if moved_traces(picture):
        rows += [
            ("solid", colours.trace_actual, "trace of a rotary axis, actual (faint: other traces)"),
            ("solid", colours.trace_nominal, "its nominal trace, where apart"),
        ]
    return [(style, f"rgb{rgb}", text) for style, rgb, text in rows]


def _scale_bars(picture: LivePicture) -> list[tuple[float, str]]:
    """Give the length of two bars, pixels, and their words: geometry in mm, displacement in µm."""
    factor = picture.exaggeration
    error_um = round_down(_BAR_MM / (factor * MM_PER_UM))
    drawn_mm = error_um * MM_PER_UM * factor
    error = (
        f"{spell_short(error_um)} µm"
        if error_um < 1e4
        else f"{spell_short(error_um * MM_PER_UM)} mm"
    )
    return [
        (_BAR_MM * _PX_PER_MM, f"{_BAR_MM:g} mm geometry"),
        (drawn_mm * _PX_PER_MM, f"{error} error, {spell_factor(factor)}"),
    ]


def summary(picture: LivePicture, *, bars: bool = True) -> str:
    """Put colour bar, numbers, scale bars and key into one block."""
    found = picture.statistics
    return render(
        "summary",
        colour_bar=Markup(colour_bar(picture)),  # noqa: S704 - escaped by its template
        length=picture.length_words,
        nodes=thousands(picture.field.norm_um.size),
        loop=picture.both_words(_loop_words),
        table="" if picture.is_difference else table_words(picture.drawn_state),
        numbers={
            "mean": found.mean_um,
            "RMS": found.rms_um,
            "P95": found.p95_um,
            "max": found.max_um,
        },
        found=found,
        scale_bars=_scale_bars(picture) if bars else [],
        lines=_key_to_lines(picture),
    )


def _loop_words(state: AppState) -> str:
    return ", ".join((f"{state.loop} loop", *placed_words(state.view())))


def heading(picture: LivePicture, order: str = "", left_behind: str = "") -> str:
    """Spell machine, error set and exaggeration."""
    state = picture.drawn_state
    active, machine = state.active, state.scene.machine
    compared = picture.compared.title if picture.compared is not None else ""
    table = "" if picture.is_difference else table_words(state)
    return render(
        "heading",
        title=state.scene.title,
        compared=compared,
        table="" if table in compared else table,
        edited=len(state.changed_keys),
        excluded=sum(1 for key, value in state.amplitudes.items() if value != active[key]),
        machine=f"{machine.title}, chain {machine.chain}",
        size=" × ".join(f"{edge:.0f}" for edge in picture.grid.extent_mm),
        nodes="×".join(str(count) for count in picture.grid.shape),
        factor=f"exaggeration {spell_factor(picture.exaggeration)}",
        auto=picture.state.exaggeration is None,
        direction=" ".join(direction_words(state.scene)),
        order=order,
        left_behind=left_behind,
    )


# --- Numbers of a comparison side by side, as HTML ------------------------------------------------

NOTHING = message(
    "Choose a scene for B, or pin the present errors as before and go on changing them: both are"
    " drawn with the same colours, exaggeration and camera."
)
MARK = "▸ "  # before the name of what is drawn
ROWS = {"mean": "mean_um", "RMS": "rms_um", "P95": "p95_um", "max": "max_um"}
"""Word on a row to field of `Statistics`."""


def comparison_html(picture: LivePicture) -> str:
    """Spell the numbers of a comparison."""
    found = picture.compared
    if found is None:
        return NOTHING
    return render(
        "comparison",
        titles=dict(zip("AB", found.titles, strict=True)),
        rows=ROWS,
        a=found.a,
        b=found.b,
        difference=found.difference,
        refused=found.refused,
        scale=picture.scale,
        own=picture.is_difference,
        colours=colour_stops(diverging=picture.scale.diverging),
    )


def marked(shown: str) -> tuple[str, ...]:
    """Name what can be drawn, with a mark before what is: a key of `SHOWN`."""
    return tuple(f"{MARK}{name}" if word == shown else name for word, name in SHOWN.items())


# --- What is written over the drawing, as HTML ----------------------------------------------------
# Heading, the strip of a phone, the buttons.


def strip(picture: LivePicture) -> str:
    """Put colours, mean and max into a strip: what a phone shows below the drawing."""
    scale, found = picture.scale, picture.statistics
    span = scale.high - scale.low
    return render(
        "strip",
        label=scale.label,
        length=picture.length_words,
        unit=scale.unit,
        colours=colour_stops(diverging=scale.diverging),
        ticks=[(100.0 * (tick - scale.low) / span, spell_short(tick)) for tick in scale.ticks],
        mean=found.mean_um,
        max=found.max_um,
        worst_place=spell_point(found.max_at_axes, found.max_at_mm),
    )


def buttons(*, ghost: bool, there: bool, attributes: Markup) -> str:
    """Spell the switch of the machine's ghost."""
    return render("buttons", ghost=ghost, there=there, attributes=attributes)
