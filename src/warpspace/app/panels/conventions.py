"""The conventions of the error map: changing them, and the effect of each choice on the map.

Changed conventions are part of the state's scene, so that maps, traces, explanations and exports
follow them; `AppState.origin` holds those of the scene.
"""

from collections.abc import Mapping
from dataclasses import replace

from markupsafe import Markup

from warpspace.analysis.convention_costs import Effect, convention_costs, measure_change
from warpspace.app.browser import actions as do
from warpspace.app.browser.templates import Templates
from warpspace.app.evaluation.live_model import evaluate_state
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.panel import Section, on
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import linear_spans
from warpspace.app.state.tree import EXAMPLE
from warpspace.app.state.typed_numbers import read_positions
from warpspace.kinematics.model import Model, convention_names, find_convention
from warpspace.machine.axes import TravelDirection, is_linear
from warpspace.scene.model import Scene
from warpspace.units import Array

HTML = Templates("conventions")


def with_travel(state: AppState, direction: str) -> AppState:
    """Set the direction of travel; an unknown one is ignored."""
    if direction not in [*TravelDirection]:
        return state
    return _with_scene(state, replace(state.scene.model, direction=TravelDirection(direction)))


def with_reference(state: AppState, at: Mapping[str, float] | None) -> AppState:
    """Set the reference point, mm in axis coordinates; None shows absolute errors.

    Coordinates outside the travels are clamped and noted; NaN is ignored.
    """
    scene = state.scene
    if at is None:
        return _with_scene(state, scene.model, None)
    spans, notes = linear_spans(scene), list[str]()
    positions = {**scene.workspace.positions, **(scene.reference or {})}
    for name in filter(spans.__contains__, at):
        requested, positions[name] = at[name], spans[name].clamp(at[name], positions[name])
        if positions[name] != requested:
            label, unit = f"reference {name}", scene.machine.axes[name].unit
            notes.append(spans[name].clamped_words(requested, positions[name], label, unit))
    return _with_scene(state, scene.model, {name: positions[name] for name in spans}).noted(*notes)


def _with_scene(state: AppState, model: Model, *reference: Mapping[str, float] | None) -> AppState:
    scene = replace(state.scene, model=model)
    return state.with_edited(replace(scene, reference=reference[0]) if reference else scene)


def choice_groups(scene: Scene) -> dict[tuple[str, str], dict[str, str]]:
    """Return all choices and their labels, in groups with a title and a hint."""
    groups = {
        ("Component errors", "Point where the errors of a motion act"): {
            f"component_errors={name}": find_convention(name).title for name in convention_names()
        },
        ("Reference", "Point of zero error"): {
            "reference=absolute": "none (absolute errors)",
            "reference=point": "a point of the working volume",
        },
    }
    for kind, moves in (("Rotary", "turns"), ("Linear", "moves")):
        groups[f"{kind} axes", f"+1 {moves} in the direction of the axis name, −1 against it"] = {
            f"direction {axis}={sign}": f"{axis} {label}"
            for axis in sorted(scene.machine.axes)
            if is_linear(axis) == (kind == "Linear")
            for sign, label in ((1, "+1"), (-1, "−1"))
        }
    return groups


def choices(scene: Scene) -> list[str]:
    return [choice for group in choice_groups(scene).values() for choice in group]


def chosen(scene: Scene) -> set[str]:
    return {
        f"component_errors={scene.model.component_errors}",
        "reference=absolute" if scene.reference is None else "reference=point",
        *(f"direction {axis.name}={axis.direction}" for axis in scene.machine.axes.values()),
    }


def with_choice(state: AppState, choice: str) -> AppState:
    """Apply a choice of the page; an unknown one is ignored."""
    model, (group, _, chosen_value) = state.scene.model, choice.partition("=")
    if choice not in choices(state.scene):
        return state
    if group == "reference":
        reference = state.scene.reference or state.origin.reference or {}
        return with_reference(state, reference if chosen_value == "point" else None)
    if group == "component_errors":
        changed = replace(model, component_errors=chosen_value, own_component_errors=())
        return _with_scene(state, changed)
    axis = group.removeprefix("direction ")
    machine = model.machine.with_direction(axis, int(chosen_value))
    return _with_scene(state, replace(model, machine=machine))


def with_own_conventions(state: AppState) -> AppState:
    origin, machine = state.origin, state.scene.machine
    scene_axes = {**machine.axes, **origin.machine.axes}
    axes = {
        name: replace(axis, direction=scene_axes[name].direction)
        for name, axis in machine.axes.items()
    }
    # an edited machine may lack axes of the scene
    reference = {name: at for name, at in (origin.reference or {}).items() if name in axes}
    model = replace(
        state.scene.model,
        component_errors=origin.model.component_errors,
        own_component_errors=origin.model.own_component_errors,
        direction=origin.model.direction,
        machine=replace(machine, axes=axes),
    )
    return _with_scene(state, model, reference or None)


def effects_of(state: AppState) -> dict[str, Effect]:
    """Compute the effect of each single choice on the map; "all" are those in force."""
    base = with_own_conventions(state)
    variants = {choice: with_choice(base, choice) for choice in choices(base.scene)}
    variants["all"] = state
    if state.scene.reference is not None:
        variants["reference=point"] = with_reference(base, state.scene.reference)
    (weights, before), in_force = _error(base), chosen(base.scene)
    effects = dict.fromkeys(in_force, (0.0, 0.0))
    for choice in variants.keys() - in_force:
        effects[choice] = measure_change(weights, _error(variants[choice])[1] - before)
    return effects


def _error(state: AppState) -> tuple[Array, Array]:
    grid, field = evaluate_state(state)
    return grid.weights, field.error_um


# --- The section ----------------------------------------------------------------------------------


class ConventionsSection(Section):
    name, task, title = "conventions", "machine", "Conventions"
    sentence = "Sign and reference conventions of the errors, and the effect of changing them"

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.state
        return (
            Identity(state.origin), Identity(state.scene), tuple(state.active.items()),
            tuple(state.positions.items()), state.view_key, state.nodes,
            Identity(state.picked),
        )  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        state = picture.state
        effects, in_force = effects_of(state), chosen(state.scene)
        scene_choices = chosen(with_own_conventions(state).scene)
        scene, reference = state.active_scene(), ""
        costs = convention_costs(scene, scene.view(state.loop), state.nodes)
        if scene.reference is not None:
            at = {**scene.workspace.positions, **scene.reference}
            reference = " ".join(f"{axis} {at[axis]:g}" for axis in linear_spans(scene))
        has_point = state.picked is not None and state.picked.point_mm is None
        return HTML.conventions(
            choice_groups(scene), in_force, scene_choices, effects, reference, has_point, costs
        )

    @on(do.Input.CHOOSE_CONVENTION)
    def choose(self, state: AppState, choice: str) -> AppState:
        return with_choice(state, choice)

    @on(do.Signal.RESET_CONVENTIONS, do.Signal.USE_PICKED_REFERENCE)
    def reset(self, state: AppState, signal: do.Signal) -> AppState | None:
        if signal is do.Signal.RESET_CONVENTIONS:
            return with_own_conventions(state)
        return state.picked and with_reference(state, state.picked.at)

    @on(do.Input.SET_REFERENCE)
    def set_reference(self, state: AppState, text: str) -> AppState:
        at = read_positions(text)
        if at is not None:
            return with_reference(state, at)
        expected = f"expected axis positions, for example {EXAMPLE}"
        return state.noted(f"point {text[:40]!r}: {expected}")
