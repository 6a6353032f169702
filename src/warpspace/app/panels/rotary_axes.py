"""The tab "Rotary axes": play, one trace as polar plots, all of them in numbers."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.rotation import chosen_trace, motion_of, moved_traces, played_axis
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.html import message
from warpspace.app.readouts.rotary_axes import circle_rows, circle_table, no_motion, polar_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.look import parse_positions, quarters
from warpspace.machine.description import Vector
from warpspace.scene.model import Scene

NONE_MOVED = "none is moved"
CHOSEN_HINT = "The trace in colour, with its name; the others are faint."
STAND_HINT = "Have the axis stand where the rotation is paused; undo takes it back."


class RotaryAxesPanel:
    """Play, the chosen trace and its polar plots, points, positions and the table of deviations."""

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
        self._stand: Any = gui.add_button(
            "Stand here", color="gray", visible=False, hint=STAND_HINT
        )
        self._stand.on_click(lambda _: context.act(self._stand_here))
        self._angle: Any = gui.add_html("")
        self._chosen: Input[str] = Input(
            gui.add_dropdown("Trace", (NONE_MOVED,), visible=False, hint=CHOSEN_HINT),
            context.changed,
        )
        self._names: tuple[str, ...] = (NONE_MOVED,)
        self._polar: Any = gui.add_html("")
        self._home: Any = gui.add_folder("Traced points", expand_by_default=False)
        self._scene: Scene | None = None
        self._parts: list[Any] = []
        self._points: list[Input[bool]] = []
        self._held: dict[str, Input[str]] = {}
        self._build(state)
        self._table: Any = gui.add_html("")
        self._written = ""
        self._drawn = ""
        self._position: dict[str, float] = {}
        if self._stage is not None:
            self._stage.listen(self._write_position)

    def _toggle(self) -> None:
        self._playing = not self._playing
        self._play(on=self._playing)
        self._name_button()

    def _stop(self) -> None:
        self._playing = False
        self._play(on=None)
        self._name_button()

    def _play(self, *, on: bool | None) -> None:
        if self._stage is not None:
            self._stage.play(on)

    def _stand_here(self) -> None:
        for axis, value in self._position.items():
            at = float(round(value))
            self._context.post(lambda state, axis=axis, at=at: state.with_position(axis, at))

    def _write_position(self, position: Mapping[str, float]) -> None:
        self._position = dict(position)
        text = ", ".join(f"{axis} = {value:.0f}°" for axis, value in position.items())
        self._angle.content = message(text, "turning") if text else ""
        if not position and self._playing:
            self._playing = False
        self._name_button()

    def _name_button(self) -> None:
        """Say what a click would do."""
        label = "Pause rotation" if self._playing else "Play rotation"
        if label != self._button.label:
            self._button.label = label
        paused = bool(self._position) and not self._playing
        if paused != self._stand.visible:
            self._stand.visible = paused

    def _build(self, state: AppState) -> None:
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
        name = self._chosen.poll()
        if name is not None and name != NONE_MOVED:
            rotary = rotary.with_chosen(name)
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
        """Write the polar plots and the table of deviations."""
        moved = moved_traces(picture)
        name = chosen_trace(picture, moved)
        self._offer(tuple(moved) or (NONE_MOVED,), name or NONE_MOVED)
        motion = motion_of(picture, moved[name]) if name else None
        shown = picture.state.shown.traces
        drawn = polar_html(motion, name) if motion else no_motion(shown=shown, nominal=not moved)
        if drawn != self._drawn:
            self._drawn = drawn
            self._polar.content = drawn
        written = circle_table(circle_rows(picture)) if moved else ""
        if written != self._written:
            self._written = written
            self._table.content = written

    def _offer(self, names: tuple[str, ...], chosen: str) -> None:
        handle = self._chosen.handle
        if names != self._names:
            self._names = names
            handle.options = names
            handle.visible = names != (NONE_MOVED,)
            if handle.value != chosen:  # viser has taken the first
                handle.value = chosen
        self._chosen.show(chosen)


def _at_quarters(state: AppState) -> AppState:
    axis = played_axis(state)
    if axis is None:
        return state
    return replace(state, rotary=state.rotary.with_held(axis, quarters(state.scene, axis)))


def _spell(state: AppState, axis: str) -> str:
    return ", ".join(f"{value:g}" for value in dict(state.rotary.held).get(axis, ()))
