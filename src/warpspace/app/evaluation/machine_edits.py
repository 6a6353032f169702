"""The machine of a state while it is being changed: pure updates, and the library to start from."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeVar

import numpy as np

from warpspace.app.evaluation import scene_edits
from warpspace.app.evaluation.scene_edits import Edited
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import curve_of
from warpspace.app.state.look import linear_spans
from warpspace.app.state.ranges import Span, position_spans
from warpspace.app.state.typed_numbers import read_typed
from warpspace.exceptions import WarpspaceError
from warpspace.machine.axes import parameter
from warpspace.machine.curves.curve import OWN, ErrorFunction
from warpspace.machine.description import Gantry
from warpspace.machine.errors import ErrorSet, ToleranceSet
from warpspace.scene.library import load_scene, scene_names
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE

# --- The two guides of a gantry: their errors, which the axis has as mean and rotation ------------

SAMPLES = 65
ALIKE = 1e-9  # by how much two curves of amplitude 1 may differ that count as one


def guide_errors(state: AppState, axis: str) -> tuple[float, float] | None:
    """Give the positioning errors of both guides of a gantry."""
    gantry = state.scene.machine.gantries.get(axis)
    if gantry is None or not _one_curve(state, gantry):
        return None
    mean = state.amplitudes[gantry.positioning_key]
    half = 0.5 * state.amplitudes[gantry.rotation_key] / gantry.rotation_weight
    return mean - half, mean + half


def with_guide_error(state: AppState, axis: str, index: int, value_um: float) -> AppState:
    """Set the positioning error of one guide; the other one stays."""
    present = guide_errors(state, axis)
    if present is None or index not in (0, 1):
        note = f"guides of {axis}: their errors have different curves; use the sliders"
        return replace(state, notes=(*state.notes, note))
    gantry = state.scene.machine.gantries[axis]
    first, second = (value_um, present[1]) if index == 0 else (present[0], value_um)
    mean, rotation = (first + second) / 2.0, (second - first) * gantry.rotation_weight
    shape = _shape(state, gantry)
    for key, amplitude in ((gantry.positioning_key, mean), (gantry.rotation_key, rotation)):
        if edits.curve_of(state, key).amplitude == 0.0:  # it takes the curve of the other one
            state = edits.with_curve(state, key, shape)
        state = state.with_amplitude(key, amplitude)
    return state


def with_same_guides(before: AppState, state: AppState, axis: str) -> AppState:
    """Keep the errors of both guides where the distance between them has been changed."""
    was, now = (one.scene.machine.gantries.get(axis) for one in (before, state))
    if was is None or now is None or was.rotation_key != now.rotation_key:
        return state
    turned = state.amplitudes[now.rotation_key] * now.rotation_weight / was.rotation_weight
    return state.with_amplitude(now.rotation_key, turned)


def _shape(state: AppState, gantry: Gantry) -> ErrorFunction:
    """Give the curve that both errors of a pair have: that of the one that is not zero."""
    curves = [edits.curve_of(state, key) for key in (gantry.positioning_key, gantry.rotation_key)]
    return next((curve for curve in curves if curve.amplitude != 0.0), curves[0])


def _one_curve(state: AppState, gantry: Gantry) -> bool:
    curves = [edits.curve_of(state, key) for key in (gantry.positioning_key, gantry.rotation_key)]
    if any(curve.amplitude == 0.0 for curve in curves):
        return True
    if any(curve.has_directions or {*curve.arguments} - {OWN} for curve in curves):
        first, second = (curve.with_amplitude(1.0) for curve in curves)
        return first == second
    at = np.linspace(*edits.axis_span(state, gantry.positioning_key), SAMPLES)
    one, other = (curve.evaluate(at) / curve.amplitude for curve in curves)
    return bool(np.abs(one - other).max() <= ALIKE)


# --- The machines to start from: those of the bundled scenes, each once ---------------------------


@dataclass(frozen=True, slots=True)
class MachineType:
    """A machine to start from."""

    name: str  # of the machine, or of its scene where it is written there
    scene: Scene  # brings its working volume and points

    @property
    def title(self) -> str:
        """Full name of the machine."""
        return self.scene.machine.title


@cache
def machine_types() -> tuple[MachineType, ...]:
    """List the machines of the bundled scenes, in the order of the scenes."""
    found: dict[str, MachineType] = {}
    for name in scene_names():
        try:
            scene = load_scene(name)
        except WarpspaceError:  # a scene that was put beside the others is no reason to fail
            continue
        found.setdefault(scene.machine.name, MachineType(scene.machine.name, scene))
    return tuple(found.values())


def library_scene(name: str) -> Scene | None:
    """Give the scene of a machine of the library; None for a name that is none."""
    return next((entry.scene for entry in machine_types() if entry.name == name), None)


# --- Changes of a state's machine -----------------------------------------------------------------
# Everything of the axes that stay is kept, undo takes them back.
#
# The changed machine lives in the state's scene; `AppState.origin` keeps the scene's own one.

T = TypeVar("T")
Edit = Callable[[Scene], Edited]
SHOWN = 30  # characters of what was typed that a message repeats
NUMBERS = frozenset({"offset", "rotation", "travel", "volume", "span"})
OF_FRAME: Mapping[str, Callable[[Scene, str], Edited]] = {
    "left": lambda scene, axis: scene_edits.move_axis(scene, axis, -1),
    "right": lambda scene, axis: scene_edits.move_axis(scene, axis, 1),
    "side": scene_edits.switch_side,
    "remove": scene_edits.remove_axis,
    "turn": scene_edits.reverse,
    "gantry": scene_edits.switch_gantry,
    "across": scene_edits.turn_gantry,
    "mesh": scene_edits.remove_mesh,
}
"""What can be done with a frame of a machine, by its word."""
UNCHANGED = "the machine stays as it was"


def with_edit(state: AppState, edit: Edit) -> AppState:
    """Change the machine of a state."""
    try:
        edited = edit(state.scene)
    except WarpspaceError as problem:
        return _noted(state, f"{str(problem).removeprefix('machine: ')}; {UNCHANGED}")
    if edited.scene == state.scene:
        return _noted(state, *edited.notes)
    try:
        changed = with_changed_scene(state, edited.scene)
    except WarpspaceError as problem:
        return _noted(state, f"{str(problem).removeprefix('machine: ')}; {UNCHANGED}")
    return _noted(changed, *edited.notes)


def with_changed_scene(state: AppState, scene: Scene) -> AppState:
    """Show a scene whose machine or working volume has been changed."""
    own = state.origin
    if scene == own:
        scene, loaded = own, None
    else:
        loaded = own
    keys = scene.parameter_keys
    amplitudes = {key: _amplitude(state, scene, key) for key in keys}
    kept = _of(state.tolerances.own, scene.machine.axes)
    ranges = position_spans(scene)
    stands = scene.workspace.positions
    # an axis whose position in the working volume was changed goes there
    before = state.scene.workspace.positions
    positions = {
        axis: span.clamp(
            state.positions[axis]
            if axis in state.positions and before.get(axis) == stands[axis]
            else stands[axis],
            span.low,
        )
        for axis, span in ranges.items()
    }
    same_axes = scene.machine.chain == state.scene.machine.chain
    changed = replace(
        state,
        scene=scene,
        loaded=loaded,
        amplitudes=amplitudes,
        positions=positions,
        exclusions=state.exclusions.within(keys),
        tolerances=ToleranceSet(state.tolerances.default, kept),
        specification=replace(
            state.specification, fixed=state.specification.fixed & frozenset(keys)
        ),
        picked=state.picked if same_axes else None,
        lever=state.lever if state.lever in keys else "",
        # the table of another machine would correct nothing here
        controller=state.controller if scene.model == state.scene.model else None,
    )
    own_curves = changed.own_curves
    start = {key: own_curves[key].amplitude if key in own_curves else 0.0 for key in keys}
    return _looked_at(replace(changed, start=start))


def _looked_at(state: AppState) -> AppState:
    linear, turning = linear_spans(state.scene), state.position_spans
    look, machine, rotary = state.look, state.machine, state.rotary
    spanning = state.scene.workspace.volume_axes
    look = replace(look, slices_mm={a: at for a, at in look.slices_mm.items() if a in spanning})
    machine = replace(
        machine, linear_mm={a: at for a, at in machine.linear_mm.items() if a in linear}
    )
    held = tuple(
        (axis, kept)
        for axis, at in rotary.held
        if axis in turning and (kept := tuple(p for p in at if _within(p, turning[axis])))
    )
    return replace(state, look=look, machine=machine, rotary=replace(rotary, held=held))


def _within(value: float, span: Span) -> bool:
    return span.low <= value <= span.high


def _amplitude(state: AppState, scene: Scene, key: str) -> float:
    """Give the amplitude of a parameter in a changed scene, µm or µrad.

    Where the working volume has grown the same curve may reach further.
    """
    present = state.amplitudes.get(key)
    if present is None:
        return scene.errors.amplitude(key)
    was, now = state.scene.errors.functions.get(key), scene.errors.functions.get(key)
    if was is None or now is None or was == now or present == 0.0 or was.amplitude == 0.0:
        return present
    if present == was.amplitude:
        return now.amplitude
    return now.amplitude * curve_of(state, key).amplitude / was.amplitude


def with_own_machine(state: AppState) -> AppState:
    """Go back to machine, working volume and points of the scene as it was opened."""
    own = state.origin
    if own.machine == state.scene.machine and own.workspace == state.scene.workspace:
        return state
    returned = own.machine.axes.keys() - state.scene.machine.axes.keys()
    changed = with_edit(state, lambda _: scene_edits.take_machine(_joined(state, returned), own))
    if changed.scene is state.scene:
        return changed
    tolerances = {**_of(own.tolerances.own, returned), **changed.tolerances.own}
    return replace(changed, tolerances=replace(changed.tolerances, own=tolerances))


def with_library_scene(state: AppState, library: Scene) -> AppState:
    """Start anew with a machine of the library: what was measured on one says nothing of another.

    The machine of the scene as it was opened comes back with all that is shown.
    """
    if state.origin.machine == library.machine:
        return with_own_machine(state)
    left = state.scene.title
    note = f"{library.title}, with its own errors: those of {left} are left behind"
    changed = replace(state.with_scene(library), left_behind=left)
    return _noted(changed, f"{note}; undo brings them back")


def _joined(state: AppState, returned: Collection[str]) -> Scene:
    """Give the scene of a state the errors, tolerances and component errors of axes that return.

    Curves that are the scene's own, but for the working volume, become those again.
    """
    scene, own, own_curves = state.scene, state.origin, state.own_curves
    functions = {
        key: own.errors.functions[key] if own_curves.get(key) == function else function
        for key, function in scene.errors.functions.items()
    }
    orders = {**dict(own.model.own_component_errors), **dict(scene.model.own_component_errors)}
    tolerances = {**_of(own.tolerances.own, returned), **scene.tolerances.own}
    return replace(
        scene,
        model=replace(scene.model, own_component_errors=tuple(orders.items())),
        errors=ErrorSet({**_of(own.errors.functions, returned), **functions}),
        tolerances=replace(scene.tolerances, own=tolerances),
    )


def _of(table: Mapping[str, T], axes: Collection[str]) -> dict[str, T]:
    return {key: value for key, value in table.items() if parameter(key).axis in axes}


def with_word(state: AppState, word: str) -> AppState:
    """Change the machine as a page spells it; a word that is none changes nothing."""
    what, _, rest = word.partition(" ")
    words = rest.split(" ", maxsplit=2)
    match what, words:
        case "chain", _:
            return with_edit(state, lambda scene: scene_edits.change_chain(scene, rest))
        case _, [frame] if what in OF_FRAME:
            return with_edit(state, lambda scene: OF_FRAME[what](scene, frame))
        case "guide", [axis, ("0" | "1") as guide, typed] if axis in state.scene.machine.gantries:
            return _with_guide(state, axis, int(guide), typed)
        case "sizes", [""]:
            return with_edit(state, scene_edits.take_sizes)
        case "own", [""]:
            return with_own_machine(state)
        case _, [frame, entry, typed] if what in NUMBERS and entry in ("0", "1", "2"):
            return _with_number(state, what, frame, int(entry), typed)
        case _:
            return state


def _with_number(state: AppState, what: str, frame: str, entry: int, typed: str) -> AppState:
    axis = state.scene.machine.axes.get(frame)
    unit = {"offset": "mm", "rotation": "°"}.get(what) or ("mm" if axis is None else axis.unit)
    value = read_typed(typed, unit)
    if value is None:
        return _no_number(state, f"{what} of {frame}", typed, unit)
    change = scene_edits.change_number
    changed = with_edit(state, lambda scene: change(scene, what, frame, entry, value))
    return with_same_guides(state, changed, frame) if what == "span" else changed


def _with_guide(state: AppState, axis: str, guide: int, typed: str) -> AppState:
    value = read_typed(typed, MICROMETRE)
    if value is None:
        return _no_number(state, f"guide {guide + 1} of {axis}", typed, MICROMETRE)
    return with_guide_error(state, axis, guide, value)


def _no_number(state: AppState, what: str, typed: str, unit: str) -> AppState:
    text = typed if len(typed) <= SHOWN else f"{typed[:SHOWN]}…"
    return _noted(state, f"{what} = “{text}”; expected a number in {unit}")


def _noted(state: AppState, *notes: str) -> AppState:
    return replace(state, notes=(*state.notes, *notes)) if notes else state
