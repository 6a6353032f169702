"""The task Machine: where the axes stand, and the conventions its errors are drawn with."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby

from markupsafe import Markup

from warpspace.app.browser.html import (
    EMPTY,
    attributes,
    button,
    field,
    fill,
    join,
    number,
    slider,
    tag,
    text_box,
)
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.conventions import (
    Effect,
    choices,
    chosen,
    costs_of,
    effects_of,
    own_state,
    reference_spans,
    with_choice,
    with_own_conventions,
    with_reference,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import machine_positions, standing
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_spans
from warpspace.app.state.picked import Picked
from warpspace.app.state.tree import leaves, value
from warpspace.app.state.typed_numbers import read_typed
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Section
from warpspace.bodies.own_meshes import check_meshes
from warpspace.kinematics.model import find_convention
from warpspace.machine.axes import is_linear
from warpspace.picture.words import spell_at, spell_point

OPEN_MESH = "The surface of a mesh of this machine is not closed; it is drawn as it is."


def setting(state: AppState, path: str, label: str) -> Markup:
    """Give a slider with a number box for a field of the state."""
    leaf, at, name = leaves(state)[path], float(value(state, path)), f"state:set.{path}"
    if leaf.span is None:
        return EMPTY
    bar = slider(name, at, leaf.span.low, leaf.span.high, leaf.span.step, twin=name, label=label,
                 text=f"{at:g} {leaf.unit}")  # fmt: skip
    box = text_box(name, f"{at:g}", size="short", inputmode="decimal")
    return field(label, bar + box, name, leaf.unit, leaf.hint)


class PositionsSection(Section):
    """Where the axes stand: the volume is drawn at the rotary ones, the bodies at all of them."""

    name, task, title = "positions", "machine", "Axis positions"
    sentence = "Move the axes: rotary axes carry the working volume, linear ones the tool point"

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow positions and machine."""
        state = picture.state
        return Identity(state.scene), Identity(state.positions), Identity(state.machine)

    def body(self, picture: LivePicture) -> Markup:
        """Write a slider an axis, and the tool point."""
        state = picture.state
        axes, point_mm = standing(state, machine_positions(state))
        copied = button("Copy", "positions:none", kind="link", hint="Copy the positions",
                        data_copy=spell_at(axes))  # fmt: skip
        said = tag("p", join(("Tool point: ", spell_point(axes, point_mm), " ", copied)),
                   class_="ws-tiny")  # fmt: skip
        is_open = state.machine.shown and bool(check_meshes(state.scene.machine))
        return join((
            *(setting(state, f"positions.{axis}", axis) for axis in state.positions),
            *(setting(state, f"machine.linear_mm.{axis}", axis)
              for axis in linear_spans(state.scene)),
            said, tag("p", OPEN_MESH, class_="ws-tiny") if is_open else EMPTY,
        ))  # fmt: skip


# --- Conventions: what the map is drawn with, and what each choice changes ------------------------

GROUPS = {
    "component_errors": ("Component errors", "Where the errors of a motion act"),
    "reference": ("Reference", "What is held still"),
    "rotary": ("Rotary axes", "+1 turns with the name of the axis, −1 against it"),
    "linear": ("Linear axes", "+1 moves with the name of the axis, −1 against it"),
}
WORDS = {"reference=absolute": "absolute", "reference=point": "a point is held still"}
COST_GROUPS = {
    "squareness": ("Sign of squareness", "the scene's: by the right-hand rule"),
    "measuring_line": ("Measuring line", "the scene's: at the origin of each axis"),
    "straightness": ("Reference line of straightness", "the scene's: with its tilt"),
    "zero_at": ("Zero of the curves", "the scene's: as given"),
}
COST_WORDS = {
    "squareness=over_90": "positive where the angle is over 90°",
    "squareness=under_90": "positive where it is under 90°",
    "measuring_line": "through the middle of the volume",
    "straightness=end_point": "end points taken out",
    "straightness=least_squares": "least squares taken out",
    "straightness=minimum_zone": "minimum zone taken out",
    "zero_at": "zero in the middle of each axis",
}
NOTE = (
    "Change of the error vector over the nodes of the grid: each choice alone, against the"
    " conventions of the scene."
)
COST_NOTE = "What a wrong assumption about the measured data would cost, to first order."


def _group(choice: str) -> str:
    what, _, axis = choice.split("=", maxsplit=1)[0].partition(" ")
    return what if not axis else "linear" if is_linear(axis) else "rotary"


def _spell(choice: str) -> str:
    what, _, given = choice.partition("=")
    if what == "component_errors":
        return find_convention(given).title
    axis = what.removeprefix("direction ")
    return WORDS.get(choice, f"{axis} {'+1' if given == '1' else '−1'}")


class ConventionsSection(Section):
    """Conventions to choose from with what each changes, and the point that is held still."""

    name, task, title = "conventions", "machine", "Conventions"
    sentence = "Choose what the errors mean, and see what another convention would change"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._known_for: tuple[object, ...] = ()
        self._effects: Mapping[str, Effect] = {}
        self._costs: tuple[Effect, ...] = ()

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow all that the effects depend on."""
        state = picture.state
        return (
            Identity(state.origin), Identity(state.scene), tuple(state.active.items()),
            tuple(state.positions.items()), state.seen, state.nodes,
            self.context.next_click is None,
        )  # fmt: skip

    def body(self, picture: LivePicture) -> Markup:
        """Write choices, reference and costs."""
        state = picture.state
        asked = self.concerns(picture)[:-1]
        if asked != self._known_for:
            self._known_for = asked
            self._effects, self._costs = effects_of(state), costs_of(state)
        own, in_force = chosen(own_state(state)), chosen(state)
        head = "<tr><th>µm</th><th class=number>mean</th><th class=number>max</th></tr>"
        lines: list[Markup] = [fill(head)]
        listed = [choice for choice in choices(state) if _group(choice) in GROUPS]
        for group, members in groupby(listed, _group):
            title, hint = GROUPS[group]
            lines.append(fill('<tr><th colspan="3" title="{hint}"><b>{title}</b></th></tr>',
                              title=title, hint=hint))  # fmt: skip
            for choice in members:
                radio = fill("<input{rest}>", rest=attributes(
                    type="radio", name=choice.split("=")[0], value=choice,
                    checked=choice in in_force, data_set="conventions:choose",
                ))  # fmt: skip
                words = _spell(choice) + (" (scene)" if choice in own else "")
                effect = None if choice in own else self._effects.get(choice)
                lines.append(_line(fill("<label>{} {}</label>", radio, words), effect))
        lines.append(_line("all choices together", self._effects.get("all")))
        back = button("Back to the scene's", "conventions:own", disabled=in_force == own)
        return join((
            tag("table", join(lines), class_="ws-choices-table"), tag("p", NOTE, class_="ws-tiny"),
            self._reference(state), tag("div", back, class_="ws-actions"), self._wrong(),
        ))  # fmt: skip

    def _reference(self, state: AppState) -> Markup:
        held, middle = state.scene.reference, state.scene.workspace.positions
        if held is None:
            return EMPTY
        boxes: list[Markup] = []
        for axis in reference_spans(state.scene):
            name, at = f"conventions:set.{axis}", held.get(axis, middle.get(axis, 0.0))
            unit = state.scene.machine.axes[axis].unit
            boxes.append(field(f"Held at {axis}", text_box(name, f"{at:g}", size="short"), name,
                               unit))  # fmt: skip
        waits = self.context.next_click is not None
        pick = button("Click a point of the box …" if waits else "Pick it in the drawing",
                      "conventions:pick", pressed=waits)  # fmt: skip
        return join((*boxes, tag("div", pick, class_="ws-actions")))

    def _wrong(self) -> Markup:
        lines: list[Markup] = []
        for group, members in groupby(self._costs, lambda cost: cost.choice.partition("=")[0]):
            title, hint = COST_GROUPS[group]
            lines.append(fill('<tr><th colspan="3"><b>{}</b> {}</th></tr>', title, hint))
            lines += [_line(COST_WORDS[cost.choice], cost) for cost in members]
        summary = tag("summary", "If the data were measured in another convention")
        note = tag("p", COST_NOTE, class_="ws-tiny")
        return tag("details", summary + note + tag("table", join(lines)), class_="ws-options")

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Choose a convention or a reference point."""
        if word == "choose":
            return with_choice(state, value)
        if word == "own":
            return replace(with_own_conventions(state), loop=state.loop)
        if word == "pick":
            self.context.act(self._toggle_picking)
        axis = word.removeprefix("set.")
        if axis in reference_spans(state.scene) and state.scene.reference is not None:
            typed = read_typed(value, state.scene.machine.axes[axis].unit)
            return state if typed is None else with_reference(state, {axis: typed})
        return state

    def _toggle_picking(self) -> None:
        self._wait(waiting=self.context.next_click is None)

    def _wait(self, *, waiting: bool) -> None:
        self.context.next_click = self._choose if waiting else None
        self.context.renew(self)

    def _choose(self, picked: Picked) -> None:
        self._wait(waiting=False)
        self.context.post(lambda state: with_reference(state, picked.at))


def _line(words: object, effect: Effect | None) -> Markup:
    cells = ("–", "–") if effect is None else (number(effect.mean_um), number(effect.max_um))
    return fill('<tr><td>{}</td><td class="number">{}</td><td class="number">{}</td></tr>',
                words, *cells)  # fmt: skip
