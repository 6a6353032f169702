"""The repair panel: what each error does to the whole volume, and which adjustments help most."""

import threading
import time
from collections.abc import Mapping
from functools import partial

from warpspace.analysis.adjusting import Objective
from warpspace.analysis.repair import DEFAULT_LIMIT, RepairResult
from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Handle, Input
from warpspace.app.evaluation.cache import Cache, taken_turn
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.repair import Question, ask, with_preview, with_repair
from warpspace.app.panels import PanelContext
from warpspace.app.readouts.html import message
from warpspace.app.readouts.repair import SEEN, looking_html, repair_html
from warpspace.app.state.app_state import AppState
from warpspace.app.state.ranges import Span
from warpspace.exceptions import WarpspaceError

OBJECTIVES = {
    "RMS of the whole volume": Objective.RMS,
    "largest |E| of the volume": Objective.MAX,
}
ALIGNMENT, ANY = "squareness and alignment", "any error (compensation)"
LIMITS = Span(1.0, 500.0, 1.0)
PAUSE_S = 0.5
"""Pause in the changes after which repairs are looked for: nothing is done during a drag."""
KEPT_BYTES, ANSWER_BYTES = 10_000_000, 100_000
"""All answers that are kept, and about what one takes with its scene."""


ANSWERS: Cache[RepairResult] = Cache(KEPT_BYTES)
"""Answers for all sessions together: pages that show the same ask the same."""


class RepairPanel:
    """Objective, limits, the best sets with their buttons, and every error alone.

    A thread of its own looks for repairs while somebody sees the panel and once changes have
    paused, so that nobody waits for it and no page that does not show it costs anything.
    """

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        gui = context.gui
        self._context = context
        self._clicks = Clicks(gui, self._clicked)
        self._objective: Input[str] = Input(
            gui.add_dropdown(
                "Make smallest", tuple(OBJECTIVES), hint="What the best values are best for."
            ),
            self._choose,
        )
        self._adjustable: Input[str] = Input(
            gui.add_dropdown(
                "Adjustable",
                (ALIGNMENT, ANY),
                hint="Squareness and alignment can be set on the machine; a curve can be"
                " compensated: its amplitude is adjusted.",
            ),
            self._choose,
        )
        self._limit: Input[float] = Input(
            gui.add_slider(
                "Each by at most ± [µm or µrad]",
                min=LIMITS.low,
                max=LIMITS.high,
                step=LIMITS.step,
                initial_value=DEFAULT_LIMIT,
                hint="How far one error may be moved from its present value.",
            ),
            self._choose,
        )
        self._looking_text = looking_html(self._clicks.button)
        self._text = Handle(gui.add_html(self._looking_text))
        self._lock = threading.Lock()
        self._wanted: Question | None = None
        self._looking = self._seen = False
        self._answered: tuple[Question, RepairResult] | None = None
        self._picture: LivePicture | None = None

    def read(self, state: AppState) -> AppState:
        """Nothing of the state is chosen here; clicks post what they change."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Nothing that must follow at once."""

    def settle(self, picture: LivePicture) -> None:
        """Have repairs looked for where something they depend on has changed."""
        self._picture = picture
        self._ask()

    def _choose(self) -> None:
        """Ask anew where only the choice has changed."""
        self._context.act(self._ask)

    def _ask(self) -> None:
        if self._picture is None:
            return
        objective = OBJECTIVES.get(str(self._objective.handle.value), Objective.RMS)
        any_error = self._adjustable.handle.value == ANY
        limit = LIMITS.clamp(float(self._limit.handle.value), DEFAULT_LIMIT)
        question = ask(self._picture.state, objective, any_error=any_error, limit=limit)
        with self._lock:
            if question == self._wanted:
                return
            self._wanted = question
        self._text.put(content=self._looking_text)
        if self._answered is not None:  # the page has told of the text that stood here before
            self._answered, self._seen = None, False
        self._begin()

    def _begin(self) -> None:
        with self._lock:
            question = self._wanted
            if question is None or not self._seen or self._looking:
                return
            self._looking = True
        threading.Thread(
            target=self._look, args=(question,), name="warpspace-repair", daemon=True
        ).start()

    def _look(self, question: Question) -> None:
        latest: Question | None = question
        while latest is not None:
            question = latest
            time.sleep(PAUSE_S)
            latest = self._other_than(question)
            if latest is not None:
                continue  # still being changed
            if not self._context.page.is_open:
                return  # nobody waits for it any more
            self._context.act(self._answer(question))
            with self._lock:
                latest = self._wanted if self._wanted is not question else None
                self._looking = latest is not None

    def _other_than(self, question: Question) -> Question | None:
        with self._lock:
            return self._wanted if self._wanted is not question else None

    def _answer(self, question: Question) -> partial[None]:
        try:
            with taken_turn(lambda: None):
                found = ANSWERS.get(question, question.answer, lambda _: ANSWER_BYTES)
            return partial(self._draw, question, found)
        except WarpspaceError as error:
            return partial(self._refuse, str(error))
        except Exception as error:  # noqa: BLE001 - handed to the session, which shows it
            return partial(_raise, error)

    def _draw(self, question: Question, found: RepairResult) -> None:
        """Show an answer, unless something else is asked by now."""
        if self._other_than(question) is not None:
            return
        self._answered = (question, found)
        self._text.put(content=repair_html(found, self._clicks.button))

    def _refuse(self, text: str) -> None:
        self._answered, self._seen = None, False
        self._text.put(content=message(text, "repair problem", small=True))

    def _clicked(self, word: str) -> None:
        self._context.act(partial(self._do, word))

    def _do(self, word: str) -> None:
        """Begin, show or apply a set; sets only of the answer to the present state."""
        if word == SEEN:
            if self._answered is None:
                self._seen = True
                self._begin()
            return
        with self._lock:
            wanted = self._wanted
        if self._answered is None or self._answered[0] is not wanted:
            return
        verb, _, size = word.partition(" ")
        for repair in self._answered[1].repairs:
            if size == str(len(repair.adjust)):
                self._change(verb, dict(repair.adjust))

    def _change(self, verb: str, adjust: Mapping[str, float]) -> None:
        if verb == "show":
            self._context.post(lambda state: with_preview(state, adjust))
        elif verb == "apply":
            self._context.post(lambda state: with_repair(state, adjust))


def _raise(error: Exception) -> None:
    raise error
