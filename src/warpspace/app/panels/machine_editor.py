"""The tab "Machine editor": chain, order, sides and sizes of the machine that is shown."""

import time
from functools import partial
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.cache import Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.machine_edits import UNCHANGED, guide_errors, machine_types, with_word
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.machine_editor import editor_html, types_html
from warpspace.app.state.app_state import AppState

# --- The machine editor: boxes in one piece of HTML, machines to start from in a window -----------

SIZES, OWN = "Sizes of a new machine", "Machine of the scene"
WORDS = {SIZES: "sizes", OWN: "own"}
CHAIN = "chain"


class MachineEditorPanel:
    """Chain, order, sides, offsets, rotations, travels, directions and working volume."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._typed = self._problem = ""
        self._window: Any = None
        self._clicks = Clicks(gui, lambda word: context.act(partial(self._do, word)))
        choose = gui.add_button(
            "Choose a machine …",
            color="gray",
            hint="Machines of the library with their pictures. Each starts with its own scene and"
            " errors; undo goes back.",
        )
        choose.on_click(lambda _: context.act(self._toggle_types))
        self._boxes = Handle(gui.add_html(""))
        self._write(state)
        group = gui.add_button_group(
            "Whole machine",
            tuple(WORDS),
            hint="Sizes of a new machine: offsets, travels, directions and working volume that suit"
            " the chain. Machine of the scene: as it was opened, with the errors of its axes.",
        )
        group.on_click(lambda event: context.act(partial(self._do, WORDS[event.target.value])))

    def _toggle_types(self) -> None:
        opened, self._window = self._window, None
        if opened is not None:
            opened.close()
            return
        gui, present = self._context.gui, self._context.store.state.scene.machine.name
        self._window = gui.add_modal("Machines to start from")
        with self._window:
            gui.add_html(types_html(machine_types(), present, self._clicks.button))
            close = gui.add_button("Close", hint="Close this window and keep the machine.")
            close.on_click(lambda _: self._context.act(self._toggle_types))

    def _do(self, word: str) -> None:
        store, before = self._context.store, self._context.store.state
        notes = store.apply(lambda state: with_word(state, word), at=time.monotonic())
        what, _, typed = word.partition(" ")
        refused = what == CHAIN and bool(notes) and store.state is before
        self._typed, self._problem = (typed, "\n".join(notes)) if refused else ("", "")
        if notes and not refused:
            colour = "yellow" if store.state is not before else "red"
            self._context.notify("Machine", "; ".join(notes), colour)
        if what == "type":
            self._context.scenes.add(store.state.origin)
            if self._window is not None:
                self._toggle_types()
        self._write(store.state)
        self._context.client.flush()

    def read(self, state: AppState) -> AppState:
        """Nothing to take over: what is clicked or typed comes as a word."""
        return state

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the boxes show."""
        scene = picture.state.scene
        return Identity(scene.machine), Identity(scene.workspace), *_guides(picture.state).items()

    def show(self, picture: LivePicture) -> None:
        """Write the boxes; a chain that was refused stays until the machine is another one."""
        self._write(picture.state)

    def _write(self, state: AppState) -> None:
        """Write chain and boxes; what is the same already is not sent."""
        problem = self._problem.removesuffix(f"; {UNCHANGED}")
        text = editor_html(
            state.scene,
            self._clicks.button,
            self._clicks.text_box,
            self._typed,
            problem,
            _guides(state),
        )
        self._boxes.put(content=text)


def _guides(state: AppState) -> dict[str, tuple[float, float] | None]:
    """Give the errors of the guides of each gantry, µm."""
    return {axis: guide_errors(state, axis) for axis in state.scene.machine.gantries}
