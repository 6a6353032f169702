"""The task "Design": tolerances and a limit of the error, and comparison of machines."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.acceptance_tests.plans import default_plan, parse_plan, plan_names
from warpspace.analysis.blocks import Histogram
from warpspace.analysis.description import Result
from warpspace.analysis.loop_parameters import loop_keys
from warpspace.analysis.options import Option, read_numbers
from warpspace.analysis.sampling.cases import Case, Reduction, SamplingPlan
from warpspace.analysis.sampling.distribution import Distribution, Draws
from warpspace.analysis.sampling.tolerance_search import Ensemble, build_ensemble
from warpspace.analysis.sampling.worst_case import worst_case_um
from warpspace.app.browser import actions as do
from warpspace.app.browser.html import EMPTY, join
from warpspace.app.browser.templates import Templates
from warpspace.app.documents.transfers import read_upload, upload_text
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.machine_edits import library
from warpspace.app.panels.analysis_panel import AnalysisOutcome, AnalysisPanel, ResultKey
from warpspace.app.panels.block_html import histogram_html
from warpspace.app.panels.panel import alert, on, setting
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.form_values import option_values
from warpspace.app.state.leaf import Identity
from warpspace.exceptions import WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.scene.model import Scene
from warpspace.units import spell_count

HTML = Templates("design")
SAMPLES = 20_000  # machines per probability on the page
ENSEMBLES: Cache[Ensemble] = Cache(100_000_000)
"""Sampled machines before tolerances are applied, for all sessions."""
SCALES = {"÷ 1.5": 1.0 / 1.5, "−5 %": 0.95, "+5 %": 1.05, "× 1.5": 1.5}
"""Factors for all tolerances, by label."""


def percent(share: float) -> str:
    """Format a share in per cent; only a certain one reads 0 or 100."""
    value = f"{100.0 * share:.1f}"
    if value == "100.0" and share < 1.0:
        return "99.9"
    return "0.1" if value == "0.0" and share > 0.0 else value


class TolerancesPanel(AnalysisPanel):
    """Limit and probability, the machines within tolerance, and each tolerance with its share."""

    sentence = "Probability that machines within tolerance meet the limit; allocation of tolerances"
    run_label = "Allocate tolerances"
    run_hint = (
        "Compute the widest tolerances that meet the limit with the required probability. The cost"
        " of a half-width w is cost/w (default 1/w). Fixed and zero tolerances are unchanged."
    )
    _order: tuple[ResultKey, tuple[str, ...]] = ((), ())

    def options(self) -> Sequence[Option]:
        return [o for o in super().options() if o.name in ("clip", "cylinder", "seed")]

    def result_key(self, state: AppState) -> ResultKey:
        values = tuple(self.values(state).items())
        return (*_sampled(state), state.tolerances, state.specification, values)

    def is_ready(self, state: AppState) -> bool:
        return state.specification.limit_um is not None and _can_sample(state)

    def is_automatic(self, state: AppState) -> bool:
        return False  # it would change tolerances by itself

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        """Allocate for the limit of the state; fixed keys of another machine are ignored."""
        specification, keys = state.specification, state.amplitudes.keys()
        fixed = specification.fixed & keys
        costs_by_key = read_numbers(specification.costs, "", "") if specification.costs else {}
        costs = tuple((k, cost) for k, cost in costs_by_key.items() if k in keys and k not in fixed)
        return {
            "limit_um": specification.limit_um, "probability": specification.percent / 100.0,
            "loop": state.loop, "over": specification.over,
            "distribution": specification.distribution, "costs": costs,
            "fixed": tuple(sorted(fixed)), "samples": SAMPLES, "workers": 1,
        }  # fmt: skip

    def _accept_outcome(self, outcome: AnalysisOutcome) -> None:
        super()._accept_outcome(outcome)
        result: Any = outcome.result

        def update(state: AppState) -> AppState:
            if self.result_key(state) != outcome.key:
                return state.noted("tolerances or limit changed in the meantime: allocate again")
            self.context.last_decision = state, f"{self.title}: allocated for the limit"
            state = edits.with_half_widths(state, result.tolerances)
            self._applied_key = self.result_key(state)
            return state

        self.context.post(update)

    def offered_changes(self, result: Result) -> Sequence[int]:
        return ()  # applied already

    def before_result(self, state: AppState) -> Markup:
        controls = _settings(state, "limit_um", "percent")
        try:
            ensemble = sample_machines(state)
        except WarpspaceError as error:
            return controls + alert(self.spell_error(error))
        specification = state.specification
        stream = ensemble.estimate(state.tolerances, specification.limit_um)
        histogram = stream.display_histogram()
        chart = Histogram(
            "|E| of the machines", "", "|E| [µm]", "machines", histogram.edges_um,
            histogram.counts.astype(float), limit=specification.limit_um,
        )  # fmt: skip
        return HTML.probability(
            controls, specification, stream, stream.probability(), histogram_html(chart), percent,
            spell_count(stream.count),
        )  # fmt: skip

    def options_html(self, state: AppState, controls: Markup = EMPTY) -> Markup:
        options = super().options_html(state, _settings(state, "over", "distribution", "costs"))
        if not _can_sample(state):
            return options
        ensemble = sample_machines(state)
        shares = ensemble.variance_shares(state.tolerances)
        order_key: ResultKey = (Identity(state.origin), ensemble.keys)
        if self._order[0] != order_key:  # rows must not move during a drag
            self._order = order_key, tuple(sorted(shares, key=lambda key: -shares[key]))
        widths = {key: edits.half_width_of(state, key) for key in self._order[1]}
        lines = [
            (parameter(key), width, edits.half_width_span(state, key), shares[key])
            for key, width in widths.items()
        ]
        longest = max(shares.values(), default=0.0) or 1.0
        return HTML.tolerances(lines, longest, state.specification.fixed, SCALES) + options

    @on(do.Input.SCALE_TOLERANCES)
    def scale(self, state: AppState, label: str) -> AppState | None:
        if label not in SCALES:
            return None
        return edits.with_scaled_tolerances(state, self._order[1], SCALES[label])

    @on(do.Signal.RESET_TOLERANCES)
    def reset(self, state: AppState) -> AppState:
        return edits.with_scene_tolerances(state)


def _settings(state: AppState, *names: str) -> Markup:
    return join(setting(state, f"specification.{name}") for name in names)


def _sampled(state: AppState) -> ResultKey:
    specification = state.specification
    positions = tuple(state.positions.items()) if state.loop is Loop.RELATIVE else ()
    shape = specification.over, specification.distribution
    return (Identity(state.scene), state.view_key, *shape, positions)


def sample_machines(state: AppState) -> Ensemble:
    def build() -> Ensemble:
        scene, specification = state.resulting_scene(), state.specification
        keys = loop_keys(scene.model, state.loop, scene.parameter_keys)
        zeros = np.zeros(len(keys))
        draws = Draws(keys, zeros, zeros, Distribution(specification.distribution))
        plan, view = SamplingPlan(SAMPLES, 0, Reduction(specification.over)), scene.view(state.loop)
        return build_ensemble(Case(scene.model, draws, scene.workspace, view, plan))

    return ENSEMBLES.get(_sampled(state), build, lambda ensemble: ensemble.size)


def _can_sample(state: AppState) -> bool:
    try:
        sample_machines(state)
    except WarpspaceError:
        return False
    return True


def allowed_words(state: AppState) -> Markup:
    """Format the largest |E| of sampled machines within tolerance, and that of all of them."""
    if not _can_sample(state):
        return EMPTY
    ensemble = sample_machines(state)
    ranges = ensemble.ranges(state.tolerances)
    largest = float(ensemble.norm_um(*ranges).max())
    if not largest:
        return EMPTY
    worst_um = None
    if ensemble.spread is None:  # all machines at the same points
        worst_um = worst_case_um(ensemble.gains.astype(float), *ranges)
    return HTML.allowed(largest, worst_um, spell_count(len(ensemble.unit)))


# --- Concepts -------------------------------------------------------------------------------------

PRESENT = "the present machine"  # the edited one, among the compared machines


class ConceptsPanel(AnalysisPanel):
    """Machines side by side: chosen by title, compared as soon as there are two."""

    runs_on_open = True
    unsupported = ("workers",)

    def offers(self, state: AppState) -> dict[str, Scene]:
        """Return the machines that can be compared, by title."""
        machines = {PRESENT: state.resulting_scene()}
        bundled = {scene.machine.title: scene for scene in library().values()}
        for title, scene in {**bundled, **self.context.scenes}.items():
            if scene not in machines.values():
                machines[title] = scene
        return machines

    def chosen(self, state: AppState) -> list[str]:
        """List the compared machines; the tolerances are those of the first."""
        text = state.forms.get(f"{self.name}.machines", PRESENT)
        return [key for key in text.split("\n") if key][:MOST_CONCEPTS]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {"limit_um": super().defaults(state)["limit_um"], "samples": str(SAMPLES)}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        offers = self.offers(state)
        return [offers[key] for key in self.chosen(state) if key in offers]

    def is_ready(self, state: AppState) -> bool:
        return len(self.scenes(state)) > 1  # links may name unknown machines

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"workers": 1}  # leaves threads to the sliders

    def result_key(self, state: AppState) -> ResultKey:
        return (
            Identity(state.scene.model), Identity(state.scene.workspace), state.tolerances,
            state.scene.title, tuple(self.values(state).items()),
        )  # fmt: skip

    def before_result(self, state: AppState) -> Markup:
        offers = self.offers(state)
        chosen = [key for key in self.chosen(state) if key in offers]
        remaining = {"": "Compare with …", **{key: key for key in offers if key not in chosen}}
        return HTML.machines(PRESENT, state.scene.title, chosen, remaining, MOST_CONCEPTS)

    def actions(self, result: Result, *, stale: bool) -> Markup:
        """Render the buttons below a result, the picture for a review first."""
        draws = self.context.services.draw_concepts is not None
        return (HTML.sheet(stale) if draws else EMPTY) + super().actions(result, stale=stale)

    @on(do.Input.ADD_CONCEPT, do.Input.REMOVE_CONCEPT)
    def choose(self, state: AppState, action: do.InputValue) -> AppState | None:
        chosen, key = self.chosen(state), action.value
        if action.input is do.Input.REMOVE_CONCEPT and key in chosen:
            chosen.remove(key)
        elif action.input is do.Input.ADD_CONCEPT and key in self.offers(state).keys() - chosen:
            chosen.append(key)
        else:
            return None
        self.outcome = None  # other machines are compared
        forms = {**state.forms, f"{self.name}.machines": "\n".join(chosen[:MOST_CONCEPTS])}
        return replace(state, forms=forms)

    @on(do.Input.OPEN_CONCEPT)
    def open(self, state: AppState, title: str) -> None:
        offers = self.offers(state)
        if title in offers and title != PRESENT:
            show = partial(self.context.show_opened, keeps_comparison=True)
            self.context.call_soon(partial(show, start_state(offers[title]), None))

    @on(do.Signal.DRAW_CONCEPTS)
    def draw(self, state: AppState) -> None:
        draw, outcome = self.context.services.draw_concepts, self.outcome
        if draw is None or outcome is None:
            return
        result: Any = outcome.result
        scenes, dark = tuple(self.scenes(state)), state.shown.dark
        self._jobs.start(
            "Drawing the machines",
            lambda job: draw(scenes, result.analysis, dark, job),
            partial(self.context.save_file, "concepts.png"),
        )


# --- Acceptance tests -----------------------------------------------------------------------------

MOST_PLAN_BYTES, PLAN, OWN_PLAN = 100_000, "plan of tests", "file"


class AcceptancePanel(AnalysisPanel):
    """The worst machine that passes its tests; their paths are drawn while the section is open."""

    sentence = "The worst machine within tolerance that still passes its acceptance tests"
    run_label = "Find the worst machine"
    unsupported = ("kinds",)  # readings are fitted first: a calibrated scene is a measured one

    def shown_options(self, state: AppState) -> Sequence[Option]:
        """Offer the uncertainty of the errors where the scene states it."""
        is_stated = bool(state.scene.covariance or state.scene.uncertainty)
        return [option for option in self.options() if is_stated or option.name != "measured"]

    def inputs(self, state: AppState) -> Mapping[str, Any]:
        return {"plan": option_values(state, self.name).get("plan") or None}

    def before_result(self, state: AppState) -> Markup:
        plan = option_values(state, self.name).get("plan") or default_plan(state.scene)
        titles = {name: name.replace("_", " ") for name in plan_names()}
        if plan not in titles:
            plan, titles = OWN_PLAN, {**titles, OWN_PLAN: "opened file"}
        return HTML.plan(self.name, titles, plan, MOST_PLAN_BYTES)

    @on(do.SetOption)
    def set_option(self, state: AppState, action: do.SetOption) -> AppState | None:
        if action.option == "plan" and action.value in plan_names():
            return self._with_plan(state, action.value)
        return super().set_option(state, action)

    @on(do.Upload, later=True)
    def upload(self, action: do.Upload) -> None:
        def read() -> str:
            name, content = read_upload(action, MOST_PLAN_BYTES, PLAN)
            text = upload_text(content, name, PLAN)
            parse_plan(text, name, self.context.state.scene)
            return text

        def accept(text: str) -> None:
            self.context.post(lambda state: self._with_plan(state, text))

        self.last_key = self.result_key(self.context.state)
        self._jobs.start("Reading", lambda _: read(), accept)

    def _with_plan(self, state: AppState, plan: str) -> AppState:
        return replace(state, forms={**state.forms, f"{self.name}.plan": plan})
