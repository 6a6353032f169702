"""Which axis is played, and where the traced points are while it turns."""

from dataclasses import dataclass, replace

import numpy as np

from warpspace.analysis.axis_motion import AxisMotion, assemble_motion, fit_circle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import standing
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.geometry.traces import Trace
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.picture.traces import (
    TraceLine,
    evaluate_axis_motion,
    is_moved,
    name_trace,
    trace_lines,
)
from warpspace.picture.words import spell_point
from warpspace.units import MM_PER_UM, URAD_PER_RAD, Array


def played_axis(state: AppState) -> str | None:
    """Name the rotary axis next to the workpiece, or to the tool; None where there is none."""
    for side in ("workpiece", "tool"):
        rotary = [axis.name for axis in state.scene.machine.branch(side) if not axis.is_linear]
        if rotary:
            return rotary[-1]
    return None


def played_position(state: AppState, angle_deg: float) -> dict[str, float]:
    """Give the played axis' position after an angle, degrees, kept within its travel.

    An axis that cannot go round swings to and fro over its travel.
    """
    axis = played_axis(state)
    if axis is None:
        return {}
    low, high = state.scene.machine.axes[axis].travel
    here = state.positions.get(axis, low)
    if high - low >= 360.0:
        return {axis: low + (here - low + angle_deg) % 360.0}
    swing = (here - low + 2.0 * (high - low) * angle_deg / 360.0) % (2.0 * (high - low))
    return {axis: low + (swing if swing <= high - low else 2.0 * (high - low) - swing)}


def points_on_traces(picture: LivePicture, position: dict[str, float]) -> tuple[Array, Array]:
    """Find where the traced points are at a position of the played axis."""
    nominal: list[Array] = []
    actual: list[Array] = []
    for lines in picture.traces:
        for number, trace in enumerate(lines.group.traces):
            if trace.axis in position:
                sweep = lines.group.coordinates[trace.axis][number]
                nominal.append(_at(lines.nominal_mm[number], sweep, position[trace.axis]))
                actual.append(_at(lines.actual_mm[number], sweep, position[trace.axis]))
    if not nominal:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return np.stack(nominal), np.stack(actual)


def _at(line_mm: Array, sweep: Array, position: float) -> Array:
    return np.array([np.interp(position, sweep, line_mm[:, i]) for i in range(3)])


# --- Which of the traces is looked at: the one chosen, as long as an error moves it ---------------


def moved_traces(picture: LivePicture) -> dict[str, TraceLine]:
    """Give the traces that an error moves, by name."""
    if not picture.state.shown.traces:
        return {}
    return {name_trace(line.trace): line for line in trace_lines(picture.traces) if is_moved(line)}


def chosen_trace(picture: LivePicture, moved: dict[str, TraceLine] | None = None) -> str:
    """Name the trace that is looked at; empty where no error moves one."""
    moved = moved_traces(picture) if moved is None else moved
    state = picture.state
    if state.rotary.chosen in moved:
        return state.rotary.chosen
    played = played_axis(state)

    def rank(line: TraceLine) -> tuple[bool, bool]:
        at = line.trace.at.items()
        stands = all(state.positions.get(axis) == value for axis, value in at)
        return line.trace.axis != played, not stands

    return min(moved, key=lambda name: rank(moved[name]), default="")


def motion_of(picture: LivePicture, line: TraceLine) -> AxisMotion | None:
    """Evaluate how the axis of a trace runs, with the errors that take part."""
    if picture.compared is None or not picture.is_difference:
        return _of_state(picture.drawn_state, line)
    one, other = (_of_state(side, line) for side in picture.compared.sides)
    if one is None or other is None:
        return None
    radial, axial, tilt = (
        a.values - b.values for a, b in zip(other.motions, one.motions, strict=True)
    )
    turn = other.angle_deg, other.radius_mm
    return assemble_motion(*turn, (radial, axial, tilt), closed=other.closed)


def _of_state(state: AppState, line: TraceLine) -> AxisMotion | None:
    scene = active_scene(state)
    return evaluate_axis_motion(replace(scene, trace_points_mm=(line.trace.point_mm,)), line)


# --- The traces of a picture as numbers: how each circle runs -------------------------------------

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
