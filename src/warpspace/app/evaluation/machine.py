"""The schematic machine of a picture: where its bodies and its tool point are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpspace.app.evaluation.colouring import shown_values
from warpspace.app.evaluation.evaluate import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_positions
from warpspace.bodies.placed import Body, load_bodies, place_points, view_motions
from warpspace.field.evaluate import build_basis
from warpspace.geometry.deform import deform
from warpspace.kinematics import transforms
from warpspace.kinematics.bodies import BodyMotion
from warpspace.kinematics.model import complete_coordinates
from warpspace.units import Array


@dataclass(frozen=True, slots=True)
class DrawnBody:
    """One body where it is drawn.

    Attributes
    ----------
    body : Body
    vertices_mm : ndarray, [V, 3], mm
        In R.
    edges_mm : ndarray, [E, 2, 3], mm
    """

    body: Body
    vertices_mm: Array
    edges_mm: Array


@dataclass(frozen=True, slots=True)
class ToolPoint:
    """The tool point at the machine's positions.

    Attributes
    ----------
    nominal_mm, drawn_mm : ndarray, [3], mm
        Where it should be and where the deformed grid has it.
    value : float
        What the map colours there, in the unit of the scale.
    error_um : ndarray, [3], µm
    """

    nominal_mm: Array
    drawn_mm: Array
    value: float
    error_um: Array


def machine_positions(
    state: AppState, turned: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Give where all axes stand, mm and degrees.

    Parameters
    ----------
    state : AppState
    turned : mapping of str to float, degrees, optional
        Axes that are being turned at the moment.
    """
    linear = linear_positions(state.scene, state.machine)
    return {**state.scene.workspace.positions, **linear, **state.positions, **(turned or {})}


def machine_motions(
    state: AppState, turned: Mapping[str, float] | None = None
) -> dict[str, BodyMotion]:
    """Find place and small motion of every body, as the state's loop and reference see it."""
    scene = state.scene
    return view_motions(
        scene.model,
        scene.errors,
        state.active,
        machine_positions(state, turned),
        scene.view(state.loop),
    )


def drawn_bodies(
    picture: LivePicture, turned: Mapping[str, float] | None = None
) -> tuple[DrawnBody, ...]:
    """Place the bodies of a picture's machine, bent where that is chosen.

    Parameters
    ----------
    picture : LivePicture
    turned : mapping of str to float, degrees, optional
        Axes that are being turned at the moment.

    Returns
    -------
    tuple of DrawnBody
        Empty for a machine without bodies.
    """
    state = picture.state
    factor = picture.exaggeration if state.machine.bent else 0.0
    motions = machine_motions(state, turned)
    return tuple(
        DrawnBody(
            body,
            place_points(motions[body.frame], body.vertices_mm, factor),
            place_points(motions[body.frame], body.edges_mm, factor),
        )
        for body in load_bodies(state.scene.machine)
    )


def tool_point(picture: LivePicture) -> ToolPoint:
    """Find the tool point in the deformed grid of a picture.

    Parameters
    ----------
    picture : LivePicture

    Returns
    -------
    ToolPoint
        Evaluated where the axes stand, so that it lies in the grid between its nodes too.
    """
    state, scene = picture.state, picture.state.scene
    coordinates = complete_coordinates(scene.machine, machine_positions(state))
    motion = machine_motions(state)["t"]
    nominal = transforms.apply(motion.nominal, scene.model.tool_point_mm)
    basis = build_basis(
        scene.model,
        scene.errors,
        scene.parameter_keys,
        coordinates,
        scene.view(state.loop),
        nominal,
    )
    field = basis.evaluate(np.array([state.active[key] for key in basis.keys]))
    return ToolPoint(
        nominal,
        deform(nominal, field.error_um, picture.exaggeration),
        float(shown_values(state, field)),
        field.error_um,
    )


def machine_room_mm(picture: LivePicture) -> Array:
    """Give the points of the nominal machine and the corners of the grid, [n, 3], mm."""
    motions = machine_motions(picture.state)
    placed = [
        place_points(motions[body.frame], body.vertices_mm, 0.0)
        for body in load_bodies(picture.state.scene.machine)
    ]
    return np.concatenate([picture.grid.bounds_mm, *placed])
