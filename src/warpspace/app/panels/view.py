"""The view panel: scene, exaggeration, component, loop, density, rotary positions, switches."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Handle, Input
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.documents.scene_file import dropped_words
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.conventions import with_travel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.help import about_scene
from warpspace.app.state.app_state import EXAGGERATION, NODES, TRUE_SCALE, AppState
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import DIRECTION_WORDS, TravelDirection
from warpspace.scene.model import Scene

# --- What the view panel calls things, and which value each name stands for -----------------------

COMPONENT_NAMES = {
    "position": {"norm": "|E| length", "x": "E_x", "y": "E_y", "z": "E_z"},
    "orientation": {
        "norm": "|φ| tilt of the tool axis",
        "x": "φ_x tilt about x",
        "y": "φ_y tilt about y",
        "z": "φ_z tilt about z",
    },
}
"""What the components are called, for each quantity that can be coloured."""
LOOP_NAMES = {
    Loop.TOOL.value: "tool point",
    Loop.WORKPIECE.value: "workpiece point",
    Loop.RELATIVE.value: "tool relative to workpiece",
}
SWITCHES = {
    "traces": ("Rotary traces", "Circles and arcs of the table: nominal light, actual dark."),
    "ghost": ("Nominal box", "The working volume without errors, dashed."),
    "grid_lines": ("Grid lines", "Lines of the grid on the deformed box."),
    "axes": ("Axes", "Coordinates of the machine in mm."),
    "dark": ("Dark mode", "Light lines on a dark ground; the colours of the map stay."),
}


class Names:
    """Words shown for the values of a dropdown, both ways."""

    def __init__(self, shown: Mapping[str, str]) -> None:
        self._shown = dict(shown)
        self._value = {text: value for value, text in shown.items()}

    @property
    def options(self) -> tuple[str, ...]:
        """All words."""
        return tuple(self._value)

    def text(self, value: str) -> str:
        """Give the words for a value."""
        return self._shown.get(value, value)

    def value(self, text: str) -> str:
        """Give the value that words stand for."""
        return self._value.get(text, text)


def component_of(text: str) -> str:
    """Give the component that a name stands for, whatever is coloured meanwhile; else the text."""
    for names in COMPONENT_NAMES.values():
        for component, name in names.items():
            if name == text:
                return component
    return text


UNSEEN = "position:absolute!important;width:1px!important;overflow:hidden;clip-path:inset(50%)"
"""Style of what only screen readers are to find."""


class ViewPanel:
    """How the field is looked at."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, self._scenes = context, context.scenes
        gui, changed = context.gui, context.changed
        self._known, self._title = state.origin, self._scenes.add(state.origin)[0]
        self._scene: Input[str] = Input(
            gui.add_dropdown(
                "Scene",
                tuple(self._scenes),
                initial_value=self._title,
                hint="Machine and error set. Changes made to the errors are lost.",
            ),
            changed,
        )
        self._about = Handle(gui.add_html(""))
        self._add_exaggeration(state)
        names = COMPONENT_NAMES[state.look.quantity]
        self._component: Input[str] = Input(
            gui.add_dropdown(
                "Component",
                tuple(names.values()),
                initial_value=names[state.component],
                hint="What the colours mean: the length or one signed component of the quantity"
                " chosen below.",
            ),
            changed,
        )
        self._loops = Names(LOOP_NAMES)
        self._loop: Input[str] = Input(
            gui.add_dropdown(
                "Structural loop",
                self._loops.options,
                initial_value=self._loops.text(state.loop),
                hint="Structural loop: whose error deforms the box.",
            ),
            changed,
        )
        self._placed: Input[bool] = Input(
            gui.add_checkbox(
                "Placement fitted out",
                initial_value=state.placed,
                visible=state.loop is Loop.RELATIVE,
                hint="Leave out where the workpiece lies, which nobody sees on a part: three shifts"
                " and three small rotations, fitted over the working volume.",
            ),
            changed,
        )
        self._ways = Names({str(way): words for way, words in DIRECTION_WORDS.items()})
        self._way: Input[str] = Input(
            gui.add_dropdown(
                "Direction of travel",
                self._ways.options,
                initial_value=self._ways.text(state.scene.model.direction),
                visible=_has_directions(state),
                hint="Of errors that depend on it. The reversal is what is left when each position"
                " is reached from both sides.",
            ),
            changed,
        )
        self._nodes: Input[float] = Input(
            gui.add_slider(
                "Grid density [nodes per axis]",
                min=NODES.low,
                max=NODES.high,
                step=NODES.step,
                initial_value=float(state.nodes),
                hint="Nodes along X, Y and Z at which the error is computed.",
            ),
            changed,
        )
        self._home: Any = gui.add_folder(None)
        self._add_positions(state)
        self._switches: dict[str, Input[bool]] = {
            name: Input(
                gui.add_checkbox(text, initial_value=getattr(state.shown, name), hint=hint), changed
            )
            for name, (text, hint) in SWITCHES.items()
        }

    def _add_exaggeration(self, state: AppState) -> None:
        gui, context = self._context.gui, self._context
        start = state.exaggeration or TRUE_SCALE  # the slider begins at true scale
        self._exaggeration: Input[float] = Input(
            gui.add_number(
                "Exaggeration ×",
                initial_value=float(start),
                min=EXAGGERATION.low,
                max=EXAGGERATION.high,
                step=1.0,
                hint="How much larger than true the errors are drawn, 0.001 to 1 000 000.",
            ),
            context.changed,
        )
        top = math.log10(EXAGGERATION.high)
        self._log: Input[float] = Input(
            gui.add_slider(
                "Exaggeration, logarithmic",
                min=0.0,
                max=top,
                step=0.01,
                initial_value=max(math.log10(start), 0.0),
                marks=((0.0, "×1"), (2.0, "×100"), (4.0, "×10 000"), (top, "×10⁶")),
                hint="How much larger than true the errors are drawn; each mark is 100 times the"
                " one before.",
            ),
            context.changed,
        )
        buttons = gui.add_button_group(
            "Exaggeration, auto or true",
            ("Auto", "True scale"),
            hint="Auto: a round number that makes the largest error a tenth of the box.",
        )
        # its own number box would show the logarithm
        gui.add_html(
            f"<style>[id='{dom_id(self._log.handle)}'] ~ .mantine-NumberInput-root"
            "{display:none}"
            # the last mark is not cut off
            f"[id='{dom_id(self._log.handle)}']{{margin-right:14px}}"
            # one control with one name: only screen readers need that of each part
            f"div:has(> p > :is(label[for='{dom_id(self._log.handle)}'],"
            f"label[for='{dom_id(buttons)}'])){{{UNSEEN}}}"
            f"div:has(> div > p > label[for='{dom_id(buttons)}']){{padding-top:10px}}</style>"
        )
        choices = {"Auto": None, "True scale": TRUE_SCALE}

        def choose(name: str) -> None:
            context.post(lambda s: s.with_exaggeration(choices[name]))

        buttons.on_click(lambda event: choose(event.target.value))

    def _add_positions(self, state: AppState) -> None:
        gui = self._context.gui
        self._built_for = (Identity(state.origin), state.position_spans)
        with self._home:
            self._folder: Any = gui.add_folder("Rotary positions", visible=bool(state.positions))
        self._positions: dict[str, Input[float]] = {}
        with self._folder:
            for axis, value in state.positions.items():
                span = state.position_spans[axis]
                slider = gui.add_slider(
                    f"{axis} [°]",
                    min=span.low,
                    max=span.high,
                    step=span.step,
                    initial_value=value,
                    hint=f"Where the {axis} axis stands while the working volume is traversed.",
                )
                self._positions[axis] = Input(slider, self._context.changed)

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen."""
        title = self._scene.poll()
        if title is not None and title in self._scenes:
            state = state.with_scene(self._scenes[title])
        exaggeration, log = self._exaggeration.poll(), self._log.poll()
        if exaggeration is not None:
            state = state.with_exaggeration(exaggeration)
        elif log is not None:
            state = state.with_exaggeration(_from_log(log))
        component, loop, nodes = self._component.poll(), self._loop.poll(), self._nodes.poll()
        way, placed = self._way.poll(), self._placed.poll()
        if component is not None:
            state = state.with_component(component_of(component))
        if loop is not None:
            state = state.with_loop(self._loops.value(loop))
        if placed is not None:
            state = replace(state, placed=placed)
        if way is not None:
            state = with_travel(state, self._ways.value(way))
        if nodes is not None:
            state = state.with_nodes(nodes)
        for axis, bound in self._positions.items():
            position = bound.poll()
            if position is not None:
                state = state.with_position(axis, position)
        for name, bound in self._switches.items():
            on = bound.poll()
            if on is not None:
                state = state.with_shown(**{name: on})
        return state

    def _know(self, scene: Scene) -> None:
        if scene is self._known:
            return
        self._known, (self._title, dropped) = scene, self._scenes.add(scene)
        options = tuple(self._scenes)
        if options != tuple(self._scene.handle.options):
            self._scene.handle.options = options
        if dropped:
            self._context.notify("Scenes", dropped_words(dropped), "gray")

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        state = picture.state
        return (
            Identity(state.origin),
            picture.exaggeration,
            (state.component, state.look.quantity, state.loop, state.nodes, state.shown),
            state.placed,
            (state.scene.model.direction, _has_directions(state)),
            Identity(state.positions),
            Identity(state.position_spans),
        )

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the state."""
        state = picture.state
        if (Identity(state.origin), state.position_spans) != self._built_for:
            self._folder.remove()
            self._add_positions(state)
        self._know(state.origin)
        self._scene.show(self._title)
        self._about.put(content=about_scene(state.origin.description))
        self._exaggeration.show(float(f"{picture.exaggeration:.4g}"))
        self._log.show(max(round(math.log10(picture.exaggeration), 2), 0.0))
        self._show_component(state)
        self._loop.show(self._loops.text(state.loop))
        self._placed.show(state.placed)
        if self._placed.handle.visible != (state.loop is Loop.RELATIVE):
            self._placed.handle.visible = state.loop is Loop.RELATIVE
        self._way.show(self._ways.text(state.scene.model.direction))
        if self._way.handle.visible != _has_directions(state):
            self._way.handle.visible = _has_directions(state)
        self._nodes.show(float(state.nodes))
        for axis, bound in self._positions.items():
            bound.show(state.positions[axis])
        for name, bound in self._switches.items():
            bound.show(getattr(state.shown, name))

    def _show_component(self, state: AppState) -> None:
        names = COMPONENT_NAMES[state.look.quantity]
        options, dropdown = tuple(names.values()), self._component.handle
        if dropdown.options != options:
            dropdown.options = options
        self._component.show(names[state.component])


def _has_directions(state: AppState) -> bool:
    scene = state.scene
    return scene.errors.has_directions or scene.model.direction != TravelDirection.MEAN


def _from_log(log: float) -> float:
    """Turn a slider position into an exaggeration of at most three digits; NaN stays NaN."""
    if math.isnan(log):
        return math.nan
    return float(f"{10.0 ** min(max(log, -1.0), 300.0):.3g}")
