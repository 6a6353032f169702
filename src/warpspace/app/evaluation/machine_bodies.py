"""The machine of a picture: its bodies, its tool point, and the rotary axis that is animated."""

from collections.abc import Mapping

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import drawn_field
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_positions
from warpspace.bodies.placed import PlacedBody, place_bodies, turning_frames
from warpspace.diagnosis.diagnose import Diagnose
from warpspace.geometry.surfaces import deform
from warpspace.kinematics.chain import branch_frames, nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.units import Array

NO_POSITIONS: Mapping[str, float] = {}
AXIS_HALF = 0.32  # half length of a drawn axis of rotation, relative to the longest edge of the box


def standing(
    state: AppState, at: Mapping[str, float] = NO_POSITIONS
) -> tuple[dict[str, float], Array]:
    """Return the positions of all axes, mm and degrees, and the tool point; `at` overrides some."""
    scene = state.scene
    linear = linear_positions(scene, state.machine)
    stands = {**scene.workspace.positions, **linear, **state.positions, **at}
    axes = {name: float(stands.get(name, 0.0)) for name in scene.machine.axes}
    coordinates = complete_coordinates(scene.machine, axes)
    return axes, nominal_point(scene.model, Loop.TOOL, coordinates)


def drawn_bodies(
    picture: LivePicture, turned: Mapping[str, float] = NO_POSITIONS, *, nominal: bool = False
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a picture's machine, deformed if selected.

    While an axis is animated, its table is drawn also where the machine is hidden.
    """
    state, scene = picture.state, picture.state.scene
    positions, _ = standing(state, turned)
    factor = picture.exaggeration if state.machine.bent and not nominal else 0.0
    is_whole = nominal or (state.machine.shown and not state.shows_rotary)
    only = None if is_whole else turning_frames(state.scene.machine)
    return place_bodies(
        scene, state.view(), factor, only, amplitudes=state.active, positions=positions
    )


def tool_point(picture: LivePicture) -> tuple[Array, Array]:
    """Compute the tool point in the deformed grid, [3], mm, and its error, [3], µm."""
    state = picture.state
    axes, nominal = standing(state)
    _, field = drawn_field(state, complete_coordinates(state.scene.machine, axes))
    return deform(nominal, field.error_um, picture.exaggeration), field.error_um


def diagnosed_guides(picture: LivePicture) -> Array:
    """Find the guides of the diagnosed element while *What is wrong?* is open, [n, 2, 3], mm.

    A linear guide runs through the origin of its frame over the travel of its axis.
    """
    state, element = picture.state, picture.state.page.element
    is_open = Diagnose.name in state.page.open and state.page.task == Diagnose.task
    ends = [np.zeros((0, 2, 3))]
    for name in element.axes if element is not None and is_open else ():
        scene, half = state.scene, AXIS_HALF * picture.size_mm
        at = complete_coordinates(scene.machine, standing(state)[0])
        side = "tool" if name in scene.machine.chain.tool else "workpiece"
        frames = branch_frames(scene.model, side, at)
        axis, before = next((of.axis, of.before) for of in frames if of.axis.name == name)
        low, high = axis.travel if axis.is_linear else (-half, half)
        along = axis.direction * before[:3, axis.index]
        ends.append((before[:3, 3] + np.outer((low, high), along))[None])
    return np.concatenate(ends)


# --- The animated axis, its traced points, and the selected trace ---------------------------------


def rotary_axes(state: AppState) -> tuple[str, ...]:
    """List the rotary axes that are drawn: of the workpiece side, or else of the tool side."""
    return turning_frames(state.scene.machine)[:-1]


def played_axis(state: AppState) -> str | None:
    """Return the rotary axis next to the workpiece, or to the tool; None where there is none."""
    return next(iter(turning_frames(state.scene.machine)[-2:]), None)


def points_on_traces(picture: LivePicture, position: Mapping[str, float]) -> tuple[Array, Array]:
    """Interpolate the traced points at a position of the animated axis, [n, 3] each, mm."""
    interpolated: list[list[float]] = []
    for lines in picture.traces:
        for number, trace in enumerate(lines.group.traces):
            if trace.axis in position:
                sweep, at = lines.group.coordinates[trace.axis][number], position[trace.axis]
                columns = np.hstack([lines.nominal_mm[number], lines.actual_mm[number]]).T
                interpolated.append([float(np.interp(at, sweep, column)) for column in columns])
    points = np.reshape(interpolated, (-1, 6))
    return points[:, :3], points[:, 3:]


def chosen_trace(picture: LivePicture) -> str:
    """Return the name of the coloured trace among those that errors move; empty without any."""
    state, moved = picture.state, picture.moved_traces
    if state.rotary.chosen in moved:
        return state.rotary.chosen
    played = played_axis(state)

    def rank(name: str) -> tuple[bool, bool]:
        trace = moved[name].trace
        stands = all(state.positions.get(axis) == at for axis, at in trace.at.items())
        return trace.axis != played, not stands

    return min(moved, key=rank, default="")
