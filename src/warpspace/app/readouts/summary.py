"""Colour bar, numbers and headings as HTML: pure text, every foreign word escaped."""

import html
from collections.abc import Mapping
from functools import cache, lru_cache

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.viewport.layers import palette
from warpspace.geometry.colour import ColourScale, colour_table
from warpspace.geometry.deform import round_down
from warpspace.picture.words import spell_factor, spell_place
from warpspace.units import MICROMETRE, MM_PER_UM

BAR_HEIGHT = 190
_BAR_MM = 100.0
_PX_PER_MM = 0.9
_STOPS = 32


def _number(value: float) -> str:
    """Spell a value of a scale with a proper minus sign."""
    return f"{value:g}".replace("-", "−")


@cache
def gradient(*, diverging: bool) -> str:
    """Spell the colours of a scale from the bottom up as a CSS gradient."""
    table = colour_table(diverging=diverging)
    last = len(table) - 1
    stops = [table[round(i * last / _STOPS)] for i in range(_STOPS + 1)]
    spelt = ",".join(f"rgb({r},{g},{b})" for r, g, b in stops)
    return f"linear-gradient(to top,{spelt})"


def colour_bar(picture: LivePicture) -> str:
    """Draw the colour bar with ticks, unit, and marks at mean, P95 and max of what is coloured."""
    heading, bar = _empty_bar(picture.scale)
    return heading + bar + "".join(_marks(picture.scale, _marked(picture))) + "</div>"


def _marked(picture: LivePicture) -> dict[str, float]:
    """Choose what is marked, by name from the lowest value up, in the unit of the scale."""
    found, values = picture.statistics, picture.values
    if picture.scale.diverging:
        # the length of the error says nothing of a signed component: its own ends do
        return {
            "min": float(values.min()),
            "mean": float(values.mean()),
            "max": float(values.max()),
        }
    if picture.scale.unit == MICROMETRE:
        return {"mean": found.mean_um, "P95": found.p95_um, "max": found.max_um}
    return {
        "mean": float(values.mean()),
        "P95": float(np.percentile(values, 95.0)),
        "max": float(values.max()),
    }


@lru_cache(maxsize=32)
def _empty_bar(scale: ColourScale) -> tuple[str, str]:
    """Draw heading and bar of a scale with its ticks, without marks; the bar is still open."""
    parts = [
        (
            f'<div style="position:relative;height:{BAR_HEIGHT}px;margin:10px 0 8px 58px;'
            f'width:62px">'
            f'<div style="position:absolute;left:0;top:0;bottom:0;width:22px;'
            f"outline:1px solid rgba(128,128,128,.5);"
            f'background:{gradient(diverging=scale.diverging)}"></div>'
        )
    ]
    for tick in scale.ticks:
        at = _height(scale, tick)
        parts.append(
            f'<div style="position:absolute;left:22px;bottom:{at:.1f}px;width:5px;'
            f'border-top:1px solid currentColor"></div>'
            f'<div style="position:absolute;left:31px;bottom:{at - 7:.1f}px;line-height:14px;'
            f'font-size:12px">{_number(tick)}</div>'
        )
    label = html.escape(scale.label).replace("_", "<sub>", 1) + (
        "</sub>" if "_" in scale.label else ""
    )
    heading = (
        f'<div style="margin-left:44px;font-weight:600">{label} [{html.escape(scale.unit)}]</div>'
    )
    return heading, "".join(parts)


def _height(scale: ColourScale, value: float) -> float:
    """Place a value on the bar, pixels above its foot."""
    part = (value - scale.low) / (scale.high - scale.low)
    return min(max(part, 0.0), 1.0) * BAR_HEIGHT


def _marks(scale: ColourScale, values: Mapping[str, float]) -> list[str]:
    """Draw names and arrows left of the bar, the names moved apart where they would overlap."""
    placed: list[str] = []
    lowest = -100.0
    for name, value in values.items():
        at = _height(scale, value)
        text = max(at, lowest + 12.0)
        lowest = text
        placed.append(
            f'<div data-mark="{name}" title="{_number(round(value, 2))} {scale.unit}"'
            f' style="position:absolute;left:-58px;width:42px;text-align:right;'
            f'bottom:{text - 7:.1f}px;line-height:14px;font-size:11px">{name}</div>'
            f'<div style="position:absolute;left:-12px;bottom:{at - 5:.1f}px;border:5px solid '
            f'transparent;border-left:8px solid currentColor;border-right:0"></div>'
        )
    return placed


def numbers(picture: LivePicture) -> str:
    """Spell the statistics of the field as a table."""
    found = picture.statistics
    rows = [
        ("mean", f"{found.mean_um:.2f} µm", True),
        ("RMS", f"{found.rms_um:.2f} µm", False),
        ("P95", f"{found.p95_um:.2f} µm", False),
        ("max", f"{found.max_um:.2f} µm", True),
    ]
    cells = "".join(
        f'<tr><td style="opacity:.7;padding:1px 0">{name}</td>'
        f'<td data-value="{name}" style="text-align:right;font-variant-numeric:tabular-nums;'
        f'font-weight:{600 if strong else 400}">{value}</td></tr>'
        for name, value, strong in rows
    )
    return f'<table style="width:100%;border-collapse:collapse;font-size:14px">{cells}</table>'


def worst_place(picture: LivePicture) -> str:
    """Spell where the largest error is."""
    return (
        '<div style="font-size:13px;margin-top:2px"><span style="opacity:.7">max at </span>'
        f'<span data-value="max at">{spell_place(picture.statistics.max_at_mm)}</span></div>'
    )


def key_to_lines(picture: LivePicture) -> str:
    """Explain the lines that are drawn."""
    colours, shown = palette(picture), picture.state.shown
    rows = [("solid", colours.edge, "bent working volume")]
    if shown.ghost:
        rows.append(("dashed", colours.ghost, "nominal working volume"))
    if shown.traces and picture.traces:
        rows += [
            ("solid", colours.trace_actual, "rotary traces, actual (paler: at other tilts)"),
            ("solid", colours.trace_nominal, "rotary traces, nominal, where apart"),
        ]
    return "".join(
        '<div style="display:flex;align-items:center;gap:8px;font-size:12px">'
        f'<span style="flex:0 0 26px;border-top:2px {style} rgb{rgb}"></span>{text}</div>'
        for style, rgb, text in rows
    )


def scale_bars(picture: LivePicture) -> str:
    """Draw the two lengths side by side: geometry in mm, displacement in µm."""
    factor = picture.exaggeration
    error = round_down(_BAR_MM / (factor * MM_PER_UM))
    width = error * MM_PER_UM * factor * _PX_PER_MM
    unit = f"{_number(error)} µm" if error < 1e4 else f"{_number(error * MM_PER_UM)} mm"

    def bar(pixels: float, text: str) -> str:
        return (
            f'<div><div style="font-size:12px;margin-top:6px">{text}</div>'
            f'<div style="width:{pixels:.1f}px;height:5px;border:2px solid currentColor;'
            f'border-top:0"></div></div>'
        )

    return bar(_BAR_MM * _PX_PER_MM, f"{_BAR_MM:g} mm geometry") + bar(
        width, f"{unit} error, {spell_factor(factor)}"
    )


def summary(picture: LivePicture) -> str:
    """Put colour bar, numbers, scale bars and key into one block."""
    nodes = f"{picture.field.norm_um.size:,}".replace(",", "\u202f")
    return (
        '<div style="padding:2px 14px 10px;line-height:1.4">'
        '<div style="display:flex;gap:14px">'
        f'<div style="flex:0 0 124px">{colour_bar(picture)}</div>'
        '<div style="flex:1"><div style="font-weight:600">|E| over the grid</div>'
        '<div style="font-size:12px;opacity:.7;margin-bottom:6px">'
        f"{nodes} nodes, {picture.both_words(lambda state: state.loop.value)} loop</div>"
        f"{numbers(picture)}</div></div>"
        f"{worst_place(picture)}"
        '<div style="display:flex;gap:18px;align-items:end;margin:2px 0 8px">'
        f"{scale_bars(picture)}</div>"
        f"{key_to_lines(picture)}</div>"
    )


def heading(picture: LivePicture) -> str:
    """Spell machine, error set and display factor."""
    state = picture.drawn_state
    factor = picture.exaggeration
    how = "true scale" if factor == 1.0 else f"displacement drawn {spell_factor(factor)}"
    auto = " (auto)" if picture.state.exaggeration is None else ""
    edited = len(state.changed_keys)
    note = f" · {edited} error{'s' if edited > 1 else ''} changed" if edited else ""
    active = state.active
    silent = sum(1 for key, value in state.amplitudes.items() if value != active[key])
    note += f" · {silent} silent" if silent else ""
    nodes = "×".join(str(count) for count in picture.grid.shape)
    size = " × ".join(f"{edge:.0f}" for edge in picture.grid.extent_mm)
    machine = f"{state.scene.machine.title}, chain {state.scene.machine.chain}"
    title = html.escape(state.scene.title)
    if picture.compared is not None:
        title = f'<span data-value="compared">{html.escape(picture.compared.title)}</span>'
    return (
        '<div style="padding:2px 14px 10px;line-height:1.4">'
        f'<div style="font-size:17px;font-weight:650">{title}'
        f'<span style="font-weight:400;opacity:.7">{note}</span></div>'
        f'<div style="font-size:12.5px;opacity:.75">'
        f"{html.escape(machine)} · {size} mm · {nodes} nodes</div>"
        f'<div style="font-size:14px;margin-top:3px"><b data-value="factor">{how}</b>{auto}'
        "</div></div>"
    )
