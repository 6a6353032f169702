"""Schematic bodies of a machine: read from its folder, placed and bent like its errors say."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from warpspace.bodies.body_file import BODY_FILE, read_bodies
from warpspace.bodies.generated.generate import generate_bodies
from warpspace.bodies.mesh import Body
from warpspace.bodies.own_meshes import own_meshes
from warpspace.field.evaluate import View
from warpspace.kinematics import transforms
from warpspace.kinematics.bodies import BASE, BodyMotion, body_motions
from warpspace.kinematics.model import Coordinates, Loop, Model, complete_coordinates
from warpspace.machine.description import Machine
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.travel import TravelDirection
from warpspace.units import Array


def load_bodies(machine: Machine) -> tuple[Body, ...]:
    """Give the bodies of a machine.

    Parameters
    ----------
    machine : Machine

    Returns
    -------
    tuple of Body
        Those that the machine's description names, for all other frames those of the file in its
        folder, and where there is none those generated from the description. Bodies of frames that
        the machine does not have are left out.

    Raises
    ------
    OptionError
        If a file cannot be read.
    """
    frames = {BASE, "S", "t", "w", *machine.axes}
    kept = read_bodies(Path(machine.body_dir) / BODY_FILE) if machine.body_dir else ()
    own = {frame: loaded.body for frame, loaded in own_meshes(machine).items()}
    bodies = [body for body in kept or generate_bodies(machine) if body.frame not in own]
    return tuple(body for body in (*bodies, *own.values()) if body.frame in frames)


def error_values_of(
    errors: ErrorSet,
    amplitudes: Mapping[str, float],
    coordinates: Coordinates,
    direction: str = TravelDirection.MEAN,
) -> dict[str, float]:
    """Evaluate error curves at one position, with amplitudes of their own.

    Parameters
    ----------
    errors : ErrorSet
        Gives the curve of each parameter along its axis.
    amplitudes : mapping of str to float, µm or µrad
    coordinates : mapping of str to ndarray, [], mm or degrees
    direction : str, optional
        Direction of travel, one of `TravelDirection`.

    Returns
    -------
    dict of str to float, µm or µrad
    """
    found: dict[str, float] = {}
    for key, amplitude in amplitudes.items():
        axis = parameter(key).axis
        if amplitude == 0.0 or axis not in coordinates:
            continue
        found[key] = amplitude * float(errors.shape_at(key, coordinates, direction))
    return found


def view_motions(
    model: Model,
    errors: ErrorSet,
    amplitudes: Mapping[str, float],
    positions: Mapping[str, float],
    view: View | None = None,
) -> dict[str, BodyMotion]:
    """Find how the bodies move as a view sees it, so that they agree with its deformed grid.

    Parameters
    ----------
    model : Model
    errors : ErrorSet
    amplitudes : mapping of str to float, µm or µrad
    positions : mapping of str to float, mm or degrees
    view : View, optional

    Returns
    -------
    dict of str to BodyMotion
        By frame. In the relative loop everything is seen from the workpiece, which hence stands
        nominally; where a reference point is held still, all bodies are shifted with it. The tool
        point of the tool and relative loops, and the point of the workpiece nominally in contact in
        the workpiece loop, then lie in the deformed grid exactly.
    """
    view = view or View()
    coordinates = complete_coordinates(model.machine, positions)
    values = error_values_of(errors, amplitudes, coordinates, model.direction)
    motions = body_motions(model, values, coordinates)
    turn, shift = np.zeros(3), np.zeros(3)
    if view.loop is Loop.RELATIVE:
        turn, shift = motions["w"].rotation_rad, motions["w"].displacement_mm
    if view.reference is not None:
        held = complete_coordinates(model.machine, {**positions, **view.reference})
        values = error_values_of(errors, amplitudes, held, model.direction)
        there = body_motions(model, values, held)
        shift = shift + _held_displacement(model, there, view.loop)
    return {
        name: BodyMotion(m.nominal, m.rotation_rad - turn, m.displacement_mm - shift)
        for name, m in motions.items()
    }


def _held_displacement(model: Model, motions: Mapping[str, BodyMotion], loop: Loop) -> Array:
    """Position error of the loop at the reference point, [3], mm."""
    point = transforms.apply(motions["t"].nominal, model.tool_point_mm)

    def moved(frame: str) -> Array:
        motion = motions[frame]
        return motion.displacement_mm + np.cross(motion.rotation_rad, point)

    if loop is Loop.WORKPIECE:
        return moved("w")
    return moved("t") - (moved("w") if loop is Loop.RELATIVE else 0.0)


def place_points(motion: BodyMotion, points_mm: Array, exaggeration: float) -> Array:
    """Give where points of a body are drawn in R.

    Parameters
    ----------
    motion : BodyMotion
    points_mm : ndarray, [..., 3], mm
        In the frame of the body.
    exaggeration : float
        Display factor of the small motion; 0 for the nominal place.

    Returns
    -------
    ndarray, [..., 3], mm
    """
    pose = motion.drawn(exaggeration)
    return points_mm @ pose[:3, :3].T + pose[:3, 3]
