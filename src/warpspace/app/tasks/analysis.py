"""An analysis on the page: its result, what to do with it, and its options, from its description.

What only a page can do (numbers that follow a drag, a picture in the box) is a hook beside it, by
the analysis' name: a subclass of `AnalysisPart` in `HOOKS`.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pkgutil import resolve_name

from markupsafe import Markup

from warpspace.analysis.blocks import Bars, Block, Table
from warpspace.analysis.catalogue import Entry, entries
from warpspace.analysis.description import Analysis, Change, Result
from warpspace.analysis.options import Option
from warpspace.app.browser.html import EMPTY, button, join, tag
from warpspace.app.browser.incoming import index_of
from warpspace.app.browser.page import error_words
from warpspace.app.documents.services import CancelledError
from warpspace.app.evaluation.cache import taken_turn
from warpspace.app.evaluation.compare import with_applied, with_proposal
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.forms import read_form
from warpspace.app.state.leaf import Identity
from warpspace.app.tasks.cards import Card, Seen, make_cards
from warpspace.app.tasks.charts import block_html
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.forms import form_html
from warpspace.app.tasks.jobs import Job, Jobs
from warpspace.app.tasks.parts import Section
from warpspace.exceptions import OptionError, WarpspaceError
from warpspace.scene.model import Scene

TITLES = {
    "gains": "Error gains", "line": "Along a line", "reach": "Volume within a limit",
    "certify": "Flatness, straightness, squareness", "convert": "Another convention",
    "montecarlo": "Random machines", "contributions": "Contributions of tolerances",
}  # fmt: skip
"""What sections are called, where the name of the command does not do."""
WIDEST = 5  # columns of a table that the column of the page has room for
OF_STATE = frozenset({"loop", "placed"})
"""Options that are set for the whole page, in one place."""
QUICK_S = 0.4  # what is answered within that time is answered anew with every change
Question = tuple[object, ...]


class AnalysisPart(Section):
    """One analysis: a section of its task."""

    follows = "in a pause"
    at_once = False  # whether it runs by itself as soon as it is unfolded

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context)
        self.entry, self.name = entry, entry.name
        self.task = entry.task
        self.title = TITLES.get(entry.name) or entry.name.replace("-", " ").capitalize()
        self.sentence = _plain(entry.sentence)
        self.at_once = self.at_once or entry.task == "understand"
        self._kind: type[Analysis] | None = None
        self._answer: tuple[Question, Result] | None = None
        self._cards: tuple[Card, ...] = ()
        self._applied: Question = ()  # what is asked once a change has been applied
        self._problem: tuple[Question, str] | None = None
        self._took_s, self._version = 0.0, 0
        self._jobs = Jobs(context, entry.name, self._again, self._fail)
        self._asked: Question = ()
        self._scene_title = ""

    # --- what a hook may say otherwise ---------------------------------------------------------

    @property
    def kind(self) -> type[Analysis]:
        """The analysis, imported when it is first unfolded."""
        if self._kind is None:
            self._kind = self.entry.load()
        return self._kind

    def options(self) -> Sequence[Option]:
        """List the options that a page asks for."""
        return [one for one in self.kind.options() if not (one.grammar and one.grammar.is_file)]

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """List those that are shown under "Options" and count."""
        return self.options()

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Give what the state says of options that nobody has set."""
        found = {"loop": str(state.loop), "limit_um": f"{state.specification.limit_um:g}"}
        found["placed"] = str(int(state.seen[1]))
        return {one.name: found[one.name] for one in self.options() if one.name in found}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        """Give what it is asked of: the machine as it is drawn."""
        return [state.active_scene()]

    def ask(
        self,
        state: AppState,
        values: Mapping[str, str],
        scenes: Sequence[Scene],
    ) -> Analysis:
        """Give what is run."""
        return read_form(self.kind, self.shown_options(state), values, scenes[0])

    def before_result(self, state: AppState) -> Markup:
        """Give what stands above the result."""
        return EMPTY

    def headline(self, found: Result) -> Markup:
        """Say what matters most of the result: its sentences."""
        said = (one.strip() for one in found.blocks() if isinstance(one, str))
        # which scene it is stands at the top of the page
        words = (one.removeprefix(f"{self._scene_title} · ") for one in said)
        return join(tag("p", one[:1].upper() + one[1:]) for one in words)

    def offered(self, found: Result) -> Sequence[int]:
        """List the places of the changes that are offered, in order: the best first."""
        return range(len(self._cards))[::-1]

    def result_html(self, found: Result) -> Markup:
        """Draw its charts and narrow tables; what is too wide for the column is folded."""
        blocks = [one for one in found.blocks() if not isinstance(one, str)]
        wide = [one for one in blocks if _is_wide(one)]
        return join(block_html(one) for one in blocks if one not in wide) + details_html(wide)

    def change_title(self, change: Change) -> str:
        """Name the side of a comparison that shows a change."""
        return f"after {self.title.lower()}: {change.words}"

    # --- the page --------------------------------------------------------------------------------

    def values(self, state: AppState) -> dict[str, str]:
        """Give what is set of its options."""
        own = f"{self.name}."
        set_ = {k.removeprefix(own): v for k, v in state.forms.items() if k.startswith(own)}
        found = self.defaults(state)
        return {**found, **set_, **{name: found[name] for name in OF_STATE & found.keys()}}

    def question(self, state: AppState) -> Question:
        """Give all that an answer depends on; equal questions have equal answers."""
        return (
            Identity(state.scene), tuple(state.active.items()), tuple(state.positions.items()),
            state.tolerances, state.placed, tuple(self.values(state).items()),
        )  # fmt: skip

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Follow its question and its answer."""
        return (self.question(picture.state), self._version)

    def body(self, picture: LivePicture) -> Markup:
        """Write result, what to do with it, and options."""
        return self._body(picture.state)

    def _body(self, state: AppState) -> Markup:
        question = self.question(state)
        stale = self._answer is not None and self._answer[0] != question
        quick = self._took_s < QUICK_S and (self._answer is not None or self.at_once)
        if quick and question != self._asked and not self._jobs.busy:
            self._run(state)
        parts: list[object] = [self.before_result(state)]
        if self._problem is not None and self._problem[0] == question:
            parts.append(tag("p", self._problem[1], class_="ws-problem", role="alert"))
        elif self._answer is not None:
            if question == self._applied:
                words = "Applied: these errors are what is shown now. Undo takes them back."
                parts.append(tag("p", words, role="status"))
            elif stale and not quick:
                parts.append(
                    tag("p", "Something has changed since: run it again.", class_="ws-stale")
                )
            found, faded = self._answer[1], stale and question != self._applied
            cards = [
                self._cards[index].html(self.name, index, stale=stale)
                for index in self.offered(found)
            ]
            said = join((self.headline(found), *cards, self.result_html(found)))
            parts.append(tag("div", said, class_="ws-result" + (" stale" if faded else "")))
            parts += [tag("p", words, class_="ws-doubt") for words in found.doubts()]
            parts.append(self.actions(found, stale=stale))
        if not quick or self._answer is None or self._jobs.html():
            parts.append(self._run_row())
        values = self.values(state)
        if options := [one for one in self.shown_options(state) if one.name not in OF_STATE]:
            form = form_html(self.name, options, values, state.scene)
            parts.append(tag("details", tag("summary", "Options") + form, class_="ws-options",
                             data_key=f"{self.name}.options"))  # fmt: skip
        return join(parts)

    def _run_row(self) -> Markup:
        words = "Run again" if self._answer else "Run"
        run = button(words, f"{self.name}:run", kind="" if self._answer else "main")
        return self._jobs.html() or tag("div", run, class_="ws-actions ws-run")

    def actions(self, found: Result, *, stale: bool) -> Markup:
        """Give what can be done with a result beside its cards."""
        saves = [
            button(f"Save {ending}", f"{self.name}:save", ending) for ending in self.files(found)
        ]
        saves.append(button("Add to report", f"{self.name}:report", kind="quiet"))
        return tag("div", join(saves), class_="ws-actions")

    def files(self, found: Result) -> dict[str, Callable[[], str]]:
        """Give the files of a result that can be saved, by their ending."""
        import json

        files: dict[str, Callable[[], str]] = {}
        table = found.file_table()
        if table is not None:
            files["CSV"] = partial(_csv, table)
        files["JSON"] = lambda: json.dumps(found.as_json(), indent=2, ensure_ascii=False)
        return files

    # --- events --------------------------------------------------------------------------------

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Set an option, run, cancel, or do something with the result."""
        if word.startswith("set."):
            return self._set(state, word.removeprefix("set."), value)
        if word == "run":
            self._run(state)
        elif word == "cancel":
            self._jobs.cancel()
        elif word == "save":
            self.context.act(partial(self._save, value))
        elif word == "report":
            self.context.act(self._into_report)
        elif word in ("preview", "apply") and (change := self._change(state, value)) is not None:
            if word == "preview":
                return with_proposal(state, change.scene, self.change_title(change))
            found = with_applied(state, change.scene, f"before {self.title.lower()}")
            self._applied = self.question(found)
            return found
        return state

    def _set(self, state: AppState, name: str, value: str) -> AppState:
        from dataclasses import replace

        if name not in {one.name for one in self.options()}:
            return state
        return replace(state, forms={**state.forms, f"{self.name}.{name}": value[:1000]})

    def _change(self, state: AppState, value: str) -> Change | None:
        index = index_of(value, len(self._cards))
        if self._answer is None or self._answer[0] != self.question(state) or index is None:
            return None
        return self._cards[index].change

    def _run(self, state: AppState) -> None:
        question, scenes, values = self.question(state), self.scenes(state), self.values(state)
        seen, self._scene_title = Seen.of(state), state.scene.title
        self._asked = question
        try:
            asked = self.ask(state, values, scenes)
        except WarpspaceError as error:
            self._fail(self.title, error)
            return

        def work(job: Job) -> None:
            def watch(share: float) -> None:
                job.share = share
                if job.is_set():
                    raise CancelledError(f"{self.title}: cancelled")

            with taken_turn(lambda: watch(job.share)):
                started = time.monotonic()
                found = asked.run_all(scenes, watch)
                took_s = time.monotonic() - started
                cards = make_cards(scenes[0], found.changes(), seen)
            if not job.is_set():
                self.context.act(partial(self._take_answer, question, found, cards, took_s))

        quiet_s = QUICK_S if self._answer and self._took_s < QUICK_S else 0.0
        self._jobs.start(self.kind.doing, work, max(self._took_s, 1.0), quiet_s)

    def _label(self, name: str) -> str:
        return next((one.label for one in self.kind.options() if one.name == name), name)

    def _take_answer(
        self, question: Question, found: Result, cards: tuple[Card, ...], took_s: float
    ) -> None:
        self._answer, self._cards = (question, found), cards
        self._problem, self._took_s = None, took_s
        self._again()

    def _fail(self, _name: str, error: Exception) -> None:
        if isinstance(error, OptionError):
            self._refuse(self._asked, error.said(self._label))
        elif not isinstance(error, CancelledError):
            self._refuse(self._asked, error_words(error))

    def _refuse(self, question: Question, words: str) -> None:
        self._problem = (question, words)
        self._again()

    def _again(self) -> None:
        self._version += 1
        self.context.renew(self)

    def _save(self, ending: str) -> None:
        if self._answer is None or (write := self.files(self._answer[1]).get(ending)) is None:
            return
        self.context.save_file(f"{self.name}.{ending.lower()}", write())

    def _into_report(self) -> None:
        if self._answer is not None:
            self.context.reported.append((self.title, self._answer[1]))
            self.context.notify("Added to the report", f"{self.title}; see Report at the top")


def details_html(blocks: Iterable[Block], words: str = "Details") -> Markup:
    """Fold what is too wide for the column."""
    inner = join(map(block_html, blocks))
    if not inner:
        return EMPTY
    wide = tag("div", inner, tabindex=0, role="group", aria_label=words)  # scrolled by keys
    return tag("details", tag("summary", words) + wide, class_="ws-details",
               data_key=f"details.{words}")  # fmt: skip


def _is_wide(block: Block) -> bool:
    if isinstance(block, Table):
        return sum(column.shows for column in block.columns) > WIDEST
    return isinstance(block, Bars)


def _plain(sentence: str) -> str:
    return sentence.replace(" of SCENE", "").replace("SCENE", "the machine").rstrip(".")


def _csv(table: Table) -> str:
    import csv
    from io import StringIO

    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(table.csv_rows())
    return text.getvalue()


HOOKS: dict[str, str] = {
    "gains": "warpspace.app.tasks.understand:GainsPart",
    "calibrate": "warpspace.app.tasks.measure:CalibratePart",
    "repair": "warpspace.app.tasks.improve:RepairPart",
    "compensate": "warpspace.app.tasks.improve:CompensatePart",
    "allocate": "warpspace.app.tasks.design:TolerancesPart",
    "concepts": "warpspace.app.tasks.design:ConceptsPart",
}
"""Parts of analyses that do more than their description says: ``module:Class`` by name."""


def sections(context: Context) -> list[Section]:
    """Build a section for each analysis that a page can ask."""
    found: list[Section] = [
        resolve_name(HOOKS[entry.name])(context, entry) if entry.name in HOOKS
        else AnalysisPart(context, entry)
        for entry in entries()
    ]  # fmt: skip
    return found
