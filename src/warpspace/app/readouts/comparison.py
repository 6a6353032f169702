"""Numbers of a comparison side by side, as HTML."""

import html

from warpspace.analysis.statistics import Statistics
from warpspace.app.evaluation.live_picture import Compared, LivePicture
from warpspace.app.readouts.summary import gradient
from warpspace.app.state.comparison import SHOWN
from warpspace.picture.words import spell_place

NOTHING = (
    '<div style="padding:4px 14px 10px;line-height:1.5;font-size:13px">Choose a scene for B, or pin'
    " what is shown now and go on changing it: both are drawn with the same colours, factor and"
    " camera.</div>"
)
MARK = "▸ "
"""Before the name of what is drawn."""
_NUMBER = 'style="text-align:right;padding:2px 0 2px 6px;font-variant-numeric:tabular-nums"'
_ROWS = (("mean", "mean_um"), ("RMS", "rms_um"), ("P95", "p95_um"), ("max", "max_um"))


def comparison_html(picture: LivePicture) -> str:
    """Spell the numbers of a comparison.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    str
        HTML; every title is escaped.
    """
    found = picture.compared
    if found is None:
        return NOTHING
    columns = dict(zip(SHOWN.values(), (found.a, found.b, found.difference), strict=True))
    head = "".join(f"<th {_NUMBER}>{name}</th>" for name in marked(found.shown))
    rows = "".join(
        f'<tr><td style="opacity:.7">{label}</td>'
        + "".join(_cell(name, label, getattr(s, field, None)) for name, s in columns.items())
        + "</tr>"
        for label, field in _ROWS
    )
    places = "".join(_place(name, stats) for name, stats in columns.items() if stats is not None)
    refused = f'<div style="font-size:12px">{found.refused}</div>' if found.refused else ""
    return (
        f'<div style="padding:2px 14px 10px;line-height:1.45">{_titles(found)}'
        '<table style="width:100%;border-collapse:collapse;font-size:13px;margin:4px 0">'
        f'<tr><th style="text-align:left;font-weight:400;opacity:.7">|E| [µm]</th>{head}</tr>{rows}'
        f"</table>{places}{refused}{bar(picture)}</div>"
    )


def marked(shown: str) -> tuple[str, ...]:
    """Name what can be drawn, with a mark before what is: a key of `SHOWN`."""
    return tuple(f"{MARK}{name}" if word == shown else name for word, name in SHOWN.items())


def _titles(found: Compared) -> str:
    """Name the two sides."""
    return "".join(
        f'<div style="font-size:12.5px"><b>{name}</b> {html.escape(title)}</div>'
        for name, title in zip("AB", found.titles, strict=True)
    )


def _cell(column: str, row: str, value: float | None) -> str:
    """Spell one number."""
    spelt = "–" if value is None else f"{value:.2f}"
    return f'<td {_NUMBER} data-compared="{row} {column}">{spelt}</td>'


def _place(name: str, found: Statistics) -> str:
    """Say where the largest is."""
    where = spell_place(found.max_at_mm)
    return f'<div style="font-size:11.5px;opacity:.8">max of {name} at {where}</div>'


def bar(picture: LivePicture) -> str:
    """Draw the colours shared by all maps as a flat bar."""
    scale = picture.scale
    ends = "".join(f"<span>{value:g}</span>".replace("-", "−") for value in (scale.low, scale.high))
    colours = gradient(diverging=scale.diverging).replace("to top", "to right")
    return (
        '<div style="font-size:11.5px;margin-top:8px">shared colours, '
        f"{html.escape(scale.label)} [{html.escape(scale.unit)}]"
        f'<div style="height:12px;margin:2px 0;background:{colours}"></div>'
        f'<div style="display:flex;justify-content:space-between">{ends}</div></div>'
    )
