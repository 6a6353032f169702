"""Changes of the machine of a scene: pure functions from one valid scene to another one."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from warpspace.exceptions import OptionError, UnknownNameError
from warpspace.field.grid import Workspace, find_volume_axes
from warpspace.machine import limits
from warpspace.machine.axes import direction_index, is_linear, parameter
from warpspace.machine.description import (
    ACROSS,
    FIXED_FRAMES,
    ORIGIN,
    Axis,
    BodySource,
    Chain,
    Gantry,
    Machine,
    Range,
    default_across,
    default_travel,
    parse_chain,
)
from warpspace.machine.errors import ErrorSet, ToleranceSet
from warpspace.scene.library import parse_scene
from warpspace.scene.machines import body_notes, load_machine, machine_names
from warpspace.scene.model import Scene
from warpspace.scene.save import scene_to_toml
from warpspace.scene.starter import starter_scene

# --- A scene whose machine or working volume is being changed, checked as its file would be -------

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Edited:
    """A changed scene."""

    scene: Scene  # reads back equal from its file
    notes: tuple[str, ...] = ()  # what had to be clamped or left out


def checked(scene: Scene, changed: Scene, notes: tuple[str, ...] = ()) -> Edited:
    """Check a changed scene by writing it down and reading it again."""
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
    """Give a scene another machine; what belongs to axes that stay is kept."""
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
    """Give a machine another chain; axes that stay keep their frames and travels."""
    # Whatever the description holds by the name of a frame is treated alike, lists of later too.
    tables: dict[str, Any] = {}
    gone = {axis for axis in machine.axes if axis not in chain.axes}
    for field in fields(machine):
        table = getattr(machine, field.name)
        if isinstance(table, Mapping) and field.name != "axes":
            tables[field.name] = {key: table[key] for key in table if key not in gone}
    axes: dict[str, Axis] = {}
    for name in chain.axes:
        axes[name] = machine.axes.get(name) or Axis(name, ORIGIN, default_travel(name))
        if is_linear(name):
            sense = machine.sense(name) if name in machine.axes else 1
            direction = sense if name in chain.tool else -sense
            axes[name] = replace(axes[name], direction=direction)
    return replace(machine, chain=chain, axes=axes, **tables)


def fitted_workspace(ranges: Mapping[str, Range], machine: Machine) -> Workspace:
    """Choose the working volume of a machine from that of another one."""
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
    return {key: value for key, value in table.items() if parameter(key).axis in machine.axes}


def _left_out(scene: Scene, gone: Collection[str]) -> list[str]:
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


# --- Numbers of a machine and of its working volume: what may be is what a file may hold ----------


def change_number(scene: Scene, what: str, frame: str, index: int, value: float) -> Edited:
    """Set an entry of the offset, rotation, travel or volume of a frame, or a gantry's span."""
    machine = scene.machine
    if what in ("offset", "rotation"):
        unit = "mm" if what == "offset" else "deg"
        return _with_place(scene, f"{what}_{unit}", f"fixed_{unit}", frame, (index, value))
    if what == "span":
        return _with_gantry(scene, frame, replace(_gantry(scene, frame), span_mm=value))
    axis = machine.axis(frame)
    if what == "travel":
        return _with_axis(scene, replace(axis, travel=_with_entry(axis.travel, index, value)))
    ends = _with_entry(scene.workspace.ranges[frame], index, value)
    workspace = Workspace({**scene.workspace.ranges, frame: ends})
    return _checked(scene, replace(scene, workspace=workspace))


def reverse(scene: Scene, axis: str) -> Edited:
    """Let an axis move against its name, or with it again."""
    present = scene.machine.axis(axis)
    turned = replace(present, direction=-present.direction, direction_given=True)
    return _with_axis(scene, turned)


def _with_place(scene: Scene, own: str, fixed: str, frame: str, entry: tuple[int, float]) -> Edited:
    """Change one entry of the offset or the rotation of an axis or of a fixed frame."""
    machine = scene.machine
    if frame in machine.axes:
        axis = machine.axes[frame]
        return _with_axis(scene, replace(axis, **{own: _with_entry(getattr(axis, own), *entry)}))
    if frame not in FIXED_FRAMES:
        raise UnknownNameError("frame", frame, (*machine.axes, *FIXED_FRAMES))
    present = getattr(machine, fixed)
    entries = {**present, frame: _with_entry(present.get(frame, ORIGIN), *entry)}
    kept = {
        name: entries[name]
        for name in FIXED_FRAMES
        if name in entries and (fixed == "fixed_mm" or entries[name] != ORIGIN)
    }
    return _with_machine(scene, replace(machine, **{fixed: kept}))


def _with_axis(scene: Scene, axis: Axis) -> Edited:
    axes = {**scene.machine.axes, axis.name: axis}
    return _with_machine(scene, replace(scene.machine, axes=axes))


def _with_machine(scene: Scene, machine: Machine) -> Edited:
    return _checked(scene, replace(scene, model=replace(scene.model, machine=machine)))


def _checked(scene: Scene, changed: Scene) -> Edited:
    """Check a scene, unless nothing has changed."""
    return Edited(scene) if changed == scene else checked(scene, changed)


def _with_entry(entries: tuple[float, ...], index: int, value: float) -> Any:
    if index not in range(len(entries)):
        raise OptionError(f"entry {index}; expected 0 to {len(entries) - 1}")
    value = 0.0 if abs(value) < limits.MIN_NUMBER else value
    return (*entries[:index], value, *entries[index + 1 :])


# --- What belongs to frames beside their places: two guides of a gantry, meshes of a user ---------

START_SPAN_MM = 1000.0  # of guides where no travel across says how far apart they are


def switch_gantry(scene: Scene, axis: str) -> Edited:
    """Let a linear axis stand on two guides, or on one again."""
    present = scene.machine.axis(axis)
    if not present.is_linear:
        raise OptionError(f"{axis} is a rotary axis; expected a linear one for two guides")
    if axis in scene.machine.gantries:
        return _with_gantry(scene, axis, None)
    across = default_across(axis)
    spans = [
        other.travel[1] - other.travel[0]
        for other in scene.machine.axes.values()
        if other.is_linear and ACROSS[other.index] == across
    ]
    return _with_gantry(scene, axis, Gantry(axis, max(spans, default=START_SPAN_MM), across))


def turn_gantry(scene: Scene, axis: str) -> Edited:
    """Let the guides of a gantry lie apart along the other direction that is not the axis's own."""
    gantry = _gantry(scene, axis)
    own = (ACROSS[direction_index(axis)], gantry.across)
    other = next(name for name in ACROSS if name not in own)
    return _with_gantry(scene, axis, replace(gantry, across=other))


def own_bodies(machine: Machine) -> dict[str, BodySource]:
    """Give the bodies that a description names, without those of its machine in the library."""
    known = load_machine(machine.name).bodies if machine.name in machine_names() else {}
    return {frame: source for frame, source in machine.bodies.items() if known.get(frame) != source}


def remove_mesh(scene: Scene, frame: str) -> Edited:
    """Take away what a description says about the body of a frame; it is generated again."""
    own = own_bodies(scene.machine)
    if frame not in own:
        raise UnknownNameError("body", frame, tuple(own))
    kept = {name: body for name, body in scene.machine.bodies.items() if name != frame}
    return _with_machine(scene, replace(scene.machine, bodies=kept))


def _gantry(scene: Scene, axis: str) -> Gantry:
    found = scene.machine.gantries.get(axis)
    if found is None:
        raise UnknownNameError("gantry", axis, tuple(scene.machine.gantries))
    return found


def _with_gantry(scene: Scene, axis: str, gantry: Gantry | None) -> Edited:
    both = {**scene.machine.gantries, axis: gantry}
    ordered = {name: one for name in scene.machine.axes if (one := both.get(name)) is not None}
    return _with_machine(scene, replace(scene.machine, gantries=ordered))


# --- Another chain, another order, the other side, another machine of the library -----------------

MOST_CHAIN_TEXT = 101  # characters of a chain that are read: one more than in a file
FRAME = "F"


def change_chain(scene: Scene, text: str) -> Edited:
    """Give the machine of a scene another chain as a user has typed it."""
    chain = parse_chain(text[:MOST_CHAIN_TEXT])
    if chain == scene.machine.chain:
        return Edited(scene)
    return with_machine(scene, rearranged(scene.machine, chain))


def move_axis(scene: Scene, axis: str, step: int) -> Edited:
    """Move an axis along the written chain, by -1 towards the workpiece; across the frame too."""
    scene.machine.axis(axis)
    places = _places(scene)
    place = places.index(axis)
    if not 0 <= place + step < len(places):
        return Edited(scene)
    places.insert(place + step, places.pop(place))
    return _placed(scene, places)


def switch_side(scene: Scene, axis: str) -> Edited:
    """Let an axis carry the tool instead of the workpiece, or the other way; next to the frame."""
    scene.machine.axis(axis)
    places = [name for name in _places(scene) if name != axis]
    places.insert(places.index(FRAME) + (axis not in scene.machine.chain.tool), axis)
    return _placed(scene, places)


def remove_axis(scene: Scene, axis: str) -> Edited:
    """Take an axis away."""
    scene.machine.axis(axis)
    if len(scene.machine.axes) == 1:
        raise OptionError(f"axis {axis} is the only one; expected a machine with at least one")
    return _placed(scene, [name for name in _places(scene) if name != axis])


def take_machine(scene: Scene, library: Scene) -> Edited:
    """Take machine, working volume and points of a scene of the library."""
    points = replace(
        scene,
        model=replace(
            scene.model,
            tool_point_mm=library.model.tool_point_mm,
            workpiece_point_mm=library.model.workpiece_point_mm,
        ),
        trace_points_mm=library.trace_points_mm,
    )
    machine = library.machine
    if not machine.body_dir:  # it stands in a scene, and comes to stand in this one
        machine = replace(machine, name=scene.name)
    return with_machine(points, machine, library.workspace)


def take_sizes(scene: Scene) -> Edited:
    """Give the machine of a scene the sizes of a new one with its chain."""
    return take_machine(scene, starter_scene(scene.machine.chain))


def _places(scene: Scene) -> list[str]:
    chain = scene.machine.chain
    return [*reversed(chain.workpiece), FRAME, *chain.tool]


def _placed(scene: Scene, places: list[str]) -> Edited:
    frame = places.index(FRAME)
    chain = Chain(tuple(reversed(places[:frame])), tuple(places[frame + 1 :]))
    return with_machine(scene, rearranged(scene.machine, chain))
