"""Changes of a state's machine: everything of the axes that stay is kept, undo takes them back.

The changed machine lives in the state's scene; `AppState.origin` keeps the scene's own one.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import TypeVar

from warpspace.app.evaluation.machine_edits.guides import with_guide_error, with_same_guides
from warpspace.app.evaluation.machine_edits.library import library_scene
from warpspace.app.state.app_state import AppState
from warpspace.app.state.edits import curve_of
from warpspace.app.state.look import linear_spans
from warpspace.app.state.ranges import Span, amplitude_span, position_spans
from warpspace.app.state.typed_numbers import read_typed
from warpspace.exceptions import WarpspaceError
from warpspace.machine.errors import ErrorSet
from warpspace.machine.parameters import parameter
from warpspace.machine.tolerances import ToleranceSet
from warpspace.scene.editing import numbers, parts, structure
from warpspace.scene.editing.edited import Edited
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE

T = TypeVar("T")
Edit = Callable[[Scene], Edited]
SHOWN = 30
"""Characters of what was typed that a message repeats."""
NUMBERS: Mapping[str, Callable[[Scene, str, int, float], Edited]] = {
    "offset": numbers.change_offset,
    "rotation": numbers.change_rotation,
    "travel": numbers.change_travel,
    "volume": numbers.change_volume,
    "span": lambda scene, axis, _, value: parts.change_span(scene, axis, value),
}
"""What is set by a frame, the number of an entry, and a value."""
UNCHANGED = "the machine stays as it was"


def with_edit(state: AppState, edit: Edit) -> AppState:
    """Change the machine of a state.

    Parameters
    ----------
    state : AppState
    edit : callable
        From a scene to a changed one.

    Returns
    -------
    AppState
        Unchanged but for a note where the edit refuses.
    """
    try:
        edited = edit(state.scene)
    except WarpspaceError as problem:
        return _noted(state, f"{problem}; {UNCHANGED}")
    if edited.scene == state.scene:
        return _noted(state, *edited.notes)
    try:
        changed = with_changed_scene(state, edited.scene)
    except WarpspaceError as problem:
        return _noted(state, f"{problem}; {UNCHANGED}")
    return _noted(changed, *edited.notes)


def with_changed_scene(state: AppState, scene: Scene) -> AppState:
    """Show a scene whose machine or working volume has been changed.

    Parameters
    ----------
    state : AppState
    scene : Scene

    Returns
    -------
    AppState
        Amplitudes, tolerances, exclusions, positions and ranges of sliders of all that is still
        there are kept; what belongs to axes that are gone is left out.
    """
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
    spans = {key: _span(state, scene, key, amplitudes[key]) for key in keys}
    same_axes = scene.machine.chain == state.scene.machine.chain
    changed = replace(
        state,
        scene=scene,
        loaded=loaded,
        amplitudes=amplitudes,
        spans=spans,
        positions=positions,
        position_spans=ranges,
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
    """Forget where axes stand, are cut or held that are gone."""
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
    """Tell whether a position lies in a range."""
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


def _span(state: AppState, scene: Scene, key: str, amplitude: float) -> Span:
    """Give the range of a slider: the present one, unless the amplitude lies beyond."""
    known = state.spans.get(key)
    if known is not None and _within(amplitude, known):
        return known
    return amplitude_span(key, amplitude, scene.tolerances.get(key))


def with_own_machine(state: AppState) -> AppState:
    """Go back to machine, working volume and points of the scene as it was opened."""
    own = state.origin
    if own.machine == state.scene.machine and own.workspace == state.scene.workspace:
        return state
    returned = own.machine.axes.keys() - state.scene.machine.axes.keys()
    changed = with_edit(state, lambda _: structure.take_machine(_joined(state, returned), own))
    if changed.scene is state.scene:
        return changed
    tolerances = {**_of(own.tolerances.own, returned), **changed.tolerances.own}
    return replace(changed, tolerances=replace(changed.tolerances, own=tolerances))


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
    """Give the entries whose parameters belong to some axes."""
    return {key: value for key, value in table.items() if parameter(key).axis in axes}


def with_word(state: AppState, word: str) -> AppState:
    """Change the machine as a page spells it; a word that is none changes nothing.

    Parameters
    ----------
    state : AppState
    word : str
        For instance "chain wCBFXYZt", "left B", "side X", "turn C", "remove A", "type scara",
        "offset X 2 150" (z of X's offset, mm), "travel X 1 300" (upper end), "gantry X",
        "across X", "span X 0 1800" (mm), "guide X 1 12" (of the second guide, µm), "mesh X" (away
        with it). Anything, since it comes from a browser.
    """
    what, _, rest = word.partition(" ")
    words = rest.split(" ", maxsplit=2)
    match what, words:
        case "chain", _:
            return with_edit(state, lambda scene: structure.change_chain(scene, rest))
        case (("left" | "right"), [axis]):
            return with_edit(state, lambda scene: structure.move_axis(scene, axis, what))
        case "side", [axis]:
            return with_edit(state, lambda scene: structure.switch_side(scene, axis))
        case "remove", [axis]:
            return with_edit(state, lambda scene: structure.remove_axis(scene, axis))
        case "turn", [axis] if axis in state.scene.machine.axes:
            against = -state.scene.machine.axes[axis].direction
            return with_edit(state, lambda s: numbers.change_direction(s, axis, against))
        case "type", [name]:
            library = library_scene(name)
            if library is None:
                return state
            return with_edit(state, lambda scene: structure.take_machine(scene, library))
        case "gantry", [axis]:
            return with_edit(state, lambda scene: parts.switch_gantry(scene, axis))
        case "across", [axis]:
            return with_edit(state, lambda scene: parts.turn_gantry(scene, axis))
        case "mesh", [frame]:
            return with_edit(state, lambda scene: parts.remove_mesh(scene, frame))
        case "guide", [axis, ("0" | "1") as guide, typed] if axis in state.scene.machine.gantries:
            return _with_guide(state, axis, int(guide), typed)
        case "sizes", [""]:
            return with_edit(state, structure.take_sizes)
        case "own", [""]:
            return with_own_machine(state)
        case _, [frame, entry, typed] if what in NUMBERS and entry in ("0", "1", "2"):
            return _with_number(state, what, frame, int(entry), typed)
        case _:
            return state


def _with_number(state: AppState, what: str, frame: str, entry: int, typed: str) -> AppState:
    """Set a number that was typed."""
    axis = state.scene.machine.axes.get(frame)
    unit = {"offset": "mm", "rotation": "°"}.get(what) or ("mm" if axis is None else axis.unit)
    value = read_typed(typed, unit)
    if value is None:
        return _no_number(state, f"{what} of {frame}", typed, unit)
    change = NUMBERS[what]
    changed = with_edit(state, lambda scene: change(scene, frame, entry, value))
    return with_same_guides(state, changed, frame) if what == "span" else changed


def _with_guide(state: AppState, axis: str, guide: int, typed: str) -> AppState:
    """Set the positioning error of a guide that was typed."""
    value = read_typed(typed, MICROMETRE)
    if value is None:
        return _no_number(state, f"guide {guide + 1} of {axis}", typed, MICROMETRE)
    return with_guide_error(state, axis, guide, value)


def _no_number(state: AppState, what: str, typed: str, unit: str) -> AppState:
    """Note that what was typed is no number."""
    text = typed if len(typed) <= SHOWN else f"{typed[:SHOWN]}…"
    return _noted(state, f"{what} = “{text}”; expected a number in {unit}")


def _noted(state: AppState, *notes: str) -> AppState:
    """Add notes."""
    return replace(state, notes=(*state.notes, *notes)) if notes else state
