"""Edits of the machine of a scene or a state, and the machines of the library.

The edited machine is part of the state's scene; `AppState.origin` holds the original one. Errors
and tolerances of the remaining axes are unchanged.
"""

import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any, TypeVar

import numpy as np
import tomli_w

from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import position_spans
from warpspace.app.state.tree import put
from warpspace.app.state.typed_numbers import read_typed
from warpspace.exceptions import OptionError, UnknownNameError, WarpspaceError
from warpspace.field.grid import find_volume_axes
from warpspace.machine import definition
from warpspace.machine.axes import PARAMETERS, direction_index, is_linear, parameter
from warpspace.machine.curves.curve import OWN_AXIS, ErrorFunction
from warpspace.machine.errors import ErrorSet
from warpspace.machine.limits import MAX_ERROR
from warpspace.scene.library import load_scene, parse_scene, scene_names
from warpspace.scene.machine_library import body_notes, load_machine, machine_names
from warpspace.scene.model import Scene, scene_notes
from warpspace.scene.scene_writer import extend_to_ranges, scene_to_toml
from warpspace.scene.starter import starter_scene
from warpspace.units import MICROMETRE

# --- Edits of a scene as a document: a single entry, or the whole machine -------------------------

Tables = dict[str, dict[str, Any]]
T = TypeVar("T")
KEYS = {"offset": "offset_mm", "rotation": "rotation_deg", "travel": "travel"}
UNITS = {"offset": "mm", "rotation": "°", "span": "mm", "travel": "", "volume": ""}
"""Units of the tables of numbers; empty for the unit of the axis."""
NOUNS = {"span": "gantry", "mesh": "body"}
START_SPAN_MM = 1000.0  # of guides without a travel across them
MOST_CHAIN_TEXT = 101  # characters of a chain that are parsed: one more than in a file
FRAME = "F"
MAX_QUOTED = 30  # characters of a typed text in a message


def tables_of(scene: Scene) -> Tables:
    machine, fixed = scene.machine, dict.fromkeys(definition.FIXED_FRAMES, definition.ORIGIN)
    offset = {name: axis.offset_mm for name, axis in machine.axes.items()}
    rotation = {name: axis.rotation_deg for name, axis in machine.axes.items()}
    return {
        "offset": {**offset, **fixed, **machine.fixed_mm},
        "rotation": {**rotation, **fixed, **machine.fixed_deg},
        "travel": {name: axis.travel for name, axis in machine.axes.items()},
        "volume": dict(scene.workspace.ranges),
        "span": {name: (gantry.span_mm,) for name, gantry in machine.gantries.items()},
        "mesh": own_bodies(machine),
    }


def own_bodies(machine: definition.Machine) -> dict[str, definition.BodySource]:
    """Return the bodies of a description that are not those of the library machine."""
    bundled = load_machine(machine.name).bodies if machine.name in machine_names() else {}
    return {
        frame: source for frame, source in machine.bodies.items() if bundled.get(frame) != source
    }


def edited(scene: Scene, word: str) -> tuple[Scene, tuple[str, ...]]:
    """Apply an edit of the page to the machine of a scene; return notes on what was removed.

    An unknown edit changes nothing; one that a file could not hold is refused.
    """
    what, _, args = word.partition(" ")
    tables, raw, machine = tables_of(scene), _document(scene), scene.machine
    guides, bodies = raw["machine"].setdefault("gantry", {}), dict(machine.bodies)
    match what, args.split(" ", maxsplit=2):
        case "chain", _:
            _rearrange(raw, scene, definition.parse_chain(args[:MOST_CHAIN_TEXT]))
        case "left" | "right" | "side" | "remove", [axis]:
            _rearrange(raw, scene, _moved(machine, what, axis))
        case "turn", [axis]:
            _put(raw, "direction", axis, -machine.axis(axis).direction)
        case "gantry", [axis]:
            if guides.pop(axis, None) is None:
                across = definition.default_across(machine.axis(axis).name)
                spans = [
                    other.travel[1] - other.travel[0]
                    for other in machine.axes.values()
                    if other.is_linear and definition.ACROSS[other.index] == across
                ]
                guides[axis] = {"span_mm": max(spans, default=START_SPAN_MM), "across": across}
        case "across", [axis]:
            _entry(tables, "span", axis)
            used = (guides[axis]["across"], definition.ACROSS[direction_index(axis)])
            guides[axis]["across"] = next(name for name in definition.ACROSS if name not in used)
        case "mesh", [frame]:
            _entry(tables, what, frame)
            del bodies[frame]
        case "sizes", [""]:
            return _with_machine(scene, starter_scene(machine.chain))
        case _, [frame, ("0" | "1" | "2") as index, typed] if what in UNITS:
            row = list(_entry(tables, what, frame))
            if int(index) >= len(row):
                raise OptionError(f"{what} of {frame} has {len(row)} numbers")
            unit = UNITS[what] or machine.axes[frame].unit
            row[int(index)] = read_number(f"{what} of {frame}", typed, unit)
            if what == "span":
                guides[frame]["span_mm"] = row[0]
            elif what == "volume":
                raw["workspace"][frame] = row[0] if row[0] == row[-1] else row
            else:
                _put(raw, KEYS[what], frame, row)
        case _:
            return scene, ()
    return _read(scene, raw, replace(machine, bodies=bodies))


def read_number(what: str, typed: str, unit: str) -> float:
    value = read_typed(typed, unit)
    if value is None:
        text = typed if len(typed) <= MAX_QUOTED else f"{typed[:MAX_QUOTED]}…"
        raise OptionError(f"{what} = “{text}”; expected a number in {unit}")
    return value


def _entry(tables: Tables, what: str, frame: str) -> Any:
    if frame not in tables[what]:
        raise UnknownNameError(NOUNS.get(what, "frame"), frame, tables[what])
    return tables[what][frame]


def _put(raw: Tables, key: str, frame: str, value: object) -> None:
    raw["machine"].setdefault(key, {})[frame] = value


def _moved(machine: definition.Machine, what: str, axis: str) -> definition.Chain:
    """Move an axis along the chain, also across the frame; or next to the frame; or remove it."""
    places = [*reversed(machine.chain.workpiece), FRAME, *machine.chain.tool]
    at = places.index(machine.axis(axis).name) + {"left": -1, "right": 1}.get(what, 0)
    places.remove(axis)
    if what == "side":
        at = places.index(FRAME) + (axis not in machine.chain.tool)
    if what != "remove":
        places.insert(max(at, 0), axis)
    return definition.parse_chain(f"w{''.join(places)}t")


def _rearrange(raw: Tables, scene: Scene, chain: definition.Chain) -> None:
    machine = scene.machine
    raw["machine"]["chain"] = str(chain)
    spanned = find_volume_axes({a: r for a, r in scene.workspace.ranges.items() if a in chain.axes})
    for axis in filter(is_linear, chain.axes):
        carries = axis in chain.tool
        if axis not in machine.axes:
            _put(raw, "direction", axis, 1 if carries else -1)
            if spanned[direction_index(axis)]:
                raw["workspace"][axis] = 0.0
        elif carries != (axis in machine.chain.tool):
            _put(raw, "direction", axis, -machine.axes[axis].direction)


def _with_machine(scene: Scene, other: Scene) -> tuple[Scene, tuple[str, ...]]:
    document = _document(other)
    raw = _document(scene) | {key: document[key] for key in ("machine", "workspace", "points_mm")}
    return _read(scene, raw, other.machine)


def _document(scene: Scene) -> Tables:
    """Return a scene as the document of its file, with its machine, without bodies and errors.

    The text of a ramp refers to the range of its axis, which an edit may change.
    """
    model = replace(scene.model, machine=replace(scene.machine, name="", bodies={}))
    return tomllib.loads(scene_to_toml(replace(scene, model=model, errors=ErrorSet())))


def _read(scene: Scene, raw: Tables, like: definition.Machine) -> tuple[Scene, tuple[str, ...]]:
    """Parse an edited document without entries of removed axes; return notes on those.

    A machine with the frames of `like` or of a library machine has its name and bodies; any other
    is named after the scene, since bodies belong to their frames.
    """
    chain = definition.parse_chain(raw["machine"]["chain"])
    gone = {a: at for a, at in scene.workspace.positions.items() if a not in chain.axes}
    orders = {axis: scene.model.convention(axis).name for axis in chain.axes}
    # the reference axis may have changed
    raw["convention"] |= {"reference_axis": "free", "component_errors": orders}
    read = parse_scene(tomli_w.dumps(_without(raw, gone)), scene.name, "machine")
    curves = of_axes(scene.errors.functions, chain.axes)
    errors = ErrorSet({key: curve.without_axes(gone) for key, curve in curves.items()})
    errors = extend_to_ranges(errors, read.model, read.workspace)
    for key, curve in errors.functions.items():
        if not abs(curve.amplitude) <= MAX_ERROR:
            peak = f"{curve.amplitude:g} {parameter(key).unit}"
            raise OptionError(f"errors.{key} reaches {peak}; expected at most ±{MAX_ERROR:g}")
    same = _frames(like) == _frames(read.machine)
    named = like if same else known_alike(read.machine)
    if named is None:
        is_own = like.chain == chain and not like.body_dir
        named = replace(read.machine, title=like.title if is_own else f"Machine {chain}")
    machine = replace(
        read.machine,
        name=named.name if named.body_dir else scene.name,
        title=named.title,
        body_dir=named.body_dir,
        bodies={frame: body for frame, body in like.bodies.items() if frame not in gone},
    )
    model = replace(read.model, machine=machine)
    notes = (*scene_notes(machine, read.workspace, errors), *body_notes(machine))
    read = replace(read, model=model, errors=errors, notes=notes, part=scene.part)
    return (scene, ()) if read == scene else (read, tuple(_left_out(scene, gone)))


def _without(table: Tables, axes: Collection[str]) -> Tables:
    remaining = {
        key: _without(value, axes) if isinstance(value, dict) else value
        for key, value in table.items()
        if key not in axes and (key not in PARAMETERS or PARAMETERS[key].axis not in axes)
    }
    return {key: value for key, value in remaining.items() if value != {}}


def _frames(machine: definition.Machine) -> tuple[object, ...]:
    places = [(axis.offset_mm, axis.rotation_deg) for axis in machine.axes.values()]
    return machine.chain, places, machine.fixed_mm, machine.fixed_deg


def known_alike(machine: definition.Machine) -> definition.Machine | None:
    """Find the library machine with the same frames; travels and directions may differ."""
    machines = map(load_machine, machine_names())
    return next((other for other in machines if _frames(other) == _frames(machine)), None)


def of_axes(table: Mapping[str, T], axes: Collection[str]) -> dict[str, T]:
    return {key: value for key, value in table.items() if parameter(key).axis in axes}


def _left_out(scene: Scene, gone: Collection[str]) -> Iterator[str]:
    for axis in gone:
        depend = [key for key in scene.errors if axis in scene.errors.arguments(key)]
        parts = {
            "its errors {}": of_axes(scene.errors.functions, [axis]),
            "its tolerances {}": of_axes(scene.tolerances.individual, [axis]),
            "the dependence of {} on it": [k for k in depend if parameter(k).axis not in gone],
            "its reference position": {axis} & (scene.reference or {}).keys(),
        }
        losses = "; ".join(words.format(", ".join(keys)) for words, keys in parts.items() if keys)
        yield f"axis {axis} removed{f', with {losses}' if losses else ''}"


# --- The machine of a state: edited errors and tolerances stay ------------------------------------

UNCHANGED = "the machine is unchanged"


def with_word(state: AppState, word: str) -> AppState:
    """Apply an edit of the page to the machine of a state; a refused edit adds a note."""
    what, *args = word.split(" ", maxsplit=3)
    gantry = state.scene.machine.gantries.get(args[0]) if args else None
    try:
        if word == "own":
            return with_own_machine(state)
        if what == "guide" and gantry is not None and len(args) == 3 and args[1] in ("0", "1"):
            what = f"guide {int(args[1]) + 1} of {args[0]}"
            value = read_number(what, args[2], MICROMETRE)
            return with_guide_error(state, gantry, int(args[1]), value)
        scene, notes = edited(state.scene, word)
        changed = state if scene is state.scene else with_changed_scene(state, scene)
    except WarpspaceError as problem:
        return state.noted(f"{str(problem).removeprefix('machine: ')}; {UNCHANGED}")
    if what == "span" and gantry is not None:  # the errors of both guides are unchanged
        now = scene.machine.gantries[gantry.axis]
        turned = changed.amplitudes[now.rotation_key] * now.rotation_weight
        turned /= gantry.rotation_weight
        changed = put(changed, f"amplitudes.{now.rotation_key}", repr(turned))
    return changed.noted(*notes)


def with_changed_scene(state: AppState, scene: Scene) -> AppState:
    before, original = state.scene, state.origin
    notes: list[str] = []
    if scene.machine.chain != before.machine.chain:
        scene = _with_origin(scene, original)
        if scene.errors and scene.title != original.title:
            notes.append(NOT_MEASURED.format(original.title, scene.machine.chain))
    keys = scene.parameter_keys
    was, stands = before.workspace.positions, scene.workspace.positions
    # an axis whose position in the working volume was edited moves there
    unmoved = {
        axis: at for axis, at in state.positions.items() if was.get(axis) == stands.get(axis)
    }
    positions = {
        axis: span.clamp(unmoved.get(axis, stands[axis]), span.low)
        for axis, span in position_spans(scene).items()
    }
    tolerances = of_axes(state.tolerances.individual, scene.machine.axes)
    fixed = state.specification.fixed & frozenset(keys)
    changed = replace(
        state.with_edited(scene),
        amplitudes={key: _amplitude(state, scene, key) for key in keys},
        positions=positions,
        exclusions=state.exclusions.within(keys),
        tolerances=replace(state.tolerances, individual=tolerances),
        specification=replace(state.specification, fixed=fixed),
        picked=state.picked if scene.machine.chain == before.machine.chain else None,
        lever=state.lever if state.lever in keys else "",
        # a table is valid for its machine only
        controller=state.controller if scene.model == before.model else None,
    )
    curves = changed.own_curves
    start = {key: curves[key].amplitude if key in curves else 0.0 for key in keys}
    return replace(changed.within_reach(), start=start).noted(*notes)


NOT_MEASURED = (
    "the errors of {} are kept as assumptions for the chain {}: readings and uncertainties were"
    " dropped, the title was changed"
)


def _with_origin(scene: Scene, original: Scene) -> Scene:
    """Return an edited scene with title and measurements of the original one, for its chain only.

    With another chain the title states it, and the errors are assumptions.
    """
    chain = scene.machine.chain
    if chain != original.machine.chain:
        title = f"{original.title or original.name}, chain {chain}"
        return replace(scene, title=title, uncertainty={}, covariance=None, measured={})
    scene = replace(scene, title=original.title)
    if scene.errors != original.errors:
        return scene
    return replace(
        scene, uncertainty=original.uncertainty, covariance=original.covariance,
        measured=original.measured,
    )  # fmt: skip


def _amplitude(state: AppState, scene: Scene, key: str) -> float:
    """Return an amplitude in an edited scene; the same curve may be larger over a larger volume."""
    if key not in state.amplitudes:
        return scene.errors.amplitude(key)
    present = state.amplitudes[key]
    was, now = (side.errors.functions.get(key) for side in (state.scene, scene))
    if was is None or now is None or was == now or was.amplitude == 0.0:
        return present
    return now.amplitude * (present / was.amplitude)


def with_own_machine(state: AppState) -> AppState:
    """Restore machine, working volume and points of the scene as opened."""
    original, scene = state.origin, state.scene
    if original.machine == scene.machine and original.workspace == scene.workspace:
        return state
    returned = original.machine.axes.keys() - scene.machine.axes.keys()
    # curves that differ from those as opened by the working volume only are restored
    original_curves, present = state.own_curves, scene.errors.functions
    curves = {key: one for key, one in present.items() if original_curves.get(key) != one}
    orders = {
        axis: (original if axis in returned else scene).model.convention(axis).name
        for axis in original.machine.axes
    }
    tolerances = {
        **of_axes(original.tolerances.individual, returned),
        **state.tolerances.individual,
    }
    joined = replace(
        scene,
        model=replace(scene.model, own_component_errors=tuple(orders.items())),
        errors=ErrorSet({**original.errors.functions, **curves}),
        reference=scene.reference and {**(original.reference or {}), **scene.reference},
        tolerances=replace(state.tolerances, individual=tolerances),
    )
    restored, notes = _with_machine(joined, original)
    state = replace(state, tolerances=joined.tolerances)
    return with_changed_scene(state, restored).noted(*notes)


# --- Errors of the two guides of a gantry, from mean and rotation of the axis ---------------------

SAMPLES = 65
ALIKE = 1e-9  # largest difference of two curves of amplitude 1 that are regarded as equal


def guide_errors(state: AppState, gantry: definition.Gantry) -> tuple[float, float] | None:
    """Return the positioning errors of both guides, µm; None where their curves differ."""
    if not _alike(state.curve(gantry.positioning_key), state.curve(gantry.rotation_key)):
        return None
    mean = state.amplitudes[gantry.positioning_key]
    half = 0.5 * state.amplitudes[gantry.rotation_key] / gantry.rotation_weight
    return mean - half, mean + half


def with_guide_error(
    state: AppState, gantry: definition.Gantry, guide: int, value_um: float
) -> AppState:
    present = guide_errors(state, gantry)
    if present is None:
        raise OptionError(
            f"guides of {gantry.axis}: their errors have different curves; use the sliders"
        )
    other = present[1 - guide]
    rotation = (value_um - other) * (1.0 if guide else -1.0) * gantry.rotation_weight
    values = {gantry.positioning_key: (value_um + other) / 2.0, gantry.rotation_key: rotation}
    curves = [state.curve(key) for key in values]
    shape = next((curve for curve in curves if curve.amplitude != 0.0), curves[0])
    for key, amplitude in values.items():
        state = put(edits.with_curve(state, key, shape), f"amplitudes.{key}", repr(amplitude))
    return state


def _alike(*curves: ErrorFunction) -> bool:
    if any(curve.amplitude == 0.0 for curve in curves):
        return True
    first, second = (curve.with_amplitude(1.0) for curve in curves)
    if any(curve.has_directions or {*curve.arguments} - {OWN_AXIS} for curve in curves):
        return first == second
    at = np.linspace(*first.span, SAMPLES)
    return bool(np.abs(first.evaluate(at) - second.evaluate(at)).max() <= ALIKE)


# --- Machines of the bundled scenes, each once ----------------------------------------------------


@cache
def library() -> Mapping[str, Scene]:
    """Load one scene of each machine, for its volume and points, by name of the machine."""
    scenes: dict[str, Scene] = {}
    for name in scene_names():
        with suppress(WarpspaceError):  # a damaged scene does not hide the others
            scene = load_scene(name)
            scenes.setdefault(scene.machine.name, scene)
    return scenes


def with_library_scene(state: AppState, scene: Scene) -> AppState:
    """Open a machine of the library with its own errors; the original machine is restored."""
    if state.origin.machine == scene.machine:
        return with_own_machine(state)
    previous = state.scene.title
    note = f"{scene.title} with its own errors; those of {previous} were dropped"
    changed = replace(state.with_scene(scene), left_behind=previous)
    return changed.noted(f"{note} (Undo restores them)")
