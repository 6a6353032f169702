"""The compensate panel: a table that is wanted, what it leaves, and the box drawn with it."""

import base64
import threading
from functools import partial
from typing import Any

from warpspace.app.browser.handles import Handle, Input
from warpspace.app.documents.compensation_files import packed
from warpspace.app.documents.services import CompensationRequest
from warpspace.app.evaluation.compensation import (
    BOXES,
    Answer,
    Question,
    answer,
    ask,
    box_of,
    holds_for,
    with_box,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.compensate.wanted import WantedPart
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.compensation import box_words, compensation_html, note_html
from warpspace.app.state.app_state import AppState

COMPUTING, MAPS = "Compensating", "Maps"
USUAL_S, MAPS_S = 3.0, 4.0
OPTIONS = {
    "--grid": "points per axis",
    "--resolution": "resolution",
    "--orientation": "tool orientation",
    "--sign": "sign",
}
"""Options of the command that messages name, as they are called here."""
ELSEWHERE = "This table was computed for another machine: press Compute."


class CompensatePanel:
    """A table for the control, what it leaves, and the box before, after and with what is left.

    The outcome stays until something else is computed; of the state only what the box shows is
    changed.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext, state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._answer: Answer | None = None
        self._picture, self._doing, self._problem = "", "", ""
        self._wanted = WantedPart(context, self._change)
        self._start: Any = gui.add_button(
            "Compute",
            hint="Write the table, read it back as the control does, and evaluate what is left.",
        )
        self._start.on_click(lambda _: context.act(self._compute))
        self._job = JobPart(
            context,
            lambda _, words: context.act(partial(self._say, words)),
            "Give it up; what was shown stays.",
            lambda _: self._doing,
            kept="What was shown stays.",
        )
        self._note = Handle(gui.add_html(""))
        self._box: Input[str] = Input(
            gui.add_dropdown(
                "The box shows",
                BOXES,
                visible=False,
                hint="Before and after: A and B of the tab Compare. What is left: in colours and"
                " with an exaggeration of its own. Sliders move the machine, the table stays.",
            ),
            lambda: context.act(self._choose_box),
        )
        self._text = Handle(gui.add_html("", visible=False))
        self._buttons = {
            "Save table": gui.add_button(
                "Save table", color="gray", visible=False, hint="Several files come as one ZIP."
            ),
            "Save maps (PNG)": gui.add_button(
                "Save maps (PNG)",
                color="gray",
                visible=False,
                hint="One sheet for a report: before, after, and what is left.",
            ),
        }
        self._buttons["Save table"].on_click(lambda _: context.act(self._save))
        self._buttons["Save maps (PNG)"].on_click(lambda _: context.act(self._save_maps))
        self._write(state)

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here; widgets post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Show what the box is drawn with."""
        self._box.show(box_of(picture.state))

    def settle(self, picture: LivePicture) -> None:
        """Say so where the outcome is no longer that of what is shown."""
        self._write(picture.state)

    def _ask(self, state: AppState) -> Question:
        """Give what would be computed now."""
        return ask(state, self._wanted.choice(state))

    def _change(self) -> None:
        """Follow widgets that a browser has changed."""
        self._problem = ""
        self._update()

    def _compute(self) -> None:
        """Start the work."""
        context, draw = self._context, self._context.services.draw_compensation
        state = context.store.state
        question, dark = self._ask(state), state.shown.dark

        def tell(words: str) -> None:
            self._doing = words

        def work(cancelled: threading.Event) -> None:
            found = answer(question, cancelled, tell)
            if cancelled.is_set():
                return
            context.act(partial(self._take, found))
            if draw is not None:
                tell("Drawing the maps …")
                png = draw(CompensationRequest(found.found, dark, narrow=True), cancelled)
                if not cancelled.is_set():
                    context.act(partial(self._take_picture, found, png))

        self._doing = ""
        if not self._job.start(COMPUTING, work, USUAL_S):
            context.notify("Busy", "Wait for what is being made, or cancel it.", "gray")

    def _take(self, found: Answer) -> None:
        """Show an answer; a box that is drawn with a table is drawn with this one from now on."""
        self._answer, self._picture, self._problem = found, "", ""
        box = box_of(self._context.store.state)
        self._post_box(box)
        self._update()

    def _take_picture(self, found: Answer, png: bytes) -> None:
        """Show maps, unless another outcome is shown by now."""
        if found is self._answer:
            self._picture = f"data:image/png;base64,{base64.b64encode(png).decode()}"
            self._update()

    def _choose_box(self) -> None:
        """Draw the box with the table, or without."""
        box = self._box.poll()
        if box is not None:
            self._post_box(str(box))
            self._update()

    def _post_box(self, box: str) -> None:
        """Have the box show something; the word comes from a browser and may be anything."""
        state, given = self._context.store.state, self._answer
        controller = state.controller if given is None else given.found.controller
        if controller is None or box not in BOXES:
            return
        if box != BOXES[0] and not holds_for(state, controller):
            self._problem = ELSEWHERE
            self._box.show(box_of(state))
            return
        self._context.post(lambda now: with_box(now, box, controller))

    def _save(self) -> None:
        """Have the browser save the files of the table."""
        if self._answer is not None:
            self._send(*packed(self._answer.found))

    def _save_maps(self) -> None:
        """Draw the sheet for a report beside the session, and have the browser save it."""
        draw, given = self._context.services.draw_compensation, self._answer
        if draw is None or given is None:
            return
        dark = self._context.store.state.shown.dark

        def work(cancelled: threading.Event) -> None:
            png = draw(CompensationRequest(given.found, dark), cancelled)
            if not cancelled.is_set():
                self._send("compensation.png", png)

        self._doing = "Drawing the maps …"
        if not self._job.start(MAPS, work, MAPS_S):
            self._context.notify("Busy", "Wait for what is being made, or cancel it.", "gray")

    def _send(self, name: str, content: bytes) -> None:
        """Have the browser save a file."""
        self._context.client.send_file_download(name, content, save_immediately=True)
        self._context.client.flush()

    def _say(self, problem: str) -> None:
        """Say what went wrong; the outcome of before stays."""
        for option, word in OPTIONS.items():
            problem = problem.replace(option, word)
        self._problem = problem
        self._update()

    def _update(self) -> None:
        """Show what has changed beside the state."""
        self._write(self._context.store.state)
        self._context.client.flush()

    def _write(self, state: AppState) -> None:
        """Write what is known; what is the same already is not sent."""
        given = self._answer
        self._wanted.follow(state)
        self._note.put(content=note_html(self._problem, known=given is not None))
        visible = given is not None or state.controller is not None
        if self._box.handle.visible != visible:
            self._box.handle.visible = visible
        if given is None:
            return
        current = self._ask(state) == given.question
        words = box_words(state, given.found)
        self._text.put(
            content=compensation_html(given.found, self._picture, words, current=current),
            visible=True,
        )
        drawable = self._context.services.draw_compensation is not None
        for name, button in self._buttons.items():
            shown = drawable or name == "Save table"
            if button.visible != shown:
                button.visible = shown
