"""An analysis on the page: its result, what to do with it, and its options, from its description.

What only a page can do (numbers that follow a drag, a picture in the box) is a hook beside it, by
the analysis' name: a subclass of `AnalysisPart` in `HOOKS` of the catalogue.
"""

import csv
import io
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeVar

from markupsafe import Markup

from warpspace.analysis.description import Analysis, Change, Result
from warpspace.analysis.options import Option
from warpspace.analysis.registry import Entry
from warpspace.app.browser.html import EMPTY, button, join, number, rows, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.browser.page import error_words
from warpspace.app.evaluation.cache import exclusive_work
from warpspace.app.evaluation.compare import (
    applied,
    plain_state,
    with_applied,
    with_proposal,
    without_table,
)
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.block_html import block_html, result_html
from warpspace.app.panels.file_dialogs import PLAIN
from warpspace.app.panels.form_controls import form_html
from warpspace.app.panels.panel import Context, Job, Jobs, Section
from warpspace.app.state.app_state import AppState
from warpspace.app.state.form_values import LONGEST, option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.machine.axes import parameter
from warpspace.picture.formatting import spell_at
from warpspace.scene.model import Scene

TITLES = {
    "gains": "Error gains", "line": "Along a line",
    "distance": "Distance and angle", "conformance": "Volume within a limit",
    "uncertainty": "Uncertainty of the map",
    "form": "Flatness, straightness, squareness", "convert": "Another convention",
    "montecarlo": "Random machines", "contributions": "Contributions of tolerances",
    "allocate": "Tolerances", "concepts": "Machines side by side",
}  # fmt: skip
"""What sections are called, where the name of the command does not do."""
OF_STATE = frozenset({"loop", "placed"})
"""Options that are set for the whole page, in one place."""
QUICK_S = 0.4  # what is answered within that time is answered anew with every change
MOST_STEPS = 4  # errors that a card names one by one
SAME = 1e-3  # µm or µrad; an error that moves by less stays
RECORD = button("Record decision", "notes:decide",
                hint="Keep what was changed, and why, among the notes")  # fmt: skip
T = TypeVar("T")
Question = tuple[object, ...]


class AnalysisOutcome(NamedTuple):
    question: Question  # that it answers
    found: Result
    cards: tuple[tuple[Change, Markup], ...] = ()  # what it proposes, and that in words
    took_s: float = 0.0


class AnalysisPanel(Section):
    """One analysis: a section of its task."""

    at_once = False  # whether it runs by itself as soon as it is unfolded
    run_words, run_hint = "Run", ""

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context)
        self.entry, self.name, self.task = entry, entry.name, entry.task
        self.title = TITLES.get(entry.name) or entry.name.replace("-", " ").capitalize()
        words = entry.sentence.replace(" of SCENE", "").replace("SCENE", "the machine")
        self.sentence = self.sentence or words.rstrip(".")
        self.at_once = self.at_once or entry.task == "understand"
        self._answer: AnalysisOutcome | None = None
        self._applied: Question = ()  # what is asked once a change has been applied
        self._problem: tuple[Question, str] | None = None
        self._jobs = Jobs(self, self.renew, self._fail)
        self._asked: Question = ()
        self._subject = ""

    @property
    def kind(self) -> type[Analysis]:
        """The analysis, imported when it is first asked."""
        return self.entry.load()

    # --- what a hook may say otherwise ---------------------------------------------------------

    def options(self) -> Sequence[Option]:
        """List the options that a page asks for."""
        return [one for one in self.kind.options() if not (one.grammar and one.grammar.is_file)]

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """List those that are shown under "Options" and count."""
        return self.options()

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Give what the state says of options that nobody has set."""
        found = {"loop": str(state.loop), "limit_um": f"{state.specification.limit_um:g}"}
        found["placed"] = str(int(state.view_key[1]))
        if state.picked is not None:
            found["at"] = spell_at(state.picked.at)
        return {one.name: found[one.name] for one in self.options() if one.name in found}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        """Give what it is asked of: the machine as it is drawn."""
        return [state.active_scene()]

    def question(self, state: AppState) -> Question:
        """Give all that an answer depends on; equal questions have equal answers."""
        return (
            Identity(state.scene), tuple(state.active.items()), tuple(state.positions.items()),
            state.tolerances, state.placed, tuple(self.values(state).items()),
        )  # fmt: skip

    def is_ready(self, state: AppState) -> bool:
        """Tell whether enough is chosen to run it."""
        return True

    def is_quick(self, state: AppState) -> bool:
        """Tell whether it follows every change by itself."""
        return self._answer.took_s < QUICK_S if self._answer else self.at_once

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        return read_form(self.kind, self.shown_options(state), values, scenes[0])

    def before_result(self, state: AppState) -> Markup:
        return EMPTY

    def headline(self, found: Result) -> Markup:
        """Say what matters most of the result: its sentences."""
        # which scene it is stands at the top of the page
        words = (one.removeprefix(self._subject) for one in found.blocks() if isinstance(one, str))
        return join(map(block_html, words))

    def offered(self, found: Result) -> Sequence[int]:
        """List the places of the changes that are offered, in order: the best first."""
        return range(len(self._answer.cards) if self._answer else 0)[::-1]

    def result_html(self, found: Result) -> Markup:
        """Draw its tables and charts."""
        return result_html(one for one in found.blocks() if not isinstance(one, str))

    def actions(self, found: Result, *, stale: bool) -> Markup:
        """Give what can be done with a result beside its cards."""
        saves = [button(f"Save {one}", f"{self.name}:save", one) for one in _endings(found)]
        saves.append(button("Add to report", f"{self.name}:report", kind="quiet"))
        return tag("div", join(saves), class_="ws-actions")

    # --- the page --------------------------------------------------------------------------------

    def values(self, state: AppState) -> dict[str, str]:
        found, told = self.defaults(state), option_values(state, self.name)
        return {**found, **told, **{name: found[name] for name in OF_STATE & found.keys()}}

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        return (self.question(picture.state),)

    def body(self, picture: LivePicture) -> Markup:
        return self._body(picture.state)

    def _body(self, state: AppState) -> Markup:
        question, is_quick = self.question(state), self.is_quick(state)
        is_ready, answer = self.is_ready(state), self._answer
        if is_quick and is_ready:
            self.keep_up(state)
        stale = answer is not None and answer.question != question
        problem = self.problem_html(state)
        parts: list[object] = [self.before_result(state), problem]
        if answer is not None and not problem:
            if question == self._applied:
                words = "Applied: this is what is shown now. Undo takes it back."
                parts.append(tag("p", words, role="status"))
                parts.append(RECORD)
            elif stale and not is_quick:
                words = "Something has changed since: run it again."
                parts.append(tag("p", words, class_="ws-stale"))
            found, faded = answer.found, stale and question != self._applied
            said = join((self.headline(found), self.cards_html(question), self.result_html(found)))
            parts.append(tag("div", said, class_="ws-result" + (" stale" if faded else "")))
            parts += [tag("p", words, class_="ws-doubt") for words in found.caveats()]
            parts.append(self.actions(found, stale=stale))
        bar = EMPTY if stale and is_quick else self._jobs.html()
        wanted = answer is None or problem or (stale and not is_quick)
        if wanted and is_ready and not bar:
            words = f"{self.run_words} again" if answer else self.run_words
            run = button(words, f"{self.name}:run", kind="" if answer else "main",
                         hint=self.run_hint)  # fmt: skip
            bar = tag("div", run, class_="ws-actions ws-run")
        parts.append(bar)
        return join((*parts, self.options_html(state)))

    def problem_html(self, state: AppState) -> Markup:
        if self._problem is None or self._problem[0] != self.question(state):
            return EMPTY
        return tag("p", self._problem[1], class_="ws-problem", role="alert")

    def cards_html(self, question: Question) -> Markup:
        answer, cards = self._answer, list[Markup]()
        if answer is None:
            return EMPTY
        hints = {"Preview": "Draw the result beside the present state",
                 "Apply": "Change the errors; the state before it is kept as A"}  # fmt: skip
        for index in self.offered(answer.found):
            buttons = join(
                button(words, f"{self.name}:{words.lower()}", index, hint=hint,
                       kind="main" if words == "Apply" else "",
                       disabled=answer.question != question)
                for words, hint in hints.items()
            )  # fmt: skip
            row = tag("div", buttons, class_="ws-actions")
            cards.append(tag("div", answer.cards[index][1] + row, class_="ws-card"))
        return join(cards)

    def options_html(self, state: AppState, above: Markup = EMPTY) -> Markup:
        options = [one for one in self.shown_options(state) if one.name not in OF_STATE]
        if not options:
            return EMPTY
        form = above + form_html(self.name, options, self.values(state), state.scene)
        return tag("details", tag("summary", "Options") + form, class_="ws-options",
                   open=bool(self.problem_html(state)),
                   data_key=f"{self.name}.options")  # fmt: skip

    # --- events --------------------------------------------------------------------------------

    def take(self, state: AppState, word: str, value: str) -> AppState:
        name = word.removeprefix("set.")
        if word.startswith("set.") and name in {one.name for one in self.options()}:
            return replace(state, forms={**state.forms, f"{self.name}.{name}": value[:LONGEST]})
        if word == "run" and self.is_ready(state):
            self._run(state)
        elif word == "cancel":
            self._jobs.cancel()
        elif word in ("save", "report"):
            self.context.act(partial(self._save, value) if word == "save" else self._into_report)
        elif word in ("preview", "apply") and (change := self._change(state, value)) is not None:
            what = self.title.lower()
            if word == "preview":
                words = change.words if change.words.startswith("after ") else ""
                words = words or f"after {what}: {change.words}"
                return with_proposal(state, change.scene, words)
            found = with_applied(state, change.scene, f"before {what}")
            self._applied = self.question(found)
            done = change.words.removeprefix(f"after {what}: ")
            self.context.decided = state, f"{self.title}: {done}"
            return found
        return state

    def _change(self, state: AppState, value: str) -> Change | None:
        answer = self._answer
        if answer is None or answer.question != self.question(state):
            return None
        index = index_of(value, len(answer.cards))
        return None if index is None else answer.cards[index][0]

    def _run(self, state: AppState) -> None:
        question, scenes = self.question(state), self.scenes(state)
        self._asked, self._subject = question, f"{state.scene.title} · "
        try:
            asked = self.ask(state, self.values(state), scenes)
        except WarpspaceError as error:
            self._fail(error)
            return

        def answer(job: Job) -> AnalysisOutcome:
            with exclusive_work(lambda: job.tell(job.share)):
                started = time.monotonic()
                found = asked.run_all(scenes, job.tell)
                took_s = time.monotonic() - started
            cards = tuple((one, _change_html(state, one)) for one in found.changes())
            return AnalysisOutcome(question, found, cards, took_s)

        self._make(self.kind.doing, answer, self._take_answer)

    def keep_up(self, state: AppState) -> None:
        """Run it for what has changed; while something is dragged, once that rests."""
        if self.question(state) == self._asked or self._jobs.busy:
            return
        if self._asked and not self.context.is_still:
            self.context.rest_again(self)
        else:
            self._run(state)

    def _make(self, words: str, make: Callable[[Job], T], take: Callable[[T], None]) -> None:
        def work(job: Job) -> None:
            made = make(job)
            if not job.is_set():
                self.context.act(partial(take, made))

        self._jobs.start(words, work)

    def _take_answer(self, answer: AnalysisOutcome) -> None:
        self._answer, self._problem = answer, None
        self.renew()

    def _fail(self, error: Exception) -> None:
        words = error_words(error)
        if isinstance(error, OptionError):
            labels = {one.name: one.label for one in self.kind.options()}
            words = error.said(lambda name: labels.get(name, name))
        self._problem = (self._asked, words)
        self.renew()

    def _save(self, ending: str) -> None:
        found = self._answer.found if self._answer else None
        if found is None or ending not in _endings(found):
            return
        text, table = io.StringIO(), found.file_table()
        if ending == "JSON":
            json.dump(found.as_json(), text, indent=2, ensure_ascii=False)
        elif table is not None:
            csv.writer(text, lineterminator="\n").writerows(table.csv_rows())
        self.context.save_file(f"{self.name}.{ending.lower()}", text.getvalue())

    def _into_report(self) -> None:
        if self._answer is not None:
            title = self.kind.title or self.title
            self.context.reported.append((title, self._answer.found))
            self.context.notify("Added to the report", f"{title}; see Report at the top")


def _endings(found: Result) -> tuple[str, ...]:
    return ("JSON",) if found.file_table() is None else ("CSV", "JSON")


def _change_html(state: AppState, change: Change) -> Markup:
    now = without_table(plain_state(state))
    then = applied(now, change.scene)
    moved: list[tuple[float, str]] = []
    for key in {**now.amplitudes, **then.amplitudes}:
        a, b = (one.amplitudes.get(key, 0.0) for one in (now, then))
        if abs(b - a) > SAME:
            said = f"{key} {number(a)} → {number(b)} {parameter(key).unit}"
            moved.append((-abs(b - a), said))
    steps = [said for _, said in sorted(moved)] or [change.words]
    lines = [tag("div", tag("b", said)) for said in steps[:MOST_STEPS]]
    if (more := len(steps) - MOST_STEPS) > 0:
        lines.append(tag("div", f"and {more} more", class_="ws-quiet"))
    try:
        before, after = (PLAIN.evaluate(one).statistics for one in (now, then))
    except WarpspaceError:
        return join(lines)
    pairs = (("max", before.max_um, after.max_um), ("mean", before.mean_um, after.mean_um))
    return join(lines) + rows((name, f"{number(a)} → {number(b)} µm") for name, a, b in pairs)
