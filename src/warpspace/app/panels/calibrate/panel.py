"""The calibrate panel: readings, what is looked for, the fit beside the session, its outcome."""

import threading
from functools import partial
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.documents.scene_list import dropped_words
from warpspace.app.evaluation.calibration import (
    LONGEST_KEYS,
    Answer,
    Question,
    answer,
    ask,
    calibrated_state,
    is_applied,
    with_calibrated_beside,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.calibrate.files import ReadingsPart
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.calibration import arrows_of, calibration_html
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers.residuals import ResidualsLayer
from warpspace.calibration.terms import AUTO

NAME, USUAL_S = "Calibrating", 4.0
NO_ARROWS, ARROWS_BEFORE, ARROWS_AFTER = "none", "before", "after"
NONE_LEFT = "No arrows: none of these readings is a vector."
TURNED = "No arrows: a rotary axis carries the workpiece, which the box does not turn with."


class CalibratePanel:
    """Readings, parameters to find, and the calibrated machine.

    Nothing of the state is changed but by Compare and Apply.

    Parameters
    ----------
    context : PanelContext
    """

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._answer: Answer | None = None
        self._doing = ""
        self._layer = ResidualsLayer(context.client.scene)
        self._size_mm = 0.0
        self._readings = ReadingsPart(context, self._write)
        self._keys: Input[str] = Input(
            gui.add_text(
                "Parameters to find",
                AUTO,
                hint="auto: those that the readings can show. Or keys such as"
                " EX0B, EZB, EYX:ramp; :ramp and :constant choose the curve.",
            ),
            lambda: context.act(self._write),
        )
        self._robust: Input[bool] = Input(
            gui.add_checkbox("Robust", False, hint="Let readings far off count less."),
            lambda: context.act(self._write),
        )
        self._start: Any = gui.add_button(
            "Fit", hint="Find the errors in the readings. It runs beside the page."
        )
        self._start.on_click(lambda _: context.act(self._fit))
        self._job = JobPart(
            context,
            lambda _, words: context.act(partial(self._say, words)),
            "Give it up; what was shown stays.",
            lambda _: self._doing,
            kept="What was shown stays.",
        )
        self._clicks = Clicks(gui, lambda word: context.act(partial(self._do, word)))
        self._arrows: Input[str] = Input(
            gui.add_dropdown(
                "Residual arrows in the box",
                (NO_ARROWS, ARROWS_BEFORE, ARROWS_AFTER),
                visible=False,
                hint="Observed − predicted at each reading, exaggerated; the factor is shown. The"
                " box is drawn as lines meanwhile.",
            ),
            lambda: context.act(self._choose_arrows),
        )
        self._text = Handle(gui.add_html("", visible=False))

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here; clicks post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing that must follow at once."""

    def settle(self, picture: LivePicture) -> None:
        """Say so where the outcome is no longer that of what is shown."""
        self._size_mm = picture.size_mm
        self._write(picture.state)

    def _ask(self, state: AppState) -> Question:
        """Give what would be fitted now."""
        keys = str(self._keys.handle.value)[: LONGEST_KEYS + 1]
        robust = bool(self._robust.handle.value)
        return ask(state, self._readings.files, keys, robust=robust)

    def _fit(self) -> None:
        """Start the work."""
        question = self._ask(self._context.store.state)
        if not question.files:
            self._say("There are no readings yet: add a file, or choose bundled ones.")
            return
        self._readings.say("")

        def tell(words: str) -> None:
            self._doing = words

        def work(cancelled: threading.Event) -> None:
            found = answer(question, cancelled, tell)
            if not cancelled.is_set():
                self._context.act(partial(self._take, found))

        self._doing = ""
        if not self._job.start(NAME, work, USUAL_S):
            self._context.notify("Busy", "Readings are being fitted already.", "gray")

    def _take(self, found: Answer) -> None:
        """Show an answer."""
        self._answer = found
        self._readings.note_fit()
        self._write()

    def _do(self, word: str) -> None:
        """Compare or apply; the word comes from a browser and may be anything."""
        given, state = self._answer, self._context.store.state
        if given is None or self._standing(state, given) != "current":
            return
        if word == "compare":
            self._context.post(lambda now: with_calibrated_beside(now, given))
        elif word == "apply":
            dropped = self._context.show_opened(calibrated_state(state, given), None)
            if dropped:
                self._context.notify("Scenes", dropped_words(dropped), "gray")

    def _standing(self, state: AppState, given: Answer) -> str:
        """Tell whether an answer is that of what is shown."""
        asked = self._ask(state)
        if asked == given.question:
            return "current"
        same = (asked.files, asked.keys, asked.robust)
        of = (given.question.files, given.question.keys, given.question.robust)
        return "applied" if same == of and is_applied(state, given) else "stale"

    def _write(self, state: AppState | None = None) -> None:
        """Write the outcome; what is the same already is not sent."""
        given = self._answer
        if given is None:
            return
        standing = self._standing(state or self._context.store.state, given)
        if not self._arrows.handle.visible:
            self._arrows.handle.visible = True
        words = self._draw_arrows(given, standing)
        self._text.put(
            content=calibration_html(given, standing, self._clicks.button, words), visible=True
        )
        self._context.client.flush()

    def _choose_arrows(self) -> None:
        """Draw arrows, or none; a closed surface would hide them."""
        inside = str(self._arrows.handle.value) != NO_ARROWS
        self._context.post(partial(edits.with_sight, inside=inside))
        self._write()

    def _draw_arrows(self, given: Answer, standing: str) -> str:
        """Draw what the fit leaves where that is chosen; say with which factor."""
        chosen = str(self._arrows.handle.value)
        if chosen not in (ARROWS_BEFORE, ARROWS_AFTER) or standing == "stale":
            self._layer.hide()
            return ""
        if any(not axis.is_linear for axis in given.found.scene.machine.branch("workpiece")):
            self._layer.hide()
            return TURNED
        before = chosen == ARROWS_BEFORE
        factor = self._layer.show(
            *arrows_of(given, before=before), size_mm=self._size_mm, before=before
        )
        return f"Arrows in the box: residuals {chosen}, × {factor:g}" if factor else NONE_LEFT

    def _say(self, problem: str) -> None:
        """Say what went wrong; the outcome of before stays."""
        self._readings.say(problem)
        self._context.client.flush()
