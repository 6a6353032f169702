"""The tab "Calibrate": the errors of the machine out of readings."""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.browser.page import error_words
from warpspace.app.documents.files import safe_name, upload_text
from warpspace.app.documents.scene_file import dropped_words
from warpspace.app.evaluation.calibration import (
    LONGEST_KEYS,
    MOST_FILES,
    Answer,
    Measured,
    Question,
    answer,
    ask,
    bundled,
    calibrated_state,
    is_applied,
    take,
    with_calibrated_beside,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.resulting_scene import scene_of
from warpspace.app.panels.context import PanelContext
from warpspace.app.panels.job_part import JobPart, add_upload
from warpspace.app.readouts.calibration import arrows_of, calibration_html, files_html
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers.residuals import ResidualsLayer
from warpspace.calibration.readings import bundled_data
from warpspace.calibration.registry import KINDS, test_kinds
from warpspace.calibration.solve import AUTO
from warpspace.exceptions import WarpspaceError

# --- The readings that are fitted -----------------------------------------------------------------
# Uploaded files and bundled ones, their kind, and their list.

MOST_BYTES = 2 * 2**20
WHAT = "CSV file of readings"
NOT_CHOSEN, BY_COLUMNS = "choose …", "told by its columns"
LONGEST_OPTIONS = 200
EMPTY = (
    "Measured data give the errors of this machine. Add a CSV file of readings (probed sphere"
    " centres, error vectors, lengths, a standard test) or choose bundled ones, then press Fit."
)
READY = "Press Fit: it takes a few seconds and changes nothing yet."


class ReadingsPart:
    """Buttons that add files, and the list of those that are there."""

    def __init__(self, context: PanelContext, changed: Callable[[], None]) -> None:
        gui = context.gui
        self._context, self._changed = context, changed
        self._files: tuple[Measured, ...] = ()
        self._problem = ""
        self._fitted = False
        self._clicks = Clicks(gui, lambda word: context.act(partial(self._do, word)))
        add_upload(
            context,
            "Add readings …",
            self._add_upload,
            self._refuse,
            _spell,
            endings=".csv",
            hint=f"A CSV file with a header, UTF-8, at most 2 MB; up to {MOST_FILES} files.",
            most_bytes=MOST_BYTES,
            what=WHAT,
        )
        self._bundled: Input[str] = Input(
            gui.add_dropdown(
                "Bundled readings",
                (NOT_CHOSEN, *bundled_data()),
                hint="Readings of a real machine that come with warpspace; fork_head_bc is its"
                " scene.",
            ),
            lambda: context.act(self._add_bundled),
        )
        self._kind: Input[str] = Input(
            gui.add_dropdown(
                "Kind of what is added",
                (BY_COLUMNS, *KINDS, *test_kinds()),
                hint="; ".join(f"{kind.name}: {kind.words}" for kind in KINDS.values())
                + "; else a standard test, with its options below.",
            ),
            lambda: context.act(self._show_options),
        )
        self._options: Any = gui.add_text(
            "Options of the test",
            "",
            visible=False,
            hint="Those of its command with colons between, for instance plane=XZ:radius=150.",
        )
        self._text = Handle(gui.add_html(""))
        self._write()

    @property
    def files(self) -> tuple[Measured, ...]:
        """What is to be fitted."""
        return self._files

    def say(self, problem: str) -> None:
        """Say what went wrong; empty for nothing."""
        self._problem = problem
        self._write()

    def note_fit(self) -> None:
        """Take note that a fit has ended well."""
        self._fitted, self._problem = True, ""
        self._write()

    def _show_options(self) -> None:
        visible = str(self._kind.handle.value) in test_kinds()
        if self._options.visible != visible:
            self._options.visible = visible
            self._context.client.flush()

    def _chosen_kind(self) -> str | None:
        kind = str(self._kind.handle.value)
        if kind in KINDS:
            return kind
        if kind not in test_kinds():
            return None
        options = str(self._options.value).strip()[:LONGEST_OPTIONS]
        return f"{kind}:{options}" if options else kind

    def _add_upload(self, name: str, content: bytes) -> None:
        spelled = _spell(name)
        self._add(spelled, lambda: upload_text(content, spelled, MOST_BYTES, WHAT))

    def _add_bundled(self) -> None:
        name = self._bundled.poll()
        self._bundled.show(NOT_CHOSEN)
        if name is not None and name != NOT_CHOSEN:
            self._add(name, lambda: bundled(name))

    def _add(self, name: str, read: Callable[[], str]) -> None:
        scene = scene_of(self._context.store.state)
        try:
            measured = take(scene, read(), name, self._chosen_kind(), self._files)
        except WarpspaceError as error:
            self._refuse(error_words(error))
            return
        self._files = (*self._files, measured)
        self._problem = ""
        self._update()

    def _refuse(self, text: str) -> None:
        """Say why a file was not added."""
        self.say(text)
        self._context.client.flush()

    def _do(self, word: str) -> None:
        verb, _, number = word.partition(" ")
        if verb == "remove" and number in map(str, range(len(self._files))):
            at = int(number)
            self._files = (*self._files[:at], *self._files[at + 1 :])
            self._problem = ""
            self._update()

    def _update(self) -> None:
        self._write()
        self._changed()
        self._context.client.flush()

    def _write(self) -> None:
        """Write the list; what is the same already is not sent."""
        note = ("" if self._fitted else READY) if self._files else EMPTY
        self._text.put(content=files_html(self._files, note, self._problem, self._clicks.button))


def _spell(name: str) -> str:
    return f"{safe_name(name, 'readings')}.csv"


# --- The calibrate panel --------------------------------------------------------------------------
# Readings, what is looked for, the fit beside the session, its outcome.

NAME, USUAL_S = "Calibrating", 4.0
NO_ARROWS, ARROWS_BEFORE, ARROWS_AFTER = "none", "before", "after"
NONE_LEFT = "No arrows: none of these readings is a vector."
TURNED = "No arrows: a rotary axis carries the workpiece, which the box does not turn with."


class CalibratePanel:
    """Readings, parameters to find, and the calibrated machine.

    Nothing of the state is changed but by Compare and Apply.
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
        self._answer = found
        self._readings.note_fit()
        self._write()

    def _do(self, word: str) -> None:
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
        self._readings.say(problem)
        self._context.client.flush()
