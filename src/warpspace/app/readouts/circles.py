"""The traces of a picture as numbers: how each circle runs, as text for the page."""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from warpspace.analysis.circles import CircleDeviation, circle_deviation
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import standing
from warpspace.app.readouts.html import message, render
from warpspace.geometry.traces import Trace
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.picture.coordinates import spell_point
from warpspace.picture.traces import TraceLine, trace_lines
from warpspace.picture.words import spell_short

MOST_ROWS = 40
_SMALLEST_MM = 1e-3


@dataclass(frozen=True, slots=True)
class CircleRow:
    """One trace in numbers; `deviation` is None where the point lies on the axis.

    `place` says where its point is while the rotary axes stand as they do.
    """

    trace: Trace
    deviation: CircleDeviation | None
    place: str = ""


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
        rows.append(CircleRow(line.trace, found, _place(picture, line)))
    return rows[:MOST_ROWS]


def _place(picture: LivePicture, line: TraceLine) -> str:
    """Spell where a traced point is, in positions of the rotary axes and in R."""
    state = picture.drawn_state
    axes, _ = standing(state, {})
    side = "workpiece" if line.loop is Loop.WORKPIECE else "tool"
    pose = branch_pose(state.scene.model, side, complete_coordinates(state.scene.machine, axes))
    point_mm = transforms.apply(pose, np.asarray(line.trace.point_mm))
    return spell_point({name: axes[name] for name in state.positions}, point_mm)


def spell_trace(trace: Trace) -> str:
    """Spell what is turned and where the others stand: ``C at B −30°``."""
    held = ", ".join(f"{axis} {spell_short(value)}°" for axis, value in trace.at.items())
    return f"{trace.axis} at {held}" if held else trace.axis


def spell_own_point(trace: Trace) -> str:
    """Spell the point of a trace in the frame that it is fixed to, mm."""
    return "(" + ", ".join(map(spell_short, trace.point_mm)) + ") mm"


def circle_table(rows: list[CircleRow]) -> str:
    """Spell the deviations of circles as a table, one block a point.

    Parameters
    ----------
    rows : list of CircleRow

    Returns
    -------
    str
        HTML.
    """
    if not rows:
        return message("no point is traced")
    blocks = [
        (point, list(own))
        for point, own in groupby(rows, lambda row: (spell_own_point(row.trace), row.place))
    ]
    return render("circles", blocks=blocks, spell_trace=spell_trace)
