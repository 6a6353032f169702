"""The task "Design": tolerances held against a limit, and machines side by side."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from warpspace.analysis.blocks import Histogram
from warpspace.analysis.cases import Case, Over, Plan
from warpspace.analysis.description import Analysis, Result
from warpspace.analysis.options import Option
from warpspace.app.browser.html import (
    EMPTY,
    button,
    choice,
    field,
    fill,
    join,
    number,
    rows,
    slider,
    tag,
    text_box,
    thousands,
)
from warpspace.app.evaluation.cache import Cache
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState, start_state
from warpspace.app.state.leaf import Identity
from warpspace.app.state.tree import leaves, put, toggled
from warpspace.app.state.typed_numbers import read_costs, spell_typed
from warpspace.app.tasks.analysis import AnalysisPart, Question
from warpspace.app.tasks.cards import Card
from warpspace.app.tasks.charts import histogram_html
from warpspace.exceptions import WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import parameter
from warpspace.machine.errors import Tolerance, ToleranceSet
from warpspace.machine.limits import MOST_CONCEPTS
from warpspace.scene.model import Scene

if TYPE_CHECKING:
    from warpspace.analysis.allocating import Ensemble
    from warpspace.analysis.concepts import Concept
    from warpspace.analysis.distribution import Probability, Stream

SAMPLES = 20_000  # machines of a probability on the page
ENSEMBLES: "Cache[Ensemble]" = Cache(100_000_000)
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


class TolerancesPart(AnalysisPart):
    """Limit and probability, the machines within tolerance, and each tolerance by its share."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.title = "Tolerances"
        self.sentence = "How likely machines within tolerance keep the limit, and which tolerances"
        self._order: tuple[Question, tuple[str, ...]] = ((), ())

    def options(self) -> Sequence[Option]:
        """Ask only what the state does not say."""
        return [one for one in super().options() if one.name in ("clip", "cylinder", "seed")]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Leave them to the analysis."""
        return {}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        """Give the machine with all its tolerances; errors do not matter."""
        return [state.resulting_scene()]

    def question(self, state: AppState) -> Question:
        """Depend on the machine, the tolerances and the limit."""
        return (*_sampled(state), state.tolerances, state.specification,
                tuple(self.values(state).items()))  # fmt: skip

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Allocate for the limit of the state; what another machine had fixed does not count."""
        asked: Any = super().ask(state, values, scenes)
        wanted, known = state.specification, state.amplitudes.keys()
        fixed = wanted.fixed & known
        every = read_costs(wanted.costs, {*known, *_keys_of(wanted.costs)})
        costs = {key: cost for key, cost in every.items() if key in known and key not in fixed}
        return replace(
            asked, limit_um=wanted.limit_um, probability=wanted.percent / 100.0, loop=state.loop,
            over=wanted.over, distribution=wanted.distribution, costs=tuple(costs.items()),
            fixed=tuple(sorted(fixed)), samples=SAMPLES, workers=1,
        )  # fmt: skip

    def _take_answer(
        self, question: Question, found: Any, cards: tuple[Card, ...], took_s: float
    ) -> None:
        super()._take_answer(question, found, cards, took_s)

        def update(state: AppState) -> AppState:
            if self.question(state) != question:
                note = "tolerances or limit were changed meanwhile: allocate again"
                return state.noted(note)
            return edits.with_half_widths(state, found.tolerances)

        self.context.post(update)

    # --- the page ------------------------------------------------------------------------------

    def _body(self, state: AppState) -> Markup:
        wanted = state.specification
        asked = join(
            _number(f"{self.name}:specification.{name}", label, f"{value:g}", unit)
            for name, label, value, unit in (
                ("limit_um", "|E| at most", wanted.limit_um, "µm"),
                ("percent", "of the machines", wanted.percent, "%"),
            )
        )
        try:
            ensemble = _ensemble(state)
        except WarpspaceError as error:
            refused = tag("p", str(error), class_="ws-problem", role="alert")
            return asked + refused + self._settings(state)
        parts = [asked, self._probability(ensemble, state), self._run_row()]
        if self._problem is not None and self._problem[0] == self.question(state):
            parts.append(tag("p", self._problem[1], class_="ws-problem", role="alert"))
        parts.append(self._allocated(state))
        parts.append(self._rows(ensemble, state))
        return join((*parts, self._settings(state)))

    def _probability(self, ensemble: "Ensemble", state: AppState) -> Markup:
        wanted = state.specification
        stream, kept = estimate(ensemble, state.tolerances, wanted.limit_um)
        bars = stream.display_histogram()
        chart = Histogram(
            "|E| of the machines", "", "|E| [µm]", "machines", bars.edges_um,
            bars.counts.astype(float), limit=wanted.limit_um,
        )  # fmt: skip
        reached = kept.low >= wanted.percent / 100.0
        told = fill(
            '<p class="ws-told"><span class="{kind}">{share} %</span> of the machines stay within'
            " {limit} µm {where}</p>",
            kind="ws-kept" if reached else "ws-missed", share=percent(kept.probability),
            limit=f"{wanted.limit_um:g}", where=WHERE[wanted.over],
        )  # fmt: skip
        numbers = (
            f"mean {number(stream.mean_um)} · P95 {number(stream.quantile(0.95))} ·"
            f" largest {number(stream.max_um)} µm; {thousands(stream.count)} machines,"
            f" 95 % confidence {percent(kept.low)} … {percent(kept.high)} %"
        )
        return told + histogram_html(chart) + tag("p", numbers, class_="ws-tiny")

    def _run_row(self) -> Markup:
        if self._jobs.busy:
            return super()._run_row()
        hint = (
            "The widest tolerances that keep the limit with the wanted probability. A half width w"
            " costs 1/w, or its cost over w. Fixed ones and those of zero stay. Undo takes it back."
        )
        run = button("Allocate tolerances", f"{self.name}:run", kind="main", hint=hint)
        return tag("div", run, class_="ws-actions ws-run")

    def _allocated(self, state: AppState) -> Markup:
        found: Any = self._answer[1] if self._answer is not None else None
        if found is None or any(
            edits.half_width_of(state, key) != width for key, width in found.tolerances.items()
        ):
            return EMPTY
        words = (
            f"Allocated: {len(found.tolerances)} tolerances;"
            f" before {percent(found.before.probability)} %."
            f" Cost {found.cost_before:.3g} → {found.cost_after:.3g}."
            f" {found.exact.words().capitalize()}."
        )
        if found.at_widest:
            words += f" At most ±{found.widest:g}: {', '.join(found.at_widest)}."
        return tag("p", words, class_="ws-tiny") + self.actions(found, stale=False)

    def _rows(self, ensemble: "Ensemble", state: AppState) -> Markup:
        shares = tolerance_shares(ensemble, state.tolerances)
        laid_out: Question = (Identity(state.origin), ensemble.keys)
        if self._order[0] != laid_out:  # no row moves away under a hand
            self._order = laid_out, tuple(sorted(shares, key=lambda key: -shares[key]))
        longest = max(shares.values(), default=0.0) or 1.0
        listed = join(
            self._row(state, key, shares[key], shares[key] / longest) for key in self._order[1]
        )
        scales = join(
            button(words, f"{self.name}:scale", words, hint="All but the fixed ones")
            for words in SCALES
        ) + button("As in the scene", f"{self.name}:reset", kind="quiet")
        return tag("h4", "Half widths and shares of the variance") + listed + tag(
            "div", scales, class_="ws-actions", role="group", aria_label="Scale all tolerances"
        )  # fmt: skip

    def _row(self, state: AppState, key: str, share: float, length: float) -> Markup:
        row, span = parameter(key), edits.half_width_span(state, key)
        width = edits.half_width_of(state, key)
        name, fixed = f"{self.name}:width.{key}", key in state.specification.fixed
        return fill(
            '<div class="ws-tolerance" data-key="{key}"><div><span><b>{code}</b> {words}</span>'
            '<span>{share} %</span></div><div class="ws-effect"><i style="width:'
            '{length}%"></i></div><div class="ws-error-set">{slider}±{box}<span class="ws-unit">'
            "{unit}</span>{fixed}</div></div>",
            key=f"tolerance-{key}", code=key, words=row.name, share=number(100.0 * share),
            length=f"{100.0 * length:.1f}", unit=row.unit,
            slider=slider(name, width, span.low, span.high, span.step, twin=name,
                          label=f"Half width of {key}", text=f"±{width:g} {row.unit}"),
            box=text_box(name, spell_typed(width), label=f"Half width of {key} in {row.unit}",
                         size="short", inputmode="decimal"),
            fixed=button("fixed" if fixed else "fix", f"{self.name}:fix", key, kind="link",
                         pressed=fixed, aria_label=f"Fix the tolerance of {key}",
                         hint="A fixed tolerance is neither allocated nor scaled"),
        )  # fmt: skip

    def _settings(self, state: AppState) -> Markup:
        from warpspace.app.tasks.forms import form_html

        parts: list[Markup] = []
        for of in ("over", "distribution", "costs"):
            leaf = leaves(state)[f"specification.{of}"]
            name, value = f"{self.name}:{leaf.path}", getattr(state.specification, of)
            control = (choice(name, value, leaf.choices) if leaf.choices
                       else text_box(name, value, placeholder="EA0Z=4, EXX=0.5"))  # fmt: skip
            parts.append(field(leaf.label, control, name, hint=leaf.hint))
        parts.append(form_html(self.name, self.options(), self.values(state), state.scene))
        return tag("details", tag("summary", "Options") + join(parts), class_="ws-options",
                   data_key=f"{self.name}.options")  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Set, fix, scale or allocate tolerances."""
        what, _, key = word.partition(".")
        if what == "width":
            return put(state, f"tolerances.{key}", value)
        if what == "specification":
            return put(state, word, value)
        if word == "fix":
            return toggled(state, "specification.fixed", value)
        if word == "scale" and value in SCALES:
            return edits.with_scaled_tolerances(state, self._order[1], SCALES[value])
        if word == "reset":
            return edits.with_scene_tolerances(state)
        return super().take(state, word, value)


def _number(name: str, label: str, value: str, unit: str) -> Markup:
    return field(label, text_box(name, value, size="short", inputmode="decimal"), name, unit)


def _keys_of(costs: str) -> set[str]:
    return {pair.partition("=")[0] for pair in costs.split(",") if pair}


def _sampled(state: AppState) -> Question:
    """Give all that machines depend on before their tolerances are known."""
    wanted, scene = state.specification, state.scene
    moving = tuple(state.positions.items()) if state.loop is Loop.RELATIVE else ()
    return (
        Identity(scene.model), Identity(scene.workspace), str(scene.reference),
        scene.parameter_keys, state.seen, wanted.over, wanted.distribution, moving,
    )  # fmt: skip


def _ensemble(state: AppState) -> "Ensemble":
    return ENSEMBLES.get(_sampled(state), lambda: sample_machines(state), lambda found: found.size)


def sample_machines(state: AppState) -> "Ensemble":
    """Draw the machines that a state's tolerances are held against."""
    # scipy's distributions take half a second to import: not before the first picture
    from warpspace.analysis.allocating import build_ensemble
    from warpspace.analysis.distribution import Distribution, Draws, loop_keys

    scene, wanted = state.resulting_scene(), state.specification
    keys = loop_keys(scene.model, state.loop, scene.parameter_keys)
    none = np.zeros(len(keys))
    draws = Draws(keys, none, none, Distribution(wanted.distribution))
    plan = Plan(SAMPLES, 0, Over(wanted.over))
    return build_ensemble(Case(scene.model, draws, scene.workspace, scene.view(state.loop), plan))


def estimate(
    ensemble: "Ensemble", tolerances: ToleranceSet, limit_um: float
) -> "tuple[Stream, Probability]":
    """Work out what a tolerance set gives, and how likely the limit is kept."""
    from warpspace.analysis.distribution import Stream

    none = Tolerance(0.0, 0.0)
    found = [tolerances.get(key) or none for key in ensemble.keys]
    norm_um = ensemble.norm_um(
        np.array([one.centre for one in found]), np.array([one.half_width for one in found])
    )
    stream = Stream(len(norm_um), limit_um)
    stream.add(norm_um)
    kept = stream.probability()
    assert kept is not None  # noqa: S101 - a limit was given
    return stream, kept


def tolerance_shares(ensemble: "Ensemble", tolerances: ToleranceSet) -> dict[str, float]:
    """Say how much each tolerance adds to the scatter of the error."""
    half = np.array(
        [one.half_width if (one := tolerances.get(key)) else 0.0 for key in ensemble.keys]
    )
    parts = half**2 * ensemble.mean_square_gain
    return dict(zip(ensemble.keys, (parts / (float(parts.sum()) or 1.0)).tolist(), strict=True))


# --- Concepts -------------------------------------------------------------------------------------

PRESENT = "present"  # the machine that is steered, among those that are compared
DRAWING_S = 8.0  # how long a sheet usually takes
ADD = "Compare with …"


class ConceptsPart(AnalysisPart):
    """Machines side by side: chosen by title, compared as soon as there are two."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.title = "Machines side by side"
        self._asked_for: tuple[str, ...] = ()
        self._compared = self._asked_for

    def offers(self, state: AppState) -> dict[str, tuple[str, Scene]]:
        """Give title and scene of each machine that can be compared, by what its choice sends."""
        from warpspace.app.evaluation.machine_edits import library

        found = {PRESENT: (f"{state.scene.title} (as it stands)", state.resulting_scene())}
        scenes = [(one.machine.title, one) for one in library().values()]
        for title, scene in (*scenes, *self.context.scenes.items()):
            if not any(scene is other or scene == other for _, other in found.values()):
                found[title] = (title, scene)
        return found

    def chosen(self, state: AppState) -> list[str]:
        """List the machines that are compared; tolerances are those of the first."""
        text = state.forms.get(f"{self.name}.machines", PRESENT)
        return [key for key in text.split("\n") if key][:MOST_CONCEPTS]

    def options(self) -> Sequence[Option]:
        """Leave out how many threads there are."""
        return [one for one in super().options() if one.name != "workers"]

    def defaults(self, state: AppState) -> Mapping[str, str]:
        """Take the limit of the state; as many machines as the tolerances have."""
        return {"limit_um": f"{state.specification.limit_um:g}", "samples": str(SAMPLES)}

    def scenes(self, state: AppState) -> Sequence[Scene]:
        """Give the chosen machines."""
        offers = self.offers(state)
        return [offers[key][1] for key in self.chosen(state) if key in offers]

    def ask(self, state: AppState, values: Mapping[str, str], scenes: Sequence[Scene]) -> Analysis:
        """Sample on one thread: the others are for who moves sliders meanwhile."""
        asked: Any = super().ask(state, values, scenes)
        return replace(asked, workers=1)

    def question(self, state: AppState) -> Question:
        """Depend on the machines and their tolerances; errors do not matter."""
        return (
            Identity(state.scene.model), Identity(state.scene.workspace), state.tolerances,
            state.scene.title, tuple(self.values(state).items()),
        )  # fmt: skip

    def before_result(self, state: AppState) -> Markup:
        """Choose a machine to compare, and list those chosen."""
        chosen, offers = self.chosen(state), self.offers(state)
        left = {key: title for key, (title, _) in offers.items() if key not in chosen}
        name = f"{self.name}:set.add"
        add = EMPTY
        if len(chosen) < MOST_CONCEPTS:
            add = choice(name, "", {"": ADD, **left}, label="Compare with another machine")
        if len(chosen) < 2:
            return add
        return add + join(
            self._card(letter, key, offers, index)
            for index, (letter, key) in enumerate(zip(ascii_uppercase, chosen, strict=False))
            if key in offers
        )

    def _card(
        self, letter: str, key: str, offers: Mapping[str, tuple[str, Scene]], index: int
    ) -> Markup:
        title = offers[key][0]
        found: Any = self._answer[1] if self._answer is not None else None
        known: Concept | None = None
        if found is not None and self._compared[index : index + 1] == (key,):
            known = found.concepts[index]
        buttons = EMPTY
        if key != PRESENT:
            buttons = button("Open", f"{self.name}:open", key, kind="link", hint="Show it here",
                             aria_label=f"Open {title}")  # fmt: skip
        buttons += button("✕", f"{self.name}:remove", key, kind="link", hint="Remove it",
                          aria_label=f"Remove {title}")  # fmt: skip
        head = tag("div", tag("b", f"{letter} ") + title + buttons)
        return tag("div", head + (_concept(known, found) if known else EMPTY), class_="ws-card",
                   data_key=f"concept-{letter}")  # fmt: skip

    def headline(self, found: Result) -> Markup:
        """Say which machine errs least."""
        concepts: Sequence[Concept] = getattr(found, "concepts", ())
        means = [one.sampled.mean_um for one in concepts]
        if len(set(means)) < 2:
            return EMPTY
        least = min(means)
        letter = ascii_uppercase[means.index(least)]
        return tag(
            "p", f"{letter} has the smallest mean |E|, {number(least)} µm.", class_="ws-told"
        )

    def result_html(self, found: Result) -> Markup:
        """Say how they were sampled."""
        asked = getattr(found, "asked", None)
        if asked is None:
            return super().result_html(found)
        tolerances = (
            "each its own tolerances" if asked.own_tolerances else "tolerances of A for all"
        )
        words = f"{thousands(asked.samples)} machines of each, {tolerances}, {asked.loop} loop"
        return tag("p", f"{words}; |E| {asked.where}.", class_="ws-tiny")

    def actions(self, found: Result, *, stale: bool) -> Markup:
        """Give a picture for a review first."""
        draws = self.context.services.draw_concepts is not None
        sheet = (button("Picture", f"{self.name}:sheet", kind="main", disabled=stale,
                        hint="One sheet for a review: the machines at one scale with their numbers")
                 if draws else EMPTY)  # fmt: skip
        return sheet + super().actions(found, stale=stale)

    def _run_row(self) -> Markup:
        return super()._run_row() if self._asked or self._jobs.busy else EMPTY

    def take(self, state: AppState, word: str, value: str) -> AppState:
        """Choose machines, which compares them; open one; draw the sheet."""
        chosen = self.chosen(state)
        if word == "set.add" and value in self.offers(state) and value not in chosen:
            chosen = [*chosen, value][:MOST_CONCEPTS]
        elif word == "remove" and value in chosen:
            chosen.remove(value)
        elif word == "open" and value in (offers := self.offers(state)) and value != PRESENT:
            opened = start_state(offers[value][1])
            self.context.act(lambda: self._open(opened))
            return state
        elif word == "sheet":
            self._draw(state)
            return state
        elif word == "run" and len(chosen) < 2:
            return state
        else:
            return super().take(state, word, value)
        state = replace(state, forms={**state.forms, f"{self.name}.machines": "\n".join(chosen)})
        if len(chosen) > 1:
            self._run(state)
        return state

    def _open(self, opened: AppState) -> None:
        self.context.show_opened(opened, None, whole=False)

    def _run(self, state: AppState) -> None:
        self._asked_for = tuple(self.chosen(state))
        super()._run(state)

    def _take_answer(
        self, question: Question, found: Any, cards: tuple[Card, ...], took_s: float
    ) -> None:
        self._compared = self._asked_for
        super()._take_answer(question, found, cards, took_s)

    def _draw(self, state: AppState) -> None:
        draw, found = self.context.services.draw_concepts, self._answer
        if draw is None or found is None:
            return
        asked: Any = found[1]
        scenes, dark = tuple(self.scenes(state)), state.shown.dark

        def work(cancelled: threading.Event) -> None:
            content = draw(scenes, asked.asked, dark, cancelled)
            if not cancelled.is_set():
                self.context.act(partial(self.context.save_file, "concepts.png", content))

        self._jobs.start("Drawing the machines", work, DRAWING_S)


def _concept(known: "Concept", found: Any) -> Markup:
    sampled = known.sampled
    three = " · ".join(number(one) for one in (sampled.mean_um, sampled.p95_um, sampled.max_um))
    pairs = [("mean, P95, max", f"{three} µm")]
    if sampled.probability is not None:
        kept = f"{percent(sampled.probability.probability)} %"
        pairs.append((f"within {found.asked.limit_um:g} µm", kept))
    matter = ", ".join(f"{one.key} {100.0 * one.share:.0f} %" for one in known.leading)
    return rows(pairs) + tag("p", f"Most of the variance: {matter}", class_="ws-tiny")
