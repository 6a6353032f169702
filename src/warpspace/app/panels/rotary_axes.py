"""The table tab: traced points, where the other axes stand, the circles in numbers, play."""

from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.rotation import played_axis
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.circles import circle_rows, circle_table
from warpspace.app.readouts.html import message
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import parse_positions, quarters
from warpspace.machine.description import Vector
from warpspace.scene.model import Scene


class RotaryAxesPanel:
    """Points, positions, play and the table of deviations.

    Parameters
    ----------
    context : PanelContext
    state : AppState
    """

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, self._stage = context, context.stage
        self._playing = False
        gui = context.gui
        self._button = gui.add_button(
            "Play rotation", color="gray", hint="Turn the table; points run along their circles."
        )
        self._button.on_click(lambda _: context.act(self._toggle))
        stop = gui.add_button("Stop", color="gray", hint="Stop, and stand where the axis stands.")
        stop.on_click(lambda _: context.act(self._stop))
        self._angle: Any = gui.add_html("")
        self._home: Any = gui.add_folder("Traced points", expand_by_default=False)
        self._scene: Scene | None = None
        self._parts: list[Any] = []
        self._points: list[Input[bool]] = []
        self._held: dict[str, Input[str]] = {}
        self._build(state)
        self._table: Any = gui.add_html("")
        self._written = ""

    def _toggle(self) -> None:
        """Play or pause."""
        self._playing = not self._playing
        self._play(on=self._playing)
        self._name_button()

    def _stop(self) -> None:
        """Take the rotation back."""
        self._playing = False
        self._play(on=None)
        self._name_button()

    def _play(self, *, on: bool | None) -> None:
        """Play, pause or take back the rotation."""
        if self._stage is not None:
            self._stage.play(on, self._write_position)

    def _write_position(self, position: str) -> None:
        """Write where the played axis is; without a position the play is over."""
        self._angle.content = message(position, "turning") if position else ""
        if not position and self._playing:
            self._playing = False
            self._name_button()

    def _name_button(self) -> None:
        """Say what a click would do."""
        self._button.label = "Pause rotation" if self._playing else "Play rotation"

    def _build(self, state: AppState) -> None:
        """Add what depends on the scene: points and axes."""
        for part in self._parts:
            part.remove()
        self._scene = state.scene
        gui, changed = self._context.gui, self._context.changed
        with self._home:
            boxes = [
                gui.add_checkbox(
                    "Trace (" + ", ".join(f"{value:g}" for value in point) + ") mm",
                    initial_value=number not in state.rotary.off,
                    hint="A point of the scene, in the workpiece frame.",
                )
                for number, point in enumerate(state.scene.trace_points_mm)
            ]
            own = gui.add_checkbox(
                "Trace a point of my own",
                initial_value=state.rotary.own_mm is not None,
                hint="In the workpiece frame, below.",
            )
            point = gui.add_vector3(
                "Own point [mm]",
                initial_value=state.rotary.own_mm or (150.0, 0.0, 100.0),
                hint="x, y and z in the workpiece frame.",
            )
            texts = {
                axis: gui.add_text(
                    f"{axis} held at [°]",
                    initial_value=_spell(state, axis),
                    hint=f"Where {axis} stands while its neighbour turns, with commas between;"
                    " empty for some positions around where it stands now.",
                )
                for axis in state.position_spans
                if len(state.position_spans) > 1
            }
            button = gui.add_button(
                "Hold at every 90°",
                color="gray",
                hint="Turn the first axis with the table at every quarter turn.",
                visible=len(texts) > 1,
            )
        button.on_click(lambda _: self._context.post(_at_quarters))
        self._points = [Input(box, changed) for box in boxes]
        self._own_on: Input[bool] = Input(own, changed)
        self._own: Input[Vector] = Input(point, changed)
        self._held = {axis: Input(text, changed) for axis, text in texts.items()}
        self._parts = [*boxes, own, point, *texts.values(), button]

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has chosen."""
        rotary, notes = state.rotary, state.notes
        for number, bound in enumerate(self._points):
            on = bound.poll()
            if on is not None:
                rotary = rotary.with_point(number, on=on)
        own_on, own = self._own_on.poll(), self._own.poll()
        if own_on is not None or (own is not None and rotary.own_mm is not None):
            keep = own_on if own_on is not None else True
            rotary = rotary.with_own(self._own.handle.value if keep else None)
        for axis, bound in self._held.items():
            text = bound.poll()
            if text is not None and axis in state.position_spans:
                positions, note = parse_positions(text, state.position_spans[axis])
                rotary = rotary.with_held(axis, positions)
                notes = (*notes, f"{axis} held at: {note}") if note else notes
        if rotary == state.rotary and notes == state.notes:
            return state
        return replace(state, rotary=rotary, notes=notes)

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        state = picture.state
        return Identity(state.scene), Identity(state.rotary), Identity(state.positions)

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show the state."""
        state = picture.state
        if self._scene is None or (
            state.scene.trace_points_mm != self._scene.trace_points_mm
            or state.scene.machine is not self._scene.machine
        ):
            self._build(state)
        self._button.visible = played_axis(state) is not None
        for number, bound in enumerate(self._points):
            bound.show(number not in state.rotary.off)
        self._own_on.show(state.rotary.own_mm is not None)
        if state.rotary.own_mm is not None:
            self._own.show(state.rotary.own_mm)
        held = dict(state.rotary.held)
        for axis, bound in self._held.items():
            # what is being typed is left alone as long as it means the same
            span = state.position_spans.get(axis)
            if span and parse_positions(bound.handle.value, span)[0] != held.get(axis, ()):
                bound.show(_spell(state, axis))

    def settle(self, picture: LivePicture) -> None:
        """Write the table of deviations."""
        written = circle_table(circle_rows(picture) if picture.state.shown.traces else [])
        if written != self._written:
            self._written = written
            self._table.content = written


def _at_quarters(state: AppState) -> AppState:
    """Hold the axis next to the point at every quarter turn."""
    axis = played_axis(state)
    if axis is None:
        return state
    return replace(state, rotary=state.rotary.with_held(axis, quarters(state.scene, axis)))


def _spell(state: AppState, axis: str) -> str:
    """Spell the positions that a user holds an axis at; empty for those by default."""
    return ", ".join(f"{value:g}" for value in dict(state.rotary.held).get(axis, ()))
