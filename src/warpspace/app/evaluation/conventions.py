"""The conventions a map is drawn with: changing them, and what each choice does to the map.

Changed conventions live in the state's scene, so that everything drawn from it (map, traces, why,
exports) has them; `AppState.origin` keeps the scene's own ones.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpspace.app.evaluation.resulting_scene import active_scene
from warpspace.app.state.app_state import AppState, start_loop
from warpspace.app.state.ranges import Span
from warpspace.field.evaluate import View
from warpspace.field.grid import Grid, Workspace, build_grid
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_frames, jacobian, nominal_point
from warpspace.kinematics.conversion import (
    ReferenceLine,
    SquarenessSign,
    angle_sign,
    fit_line,
    squareness_keys,
)
from warpspace.kinematics.model import (
    ComponentErrors,
    Coordinates,
    Loop,
    Model,
    batch_shape,
    convention_names,
)
from warpspace.machine.axes import TravelDirection, axis_parameters, is_linear, parameter
from warpspace.machine.description import Axis
from warpspace.machine.errors import ErrorSet, Table
from warpspace.scene.model import Scene, evaluate_grid
from warpspace.units import Array

Reference = Mapping[str, float] | None


@dataclass(frozen=True, slots=True)
class Effect:
    """What one choice does to the map, against the scene's own conventions."""

    choice: str  # for instance "component_errors=before_motion" or "squareness=over_90"
    mean_um: float  # mean over the volume and largest length of the change of the error vector
    max_um: float


def reference_spans(scene: Scene) -> dict[str, Span]:
    """Give the ranges of a reference point, mm: the working volume's, by linear axis."""
    ranges = scene.workspace.ranges
    return {
        name: Span(*(ranges.get(name) or scene.machine.axes[name].travel), 1.0)
        for name in scene.machine.axes
        if is_linear(name) or name in scene.workspace.volume_axes
    }


def with_travel(state: AppState, direction: str) -> AppState:
    """Look at errors for another direction of travel; an unknown one changes nothing."""
    if direction not in [*TravelDirection]:
        return state
    model = replace(state.scene.model, direction=TravelDirection(direction))
    return _with_scene(state, replace(state.scene, model=model))


def with_reference(state: AppState, at: Reference) -> AppState:
    """Hold a point still, mm in axis coordinates; None shows absolute errors.

    Coordinates outside the working volume are clamped and noted; what is no number stays.
    """
    if at is None:
        return _with_scene(state, replace(state.scene, reference=None))
    before = {**state.scene.workspace.positions, **(state.scene.reference or {})}
    kept: dict[str, float] = {}
    notes = state.notes
    for name, span in reference_spans(state.scene).items():
        wanted = float(at.get(name, before.get(name, 0.0)))
        kept[name] = span.clamp(wanted, before.get(name, 0.0))
        if kept[name] != wanted:
            unit = state.scene.machine.axes[name].unit
            note = f"reference {name} = {wanted:g} {unit}: clamped to {kept[name]:g} {unit}"
            notes = (*notes, note)
    scene = replace(state.scene, reference=kept)
    return replace(_with_scene(state, scene), notes=notes)


def with_choice(state: AppState, choice: str) -> AppState:
    """Apply a choice as a page spells it, for instance "direction C=-1"; others change nothing."""
    what, _, value = choice.partition("=")
    model = state.scene.model
    match what.split(" "):
        case ["component_errors"] if value in convention_names():
            changed = replace(model, component_errors=value, own_component_errors=())
            return _with_scene(state, replace(state.scene, model=changed))
        case ["loop"] if value in [*Loop]:
            return replace(state, loop=Loop(value))
        case ["reference"] if value == "absolute":
            return with_reference(state, None)
        case ["reference"] if value == "point":
            own = state.origin.reference or {}
            return with_reference(state, state.scene.reference or own)
        case ["direction", axis] if value in ("1", "-1") and axis in model.machine.axes:
            turned = replace(model.machine.axes[axis], direction=int(value), direction_given=True)
            axes = {**model.machine.axes, axis: turned}
            changed = replace(model, machine=replace(model.machine, axes=axes))
            return _with_scene(state, replace(state.scene, model=changed))
        case _:
            return state


def with_own_conventions(state: AppState) -> AppState:
    """Go back to the conventions of the scene."""
    own = state.origin
    axes: dict[str, Axis] = {}
    for name, axis in state.scene.machine.axes.items():
        said = own.machine.axes.get(name, axis)
        axes[name] = replace(axis, direction=said.direction, direction_given=said.direction_given)
    # an edited machine may not have all axes of the scene's
    held = {name: at for name, at in (own.reference or {}).items() if name in axes}
    model = replace(
        state.scene.model,
        component_errors=own.model.component_errors,
        own_component_errors=own.model.own_component_errors,
        direction=own.model.direction,
        machine=replace(state.scene.machine, axes=axes),
    )
    return _with_scene(state, replace(state.scene, model=model, reference=held or None))


def _with_scene(state: AppState, scene: Scene) -> AppState:
    if scene == state.scene:
        return state
    own = state.origin
    return (
        replace(state, scene=own, loaded=None)
        if scene == own
        else replace(state, scene=scene, loaded=own)
    )


def choices(state: AppState) -> list[str]:
    """List what can be chosen, as `with_choice` takes it, in the order shown."""
    axes = sorted(state.scene.machine.axes.values(), key=lambda axis: (axis.is_linear, axis.name))
    return [
        *(f"component_errors={order}" for order in convention_names()),
        *(f"loop={loop}" for loop in Loop),
        "reference=absolute",
        "reference=point",
        *(f"direction {axis.name}={sign}" for axis in axes for sign in (1, -1)),
    ]


def chosen(state: AppState) -> set[str]:
    """Tell which choices are in force."""
    scene = state.scene
    return {
        f"component_errors={scene.model.component_errors}",
        f"loop={state.loop}",
        "reference=absolute" if scene.reference is None else "reference=point",
        *(f"direction {axis.name}={axis.direction}" for axis in scene.machine.axes.values()),
    }


def effects_of(state: AppState) -> dict[str, Effect]:
    """Work out what each choice, taken alone, does to the map; "all" is what is in force."""
    own = own_state(state)
    known, looks = chosen(own), {"all": state}
    looks |= {c: with_choice(own, c) for c in choices(state) if c not in known}
    if state.scene.reference is not None:
        looks["reference=point"] = with_reference(own, state.scene.reference)
    weights, before = _grid(own).weights, _error(own)
    found = {choice: Effect(choice, 0.0, 0.0) for choice in known}
    for choice, look in looks.items():
        length = np.linalg.norm(_error(look) - before, axis=-1)
        found[choice] = Effect(choice, float(np.sum(weights * length)), float(length.max()))
    return found


def _grid(state: AppState) -> Grid:
    return build_grid(state.scene.model, state.scene.workspace.moved(state.positions), state.nodes)


def _error(state: AppState) -> Array:
    return evaluate_grid(active_scene(state), _grid(state), state.view()).error_um


def own_state(state: AppState) -> AppState:
    """Give the state with the conventions of its scene: order, reference, directions and loop."""
    return replace(with_own_conventions(state), loop=start_loop(state.origin))


# --- What it would cost if errors had been measured in another convention than is read ------------
# The numbers stay as they are and are read once in the convention of the scene and once in another
# one; the difference of both fields is the cost, to first order.

MEASURING_LINE, ZERO = "measuring_line", "zero_at"
EVENLY = 101
URAD_PER_UM_OVER_MM = 1e3
Values = dict[str, Array]
Reading = Callable[["_Read", Values, Coordinates], Values]


@dataclass(frozen=True, slots=True)
class _Read:
    """What all readings work on."""

    model: Model
    errors: ErrorSet
    workspace: Workspace
    keys: tuple[str, ...]

    def values(self, coordinates: Coordinates) -> Values:
        way = self.model.direction
        return {
            key: self.errors.evaluate_at(key, coordinates, way)
            for key in self.keys
            if key in self.errors
        }


def costs_of(state: AppState) -> tuple[Effect, ...]:
    """Find what it would cost if the errors drawn had been measured in another convention."""
    scene = active_scene(state)
    view = scene.view(state.loop)
    return convention_costs(scene.model, scene.errors, scene.workspace, view, state.nodes)


def convention_costs(
    model: Model,
    errors: ErrorSet,
    workspace: Workspace,
    view: View | None = None,
    nodes: int = 21,
) -> tuple[Effect, ...]:
    """Find what each wrong convention would cost over the working volume."""
    view = view or View()
    grid = build_grid(model, workspace, nodes)
    keys = tuple(
        row.key
        for axis in model.machine.axes
        for row in axis_parameters(axis)
        if not row.is_constant or row.key in errors
    )
    read = _Read(model, errors, workspace, keys)
    places: list[tuple[Coordinates, Array]] = [(grid.coordinates, grid.point_mm)]
    if view.reference is not None:
        held = {
            axis: np.asarray(view.reference.get(axis, at))
            for axis, at in workspace.positions.items()
        }
        places.append((held, nominal_point(model, Loop.TOOL, held)))
    gains = [jacobian(model, view.loop, keys, *place)[0] for place in places]
    own = [read.values(coordinates) for coordinates, _ in places]
    found: list[Effect] = []
    for name, reading in _readings().items():
        parts = [
            _field(keys, gain, _change(own_values, reading(read, own_values, coordinates)))
            for gain, own_values, (coordinates, _) in zip(gains, own, places, strict=True)
        ]
        change = parts[0] - parts[1] if len(parts) > 1 else parts[0]
        length = np.linalg.norm(np.broadcast_to(change, (*grid.shape, 3)), axis=-1)
        found.append(Effect(name, float(np.sum(grid.weights * length)), float(length.max())))
    return tuple(found)


def _change(own: Values, other: Values) -> Values:
    return {key: value - own.get(key, 0.0) for key, value in other.items()}


def _field(keys: tuple[str, ...], gains: Array, values: Mapping[str, Array]) -> Array:
    """Add up gains times values, [..., 3], µm."""
    total = np.zeros(gains.shape[1:])
    for key, value in values.items():
        total += gains[keys.index(key)] * value[..., None]
    return total


def _readings() -> dict[str, Reading]:
    """List how else the numbers may have been meant."""
    found: dict[str, Reading] = {
        f"squareness={sign}": _squareness(sign)
        for sign in (SquarenessSign.OVER_90, SquarenessSign.UNDER_90)
    }
    found[MEASURING_LINE] = _measuring_line
    found |= {f"straightness={line}": _reference_line(line) for line in ReferenceLine}
    found[ZERO] = _zero_in_the_middle
    return found


def _squareness(sign: SquarenessSign) -> Reading:
    def reading(read: _Read, values: Values, coordinates: Coordinates) -> Values:
        del coordinates
        turned = 1 if sign is SquarenessSign.OVER_90 else -1
        keys = squareness_keys(read.model.machine)
        return {k: -values[k] for k in keys if k in values and angle_sign(k) != turned}

    return reading


def _measuring_line(read: _Read, values: Values, coordinates: Coordinates) -> Values:
    model, found = read.model, Values()
    middle = {axis: np.asarray(at) for axis, at in read.workspace.positions.items()}
    point = nominal_point(model, Loop.TOOL, middle)
    shape = batch_shape(coordinates)
    for side in ("tool", "workpiece"):
        for frames in branch_frames(model, side, middle):
            axis = frames.axis
            if not axis.is_linear:
                continue
            lever = transforms.apply(transforms.inverse(frames.after), point)
            fixed = model.convention(axis.name).name == ComponentErrors.BEFORE_MOTION
            levers = np.broadcast_to(lever, (*shape, 3)).copy()
            if fixed:
                levers[..., axis.index] += axis.direction * coordinates[axis.name]
            turns = np.stack(
                [
                    np.broadcast_to(values.get(f"E{letter}{axis.name}", np.zeros(())), shape)
                    for letter in "ABC"
                ],
                -1,
            )
            arm = np.cross(turns, levers) / URAD_PER_UM_OVER_MM
            for index, letter in enumerate("XYZ"):
                key = f"E{letter}{axis.name}"
                if arm[..., index].any():
                    found[key] = values.get(key, np.zeros(())) - arm[..., index]
    return found


def _reference_line(line: ReferenceLine) -> Reading:
    def reading(read: _Read, values: Values, coordinates: Coordinates) -> Values:
        found = Values()
        for key in values:
            row = parameter(key)
            axis = read.model.machine.axes[row.axis]
            straight = not row.is_rotation and not row.is_constant and row.direction != axis.index
            if not axis.is_linear or not straight:
                continue
            at = _points(read, key)
            offset, slope = fit_line(at, read.errors.evaluate(key, at), line)
            found[key] = values[key] - offset - slope * coordinates[axis.name]
        return found

    return reading


def _points(read: _Read, key: str) -> Array:
    axis = parameter(key).axis
    low, high = read.workspace.ranges[axis]
    if low == high:
        low, high = read.model.machine.axes[axis].travel
    function = read.errors.functions[key]
    points = np.array(function.kinks if isinstance(function, Table) else ())
    points = points[(points >= low) & (points <= high)]
    return points if len(points) > 1 else np.linspace(low, high, EVENLY)


def _zero_in_the_middle(read: _Read, values: Values, coordinates: Coordinates) -> Values:
    middle = read.workspace.positions
    found = Values()
    for key in values:
        row = parameter(key)
        if not row.is_constant:
            at = {**coordinates, row.axis: np.asarray(middle[row.axis])}
            there = read.errors.evaluate_at(key, at, read.model.direction)
            found[key] = values[key] - there
    return found
