"""The traces of a picture as numbers: how each circle runs, as text for the page."""

import html
from dataclasses import dataclass

from warpspace.analysis.circles import CircleDeviation, circle_deviation
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.geometry.traces import Trace
from warpspace.picture.traces import trace_lines

MOST_ROWS = 40
_SMALLEST_MM = 1e-3
HEADINGS = (
    ("radius", "mm", "Nominal radius of the circle."),
    ("radial", "µm", "Peak to valley of the radial error once centre and radius are fitted."),
    ("axial", "µm", "Peak to valley of the axial error once offset and tilt are fitted."),
    ("tilt", "µrad", "Tilt of the plane of the trace."),
    ("centre", "µm", "Displacement of the centre in the plane of the trace."),
)


@dataclass(frozen=True, slots=True)
class CircleRow:
    """One trace in numbers; `deviation` is None where the point lies on the axis."""

    trace: Trace
    deviation: CircleDeviation | None


def circle_rows(picture: LivePicture) -> list[CircleRow]:
    """Take the errors of all traces of a picture apart.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    list of CircleRow
        At most forty.
    """
    rows: list[CircleRow] = []
    for line in trace_lines(picture.traces):
        spread = float((line.nominal_mm.max(axis=0) - line.nominal_mm.min(axis=0)).max())
        found = circle_deviation(line.nominal_mm, line.error_um) if spread > _SMALLEST_MM else None
        rows.append(CircleRow(line.trace, found))
    return rows[:MOST_ROWS]


def spell_trace(trace: Trace) -> str:
    """Spell what is turned and where the others stand: ``C at B −30°``."""
    held = ", ".join(f"{axis} {value:g}°" for axis, value in trace.at.items())
    return (f"{trace.axis} at {held}" if held else trace.axis).replace("-", "−")


def spell_point(trace: Trace) -> str:
    """Spell the point of a trace, mm in the workpiece frame."""
    return ("(" + ", ".join(f"{value:g}" for value in trace.point_mm) + ") mm").replace("-", "−")


def circle_table(rows: list[CircleRow]) -> str:
    """Spell the deviations of circles as a table, one block a point.

    Parameters
    ----------
    rows : list of CircleRow

    Returns
    -------
    str
        HTML; numbers of ours only.
    """
    if not rows:
        return '<div style="padding:8px 14px;opacity:.7">no point is traced</div>'
    head = "".join(
        f'<th title="{hint}" style="text-align:right;font-weight:500">{name}<br>'
        f'<span style="opacity:.65">{unit}</span></th>'
        for name, unit, hint in HEADINGS
    )
    parts = [f"<tr><th></th>{head}</tr>"]
    point = ""
    for row in rows:
        if (named := spell_point(row.trace)) != point:
            point = named
            parts.append(
                f'<tr><td colspan="6" style="padding-top:5px;opacity:.7">point {named}</td></tr>'
            )
        parts.append(_row(row))
    return (
        '<div style="padding:2px 12px 8px;overflow-x:auto"><table data-value="circles" style="'
        'width:100%;border-collapse:collapse;font-size:11.5px;font-variant-numeric:tabular-nums">'
        f"{''.join(parts)}</table></div>"
    )


def _row(row: CircleRow) -> str:
    """Spell one trace."""
    name = html.escape(spell_trace(row.trace))
    found = row.deviation
    if found is None:
        return f'<tr><td>{name}</td><td colspan="5" style="text-align:right">on the axis</td></tr>'
    values = (
        f"{found.radius_mm:.1f}",
        f"{found.radial_um:.2f}",
        f"{found.axial_um:.2f}",
        f"{found.tilt_urad:.1f}",
        f"{found.centre_um:.2f}",
    )
    cells = "".join(f'<td style="text-align:right">{value}</td>' for value in values)
    return f"<tr><td>{name}</td>{cells}</tr>"
