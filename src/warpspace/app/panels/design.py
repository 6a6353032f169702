"""The task "Design": tolerances held against a limit, and machines side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from string import ascii_uppercase
from typing import Any

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Histogram
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option, read_numbers
from warpspace.analysis.sampling.cases import Case, Over, SamplingPlan
from warpspace.analysis.sampling.distribution import (
    Distribution,
    Draws,
    Probability,
    Stream,
    loop_keys,
)
from warpspace.analysis.sampling.tolerance_search import Ensemble, build_ensemble
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    fill,
    join,
    number,
    rows,
    slider,
    tag,
    text_box,
)
from warpspace.app.evaluation.cache import Cache
from warpspace.app.evaluation.machine_edits import library
from warpspace.app.panels.analysis_panel import AnalysisOutcome, AnalysisPanel, Question
from warpspace.app.panels.block_html import histogram_html
from warpspace.app.panels.form_controls import setting
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.leaf import Identity
from warpspace.app.state.typed_numbers import spell_typed
from warpspace.exceptions import WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Tolerance, ToleranceSet
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.scene.model import Scene
from warpspace.units import Array, spell_count

SAMPLES = 20_000  # machines of a probability on the page
ENSEMBLES: Cache[Ensemble] = Cache(100_000_000)
"""Sampled machines before their tolerances are known, for all sessions together."""
WHERE = {"max": "everywhere", "sampled": "at a random point"}
SCALES = {"÷ 1.5": 1.0 / 1.5, "−5 %": 0.95, "+5 %": 1.05, "× 1.5": 1.5}
"""What all tolerances can be multiplied by."""


def percent(share: float) -> str:
    """Spell a share in per cent; only what is certain reads 0 or 100."""
    value = f"{100.0 * share:.1f}"
    if value == "100.0" and share < 1.0:
        return "99.9"
    return "0.1" if value == "0.0" and share > 0.0 else value


class TolerancesPanel(AnalysisPanel):
    """Limit and probability, the machines within tolerance, and each tolerance by its share."""

    sentence = "How likely machines within tolerance keep the limit, and which tolerances"
    run_words = "Allocate tolerances"
    run_hint = (
        "The widest tolerances that keep the limit with the wanted probability. A half width w"
        " costs 1/w, or its cost over w. Fixed ones and those of zero stay. Undo takes it back."
    )
    _order: tuple[Question, tuple[str, ...]] = ((), ())

    def options(self) -> Sequence[Option]:
        return [one for one in super().options() if one.name in ("clip", "cylinder", "seed")]

    def question(self, state: AppState) -> Question:
        values = tuple(self.values(state).items())
        return (*_sampled(state), state.tolerances, state.specification, values)

    def is_ready(self, state: AppState) -> bool:
        try:
            sample_machines(state)
        except WarpspaceError:
            return False
        return True

    def is_quick(self, state: AppState) -> bool:
        return False  # it would change tolerances by itself

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Allocate for the limit of the state; what another machine had fixed does not count."""
        asked: Any = super().ask(state, values, scenes)
        wanted, known = state.specification, state.amplitudes.keys()
        fixed = wanted.fixed & known
        every = read_numbers(wanted.costs, "", "") if wanted.costs else {}
        costs = tuple((k, cost) for k, cost in every.items() if k in known and k not in fixed)
        return replace(
            asked, limit_um=wanted.limit_um, probability=wanted.percent / 100.0, loop=state.loop,
            over=wanted.over, distribution=wanted.distribution, costs=costs,
            fixed=tuple(sorted(fixed)), samples=SAMPLES, workers=1,
        )  # fmt: skip

    def _take_answer(self, answer: AnalysisOutcome) -> None:
        super()._take_answer(answer)
        found: Any = answer.found

        def update(state: AppState) -> AppState:
            if self.question(state) != answer.question:
                note = "tolerances or limit were changed meanwhile: allocate again"
                return state.noted(note)
            self.context.decided = state, f"{self.title}: allocated for the limit"
            state = edits.with_half_widths(state, found.tolerances)
            self._applied = self.question(state)
            return state

        self.context.post(update)

    def offered(self, found: Result) -> Sequence[int]:
        return ()  # they are set already

    def before_result(self, state: AppState) -> Markup:
        asked = _controls(state, "limit_um", "percent")
        try:
            return asked + self._probability(sample_machines(state), state)
        except WarpspaceError as error:
            return asked + tag("p", str(error), class_="ws-problem", role="alert")

    def options_html(self, state: AppState, above: Markup = EMPTY) -> Markup:
        listed = self._rows(sample_machines(state), state) if self.is_ready(state) else EMPTY
        return listed + super().options_html(
            state, _controls(state, "over", "distribution", "costs")
        )

    def _probability(self, ensemble: Ensemble, state: AppState) -> Markup:
        wanted = state.specification
        stream, kept = estimate(ensemble, state.tolerances, wanted.limit_um)
        bars = stream.display_histogram()
        chart = Histogram(
            "|E| of the machines", "", "|E| [µm]", "machines", bars.edges_um,
            bars.counts.astype(float), limit=wanted.limit_um,
        )  # fmt: skip
        told = fill(
            '<p class="ws-told"><span class="{kind}">{share} %</span> of the machines stay within'
            " {limit} µm {where}</p>",
            kind="ws-kept" if kept.low >= wanted.percent / 100.0 else "ws-missed",
            share=percent(kept.probability), limit=f"{wanted.limit_um:g}", where=WHERE[wanted.over],
        )  # fmt: skip
        numbers = (
            f"mean {number(stream.mean_um)} · P95 {number(stream.quantile(0.95))} ·"
            f" largest {number(stream.max_um)} µm; {spell_count(stream.count)} machines,"
            f" 95 % confidence {percent(kept.low)} … {percent(kept.high)} %"
        )
        return told + histogram_html(chart) + tag("p", numbers, class_="ws-tiny")

    def _rows(self, ensemble: Ensemble, state: AppState) -> Markup:
        shares = tolerance_shares(ensemble, state.tolerances)
        laid_out: Question = (Identity(state.origin), ensemble.keys)
        if self._order[0] != laid_out:  # no row moves away under a hand
            self._order = laid_out, tuple(sorted(shares, key=lambda key: -shares[key]))
        longest = max(shares.values(), default=0.0) or 1.0
        listed = join(_row(state, key, shares[key], longest) for key in self._order[1])
        scales = join(
            button(words, f"{self.name}:scale", words, hint="All but the fixed ones")
            for words in SCALES
        ) + button("As in the scene", f"{self.name}:reset", kind="quiet")
        return tag("h4", "Half widths and shares of the variance") + listed + tag(
            "div", scales, class_="ws-actions", role="group", aria_label="Scale all tolerances"
        )  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "scale" and value in SCALES:
            return edits.with_scaled_tolerances(state, self._order[1], SCALES[value])
        if word == "reset":
            return edits.with_scene_tolerances(state)
        return super().take(state, word, value)


def _controls(state: AppState, *names: str) -> Markup:
    return join(setting(state, f"specification.{name}") for name in names)


def _row(state: AppState, key: str, share: float, longest: float) -> Markup:
    row, span = parameter(key), edits.half_width_span(state, key)
    width, is_fixed = edits.half_width_of(state, key), key in state.specification.fixed
    name = f"state:set.tolerances.{key}"
    return fill(
        '<div class="ws-tolerance" data-key="{name}"><div><span><b>{code}</b> {words}</span>'
        '<span>{share} %</span></div><div class="ws-effect"><i style="width:'
        '{length}%"></i></div><div class="ws-error-set">{slider}±{box}<span class="ws-unit">'
        "{unit}</span>{fixed}</div></div>",
        name=name, code=key, words=row.name, share=number(100.0 * share),
        length=f"{100.0 * share / longest:.1f}", unit=row.unit,
        slider=slider(name, width, span.low, span.high, span.step, twin=name,
                      label=f"Half width of {key}", text=f"±{width:g} {row.unit}"),
        box=text_box(name, spell_typed(width), label=f"Half width of {key} in {row.unit}",
                     size="short", inputmode="decimal"),
        fixed=button("fixed" if is_fixed else "fix", "state:set.specification.fixed",
                     f"{'-' if is_fixed else '+'}{key}", kind="link", pressed=is_fixed,
                     aria_label=f"Fix the tolerance of {key}",
                     hint="A fixed tolerance is neither allocated nor scaled"),
    )  # fmt: skip


def _sampled(state: AppState) -> Question:
    wanted = state.specification
    moving = tuple(state.positions.items()) if state.loop is Loop.RELATIVE else ()
    return (Identity(state.scene), state.view_key, wanted.over, wanted.distribution, moving)


def sample_machines(state: AppState) -> Ensemble:
    """Draw the machines that a state's tolerances are held against."""

    def build() -> Ensemble:
        scene, wanted = state.resulting_scene(), state.specification
        keys = loop_keys(scene.model, state.loop, scene.parameter_keys)
        none = np.zeros(len(keys))
        draws = Draws(keys, none, none, Distribution(wanted.distribution))
        plan, view = SamplingPlan(SAMPLES, 0, Over(wanted.over)), scene.view(state.loop)
        return build_ensemble(Case(scene.model, draws, scene.workspace, view, plan))

    return ENSEMBLES.get(_sampled(state), build, lambda found: found.size)


def allowed_words(state: AppState) -> str:
    """Say the largest error of the machines within tolerance; nothing where there are none."""
    try:
        ensemble = sample_machines(state)
    except WarpspaceError:
        return ""
    largest = float(ensemble.norm_um(*_centres_and_widths(ensemble, state.tolerances)).max())
    return f"tolerances allow {number(largest)} µm" if largest else ""


def _centres_and_widths(ensemble: Ensemble, tolerances: ToleranceSet) -> Array:
    none = Tolerance(0.0, 0.0)
    found = (tolerances.get(key) or none for key in ensemble.keys)
    return np.array([(one.centre, one.half_width) for one in found]).reshape(-1, 2).T


def estimate(
    ensemble: Ensemble, tolerances: ToleranceSet, limit_um: float
) -> tuple[Stream, Probability]:
    """Work out what a tolerance set gives, and how likely the limit is kept."""
    norm_um = ensemble.norm_um(*_centres_and_widths(ensemble, tolerances))
    stream = Stream(len(norm_um), limit_um)
    stream.add(norm_um)
    kept = stream.probability()
    assert kept is not None  # noqa: S101 - a limit was given
    return stream, kept


def tolerance_shares(ensemble: Ensemble, tolerances: ToleranceSet) -> dict[str, float]:
    """Say how much each tolerance adds to the scatter of the error."""
    _, half = _centres_and_widths(ensemble, tolerances)
    parts = half**2 * ensemble.mean_square_gain
    return dict(zip(ensemble.keys, (parts / (float(parts.sum()) or 1.0)).tolist(), strict=True))


# --- Concepts -------------------------------------------------------------------------------------

PRESENT = "the present machine"  # the one that is steered, among those that are compared
ADD = "Compare with …"


class ConceptsPanel(AnalysisPanel):
    """Machines side by side: chosen by title, compared as soon as there are two."""

    at_once = True

    def offers(self, state: AppState) -> dict[str, Scene]:
        """Give the machines that can be compared, by title."""
        found = {PRESENT: state.resulting_scene()}
        own = {one.machine.title: one for one in library().values()}
        for title, scene in {**own, **self.context.scenes}.items():
            if scene not in found.values():
                found[title] = scene
        return found

    def chosen(self, state: AppState) -> list[str]:
        """List the machines that are compared; tolerances are those of the first."""
        text = state.forms.get(f"{self.name}.machines", PRESENT)
        return [key for key in text.split("\n") if key][:MOST_CONCEPTS]

    def options(self) -> Sequence[Option]:
        return [one for one in super().options() if one.name != "workers"]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        return {"limit_um": f"{state.specification.limit_um:g}", "samples": str(SAMPLES)}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        offers = self.offers(state)
        return [offers[key] for key in self.chosen(state) if key in offers]

    def is_ready(self, state: AppState) -> bool:
        return len(self.scenes(state)) > 1  # links may name machines that are not here

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        asked: Any = super().ask(state, values, scenes)
        return replace(asked, workers=1)  # other threads are for who moves sliders meanwhile

    def question(self, state: AppState) -> Question:
        return (
            Identity(state.scene.model), Identity(state.scene.workspace), state.tolerances,
            state.scene.title, tuple(self.values(state).items()),
        )  # fmt: skip

    def before_result(self, state: AppState) -> Markup:
        offers, lines = self.offers(state), list[tuple[Markup, Markup]]()
        chosen = [key for key in self.chosen(state) if key in offers]
        for letter, key in zip(ascii_uppercase, chosen, strict=False):
            opens = button("Open", f"{self.name}:open", key, kind="link", hint="Show it here",
                           aria_label=f"Open {key}")  # fmt: skip
            removes = button("✕", f"{self.name}:remove", key, kind="link", hint="Remove it",
                             aria_label=f"Remove {key}")  # fmt: skip
            title, opens = (key, opens) if key != PRESENT else (state.scene.title, EMPTY)
            lines.append((tag("b", f"{letter} ") + title, opens + removes))
        left = {key: key for key in offers if key not in chosen}
        add = choice(f"{self.name}:set.add", "", {"": ADD, **left},
                     label="Compare with another machine")  # fmt: skip
        listed = rows(lines) if self.is_ready(state) else EMPTY
        return (add if len(chosen) < MOST_CONCEPTS else EMPTY) + listed

    def actions(self, found: Result, *, stale: bool) -> Markup:
        """Give a picture for a review first."""
        draws = self.context.services.draw_concepts is not None
        sheet = (button("Picture", f"{self.name}:sheet", kind="main", disabled=stale,
                        hint="One sheet for a review: the machines at one scale with their numbers")
                 if draws else EMPTY)  # fmt: skip
        return sheet + super().actions(found, stale=stale)

    def take(self, state: AppState, word: str, value: str) -> AppState:
        chosen, offers = self.chosen(state), self.offers(state)
        if word == "set.add" and value in offers and value not in chosen:
            chosen = [*chosen, value][:MOST_CONCEPTS]
        elif word == "remove" and value in chosen:
            chosen.remove(value)
        elif word == "open" and value in offers and value != PRESENT:
            opened = start_state(offers[value])
            self.context.act(partial(self.context.show_opened, opened, None, whole=False))
            return state
        elif word == "sheet":
            self._draw(state)
            return state
        else:
            return super().take(state, word, value)
        self._answer = None  # other machines are compared
        return replace(state, forms={**state.forms, f"{self.name}.machines": "\n".join(chosen)})

    def _draw(self, state: AppState) -> None:
        draw, found = self.context.services.draw_concepts, self._answer
        if draw is None or found is None:
            return
        asked: Any = found.found
        scenes, dark = tuple(self.scenes(state)), state.shown.dark
        self._make(
            "Drawing the machines",
            lambda job: draw(scenes, asked.asked, dark, job),
            partial(self.context.save_file, "concepts.png"),
        )  # fmt: skip
