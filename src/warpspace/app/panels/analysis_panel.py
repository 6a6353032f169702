"""The panel of an analysis, generated from its description: options, result and actions.

Features that only a page has (numbers that follow a drag, a picture in the box) are added by a
subclass of `AnalysisPanel`, registered in `page_panels.PANELS` by the name of the analysis.
"""

import csv
import io
import json
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

from markupsafe import Markup

from warpspace.analysis.description import Analysis, Change, Result
from warpspace.analysis.options import Option
from warpspace.analysis.registry import Entry
from warpspace.analysis.statistics import volume_statistics
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, join, number, tag
from warpspace.app.browser.page import error_words
from warpspace.app.browser.templates import Templates
from warpspace.app.evaluation import compare
from warpspace.app.evaluation.cache import exclusive_work
from warpspace.app.evaluation.live_model import evaluate_state
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.block_html import block_html, result_html
from warpspace.app.panels.file_dialogs import limit_words
from warpspace.app.panels.panel import Context, Job, Jobs, Section, alert, on
from warpspace.app.state.app_state import AppState, Side
from warpspace.app.state.form_values import LONGEST, option_values, read_form
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import WarpspaceError
from warpspace.field.grid import DEFAULT_NODES
from warpspace.machine.axes import parameter
from warpspace.picture.formatting import spell_at
from warpspace.scene.model import Scene

TITLES = {
    "gains": "Error gains", "line": "Along a line",
    "distance": "Distance and angle", "conformance": "Volume within a limit",
    "uncertainty": "Uncertainty of the map",
    "form": "Flatness, straightness, squareness", "convert": "Another convention",
    "montecarlo": "Random machines", "contributions": "Contributions of tolerances",
    "adjust": "Adjustment", "allocate": "Tolerances", "concepts": "Machines side by side",
    "acceptance": "Acceptance tests", "diagnose": "What is wrong?",
}  # fmt: skip
"""Titles of sections that differ from the name of the command."""
OF_STATE = frozenset({"loop", "placed", "limit_um"})  # options set once, for the whole page
QUICK_S = 1.0  # an analysis that takes less is repeated after each change
MOST_STEPS = 4  # errors listed on a card
SAME = 1e-3  # µm or µrad; smaller changes of an error are not listed
EXAMPLES = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}  # by metavariable
HTML = Templates("analysis_panel")
ResultKey = tuple[object, ...]


class AnalysisOutcome(NamedTuple):
    key: ResultKey  # of the inputs
    result: Result
    cards: tuple[tuple[Change, Markup], ...] = ()  # proposed changes and their descriptions
    took_s: float = 0.0


class AnalysisPanel(Section):
    """One analysis: a section of its task."""

    runs_on_open = False
    run_label, run_hint = "Run", ""
    own_kind: type[Analysis] | None = None  # in place of that of the entry
    unsupported: tuple[str, ...] = ()  # options that the page does not offer
    outcome: AnalysisOutcome | None = None
    problem: tuple[ResultKey, str] | None = None
    last_key: ResultKey = ()  # of the last run
    _applied_key: ResultKey = ()  # of the state after a proposed change was applied
    _title_prefix = ""

    def __init__(self, context: Context, entry: Entry) -> None:
        super().__init__(context)
        self.entry, self.name, self.task = entry, entry.name, entry.task
        self.title = TITLES.get(entry.name) or entry.name.replace("-", " ").capitalize()
        sentence = entry.sentence.replace(" of SCENE", "").replace("SCENE", "the machine")
        self.sentence = self.sentence or sentence.rstrip(".")
        self.runs_on_open = self.runs_on_open or entry.task == "understand"
        self._jobs = Jobs(self, self.rerender, self._fail)

    @property
    def kind(self) -> type[Analysis]:
        """The analysis, imported on first use."""
        return self.own_kind or self.entry.load()

    # --- what a subclass may override ------------------------------------------------------------

    def options(self) -> Sequence[Option]:
        options = [o for o in self.kind.options() if o.name not in self.unsupported]
        return [
            o for o in options if not (o.grammar and (o.grammar.is_file or o.grammar.is_extended))
        ]

    def shown_options(self, state: AppState) -> Sequence[Option]:
        return self.options()

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Return values of options that follow the state unless they are set."""
        limit = state.specification.limit_um
        state_values = {"loop": str(state.loop), "limit_um": "" if limit is None else f"{limit!r}"}
        state_values["placed"] = str(int(state.view_key[1]))
        if state.picked is not None:
            state_values["at"] = spell_at(state.picked.at)
        for option in self.options():  # statistics are those of the drawn grid
            if option.name in ("grid", "nodes") and option.default == DEFAULT_NODES:
                state_values[option.name] = str(min(state.nodes, int(option.high or state.nodes)))
        return {o.name: state_values[o.name] for o in self.options() if o.name in state_values}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        """Return the scenes to analyse: the machine as drawn."""
        return [state.active_scene()]

    def result_key(self, state: AppState) -> ResultKey:
        """Return all inputs of the result; equal keys have equal results."""
        return (
            Identity(state.scene), tuple(state.active.items()), tuple(state.positions.items()),
            state.tolerances, state.placed, tuple(self.values(state).items()),
        )  # fmt: skip

    def is_ready(self, state: AppState) -> bool:
        """Check if all required inputs are chosen."""
        return True

    def is_automatic(self, state: AppState) -> bool:
        """Check if it runs by itself after each change."""
        return self.outcome.took_s < QUICK_S if self.outcome else self.runs_on_open

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        """Return fields of the analysis that are no options of the page."""
        return {}

    def build_analysis(self, state: AppState, values: Mapping[str, str], scene: Scene) -> Analysis:
        analysis: Any = read_form(self.kind, self.shown_options(state), values, scene)
        return replace(analysis, **self.inputs(state))

    def before_result(self, state: AppState) -> Markup:
        return EMPTY

    def headline(self, result: Result) -> Markup:
        # the title of the scene is at the top of the page
        prefix, sentences = self._title_prefix, (b for b in result.blocks() if isinstance(b, str))
        return join(block_html(sentence.removeprefix(prefix)) for sentence in sentences)

    def offered_changes(self, result: Result) -> Sequence[int]:
        """List the indices of the offered changes, best first."""
        return range(len(self.outcome.cards) if self.outcome else 0)[::-1]

    def result_html(self, result: Result) -> Markup:
        return result_html(block for block in result.blocks() if not isinstance(block, str))

    def actions(self, result: Result, *, stale: bool) -> Markup:
        return HTML.buttons(self.name, _endings(result))

    # --- the page --------------------------------------------------------------------------------

    def values(self, state: AppState) -> dict[str, str]:
        defaults, chosen = self.defaults(state), option_values(state, self.name)
        return {**defaults, **chosen, **{k: defaults[k] for k in OF_STATE & defaults.keys()}}

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (self.result_key(picture.state), compare.present_words(picture))

    def body(self, picture: LivePicture) -> Markup:
        text = compare.present_words(picture)
        remark = tag("p", text, class_="ws-tiny") if text else EMPTY
        return remark + self._body(picture.state)

    def _body(self, state: AppState) -> Markup:
        key, is_automatic = self.result_key(state), self.is_automatic(state)
        is_ready, outcome = self.is_ready(state), self.outcome
        if is_automatic and is_ready:
            self.run_if_stale(state)
        stale = outcome is not None and outcome.key != key
        parts = {"inputs": self.before_result(state), "problem": self.problem_html(state)}
        if outcome is not None and not parts["problem"]:
            result = outcome.result
            parts["result"] = join(
                (self.headline(result), self.cards_html(key), self.result_html(result))
            )
            parts["actions"] = self.actions(result, stale=stale)
        parts["progress"] = EMPTY if stale and is_automatic else self._jobs.html()
        parts["options"] = self.options_html(state)
        is_missing = outcome is None or parts["problem"] or (stale and not is_automatic)
        needs_run = is_missing and is_ready and not parts["progress"]
        is_applied = key == self._applied_key
        return HTML.analysis(self, outcome, parts, stale, is_applied, is_automatic, needs_run)

    def problem_html(self, state: AppState) -> Markup:
        key, text = self.problem or ((), "")
        return alert(text) if key == self.result_key(state) else EMPTY

    def cards_html(self, key: ResultKey) -> Markup:
        outcome = self.outcome
        if outcome is None or key == self._applied_key != outcome.key:
            return EMPTY  # applied, not offered again
        cards = [(n, outcome.cards[n][1]) for n in self.offered_changes(outcome.result)]
        return HTML.cards(self.name, cards, outcome.key == key)

    def options_html(self, state: AppState, controls: Markup = EMPTY) -> Markup:
        options, values = self.shown_options(state), self.values(state)
        limit = limit_words(state) if any(o.name == "limit_um" for o in options) else ""
        lines = [
            (o, values.get(o.name), _titles(o, state.scene), _example(o))
            for o in options
            if o.name not in OF_STATE
        ]
        if not (lines or controls or limit):
            return EMPTY
        is_open = bool(self.problem_html(state))
        return HTML.options(self.name, limit, controls, lines, is_open)

    # --- actions -------------------------------------------------------------------------------

    @on(do.SetOption)
    def set_option(self, state: AppState, action: do.SetOption) -> AppState | None:
        name, text = action.option, action.value[:LONGEST]
        if name not in {option.name for option in self.options()}:
            return None
        return replace(state, forms={**state.forms, f"{self.name}.{name}": text})

    @on(do.Run)
    def run(self, state: AppState, action: do.Run) -> None:
        if self.is_ready(state):
            self._run(state)

    @on(do.Cancel, later=True)
    def cancel(self, _: do.Cancel) -> None:
        self._jobs.cancel()

    @on(do.Preview, do.Apply)
    def use_card(self, state: AppState, action: do.Preview | do.Apply) -> AppState | None:
        """Compare with a proposed change, or apply it."""
        outcome, at = self.outcome, action.card
        if outcome is None or outcome.key != self.result_key(state) or at >= len(outcome.cards):
            return None
        change, _ = outcome.cards[at]
        if isinstance(action, do.Apply):
            return self.applied(state, change)
        name = change.label if change.label.startswith("after ") else ""
        name = name or f"after {self.title.lower()}: {change.label}"
        return compare.with_proposal(state, change.scene, name)

    def applied(self, state: AppState, change: Change) -> AppState:
        before = Side(f"before {self.title.lower()}", compare.plain_state(state))
        applied_state = compare.applied(compare.with_before(state, before), change.scene)
        self._applied_key = self.result_key(applied_state)
        text = change.label.partition(": ")[2] if change.label.startswith("after ") else ""
        self.context.last_decision = state, f"{self.title}: {text or change.label}"
        return applied_state

    def _run(self, state: AppState) -> None:
        key, scenes = self.result_key(state), self.scenes(state)
        if self._jobs.busy and key == self.last_key:
            return  # a double click
        self.last_key, self._title_prefix = key, f"{state.scene.title} · "
        try:
            analysis = self.build_analysis(state, self.values(state), scenes[0])
        except WarpspaceError as error:
            self._fail(error)
            return

        def compute(job: Job) -> AnalysisOutcome:
            with exclusive_work(lambda: job.report_progress(job.share)):
                start_s = time.monotonic()
                result = analysis.run_all(scenes, job.report_progress)
                took_s = time.monotonic() - start_s
            cards = tuple((change, _change_html(state, change)) for change in result.changes())
            return AnalysisOutcome(key, result, cards, took_s)

        self._jobs.start(self.kind.doing, compute, self._accept_outcome)

    def run_if_stale(self, state: AppState) -> None:
        """Run it if its inputs have changed; during a drag, when that pauses."""
        if self.result_key(state) == self.last_key or self._jobs.busy:
            return
        if self.last_key and not self.context.is_paused:
            self.context.restart_idle(self)
        else:
            self._run(state)

    def _accept_outcome(self, outcome: AnalysisOutcome) -> None:
        self.outcome, self.problem = outcome, None
        self.rerender()

    def _fail(self, error: Exception) -> None:
        self.problem = (self.last_key, self.spell_error(error))
        self.rerender()

    def spell_error(self, error: Exception) -> str:
        """Format an exception with the labels of the options."""
        if not isinstance(error, WarpspaceError):
            return error_words(error)
        labels = {option.name: f"“{option.label}”" for option in self.kind.options()}
        return error.with_names(lambda name: labels.get(name, name.replace("_", " ")))

    @on(do.SaveResult, later=True)
    def save(self, action: do.SaveResult) -> None:
        result = self.outcome.result if self.outcome else None
        if result is None or action.format not in _endings(result):
            return
        text, table = io.StringIO(), result.file_table()
        if action.format == "JSON":
            json.dump(result.as_json(), text, indent=2, ensure_ascii=False)
        elif table is not None:
            csv.writer(text, lineterminator="\n").writerows(table.csv_rows())
        self.context.save_file(f"{self.name}.{action.format.lower()}", text.getvalue())

    @on(do.AddToReport, later=True)
    def add_to_report(self, _: do.AddToReport) -> None:
        if self.outcome is not None:
            title = self.kind.title or self.title
            self.context.report_results.append((title, self.outcome.result))
            self.context.notify("Added to the report", f"{title}; open Report in the top bar")


def _endings(result: Result) -> tuple[Literal["CSV", "JSON"], ...]:
    return ("JSON",) if result.file_table() is None else ("CSV", "JSON")


def _change_html(state: AppState, change: Change) -> Markup:
    before_state = compare.without_table(compare.plain_state(state))
    after_state = compare.applied(before_state, change.scene)
    moved: list[tuple[float, str]] = []
    for key in {**before_state.amplitudes, **after_state.amplitudes}:
        a, b = (state.amplitudes.get(key, 0.0) for state in (before_state, after_state))
        if abs(b - a) > SAME:
            line = f"{key} {number(a)} → {number(b)} {parameter(key).unit}"
            moved.append((-abs(b - a), line))
    steps = [*change.steps, *(line for _, line in sorted(moved))] or [change.label]
    try:
        before, after = (
            volume_statistics(field, grid)
            for grid, field in map(evaluate_state, (before_state, after_state))
        )
    except WarpspaceError:
        return HTML.change(steps, MOST_STEPS)
    return HTML.change(steps, MOST_STEPS, before, after)


def _example(option: Option) -> str:
    """Return an example of the notation of an option; empty for numbers."""
    metavar = option.grammar.metavar if option.grammar else ""
    return EXAMPLES.get(metavar, metavar)


def _titles(option: Option, scene: Scene) -> dict[str, str]:
    """Return the labels of the values that can be chosen; empty for a text box."""
    of_axis = option.grammar is not None and option.grammar.metavar == "AXIS"
    keys = option.choices or (scene.machine.axes if of_axis else ())
    titles = {key: option.choice_labels.get(key, re.sub("[_-]", " ", key)) for key in keys}
    if option.default or not titles:
        return titles
    return {"": option.default_words or "automatic", **titles}  # chosen by the analysis
