"""The conventions a map is drawn with: changing them, and what each choice does to the map.

Changed conventions live in the state's scene, so that everything drawn from it (map, traces, why,
exports) has them; `AppState.origin` keeps the scene's own ones.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from warpspace.app.browser.html import EMPTY, button, field, fill, join, number, tag, text_box
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.panel import Section
from warpspace.app.state.app_state import AppState
from warpspace.app.state.leaf import Identity
from warpspace.app.state.look import linear_spans
from warpspace.app.state.tree import EXAMPLE
from warpspace.app.state.typed_numbers import read_positions
from warpspace.exceptions import OptionError
from warpspace.field.evaluate import View, evaluate_first_order
from warpspace.field.grid import build_grid
from warpspace.kinematics import conversion, transforms
from warpspace.kinematics.axis_errors import AxisErrors
from warpspace.kinematics.chain import branch_frames, nominal_point
from warpspace.kinematics.model import Loop, Model, convention_names, find_convention
from warpspace.machine.axes import TravelDirection, is_linear, parameter
from warpspace.machine.definition import Vector
from warpspace.machine.errors import Constant, ErrorFunction, ErrorSet, Poly
from warpspace.scene.model import Scene, evaluate_grid
from warpspace.scene.scene_writer import covered_spans
from warpspace.units import Array

Effect = tuple[float, float]
"""Mean over the volume and largest length of the change of the error vector, µm."""


def with_travel(state: AppState, direction: str) -> AppState:
    """Look at errors for another direction of travel; an unknown one changes nothing."""
    if direction not in [*TravelDirection]:
        return state
    return _with_scene(state, replace(state.scene.model, direction=TravelDirection(direction)))


def with_reference(state: AppState, at: Mapping[str, float] | None) -> AppState:
    """Hold a point still, mm in axis coordinates; None shows absolute errors.

    Coordinates outside the travels are clamped and noted; what is no number stays.
    """
    scene = state.scene
    if at is None:
        return _with_scene(state, scene.model, None)
    spans, notes = linear_spans(scene), list[str]()
    kept = {**scene.workspace.positions, **(scene.reference or {})}
    for name in filter(spans.__contains__, at):
        wanted, kept[name] = at[name], spans[name].clamp(at[name], kept[name])
        if kept[name] != wanted:
            what, unit = f"reference {name}", scene.machine.axes[name].unit
            notes.append(spans[name].clamped_words(wanted, kept[name], what, unit))
    return _with_scene(state, scene.model, {name: kept[name] for name in spans}).noted(*notes)


def _with_scene(state: AppState, model: Model, *reference: Mapping[str, float] | None) -> AppState:
    scene = replace(state.scene, model=model)
    return state.with_edited(replace(scene, reference=reference[0]) if reference else scene)


def choices_of(scene: Scene) -> dict[tuple[str, str], dict[str, str]]:
    """Give what can be chosen and its words, in groups with a title and a hint."""
    found = {
        ("Component errors", "Where the errors of a motion act"): {
            f"component_errors={name}": find_convention(name).title for name in convention_names()
        },
        ("Reference", "What is held still"): {
            "reference=absolute": "absolute",
            "reference=point": "a point is held still",
        },
    }
    for kind, moves in (("Rotary", "turns"), ("Linear", "moves")):
        hint = f"+1 {moves} with the name of the axis, −1 against it"
        found[f"{kind} axes", hint] = {
            f"direction {axis}={sign}": f"{axis} {words}"
            for axis in sorted(scene.machine.axes)
            if is_linear(axis) == (kind == "Linear")
            for sign, words in ((1, "+1"), (-1, "−1"))
        }
    return found


def choices(scene: Scene) -> list[str]:
    return [choice for group in choices_of(scene).values() for choice in group]


def chosen(scene: Scene) -> set[str]:
    """Tell which choices are in force."""
    return {
        f"component_errors={scene.model.component_errors}",
        "reference=absolute" if scene.reference is None else "reference=point",
        *(f"direction {axis.name}={axis.direction}" for axis in scene.machine.axes.values()),
    }


def with_choice(state: AppState, choice: str) -> AppState:
    """Apply a choice as a page spells it; what is none changes nothing."""
    model, (what, _, given) = state.scene.model, choice.partition("=")
    if choice not in choices(state.scene):
        return state
    if what == "reference":
        held = state.scene.reference or state.origin.reference or {}
        return with_reference(state, held if given == "point" else None)
    if what == "component_errors":
        changed = replace(model, component_errors=given, own_component_errors=())
        return _with_scene(state, changed)
    axis = model.machine.axes[what.removeprefix("direction ")]
    axes = {**model.machine.axes, axis.name: replace(axis, direction=int(given))}
    machine = replace(model.machine, axes=axes)
    return _with_scene(state, replace(model, machine=machine))


def with_own_conventions(state: AppState) -> AppState:
    own, machine = state.origin, state.scene.machine
    said = {**machine.axes, **own.machine.axes}
    axes = {
        name: replace(axis, direction=said[name].direction) for name, axis in machine.axes.items()
    }
    # an edited machine may not have all axes of the scene's
    held = {name: at for name, at in (own.reference or {}).items() if name in axes}
    model = replace(
        state.scene.model,
        component_errors=own.model.component_errors,
        own_component_errors=own.model.own_component_errors,
        direction=own.model.direction,
        machine=replace(machine, axes=axes),
    )
    return _with_scene(state, model, held or None)


def effects_of(state: AppState) -> dict[str, Effect]:
    """Work out what each choice, taken alone, does to the map; "all" is what is in force."""
    own = with_own_conventions(state)
    looks = {choice: with_choice(own, choice) for choice in choices(own.scene)} | {"all": state}
    if state.scene.reference is not None:
        looks["reference=point"] = with_reference(own, state.scene.reference)
    (weights, before), known = _error(own), chosen(own.scene)
    return {
        choice: (0.0, 0.0) if choice in known else _effect(weights, _error(look)[1] - before)
        for choice, look in looks.items()
    }


def _error(state: AppState) -> tuple[Array, Array]:
    workspace = state.scene.workspace.moved(state.positions)
    grid = build_grid(state.scene.model, workspace, state.nodes)
    return grid.weights, evaluate_grid(state.active_scene(), grid, state.view()).error_um


def _effect(weights: Array, change_um: Array) -> Effect:
    length = np.linalg.norm(change_um, axis=-1)
    return float(np.sum(weights * length)), float(length.max())


# --- What it would cost if errors had been measured in another convention than is read ------------


def convention_costs(scene: Scene, view: View, nodes: int = 21) -> dict[str, Effect]:
    """Find what each wrong convention would cost over the working volume, to first order.

    The numbers stay as they are and are read in the convention of the scene and in another one.
    What cannot be converted has no cost.
    """
    grid = build_grid(scene.model, scene.workspace, nodes)

    def field_of(errors: ErrorSet, way: str = scene.model.direction) -> Array:
        at = grid.coordinates, view, grid.point_mm
        return evaluate_first_order(replace(scene.model, direction=way), errors, *at).error_um

    own = field_of(scene.errors)
    found = {
        name: field_of(ErrorSet(changes), TravelDirection.MEAN)
        for name, changes in _changes(scene).items()
    }
    for sign in conversion.SquarenessSign:
        read = conversion.convert_squareness(scene.machine, scene.errors, sign)
        found[f"squareness={sign}"] = field_of(read) - own
    with suppress(OptionError):
        found["measuring_line"] = field_of(_measured_in_the_middle(scene)) - own
    return {name: _effect(grid.weights, change) for name, change in found.items()}


def _changes(scene: Scene) -> dict[str, dict[str, ErrorFunction]]:
    """Give by how much curves differ whose lines or values in the middle were taken out."""
    errors, axes = scene.errors, scene.machine.axes
    middle = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    found = {
        name: dict[str, ErrorFunction]()
        for name in ("zero_at", *map(str, conversion.ReferenceLine))
    }
    for row in map(parameter, errors):
        axis, span = axes[row.axis], scene.axis_span(row.axis)
        if not row.is_constant:
            there = errors.evaluate_at(row.key, middle, scene.model.direction)
            found["zero_at"][row.key] = Constant(span, -float(there))
            if axis.is_linear and not row.is_rotation and row.direction != axis.index:
                at = conversion.line_positions(
                    AxisErrors(scene.model, errors, row.axis, span), row.key
                )
                for line in conversion.ReferenceLine:
                    offset, slope = conversion.fit_line(at, errors.evaluate(row.key, at), line)
                    found[line][row.key] = Poly(span, (-offset, -slope))
    return found


def _measured_in_the_middle(scene: Scene) -> ErrorSet:
    """Read translations as measured along lines through the middle of the volume."""
    model = scene.model
    middle = {axis: np.asarray(at) for axis, at in scene.workspace.positions.items()}
    point = nominal_point(model, Loop.TOOL, middle)
    lines: dict[str, Vector] = {}
    for frames in (
        *branch_frames(model, "tool", middle),
        *branch_frames(model, "workpiece", middle),
    ):
        if frames.axis.is_linear:
            x, y, z = transforms.apply(transforms.inverse(frames.after), point).tolist()
            lines[frames.axis.name] = (x, y, z)
    spans = covered_spans(model, scene.workspace)
    return conversion.move_measuring_line(model, scene.errors, spans, lines, to_origin=True)


# --- The section ----------------------------------------------------------------------------------

COSTS = {
    "squareness=over_90": "squareness: positive where the angle is over 90°",
    "squareness=under_90": "squareness: positive where the angle is under 90°",
    "measuring_line": "measuring line: through the middle of the volume",
    "end_point": "straightness: end points taken out",
    "least_squares": "straightness: least squares taken out",
    "minimum_zone": "straightness: minimum zone taken out",
    "zero_at": "curves: zero in the middle of each axis",
}
NOTE = (
    "Change of the error vector over the nodes of the grid, through the loop that is drawn: each"
    " choice alone, against the conventions of the scene."
)
RADIO = (
    '<label><input type="radio" name="{}" value="{}"{} data-set="conventions:choose"> {}</label>'
)
COST_NOTE = (
    "What a wrong assumption about the measured data would cost, to first order. The scene's:"
    " squareness by the right-hand rule, measuring lines at the origin of each axis, straightness"
    " with its tilt, curves as given."
)


class ConventionsSection(Section):
    name, task, title = "conventions", "machine", "Conventions"
    sentence = "Choose what the errors mean, and see what another convention would change"

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        state = picture.state
        return (
            Identity(state.origin), Identity(state.scene), tuple(state.active.items()),
            tuple(state.positions.items()), state.view_key, state.nodes,
            Identity(state.picked),
        )  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        state = picture.state
        effects, in_force = effects_of(state), chosen(state.scene)
        own = chosen(with_own_conventions(state).scene)
        lines = [fill("<tr><th>µm</th><th class=number>mean</th><th class=number>max</th></tr>")]
        for head, members in choices_of(state.scene).items():
            lines.append(fill('<tr><th colspan="3"><b>{}</b> {}</th></tr>', *head))
            for choice, words in members.items():
                checked = Markup(" checked") if choice in in_force else ""
                told = f"{words} (scene)" if choice in own else words
                radio = fill(RADIO, choice.partition("=")[0], choice, checked, told)
                lines.append(_row(radio, None if choice in own else effects[choice]))
        lines.append(_row("all choices together", effects["all"]))
        back = button("Back to the scene's", "conventions:own", disabled=in_force == own)
        return join((
            tag("table", join(lines), class_="ws-choices-table"), tag("p", NOTE, class_="ws-tiny"),
            _reference(state), tag("div", back, class_="ws-actions"), _wrong(state),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "choose":
            return with_choice(state, value)
        if word == "own":
            return with_own_conventions(state)
        if word == "pick" and state.picked is not None:
            return with_reference(state, state.picked.at)
        if word == "set.reference":
            at = read_positions(value)
            if at is not None:
                return with_reference(state, at)
            expected = f"expected positions of the axes, for instance {EXAMPLE}"
            return state.noted(f"point {value[:40]!r}: {expected}")
        return state


def _reference(state: AppState) -> Markup:
    if state.scene.reference is None:
        return EMPTY
    held = {**state.scene.workspace.positions, **state.scene.reference}
    spelled = " ".join(f"{axis} {held[axis]:g}" for axis in linear_spans(state.scene))
    name, hint = "conventions:set.reference", "Click a point of the box in the drawing first"
    box = field("Held at", text_box(name, spelled), name, hint="Positions of the axes")
    nowhere = state.picked is None or state.picked.point_mm is not None
    pick = button("Hold the clicked point", "conventions:pick", hint=hint, disabled=nowhere)
    return box + tag("div", pick, class_="ws-actions")


def _row(words: object, effect: Effect | None) -> Markup:
    cells = ("–", "–") if effect is None else map(number, effect)
    line = '<tr><td>{}</td><td class="number">{}</td><td class="number">{}</td></tr>'
    return fill(line, words, *cells)


def _wrong(state: AppState) -> Markup:
    scene = state.active_scene()
    costs = convention_costs(scene, scene.view(state.loop), state.nodes)
    rows = [_row(words, costs.get(name)) for name, words in COSTS.items()]
    summary = tag("summary", "If the data were measured in another convention")
    note = tag("p", COST_NOTE, class_="ws-tiny")
    return tag("details", join((summary, note, tag("table", join(rows)))), class_="ws-options")
