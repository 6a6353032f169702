"""The panel "Conventions": what the map is drawn with, and what each choice changes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.conventions import (
    Effect,
    Effects,
    costs_of,
    reference_spans,
    with_choice,
    with_own_conventions,
    with_reference,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.conventions import conventions_html
from warpspace.app.state.app_state import AppState, start_loop
from warpspace.app.state.picked import Picked

PICKING = "Click a point of the box …"


class ConventionsPanel:
    """Rows to choose from, the reference point in numbers or picked in 3-D, and the way back."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        gui = context.gui
        self._context, self._effects = context, Effects()
        self._known: dict[str, Effect] = {}
        self._costs: tuple[Effect, ...] = ()
        self._asked: AppState | None = None
        self._clicks = Clicks(gui, lambda word: context.post(lambda s: with_choice(s, word)))
        self._text: Any = gui.add_html("")
        self._pick: Any = gui.add_button(
            "Pick the reference in 3-D",
            color="gray",
            hint="The next click on the box chooses the point that is held still.",
        )
        self._pick.on_click(lambda _: context.act(self._toggle_picking))
        self._home: Any = gui.add_folder(None)
        self._built_for: tuple[object, ...] = ()
        self._at: dict[str, Input[float]] = {}
        self._build(state)
        back = gui.add_button(
            "Conventions of the scene", color="gray", hint="Undo all choices made here."
        )
        back.on_click(lambda _: context.post(_back))

    def _build(self, state: AppState) -> None:
        for bound in self._at.values():
            bound.handle.remove()
        self._at, self._built_for = {}, _axes_of(state)
        middle = state.scene.workspace.positions
        with self._home:
            for axis, span in reference_spans(state.scene).items():
                box = self._context.gui.add_number(
                    f"Reference {axis} [{state.scene.machine.axes[axis].unit}]",
                    initial_value=float((state.scene.reference or middle).get(axis, 0.0)),
                    min=span.low,
                    max=span.high,
                    step=1.0,
                    hint="Position of the axis at the point that is held still.",
                )
                self._at[axis] = Input(box, self._context.changed)

    def _toggle_picking(self) -> None:
        """Take the next click on the box for the reference, or do not any more."""
        self._wait(self._choose if self._context.next_click is None else None)

    def _choose(self, picked: Picked) -> None:
        self._wait(None)
        self._context.post(lambda state: with_reference(state, picked.at))

    def _wait(self, choose: Callable[[Picked], None] | None) -> None:
        self._context.next_click = choose
        self._pick.label = "Pick the reference in 3-D" if choose is None else PICKING

    def read(self, state: AppState) -> AppState:
        """Take over a reference point that was typed."""
        typed = {axis: value for axis, b in self._at.items() if (value := b.poll()) is not None}
        return with_reference(state, typed) if typed else state

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what is in force."""
        state = picture.state
        return (
            Identity(state.origin),
            Identity(state.scene.model),
            Identity(state.scene.workspace),
            state.scene.reference,
            state.seen,
            state.nodes,
        )

    def show(self, picture: LivePicture) -> None:
        """Show what is in force; the effects follow when changes pause."""
        state = picture.state
        if _axes_of(state) != self._built_for:
            self._known, self._costs = {}, ()
            self._build(state)
        reference = state.scene.reference
        if reference is not None:
            for axis, bound in self._at.items():
                bound.show(float(reference.get(axis, bound.handle.value)))
        self._write(state)

    def rest(self, picture: LivePicture) -> None:
        """Have it worked out what every choice changes: slow, so that other tabs need not wait."""
        waiting, self._asked = self._asked is not None, picture.state
        if not waiting:
            self._context.act(self._work_out)

    def _work_out(self) -> None:
        state, self._asked = self._asked, None
        if state is None:
            return
        known, costs = self._effects.of(state), costs_of(state)
        if (known, costs) != (self._known, self._costs):
            self._known, self._costs = known, costs
            self._write(state)

    def _write(self, state: AppState) -> None:
        content = conventions_html(state, self._known, self._clicks.attributes, self._costs)
        if content != self._text.content:
            self._text.content = content


def _axes_of(state: AppState) -> tuple[object, ...]:
    return Identity(state.origin), reference_spans(state.scene)


def _back(state: AppState) -> AppState:
    return replace(with_own_conventions(state), loop=start_loop(state.origin))
