"""The panel of an analysis, generated from its description: options, result and actions.

Features that only a page has (numbers that follow a drag, a picture in the box) are added by a
subclass of `AnalysisPanel`, registered in `page_panels.PANELS` by the name of the analysis.
"""

import csv
import io
import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal, NamedTuple, TypeVar

from markupsafe import Markup

from warpspace.analysis.description import Analysis, Change, Result
from warpspace.analysis.options import Option
from warpspace.analysis.registry import Entry
from warpspace.app.browser import actions as do
from warpspace.app.browser import html
from warpspace.app.browser.html import EMPTY, button, field, join, tag, text_box
from warpspace.app.browser.page import error_words
from warpspace.app.evaluation import compare
from warpspace.app.evaluation.cache import exclusive_work
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.block_html import block_html, result_html
from warpspace.app.panels.file_dialogs import PLAIN, limit_words
from warpspace.app.panels.panel import (
    Context,
    Job,
    Jobs,
    Section,
    actions,
    alert,
    details,
    on,
    quiet,
)
from warpspace.app.state.app_state import AppState
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
}  # fmt: skip
"""Titles of sections that differ from the name of the command."""
OF_STATE = frozenset({"loop", "placed", "limit_um"})  # options set once, for the whole page
QUICK_S = 1.0  # an analysis that takes less is repeated after each change
MOST_STEPS = 4  # errors listed on a card
SAME = 1e-3  # µm or µrad; smaller changes of an error are not listed
RECORD = button("Record decision", do.Signal.RECORD_DECISION,
                hint="Record the change and its reason as a note")  # fmt: skip
UNSET = ""  # value of an option that the analysis chooses
EXAMPLES = {"X=..,Y=..": "X=0,B=30", "X,Y,Z": "100,0,50"}
T = TypeVar("T")
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
        return self.entry.load()

    # --- what a subclass may override ------------------------------------------------------------

    def options(self) -> Sequence[Option]:
        options = [o for o in self.kind.options() if o.name not in self.unsupported]
        return [o for o in options if not (o.grammar and o.grammar.is_file)]

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
        saves = [button(f"Save {end}", do.SaveResult(self.name, end)) for end in _endings(result)]
        saves.append(button("Add to report", do.AddToReport(self.name), kind="quiet"))
        return actions(*saves)

    # --- the page --------------------------------------------------------------------------------

    def values(self, state: AppState) -> dict[str, str]:
        defaults, chosen = self.defaults(state), option_values(state, self.name)
        return {**defaults, **chosen, **{k: defaults[k] for k in OF_STATE & defaults.keys()}}

    def body_dependencies(self, picture: LivePicture) -> tuple[object, ...]:
        return (self.result_key(picture.state), compare.present_words(picture))

    def body(self, picture: LivePicture) -> Markup:
        words = compare.present_words(picture)
        remark = tag("p", words, class_="ws-tiny") if words else EMPTY
        return remark + self._body(picture.state)

    def _body(self, state: AppState) -> Markup:
        key, is_automatic = self.result_key(state), self.is_automatic(state)
        is_ready, outcome = self.is_ready(state), self.outcome
        if is_automatic and is_ready:
            self.run_if_stale(state)
        stale = outcome is not None and outcome.key != key
        problem = self.problem_html(state)
        parts: list[object] = [self.before_result(state), problem]
        if outcome is not None and not problem:
            if key == self._applied_key:
                text = "Applied to the displayed machine. Undo reverts it."
                parts += [tag("p", text, role="status"), RECORD]
            elif stale and not is_automatic:
                text = "Out of date: inputs have changed. Run again."
                parts.append(tag("p", text, class_="ws-stale"))
            result, faded = outcome.result, stale and key != self._applied_key
            content = join((self.headline(result), self.cards_html(key), self.result_html(result)))
            parts.append(tag("div", content, class_="ws-result" + (" stale" if faded else "")))
            parts += [tag("p", caveat, class_="ws-caveat") for caveat in result.caveats()]
            parts.append(self.actions(result, stale=stale))
        bar = EMPTY if stale and is_automatic else self._jobs.html()
        needs_run = outcome is None or problem or (stale and not is_automatic)
        if needs_run and is_ready and not bar:
            label = f"{self.run_label} again" if outcome else self.run_label
            run = button(label, do.Run(self.name), kind="" if outcome else "main",
                         hint=self.run_hint)  # fmt: skip
            bar = tag("div", run, class_="ws-actions ws-run")
        parts.append(bar)
        return join((*parts, self.options_html(state)))

    def problem_html(self, state: AppState) -> Markup:
        key, text = self.problem or ((), "")
        return alert(text) if key == self.result_key(state) else EMPTY

    def cards_html(self, key: ResultKey) -> Markup:
        outcome, cards = self.outcome, list[Markup]()
        if outcome is None:
            return EMPTY
        if key == self._applied_key != outcome.key:
            return EMPTY  # applied, not offered again
        hints = {do.Preview: "Compare the result with the current state",
                 do.Apply: "Change the errors; the current state becomes A"}  # fmt: skip
        for index in self.offered_changes(outcome.result):
            buttons = (
                button(kind.__name__, kind(self.name, index), hint=hint,
                       kind="main" if kind is do.Apply else "", disabled=outcome.key != key)
                for kind, hint in hints.items()
            )  # fmt: skip
            cards.append(tag("div", outcome.cards[index][1] + actions(*buttons), class_="ws-card"))
        return join(cards)

    def options_html(self, state: AppState, controls: Markup = EMPTY) -> Markup:
        options = [option for option in self.shown_options(state) if option.name not in OF_STATE]
        if "limit_um" in {option.name for option in self.shown_options(state)}:
            controls = quiet(f"{limit_words(state)}: see the heading.") + controls
        if not options and not controls:
            return EMPTY
        values = self.values(state)
        form = controls + join(
            _control(
                do.SetOption(self.name, option.name), option, values.get(option.name), state.scene
            )
            for option in options
        )
        is_open, key = bool(self.problem_html(state)), f"{self.name}.options"
        return details("Options", form, open=is_open, data_key=key)

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

    @on(do.Preview)
    def preview(self, state: AppState, action: do.Preview) -> AppState | None:
        change = self._change(state, action.card)
        if change is None:
            return None
        name = change.label if change.label.startswith("after ") else ""
        name = name or f"after {self.title.lower()}: {change.label}"
        return compare.with_proposal(state, change.scene, name)

    @on(do.Apply)
    def apply(self, state: AppState, action: do.Apply) -> AppState | None:
        change = self._change(state, action.card)
        if change is None:
            return None
        applied_state = compare.with_applied(state, change.scene, f"before {self.title.lower()}")
        self._applied_key = self.result_key(applied_state)
        description = change.label
        if description.startswith("after "):
            description = description.partition(": ")[2] or description
        self.context.last_decision = state, f"{self.title}: {description}"
        return applied_state

    def _change(self, state: AppState, card: int) -> Change | None:
        outcome = self.outcome
        if outcome is None or outcome.key != self.result_key(state) or card >= len(outcome.cards):
            return None
        return outcome.cards[card][0]

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

        self._run_job(self.kind.doing, compute, self._accept_outcome)

    def run_if_stale(self, state: AppState) -> None:
        """Run it if its inputs have changed; during a drag, when that pauses."""
        if self.result_key(state) == self.last_key or self._jobs.busy:
            return
        if self.last_key and not self.context.is_paused:
            self.context.restart_idle(self)
        else:
            self._run(state)

    def _run_job(self, name: str, compute: Callable[[Job], T], accept: Callable[[T], None]) -> None:
        def work(job: Job) -> None:
            product = compute(job)
            if not job.is_set():
                self.context.call_soon(partial(accept, product))

        self._jobs.start(name, work)

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
            line = f"{key} {html.number(a)} → {html.number(b)} {parameter(key).unit}"
            moved.append((-abs(b - a), line))
    steps = [line for _, line in sorted(moved)] or [change.label]
    lines = [tag("div", tag("b", line)) for line in steps[:MOST_STEPS]]
    n_hidden = len(steps) - MOST_STEPS
    if n_hidden > 0:
        lines.append(tag("div", f"and {n_hidden} more", class_="ws-quiet"))
    try:
        before, after = (PLAIN.evaluate(state).statistics for state in (before_state, after_state))
    except WarpspaceError:
        return join(lines)
    numbers = {"max": "max_um", "mean": "mean_um", "RMS": "rms_um"}
    pairs = ((name, getattr(before, at), getattr(after, at)) for name, at in numbers.items())
    return join(lines) + html.rows(
        (name, f"{html.number(a)} → {html.number(b)} µm") for name, a, b in pairs
    )


def _control(name: do.SetOption, option: Option, text: str | None, scene: Scene) -> Markup:
    hint, default = f"{option.about}.", option.default_words
    metavar = option.grammar and option.grammar.metavar
    if option.kind is bool:
        return html.switch(
            name, option.label, hint=hint, on=(text or str(int(option.default))) == "1"
        )
    if option.choices or metavar == "AXIS":
        keys = option.choices or tuple(scene.machine.axes)
        titles = {key: option.choice_labels.get(key, re.sub("[_-]", " ", key)) for key in keys}
        if not option.default:
            titles = {UNSET: default or "automatic", **titles}
        control = html.choice(name, str(option.default or UNSET) if text is None else text, titles)
        return field(option.label, control, name, option.unit, hint)
    if option.low is not None and option.high is not None:
        hint += f" Range: {option.low:g} to {option.high:g}"
    initial = "" if metavar or option.unset else default
    control = text_box(
        name, initial if text is None else text, size="" if metavar else "short",
        placeholder=default or EXAMPLES.get(metavar or "", metavar or ""),
    )  # fmt: skip
    return field(option.label, control, name, option.unit, hint)
