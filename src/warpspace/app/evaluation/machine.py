"""The schematic machine of a picture: where its bodies and its tool point are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_positions
from warpspace.bodies.placed import PlacedBody, place_bodies, scene_motions
from warpspace.field.evaluate import evaluate_first_order
from warpspace.geometry.surfaces import deform
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import BodyMotion, nominal_point
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.picture.model import coloured_values
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class ToolPoint:
    """The tool point at the machine's positions."""

    nominal_mm: Array  # [3]; where it should be and where the deformed grid has it
    drawn_mm: Array
    value: float  # what the map colours there, in the unit of the scale
    error_um: Array  # [3]


def machine_positions(
    state: AppState, turned: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Give where all axes stand, mm and degrees."""
    linear = linear_positions(state.scene, state.machine)
    return {**state.scene.workspace.positions, **linear, **state.positions, **(turned or {})}


def standing(state: AppState, at: Mapping[str, float]) -> tuple[dict[str, float], Array]:
    """Tell where the tool point is while some axes stand somewhere, nominally."""
    scene = state.scene
    stands = {**scene.workspace.positions, **state.positions, **at}
    axes = {name: float(stands.get(name, 0.0)) for name in scene.machine.axes}
    coordinates = complete_coordinates(scene.machine, axes)
    return axes, nominal_point(scene.model, Loop.TOOL, coordinates)


def machine_motions(
    state: AppState, turned: Mapping[str, float] | None = None
) -> dict[str, BodyMotion]:
    """Find place and small motion of every frame, as the state's loop and reference see it."""
    return scene_motions(
        state.scene,
        state.view(),
        amplitudes=state.active,
        positions=machine_positions(state, turned),
    )


def drawn_bodies(
    picture: LivePicture, turned: Mapping[str, float] | None = None
) -> tuple[PlacedBody, ...]:
    """Place the bodies of a picture's machine, bent where that is chosen."""
    state = picture.state
    factor = picture.exaggeration if state.machine.bent else 0.0
    only = None if state.machine.shown else _turning_frames(state, turned or {})
    return place_bodies(state.scene, machine_motions(state, turned), factor, only)


def _turning_frames(state: AppState, turned: Mapping[str, float]) -> tuple[str, ...]:
    for side, end in (("workpiece", "w"), ("tool", "t")):
        rotary = [axis.name for axis in state.scene.machine.branch(side) if not axis.is_linear]
        if not turned.keys().isdisjoint(rotary):
            return (*rotary, end)
    return ()


def nominal_bodies(picture: LivePicture) -> tuple[PlacedBody, ...]:
    """Place the bodies of a picture's machine where they nominally are."""
    return place_bodies(picture.state.scene, machine_motions(picture.state), 0.0)


def tool_point(picture: LivePicture) -> ToolPoint:
    """Find the tool point in the deformed grid of a picture."""
    state, scene = picture.state, picture.state.scene
    coordinates = complete_coordinates(scene.machine, machine_positions(state))
    motion = machine_motions(state)["t"]
    nominal = transforms.apply(motion.nominal, scene.model.tool_point_mm)
    now = active_scene(state)
    if state.controller is not None:
        field = state.controller.field(coordinates, nominal, now, state.loop)
    else:
        field = evaluate_first_order(scene.model, now.errors, coordinates, state.view(), nominal)
    return ToolPoint(
        nominal,
        deform(nominal, field.error_um, picture.exaggeration),
        float(coloured_values(field, state.component, state.look.quantity)),
        field.error_um,
    )


def machine_room_mm(picture: LivePicture) -> Array:
    """Give the points of the nominal machine and the corners of the grid, [n, 3], mm."""
    state = picture.state
    placed = place_bodies(state.scene, machine_motions(state), 0.0)
    return np.concatenate([picture.grid.bounds_mm, *(part.nominal_mm for part in placed)])
