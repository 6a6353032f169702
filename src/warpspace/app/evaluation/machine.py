"""The schematic machine of a picture: where its bodies and its tool point are drawn."""

from collections.abc import Mapping

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_positions
from warpspace.bodies.placed import PlacedBody, place_bodies, scene_motions
from warpspace.field.evaluate import evaluate_first_order
from warpspace.geometry.surfaces import deform
from warpspace.kinematics.chain import nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.units import Array

HERE: Mapping[str, float] = {}


def standing(state: AppState, at: Mapping[str, float] = HERE) -> tuple[dict[str, float], Array]:
    """Tell where all axes stand, mm and degrees, some of them elsewhere; and the tool point."""
    scene = state.scene
    linear = linear_positions(scene, state.machine)
    stands = {**scene.workspace.positions, **linear, **state.positions, **at}
    axes = {name: float(stands.get(name, 0.0)) for name in scene.machine.axes}
    coordinates = complete_coordinates(scene.machine, axes)
    return axes, nominal_point(scene.model, Loop.TOOL, coordinates)


def drawn_bodies(
    picture: LivePicture, turned: Mapping[str, float] = HERE, *, nominal: bool = False
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a picture's machine, bent where that is chosen.

    While an axis is turned its table is drawn also where the machine is not.
    """
    state, scene = picture.state, picture.state.scene
    positions, _ = standing(state, turned)
    motions = scene_motions(scene, state.view(), amplitudes=state.active, positions=positions)
    factor = picture.exaggeration if state.machine.bent and not nominal else 0.0
    only = None if state.machine.shown or nominal else _turning_frames(state, turned)
    return place_bodies(scene, motions, factor, only)


def _turning_frames(state: AppState, turned: Mapping[str, float]) -> tuple[str, ...]:
    for side, end in (("workpiece", "w"), ("tool", "t")):
        rotary = [axis.name for axis in state.scene.machine.branch(side) if not axis.is_linear]
        if not turned.keys().isdisjoint(rotary):
            return (*rotary, end)
    return ()


def tool_point(picture: LivePicture) -> tuple[Array, Array]:
    """Find the tool point in the deformed grid, [3], mm, and its error, [3], µm."""
    state, scene = picture.state, picture.state.scene
    axes, nominal = standing(state)
    coordinates, now = complete_coordinates(scene.machine, axes), state.active_scene()
    if state.controller is not None:
        field = state.controller.field(coordinates, nominal, now, state.loop)
    else:
        field = evaluate_first_order(scene.model, now.errors, coordinates, state.view(), nominal)
    return deform(nominal, field.error_um, picture.exaggeration), field.error_um
