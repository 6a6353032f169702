"""The chance panel's picture as HTML: the probability in words, the histogram, the shares."""

import html
from collections.abc import Mapping
from typing import TYPE_CHECKING

from warpspace.app.state.specification import MAX
from warpspace.machine.parameters import parameter

if TYPE_CHECKING:
    from warpspace.app.evaluation.probability import Chance

WIDTH, HEIGHT, FOOT = 280.0, 96.0, 31.0
WITHIN, BEYOND = "#4a7ab5", "#c9863a"
SHOWN_SHARES = 6


def spell_chance(chance: "Chance", shares: Mapping[str, float]) -> str:
    """Draw what a tolerance set is likely to give.

    Parameters
    ----------
    chance : Chance
    shares : mapping of str to float
        Share of the scatter by parameter.

    Returns
    -------
    str
        HTML.
    """
    found = chance.probability
    where = "everywhere in the volume" if chance.over == MAX else "at a random point"
    low, high = _percent(found.low), _percent(found.high)
    return (
        '<div style="padding:2px 12px 10px;font-size:12px;line-height:1.4">'
        '<div style="font-size:13px"><b data-value="chance" style="font-size:20px">'
        f"{_percent(found.probability)} %</b> of the machines stay within "
        f"<b>{found.spec_um:g} µm</b> {where}</div>"
        f'<div style="opacity:.7" data-value="interval">95 % confidence: {low} … {high} %, '
        f"{chance.samples:_} machines</div>".replace("_", "\u202f")
        + _histogram(chance)
        + _numbers(chance)
        + _shares(shares)
        + "</div>"
    )


def spell_refusal(text: str) -> str:
    """Say why there is no chance to show."""
    return f'<div style="padding:4px 12px 10px;font-size:12px">{html.escape(text)}</div>'


def _percent(share: float) -> str:
    """Spell a share in per cent; only what is certain reads 0 or 100."""
    value = f"{100.0 * share:.1f}"
    if value == "100.0" and share < 1.0:
        return "99.9"
    return "0.1" if value == "0.0" and share > 0.0 else value


def _histogram(chance: "Chance") -> str:
    """Draw the histogram of |E|, what is beyond the limit in another colour."""
    edges, counts = chance.histogram.edges_um, chance.histogram.counts
    limit = chance.probability.spec_um
    right = max(float(edges[-1]), limit) * 1.02
    peak = float(counts.max()) or 1.0
    scale = WIDTH / right
    bars = {True: "", False: ""}
    for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True):
        tall = HEIGHT * float(count) / peak
        middle = (float(low) + float(high)) / 2.0
        width = max((float(high) - float(low)) * scale - 0.4, 0.6)
        bars[middle <= limit] += (
            f"M{float(low) * scale:.1f} {HEIGHT:g}v{-tall:.1f}h{width:.1f}v{tall:.1f}z"
        )
    at = limit * scale
    ticks = "".join(
        f'<text x="{value * scale:.1f}" y="{HEIGHT + 14:g}" text-anchor="middle" '
        f'font-size="10" fill="currentColor" opacity=".7">{value:g}</text>'
        for value in _ticks(right)
    )
    return (
        f'<svg data-value="histogram" viewBox="-6 -4 {WIDTH + 14:g} {HEIGHT + FOOT + 4:g}" '
        'style="width:100%;display:block;margin:6px 0 0">'
        f'<path d="{bars[True]}" fill="{WITHIN}"/><path d="{bars[False]}" fill="{BEYOND}"/>'
        f'<path d="M0 {HEIGHT:g}H{WIDTH:g}" stroke="currentColor" opacity=".5"/>'
        f'<path d="M{at:.1f} -2V{HEIGHT:g}" stroke="currentColor" stroke-dasharray="4 3"/>'
        f'{ticks}<text x="{WIDTH / 2:g}" y="{HEIGHT + 27:g}" text-anchor="middle" font-size="10" '
        f'fill="currentColor">|E| [µm]</text></svg>'
    )


def _ticks(right: float) -> list[float]:
    """Choose some round values along the axis, µm."""
    step = next(
        s for s in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1e3, 1e4, 1e5) if right / s <= 7
    )
    return [i * step for i in range(int(right / step) + 1)]


def _numbers(chance: "Chance") -> str:
    """Spell mean, P95 and the largest."""
    cells = "".join(
        f'<span><span style="opacity:.7">{name}</span> '
        f'<b data-value="chance {name}">{value:.1f}</b> µm</span>'
        for name, value in (
            ("mean", chance.mean_um),
            ("P95", chance.p95_um),
            ("largest", chance.max_um),
        )
    )
    return (
        '<div style="display:flex;justify-content:space-between;font-variant-numeric:tabular-nums">'
        f"{cells}</div>"
    )


def _shares(shares: Mapping[str, float]) -> str:
    """Draw which tolerances the scatter comes from."""
    ranked = sorted(shares.items(), key=lambda item: -item[1])[:SHOWN_SHARES]
    longest = max((share for _, share in ranked), default=0.0) or 1.0
    rows = "".join(
        '<div style="display:flex;align-items:center;gap:6px">'
        f'<span style="width:44px"><b>{key}</b></span>'
        f'<span style="flex:1"><span style="display:block;height:5px;border-radius:2px;'
        f'background:{WITHIN};width:{100.0 * share / longest:.1f}%"></span></span>'
        '<span style="width:44px;text-align:right;white-space:nowrap">'
        f"{100.0 * share:.1f} %</span></div>"
        for key, share in ranked
        if share > 0.0 and parameter(key)
    )
    if not rows:
        return ""
    return f'<div style="opacity:.75;margin-top:8px">the scatter comes from</div>{rows}'
