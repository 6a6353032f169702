"""The tab "Compensate": a table for the control, and the error that it leaves."""

import base64
import io
import threading
import zipfile
from collections.abc import Callable
from functools import partial
from typing import Any

from warpspace.app.browser.handles import Handle, Input
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
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.compensation import box_words, compensation_html, note_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.compensation_choice import (
    LONGEST_POINTS,
    LOOP_WORDS,
    RESOLUTIONS,
    SIGN_WORDS,
    CompensationChoice,
    format_titles,
    has_place_for_tilt,
    is_table,
)
from warpspace.formats.compensation.compensate import Compensation

# --- The files of a compensation as one download --------------------------------------------------

STEM = "compensation"
DATE = (1980, 1, 1, 0, 0, 0)  # the same table gives the same bytes


def packed(found: Compensation) -> tuple[str, bytes]:
    """Give name and content of what is saved: the file of the table, or a ZIP of several."""
    ending = found.format.endings[0]
    files = {f"{STEM}{add or ending}": text.encode("utf-8") for add, text in found.files.items()}
    if len(files) == 1:
        return next(iter(files.items()))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in files.items():
            bundle.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    return f"{STEM}.zip", buffer.getvalue()


# --------------------------------------------------------------------------------------------------
# The widgets that say which table is wanted; those that a format has no use for are hidden.


class WantedPart:
    """Format, points, resolution, sign, loop and orientation."""

    def __init__(self, context: PanelContext, changed: Callable[[], None]) -> None:
        gui = context.gui
        self._titles = format_titles()

        def note() -> None:
            context.act(changed)

        self._format: Input[str] = Input(
            gui.add_dropdown(
                "Table",
                tuple(self._titles),
                hint="What your control reads. `warpspace import --formats` says what each holds.",
            ),
            note,
        )
        self._points: Input[str] = Input(
            gui.add_text(
                "Points per axis",
                "",
                hint="A number, or X=9,Y=5; empty for what suits the table.",
            ),
            note,
        )
        self._resolution: Input[float] = Input(
            gui.add_number(
                "Resolution [mm]",
                0.0,
                min=RESOLUTIONS.low,
                max=RESOLUTIONS.high,
                step=RESOLUTIONS.step,
                hint="Smallest step of a value (degrees for rotary axes); of fanuc-3d the detection"
                " unit. 0: that of the table.",
            ),
            note,
        )
        self._sign: Input[str] = Input(
            gui.add_dropdown(
                "Sign of the numbers",
                tuple(SIGN_WORDS),
                hint="Error: the control takes the numbers back. Correction: it adds them.",
            ),
            note,
        )
        self._loop: Input[str] = Input(
            gui.add_dropdown(
                "Loop corrected",
                tuple(LOOP_WORDS),
                hint="Suits: relative where a linear axis carries the workpiece, or where all"
                " rotary axes that correct the orientation do; else tool.",
            ),
            note,
        )
        self._orientation: Input[bool] = Input(
            gui.add_checkbox(
                "Correct the tool orientation",
                False,
                hint="Rotary axes take back the tilt of the tool axis, as far as they can.",
            ),
            note,
        )

    def choice(self, state: AppState) -> CompensationChoice:
        """Give what is wanted, clamped; what is hidden counts as not given."""
        title = str(self._format.handle.value)
        name = self._titles.get(title, next(iter(self._titles.values())))
        table, tilts = is_table(name), has_place_for_tilt(name, state.scene.machine)
        sign = SIGN_WORDS.get(str(self._sign.handle.value), "")
        return CompensationChoice(
            name,
            str(self._points.handle.value)[: LONGEST_POINTS + 1],
            RESOLUTIONS.clamp(_number(self._resolution.handle.value), 0.0) if table else 0.0,
            sign if table else "",
            LOOP_WORDS.get(str(self._loop.handle.value), ""),
            bool(self._orientation.handle.value) and tilts,
        )

    def follow(self, state: AppState) -> None:
        """Show what the format and the machine have a use for."""
        name = self._titles.get(str(self._format.handle.value), "")
        table = not name or is_table(name)
        tilts = bool(name) and has_place_for_tilt(name, state.scene.machine)
        for one, visible in (
            (self._resolution, table),
            (self._sign, table),
            (self._orientation, tilts),
        ):
            if one.handle.visible != visible:
                one.handle.visible = visible


def _number(value: Any) -> float:
    """Take a number from a browser; what is none is 0."""
    return float(value) if isinstance(value, int | float) else 0.0


# --- The compensate panel -------------------------------------------------------------------------
# A table that is wanted, what it leaves, and the box drawn with it.

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
        self._problem = ""
        self._update()

    def _compute(self) -> None:
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
        box = self._box.poll()
        if box is not None:
            self._post_box(str(box))
            self._update()

    def _post_box(self, box: str) -> None:
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
        if self._answer is not None:
            self._send(*packed(self._answer.found))

    def _save_maps(self) -> None:
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
        self._context.client.send_file_download(name, content, save_immediately=True)
        self._context.client.flush()

    def _say(self, problem: str) -> None:
        for option, word in OPTIONS.items():
            problem = problem.replace(option, word)
        self._problem = problem
        self._update()

    def _update(self) -> None:
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
