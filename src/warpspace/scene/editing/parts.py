"""What belongs to frames beside their places: two guides of a gantry, meshes of a user."""

import math
from dataclasses import replace

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.machine.axes import direction_index
from warpspace.machine.body_source import BodySource
from warpspace.machine.description import Machine
from warpspace.machine.gantry import ACROSS, Gantry, default_across
from warpspace.machine.limits import GANTRY_SPAN_MM
from warpspace.scene.editing.edited import Edited, checked
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.model import Scene

START_SPAN_MM = 1000.0
"""Of guides where no travel across says how far apart they are."""


def switch_gantry(scene: Scene, axis: str) -> Edited:
    """Let a linear axis stand on two guides, or on one again.

    Parameters
    ----------
    scene : Scene
    axis : str

    Returns
    -------
    Edited
        New guides are as far apart as the axis across travels.

    Raises
    ------
    UnknownNameError, OptionError
        If there is no such axis, or it is a rotary one.
    """
    present = scene.machine.axis(axis)
    if not present.is_linear:
        raise OptionError(f"{axis} is a rotary axis; expected a linear one for two guides")
    if axis in scene.machine.gantries:
        return _with_gantry(scene, axis, None)
    across = default_across(axis)
    spans = [
        other.travel[1] - other.travel[0]
        for other in scene.machine.axes.values()
        if other.is_linear and "xyz"[direction_index(other.name)] == across
    ]
    return _with_gantry(scene, axis, Gantry(axis, max(spans, default=START_SPAN_MM), across))


def change_span(scene: Scene, axis: str, value: float) -> Edited:
    """Set the distance between the guides of a gantry, mm, clamped to what a file may hold.

    Raises
    ------
    UnknownNameError, OptionError
        If the axis is no gantry, or the value no number.
    """
    gantry = _gantry(scene, axis)
    if math.isnan(value):
        raise OptionError(f"span of {axis}: nan; expected a number")
    low, high = GANTRY_SPAN_MM
    kept = min(max(value, low), high)
    note = f"span of {axis} = {value:g} mm; expected {low:g} to {high:g} mm, clamped to {kept:g}"
    return _with_gantry(
        scene, axis, replace(gantry, span_mm=kept), () if kept == value else (note,)
    )


def turn_gantry(scene: Scene, axis: str) -> Edited:
    """Let the guides of a gantry lie apart along the other direction that is not the axis's own.

    Raises
    ------
    UnknownNameError
        If the axis is no gantry.
    """
    gantry = _gantry(scene, axis)
    own = "xyz"[direction_index(axis)]
    other = next(name for name in ACROSS if name not in (own, gantry.across))
    return _with_gantry(scene, axis, replace(gantry, across=other))


def own_bodies(machine: Machine) -> dict[str, BodySource]:
    """Give the bodies that a description names, without those that its machine of the library has.

    Parameters
    ----------
    machine : Machine

    Returns
    -------
    dict of str to BodySource
        By frame.
    """
    library = machine_names()
    known = load_machine(machine.name).bodies if machine.name in library else {}
    return {frame: source for frame, source in machine.bodies.items() if known.get(frame) != source}


def remove_mesh(scene: Scene, frame: str) -> Edited:
    """Take away what a description says about the body of a frame; it is generated again.

    Raises
    ------
    UnknownNameError
        If the scene says nothing about it.
    """
    machine = scene.machine
    own = own_bodies(machine)
    if frame not in own:
        raise UnknownNameError("body", frame, tuple(own))
    kept = {name: source for name, source in machine.bodies.items() if name != frame}
    changed = replace(scene.model, machine=replace(machine, bodies=kept))
    return checked(scene, replace(scene, model=changed))


def _gantry(scene: Scene, axis: str) -> Gantry:
    """Look up the guides of an axis."""
    found = scene.machine.gantries.get(axis)
    if found is None:
        raise UnknownNameError("gantry", axis, tuple(scene.machine.gantries))
    return found


def _with_gantry(
    scene: Scene, axis: str, gantry: Gantry | None, notes: tuple[str, ...] = ()
) -> Edited:
    """Give an axis guides, or none."""
    rest = {name: one for name, one in scene.machine.gantries.items() if name != axis}
    both = rest if gantry is None else {**rest, axis: gantry}
    ordered = {name: both[name] for name in scene.machine.axes if name in both}
    machine = replace(scene.machine, gantries=ordered)
    if machine == scene.machine:
        return Edited(scene, notes)
    return checked(scene, replace(scene, model=replace(scene.model, machine=machine)), notes)
