"""The machine tab: its bodies, where its axes stand, whether they are deformed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Handle, Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine import machine_positions, standing
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.places import tool_point_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import linear_positions, linear_spans
from warpspace.bodies.own_meshes import check_meshes
from warpspace.scene.model import Scene

SWITCHES = {
    "ghost": (
        "Ghost of the machine",
        "The bodies, nearly transparent, around the working volume; the button on the drawing too.",
    ),
    "shown": (
        "Machine bodies",
        "A schematic of the machine around the working volume, in true proportions.",
    ),
    "bent": (
        "Bodies deformed by the errors",
        "Every body takes the errors before it, with the exaggeration of the box. Off: nominal.",
    ),
}
OPEN_MESH = "The surface of a mesh of this machine is not closed; it is drawn as it is."


class MachinePanel:
    """Switches and a slider per axis."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context = context
        self._switches: dict[str, Input[bool]] = {
            name: Input(
                context.gui.add_checkbox(
                    text, initial_value=getattr(state.machine, name), hint=hint
                ),
                context.changed,
            )
            for name, (text, hint) in SWITCHES.items()
        }
        self._place = Handle(context.gui.add_html(""))
        self._note: Any = context.gui.add_markdown(OPEN_MESH, visible=False)
        self._home: Any = context.gui.add_folder("Axis positions")
        self._built_for: Scene | None = None
        self._sliders: dict[str, Any] = {}
        self._linear: dict[str, Input[float]] = {}
        self._rotary: dict[str, Input[float]] = {}
        self._state = state
        self._build(state)
        if context.stage is not None:
            context.stage.listen(self._follow)

    def _follow(self, turned: Mapping[str, float]) -> None:
        for axis, bound in self._rotary.items():
            at = turned.get(axis, self._state.positions.get(axis))
            if at is not None:
                bound.show(float(round(at)) if axis in turned else at)

    def _build(self, state: AppState) -> None:
        for slider in self._sliders.values():
            slider.remove()
        self._built_for = state.scene
        linear = linear_positions(state.scene, state.machine)
        spans = {**linear_spans(state.scene), **state.position_spans}
        with self._home:
            self._sliders = {
                axis: self._context.gui.add_slider(
                    f"Machine {axis} [{state.scene.machine.axes[axis].unit}]",
                    min=span.low,
                    max=span.high,
                    step=span.step,
                    initial_value=linear.get(axis, state.positions.get(axis, 0.0)),
                    hint=f"Where {axis} stands: moves the bodies and the tool point."
                    + ("" if axis in linear else " The working volume is drawn for it too."),
                )
                for axis, span in spans.items()
            }
        bound = {axis: Input[float](s, self._context.changed) for axis, s in self._sliders.items()}
        self._linear = {axis: b for axis, b in bound.items() if axis in linear}
        self._rotary = {axis: b for axis, b in bound.items() if axis not in linear}

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has moved."""
        machine, spans = state.machine, linear_spans(state.scene)
        for name, switch in self._switches.items():
            on = switch.poll()
            if on is not None:
                machine = machine.switched(**{name: on})
        for axis, bound in self._linear.items():
            value = bound.poll()
            if value is not None and axis in spans:
                machine = machine.with_linear(axis, value, spans[axis])
        if machine is not state.machine:
            state = replace(state, machine=machine)
        for axis, bound in self._rotary.items():
            value = bound.poll()
            if value is not None:
                state = state.with_position(axis, value)
        return state

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        state = picture.state
        return Identity(state.scene), Identity(state.machine), Identity(state.positions)

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the state."""
        state = self._state = picture.state
        before = self._built_for
        if before is None or (before.machine, before.workspace) != (
            state.scene.machine,
            state.scene.workspace,
        ):
            self._build(state)
        self._place.put(content=tool_point_html(*standing(state, machine_positions(state))))
        for name, switch in self._switches.items():
            switch.show(getattr(state.machine, name))
        self._note.visible = state.machine.shown and bool(check_meshes(state.scene.machine))
        for axis, value in linear_positions(state.scene, state.machine).items():
            if axis in self._linear:
                self._linear[axis].show(value)
        for axis, bound in self._rotary.items():
            if axis in state.positions:
                bound.show(state.positions[axis])
