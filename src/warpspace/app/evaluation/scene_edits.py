"""Changes of the machine of a scene: pure functions from one valid scene to another one."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from warpspace.exceptions import ChainError, OptionError, UnknownNameError
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


# --- Numbers of a machine and of its working volume -----------------------------------------------

ENDS = ("lower", "upper")
DIRECTIONS = ("x", "y", "z")


def change_offset(scene: Scene, frame: str, index: int, value: float) -> Edited:
    """Set one coordinate of the origin of a frame in the frame before it."""
    what = f"offset of {frame} along {_named(index, DIRECTIONS)}"
    kept, notes = _clamped(what, value, limits.MAX_LENGTH_MM, "mm")
    return _with_place(scene, frame, ("offset_mm", "fixed_mm"), index, kept, notes)


def change_rotation(scene: Scene, frame: str, index: int, value: float) -> Edited:
    """Set one angle of the fixed rotation of a frame against the frame before it."""
    what = f"rotation of {frame} about {_named(index, DIRECTIONS)}"
    kept, notes = _clamped(what, value, limits.FULL_TURN_DEG, "°")
    return _with_place(scene, frame, ("rotation_deg", "fixed_deg"), index, kept, notes)


def change_travel(scene: Scene, axis: str, end: int, value: float) -> Edited:
    """Set one end of the travel of an axis."""
    present = scene.machine.axis(axis)
    what = f"{_named(end, ENDS)} end of the travel of {axis}"
    kept, notes = _clamped(what, value, limits.MAX_LENGTH_MM, present.unit)
    low, high = _with_entry(present.travel, end, kept)
    if high - low < limits.MIN_SPAN:
        raise OptionError(
            f"travel of {axis} {low:g} … {high:g} {present.unit}; expected the lower end below the"
            " upper"
        )
    return _with_axis(scene, replace(present, travel=(low, high)), notes)


def change_direction(scene: Scene, axis: str, direction: int) -> Edited:
    """Let an axis move with (+1) or against (−1) its name."""
    present = scene.machine.axis(axis)
    if direction not in (1, -1):
        raise OptionError(f"direction of {axis} {direction}; expected 1 or −1")
    return _with_axis(scene, replace(present, direction=direction, direction_given=True))


def change_volume(scene: Scene, axis: str, end: int, value: float) -> Edited:
    """Set one end of the range of an axis in the working volume."""
    unit = scene.machine.axis(axis).unit
    what = f"{_named(end, ENDS)} end of {axis} in the working volume"
    kept, notes = _clamped(what, value, limits.MAX_LENGTH_MM, unit)
    low, high = _with_entry(scene.workspace.ranges[axis], end, kept)
    if low > high or 0.0 < high - low < limits.MIN_SPAN:
        raise OptionError(
            f"working volume of {axis} {low:g} … {high:g} {unit}; expected the lower end below the"
            " upper, or both equal where the axis stands still"
        )
    workspace = Workspace({**scene.workspace.ranges, axis: (low, high)})
    return _checked(scene, replace(scene, workspace=workspace), notes)


def _with_place(
    scene: Scene,
    frame: str,
    tables: tuple[str, str],
    index: int,
    value: float,
    notes: tuple[str, ...],
) -> Edited:
    """Change one entry of the offset or the rotation of an axis or of a fixed frame."""
    machine, (own, fixed) = scene.machine, tables
    if frame in machine.axes:
        axis = machine.axes[frame]
        return _with_axis(
            scene, replace(axis, **{own: _with_entry(getattr(axis, own), index, value)}), notes
        )
    if frame not in FIXED_FRAMES:
        raise UnknownNameError("frame", frame, (*machine.axes, *FIXED_FRAMES))
    present = getattr(machine, fixed)
    entries = {**present, frame: _with_entry(present.get(frame, ORIGIN), index, value)}
    kept = {
        name: entries[name]
        for name in FIXED_FRAMES
        if name in entries and (fixed == "fixed_mm" or entries[name] != ORIGIN)
    }
    return _with_machine(scene, replace(machine, **{fixed: kept}), notes)


def _with_axis(scene: Scene, axis: Axis, notes: tuple[str, ...] = ()) -> Edited:
    axes = {**scene.machine.axes, axis.name: axis}
    return _with_machine(scene, replace(scene.machine, axes=axes), notes)


def _with_machine(scene: Scene, machine: Machine, notes: tuple[str, ...] = ()) -> Edited:
    return _checked(scene, replace(scene, model=replace(scene.model, machine=machine)), notes)


def _checked(scene: Scene, changed: Scene, notes: tuple[str, ...]) -> Edited:
    """Check a scene, unless nothing has changed."""
    return Edited(scene, notes) if changed == scene else checked(scene, changed, notes)


def _named(index: int, names: tuple[str, ...]) -> str:
    if index not in range(len(names)):
        what = "end" if names == ENDS else "direction"
        raise OptionError(f"{what} {index}; expected 0 to {len(names) - 1} for {', '.join(names)}")
    return names[index]


def _with_entry(entries: Sequence[float], index: int, value: float) -> tuple[float, ...]:
    return tuple(value if at == index else entry for at, entry in enumerate(entries))


def _clamped(what: str, value: float, limit: float, unit: str) -> tuple[float, tuple[str, ...]]:
    """Bring a number within ± a limit; note that it was not."""
    if math.isnan(value):
        raise OptionError(f"{what}: nan; expected a number")
    kept = min(max(value, -limit), limit)
    kept = 0.0 if abs(kept) < limits.MIN_NUMBER else kept
    if value in {kept, 0.0}:
        return kept, ()
    return kept, (f"{what} = {value:g} {unit} is beyond ±{limit:g} {unit}; clamped to {kept:g}",)


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


def change_span(scene: Scene, axis: str, value: float) -> Edited:
    """Set the distance between the guides of a gantry, mm, clamped to what a file may hold."""
    gantry = _gantry(scene, axis)
    if math.isnan(value):
        raise OptionError(f"span of {axis}: nan; expected a number")
    low, high = limits.GANTRY_SPAN_MM
    kept = min(max(value, low), high)
    note = f"span of {axis} = {value:g} mm; expected {low:g} to {high:g} mm, clamped to {kept:g}"
    return _with_gantry(
        scene, axis, replace(gantry, span_mm=kept), () if kept == value else (note,)
    )


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


def _with_gantry(
    scene: Scene, axis: str, gantry: Gantry | None, notes: tuple[str, ...] = ()
) -> Edited:
    both = {**scene.machine.gantries, axis: gantry}
    ordered = {name: one for name in scene.machine.axes if (one := both.get(name)) is not None}
    return _with_machine(scene, replace(scene.machine, gantries=ordered), notes)


# --- Another chain, another order, the other side, another machine of the library -----------------

MOST_CHAIN_TEXT = 100  # characters of a chain, as in a file
FRAME = "F"
STEPS = {"left": -1, "right": 1}
"""Ways in which an axis moves along the written chain: towards the workpiece, towards the tool."""


def change_chain(scene: Scene, text: str) -> Edited:
    """Give the machine of a scene another chain as a user has typed it."""
    if len(text) > MOST_CHAIN_TEXT:
        raise ChainError(
            f"chain of {len(text)} characters; expected at most {MOST_CHAIN_TEXT},"
            " for instance wCBFXYZt"
        )
    chain = parse_chain(text)
    if chain == scene.machine.chain:
        return Edited(scene)
    return with_machine(scene, rearranged(scene.machine, chain))


def move_axis(scene: Scene, axis: str, way: str) -> Edited:
    """Move an axis by one place along the written chain; across the frame it changes sides."""
    scene.machine.axis(axis)
    if way not in STEPS:
        raise UnknownNameError("way", way, STEPS)
    places = _places(scene)
    place = places.index(axis)
    other = place + STEPS[way]
    if not 0 <= other < len(places):
        return Edited(scene)
    places[place], places[other] = places[other], places[place]
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
