"""What is said of a picture wherever it goes: title, numbers, place of the max, colour bar."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from markupsafe import Markup

from warpspace.analysis.statistics import share_below, volume_statistics
from warpspace.app.browser.html import fill, join, lowered, number, tag
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.table import table_words
from warpspace.field.evaluate import ErrorField
from warpspace.geometry.colour import ColourScale, colour_table
from warpspace.picture.words import direction_words, list_axes, own_axes
from warpspace.units import MICROMETRE, spell_short

APART = 15.5 / 240.0  # least distance of two names beside the colour bar, as a part of its height
_STOPS = 32


@cache
def colour_stops(*, diverging: bool) -> str:
    """Spell the colours of a scale from the bottom up as the stops of a CSS gradient."""
    table = colour_table(diverging=diverging)
    last = len(table) - 1
    stops = [table[round(i * last / _STOPS)] for i in range(_STOPS + 1)]
    return ",".join(f"rgb({r},{g},{b})" for r, g, b in stops)


# --- The colour bar -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Mark:
    """What is named beside the colour bar; heights are parts of its own."""

    name: str  # empty at the ends
    value: float
    at: float
    name_at: float  # away from others

    @property
    def words(self) -> str:
        """Name and value."""
        if self.name in ("", "limit"):
            return f"{self.name} {spell_short(self.value)}".strip()
        return f"{self.name} {number(self.value)}"


def marks(picture: LivePicture, apart: float = APART) -> list[Mark]:
    """Name ends, limit and statistics of what is coloured, from the lowest up."""
    scale = picture.scale
    ends = [("", scale.low), ("", scale.high)]
    named = sorted([*ends, *_marked(picture).items()], key=lambda mark: mark[1])
    at = [min(max((value - scale.low) / (scale.high - scale.low), 0.0), 1.0) for _, value in named]
    placed, beyond = list(at), sum(value > scale.high for _, value in named)
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + apart)
    for i in reversed(range(len(placed))):
        placed[i] = min(placed[i], 1.0 - apart * (len(placed) - 1 - beyond - i))
    return [Mark(*pair, *places) for pair, *places in zip(named, at, placed, strict=True)]


def _marked(picture: LivePicture) -> dict[str, float]:
    found, values = picture.statistics, picture.values
    if picture.component != "norm":
        # the length of the error says nothing of a signed component: its own ends do
        return {
            "min": float(values.min()),
            "mean": float(np.sum(picture.grid.weights * values.reshape(picture.shape))),
            "max": float(values.max()),
        }
    if picture.scale.unit != MICROMETRE:
        # the length of the tilt is summarised as that of the position error is
        tilt = picture.field.orientation_urad
        found = volume_statistics(ErrorField(picture.field.nominal_mm, tilt, tilt), picture.grid)
    limit = {"limit": picture.state.specification.limit_um}
    beside = {} if picture.scale.unit != MICROMETRE or picture.is_difference else limit
    return {"mean": found.mean_um, "P95": found.p95_um, "max": found.max_um, **beside}


def legend_html(picture: LivePicture) -> Markup:
    """Draw the colour bar with unit, ends, limit, mean, P95 and max."""
    scale, named = picture.scale, marks(picture)
    names = join(
        tag("i", mark.words, style=f"bottom:{100.0 * mark.name_at:.2f}%",
            class_="ws-mark" if mark.name else "ws-tick", data_mark=mark.name or None)
        for mark in named
    )  # fmt: skip
    leads = join(
        fill('<path d="M0 {y}L3 {y}L10 {to}"/>', y=f"{100.0 - 100.0 * mark.at:.1f}",
             to=f"{100.0 - 100.0 * mark.name_at:.1f}")
        for mark in named if mark.name and mark.name_at <= 1.0
    )  # fmt: skip
    return fill(
        '<b>{label} [{unit}]</b><div class="ws-scale" role="img" aria-label="{words}">'
        '<i class="ws-colours" style="background:{colours}"></i><svg viewBox="0 0 10 100"'
        ' preserveAspectRatio="none">{leads}</svg>{names}</div>',
        label=lowered(scale.label), unit=scale.unit, leads=leads, names=names,
        words=f"Colours from {spell_short(scale.low)} to {spell_short(scale.high)} {scale.unit}: "
        + ", ".join(mark.words for mark in named if mark.name),
        colours=_background(scale),
    )  # fmt: skip


def _background(scale: ColourScale) -> str:
    limit = getattr(scale, "limit", None)
    if limit is None:
        return f"linear-gradient(to top,{colour_stops(diverging=scale.diverging)})"
    kept, missed = (
        f"rgb({r},{g},{b})" for r, g, b in scale.colours(np.array([0.0, 2.0 * limit])).tolist()
    )
    at = 100.0 * min(limit / scale.high, 1.0)
    return f"linear-gradient(to top,{kept} {at:.1f}%,{missed} {at:.1f}%)"


# --- The heading ----------------------------------------------------------------------------------


def numbers_words(picture: LivePicture) -> str:
    """Say mean and max: ``mean 30.9 µm · max 51.7 µm``."""
    found = picture.statistics
    change = "change: " if picture.is_difference else ""
    return f"{change}mean {number(found.mean_um)} µm · max {number(found.max_um)} µm"


def place_words(picture: LivePicture) -> str:
    """Say where the max is: ``at X 275 Y −225 Z −480``."""
    axes = own_axes(picture.drawn_state.scene, picture.statistics.max_at_axes)
    return f"at {list_axes(axes)}" if axes else ""


def kept_words(picture: LivePicture) -> tuple[str, bool]:
    """Say which part of the volume keeps the limit, and whether all of it does; see `share_below`.

    What is not kept everywhere is never said to be, however little is missing.
    """
    limit = picture.state.specification.limit_um
    percent = 100.0 * share_below(picture.field.norm_um, limit)
    kept = picture.statistics.max_um <= limit
    shown = number(min(percent, 99.9), 0 if percent < 99.0 else 1)
    return f"{'all' if kept else f'{shown} %'} of the volume within {limit:g} µm", kept


def subject_words(picture: LivePicture) -> list[str]:
    """Say what is drawn beside the scene: side of a comparison, table, changes, exclusions."""
    state = picture.drawn_state
    words = [] if picture.compared is None else [picture.compared.title]
    table = "" if picture.is_difference else table_words(state)
    if table and not (words and table in words[0]):
        words.append(table)
    return words + _changed_words(state) + list(direction_words(state.scene))


def _changed_words(state: AppState) -> list[str]:
    active = state.active
    edited = len(state.changed_keys)
    excluded = sum(value != active[key] for key, value in state.amplitudes.items())
    found = [f"{edited} error{'s' if edited > 1 else ''} changed"] if edited else []
    return found + ([f"{excluded} excluded"] if excluded else [])
