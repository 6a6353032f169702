"""A scene whose machine or working volume is being changed, checked as its file would be."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from warpspace.exceptions import OptionError
from warpspace.field.grid import Workspace, find_volume_axes
from warpspace.machine.axes import is_linear
from warpspace.machine.description import (
    ORIGIN,
    Axis,
    Chain,
    Machine,
    Range,
    default_travel,
)
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.tolerances import ToleranceSet
from warpspace.scene.bodies import body_notes
from warpspace.scene.library import parse_scene
from warpspace.scene.machines import load_machine, machine_names
from warpspace.scene.model import Scene
from warpspace.scene.save import scene_to_toml

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Edited:
    """A changed scene.

    Attributes
    ----------
    scene : Scene
        Reads back equal from its file.
    notes : tuple of str
        What had to be clamped or left out.
    """

    scene: Scene
    notes: tuple[str, ...] = ()


def checked(scene: Scene, changed: Scene, notes: tuple[str, ...] = ()) -> Edited:
    """Check a changed scene by writing it down and reading it again.

    Parameters
    ----------
    scene : Scene
        As it was before.
    changed : Scene
        As it is to become.
    notes : tuple of str, optional

    Returns
    -------
    Edited
        With the remarks that a reader of its file makes, and with curves over its working volume.

    Raises
    ------
    SceneError
        If its file could not be read: a number beyond its limits, a volume of too many axes.
    """
    machine = _dressed(scene, changed.machine)
    changed = replace(changed, model=replace(changed.model, machine=machine))
    read = parse_scene(scene_to_toml(changed), scene.name, "machine")
    # the text is read without its folder: what that says of meshes is true of others only
    unread = body_notes(read.machine)
    remarks = (*(note for note in read.notes if note not in unread), *body_notes(machine))
    model = replace(read.model, machine=machine)
    return Edited(replace(read, model=model, notes=remarks), notes)


def same_shape(one: Machine, other: Machine) -> bool:
    """Tell whether two machines have the same frames, whatever their travels and directions."""
    places = [
        ([(axis.offset_mm, axis.rotation_deg) for axis in machine.axes.values()], machine.chain)
        for machine in (one, other)
    ]
    fixed = one.fixed_mm == other.fixed_mm and one.fixed_deg == other.fixed_deg
    return fixed and places[0] == places[1]


def _dressed(scene: Scene, machine: Machine) -> Machine:
    """Name a machine after its frames: that of the library with the same ones, else its scene's.

    Bodies that were made for other frames suit it no more.
    """
    before = scene.machine
    if machine.name != before.name or machine.body_dir != before.body_dir:
        return machine  # another machine of the library
    if same_shape(before, machine):
        return machine
    for name in machine_names():
        known = load_machine(name)
        if same_shape(known, machine):
            return replace(machine, name=name, title=known.title, body_dir=known.body_dir)
    same_chain = machine.chain == before.chain
    title = machine.title if same_chain and not before.body_dir else f"Machine {machine.chain}"
    return replace(machine, name=scene.name, title=title, body_dir="")


def with_machine(scene: Scene, machine: Machine, workspace: Workspace | None = None) -> Edited:
    """Give a scene another machine; what belongs to axes that stay is kept.

    Parameters
    ----------
    scene : Scene
    machine : Machine
    workspace : Workspace, optional
        Working volume; that of the scene by default, as far as its axes are still there.

    Returns
    -------
    Edited
        Errors, tolerances, component errors and reference of axes that the machine does not have
        are left out, and the notes say which.

    Raises
    ------
    SceneError
        If its file could not be read.
    """
    gone = [axis for axis in scene.machine.axes if axis not in machine.axes]
    still = {axis: scene.workspace.positions[axis] for axis in gone}
    kept = _kept(scene.errors.functions, machine)
    errors = ErrorSet({key: function.without_axes(still) for key, function in kept.items()})
    tolerances = ToleranceSet(scene.tolerances.default, _kept(scene.tolerances.own, machine))
    reference = scene.reference
    if reference is not None:
        reference = {axis: at for axis, at in reference.items() if axis in machine.axes} or None
    orders = tuple(own for own in scene.model.own_component_errors if own[0] in machine.axes)
    model = replace(scene.model, machine=machine, own_component_errors=orders)
    changed = replace(
        scene,
        model=model,
        workspace=workspace or fitted_workspace(scene.workspace.ranges, machine),
        errors=errors,
        tolerances=tolerances,
        reference=reference,
        uncertainty=_kept(scene.uncertainty, machine),
        measured=_kept(scene.measured, machine),
    )
    return checked(scene, changed, tuple(_left_out(scene, gone)))


def rearranged(machine: Machine, chain: Chain) -> Machine:
    """Give a machine another chain; axes that stay keep their frames, travels and directions.

    Parameters
    ----------
    machine : Machine
    chain : Chain

    Returns
    -------
    Machine
        New axes have no offset and the travel of axes that none is given for. Of whatever else is
        told by axis, that of axes which are gone is left out.
    """
    # Whatever the description holds by the name of a frame is treated alike, lists of later too.
    tables: dict[str, Any] = {}
    gone = {axis for axis in machine.axes if axis not in chain.axes}
    for field in fields(machine):
        table = getattr(machine, field.name)
        if isinstance(table, Mapping) and field.name != "axes":
            tables[field.name] = {key: table[key] for key in table if key not in gone}
    axes = {
        name: machine.axes.get(name) or Axis(name, ORIGIN, default_travel(name))
        for name in chain.axes
    }
    return replace(machine, chain=chain, axes=axes, **tables)


def fitted_workspace(ranges: Mapping[str, Range], machine: Machine) -> Workspace:
    """Choose the working volume of a machine from that of another one.

    Parameters
    ----------
    ranges : mapping of str to tuple of float, (2,), mm or degrees
        Of the other machine.
    machine : Machine

    Returns
    -------
    Workspace
        Axes that both have keep their ranges. A new linear axis has its travel where no other one
        spans its direction; a new rotary axis stands at zero, or as near as its travel allows. Of
        two ranges along one direction the one of the axis that was there stays.
    """
    found: dict[str, Range] = {}
    known = [name for name in machine.axes if name in ranges]
    added = [name for name in machine.axes if name not in ranges]
    for name in (*known, *added):
        low, high = machine.axes[name].travel
        at = min(max(0.0, low), high)
        wanted = ranges.get(name) or ((low, high) if is_linear(name) else (at, at))
        try:
            find_volume_axes({**found, name: wanted})
        except OptionError:
            at = at if name in added else (wanted[0] + wanted[1]) / 2.0
            wanted = (at, at)
        found[name] = wanted
    return Workspace({name: found[name] for name in machine.axes})


def _kept(table: Mapping[str, T], machine: Machine) -> dict[str, T]:
    """Give the entries whose parameters a machine has."""
    return {key: value for key, value in table.items() if parameter(key).axis in machine.axes}


def _left_out(scene: Scene, gone: Collection[str]) -> list[str]:
    """Say what belonged to axes that are gone."""
    notes: list[str] = []
    for axis in gone:
        errors = [key for key in scene.errors if parameter(key).axis == axis]
        own = [key for key in scene.tolerances.own if parameter(key).axis == axis]
        parts = [f"its errors {', '.join(errors)}"] if errors else []
        parts += [f"its tolerances {', '.join(own)}"] if own else []
        second = [
            key
            for key in scene.errors
            if parameter(key).axis not in gone and axis in scene.errors.arguments(key)
        ]
        parts += [f"how {', '.join(second)} depends on it"] if second else []
        parts += ["its position at the reference"] if axis in (scene.reference or {}) else []
        what = f" and with it {'; '.join(parts)}" if parts else ""
        notes.append(f"axis {axis} left out{what}")
    return notes
