"""Error motions of a rotary axis: circles fitted to its traces, polar plots."""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from warpspace.analysis.axis_motion import AxisMotion, fit_circle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import standing
from warpspace.app.readouts.html import message, render
from warpspace.bench.base import LEAST, lay_polar
from warpspace.geometry.traces import Trace
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.picture.traces import POSITIVE, TraceLine, motion_lines, trace_lines, turn_words
from warpspace.picture.words import spell_point
from warpspace.units import MM_PER_UM, URAD_PER_RAD, Array, spell_short

# --- The traces of a picture as numbers: how each circle runs, as text for the page ---------------

MOST_ROWS = 40
_SMALLEST_MM = 1e-3


@dataclass(frozen=True, slots=True)
class CircleDeviation:
    """How the trace of a point differs from its nominal circle or arc."""

    radius_mm: float  # nominal radius
    centre_um: float  # displacement of the centre in the plane of the circle
    radial_um: float  # peak to valley of the radial error once centre and radius are fitted
    axial_um: float  # peak to valley of the axial error once offset and tilt are fitted
    axial_offset_um: float  # mean displacement along the axis
    tilt_urad: float  # tilt of the plane of the trace


def circle_deviation(nominal_mm: Array, error_um: Array) -> CircleDeviation:
    """Take the error of a trace, [n, 3], µm, apart into displacement, tilt and what remains.

    The nominal points, [n, 3], mm, lie on a circle or arc in order, at least five and not all in
    one line.

    Notes
    -----
    Least squares of ``1, cos θ, sin θ`` to the radial and to the axial error; first order in
    error/radius.
    """
    centre_mm, radius, normal = fit_circle(nominal_mm)
    outwards = (nominal_mm - centre_mm) / radius
    first = outwards[0]
    angle = np.arctan2(outwards @ np.cross(normal, first), outwards @ first)
    harmonic = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], -1)
    radial = np.sum(error_um * outwards, axis=-1)
    axial = error_um @ normal
    around, *_ = np.linalg.lstsq(harmonic, radial, rcond=None)
    along, *_ = np.linalg.lstsq(harmonic, axial, rcond=None)
    return CircleDeviation(
        radius,
        float(np.hypot(*around[1:])),
        float(np.ptp(radial - harmonic @ around)),
        float(np.ptp(axial - harmonic @ along)),
        float(along[0]),
        float(np.hypot(*along[1:]) * MM_PER_UM / radius * URAD_PER_RAD),
    )


@dataclass(frozen=True, slots=True)
class CircleRow:
    """One trace in numbers; `deviation` is None where the point lies on the axis.

    `place` says where its point is while the rotary axes stand as they do.
    """

    trace: Trace
    deviation: CircleDeviation | None
    place: str = ""


def circle_rows(picture: LivePicture) -> list[CircleRow]:
    """Take the errors of all traces of a picture apart."""
    rows: list[CircleRow] = []
    for line in trace_lines(picture.traces):
        spread = float((line.nominal_mm.max(axis=0) - line.nominal_mm.min(axis=0)).max())
        found = circle_deviation(line.nominal_mm, line.error_um) if spread > _SMALLEST_MM else None
        rows.append(CircleRow(line.trace, found, _place(picture, line)))
    return rows[:MOST_ROWS]


def _place(picture: LivePicture, line: TraceLine) -> str:
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
    """Spell the deviations of circles as a table, one block a point."""
    if not rows:
        return message("no point is traced")
    blocks = [
        (point, list(own))
        for point, own in groupby(rows, lambda row: (spell_own_point(row.trace), row.place))
    ]
    return render("circles", blocks=blocks, spell_trace=spell_trace)


# --- The error motion of the axis that is looked at: three polar plots and their numbers ----------

NOTHING_MOVED = (
    "No error moves the traced points: all errors of the axes that carry them are zero or"
    " excluded. Set one, for instance a translation error of a rotary axis, and the traces appear."
)
TRACES_OFF = "Traces are switched off (C switches them on)."
ON_THE_AXIS = "The point lies on the axis: it has no direction that deviations could be taken in."


def no_motion(*, shown: bool, nominal: bool) -> str:
    """Say why there is no polar plot."""
    text = (NOTHING_MOVED if nominal else ON_THE_AXIS) if shown else TRACES_OFF
    return message(text, "polar none", small=True)


def polar_html(motion: AxisMotion, name: str) -> str:
    """Draw and spell an error motion."""
    layouts = [lay_polar(motion_lines(name, motion, part)) for part in motion.motions]
    return render(
        "polar",
        name=name,
        closed=motion.closed,
        plots=[
            (part, plot, *map(_path, plot.curves))
            for part, plot in zip(motion.motions, layouts, strict=True)
        ],
        least=LEAST,
        marks=POSITIVE,
        turn_words=turn_words,
    )


def _path(points: Array) -> str:
    return "M" + "L".join(f"{x:.3f} {-y:.3f}" for x, y in points)
