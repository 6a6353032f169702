"""The tab "Tolerances": limit and probability, a slider and a share per error, allocation."""

import threading
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from viser import uplot

from warpspace.app.browser.clicks import Clicks
from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.curve_chart import (
    WHOLE,
    add_chart,
    chart_axis,
    chart_text,
    describe_histogram,
)
from warpspace.app.readouts.html import message
from warpspace.app.readouts.probability import (
    FIXED,
    histogram_lines,
    spell_allocation,
    spell_probability,
    spell_scatter,
    spell_tolerance,
)
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.specification import LIMIT_UM, MAX, NORMAL, PERCENT, SAMPLED, UNIFORM
from warpspace.exceptions import WarpspaceError
from warpspace.kinematics.model import Loop
from warpspace.machine.axes import Parameter, parameter
from warpspace.machine.errors import ToleranceSet

if TYPE_CHECKING:
    from warpspace.analysis.allocating import Ensemble


# --- The rows of the tab Tolerances: per error its share, its box "fixed" and its slider ----------


class ToleranceRows:
    """Sliders of half widths, those that matter most first.

    Their order is that of the shares when they are laid out: no row moves away under a hand.
    """

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._clicks = Clicks(context.gui, self._clicked)
        self._home: Any = context.gui.add_folder(None)
        self._folder: Any = None
        self._sliders: dict[str, Input[float]] = {}
        self._shares: dict[str, Any] = {}

    @property
    def keys(self) -> tuple[str, ...]:
        """Parameters that have a row."""
        return tuple(self._sliders)

    def _clicked(self, word: str) -> None:
        what, _, key = word.partition(" ")
        if what == FIXED:
            self._context.post(
                lambda state: edits.with_fixed(state, key, key not in state.specification.fixed)
            )

    def build(self, state: AppState, shares: Mapping[str, float]) -> None:
        """Lay out the rows of the parameters of a loop."""
        gui = self._context.gui
        if self._folder is not None:
            self._folder.remove()
        self._sliders, self._shares = {}, {}
        with self._home:
            self._folder = gui.add_folder("Half width and share of each error")
        longest = max(shares.values(), default=0.0)
        with self._folder:
            for key in sorted(shares, key=lambda key: -shares[key]):
                row = parameter(key)
                self._shares[key] = gui.add_html(self._spell(state, row, shares[key], longest))
                self._sliders[key] = Input(self._slider(state, row), self._context.changed)

    def _slider(self, state: AppState, row: Parameter) -> Any:
        span = edits.half_width_span(state, row.key)
        centre = found.centre if (found := state.tolerances.get(row.key)) else 0.0
        return self._context.gui.add_slider(
            f"{row.key} · {row.name} ± [{row.unit}]",
            min=span.low,
            max=span.high,
            step=span.step,
            initial_value=edits.half_width_of(state, row.key),
            hint=f"Half width of the tolerance of {row.name} about {centre:g} {row.unit}; 0 holds"
            " it there.",
        )

    def _spell(self, state: AppState, row: Parameter, share: float, longest: float) -> str:
        fixed = row.key in state.specification.fixed
        return spell_tolerance(row, share, longest, fixed=fixed, button=self._clicks.button)

    def read(self, state: AppState) -> AppState:
        """Take over the sliders that a browser has moved."""
        for key, slider in self._sliders.items():
            half_width = slider.poll()
            if half_width is not None:
                state = edits.with_half_width(state, key, half_width)
        return state

    def show(self, state: AppState) -> None:
        """Put the sliders where the state has them; one that is too short is made longer."""
        for key, slider in self._sliders.items():
            span = edits.half_width_span(state, key)
            slider.handle.max = max(slider.handle.max, span.high)
            slider.show(edits.half_width_of(state, key))

    def show_shares(self, state: AppState, shares: Mapping[str, float]) -> None:
        """Write the shares and the boxes; what is the same already is not sent."""
        longest = max(shares.values(), default=0.0)
        for key, handle in self._shares.items():
            text = self._spell(state, parameter(key), shares[key], longest)
            if handle.content != text:
                handle.content = text


# --- The button "Allocate" with what belongs to it ------------------------------------------------
# Wanted share, costs, progress, outcome.

NAME = "Allocating tolerances"
USUAL_S = 3.0


class AllocationPart:
    """Allocates tolerances beside the session and applies them as one change."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, gui = context, context.gui
        self._done = 0.0
        self._keys: tuple[str, ...] = ()
        self._found: tuple[ToleranceSet, str] | None = None
        self._percent: Input[float] = Input(
            gui.add_slider(
                "Probability wanted [%]",
                min=PERCENT.low,
                max=PERCENT.high,
                step=PERCENT.step,
                initial_value=state.specification.percent,
                hint="Share of the machines that is to stay within the limit once tolerances are"
                " allocated.",
            ),
            context.changed,
        )
        self._start: Any = gui.add_button(
            "Allocate",
            hint="The widest tolerances that keep the limit with the wanted probability. A half"
            " width w costs 1/w, or the cost below over w. Fixed ones and those of zero stay."
            " Undo takes it back in one step.",
        )
        self._start.on_click(lambda _: context.act(self._allocate))
        self._job = JobPart(
            context,
            lambda _, words: context.notify("Not allocated", words, "red"),
            "Leave the tolerances as they are.",
            words=None,
            percent=lambda _: min(100.0 * self._done, 100.0),
            kept="The tolerances stay as they were.",
        )
        self._outcome: Any = gui.add_html("", visible=False)

    def add_costs(self, state: AppState) -> None:
        """Add the box for costs; it stands further below."""
        self._costs: Input[str] = Input(
            self._context.gui.add_text(
                "Costs other than 1",
                state.specification.costs,
                hint="Cost of a tolerance, for instance EA0Z=4, EXX=0.5. What costs more is"
                " allocated wider; the ratio of the numbers counts.",
            ),
            self._context.changed,
        )

    def use(self, keys: tuple[str, ...]) -> None:
        """Take the parameters of the machines sampled; none where they cannot be."""
        self._keys = keys

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has set."""
        percent, costs = self._percent.poll(), self._costs.poll()
        if percent is not None:
            state = edits.with_specification(state, state.specification.with_percent(percent))
        return state if costs is None else edits.with_costs(state, costs)

    def show(self, state: AppState) -> None:
        """Put the widgets where the state has them; the outcome is there as long as it holds."""
        self._percent.show(state.specification.percent)
        self._costs.show(state.specification.costs)
        self._show_outcome(state)

    def _show_outcome(self, state: AppState) -> None:
        text = ""
        if self._found is not None and state.tolerances == self._found[0]:
            text = self._found[1]
        if self._outcome.content != text:
            self._outcome.content = text
            self._outcome.visible = bool(text)

    def _allocate(self) -> None:
        from warpspace.app.evaluation.allocation import allocate_tolerances, with_allocated

        asked, keys = self._context.store.state, self._keys
        if not keys:
            self._context.notify("Not allocated", "No machines can be sampled here.", "yellow")
            return

        def progress(share: float) -> None:
            self._done += share

        def work(cancelled: threading.Event) -> None:
            found = allocate_tolerances(asked, keys, cancelled, progress)
            if found is None or cancelled.is_set():
                return
            after = with_allocated(asked, asked, found)
            self._found = after.tolerances, spell_allocation(found)
            self._context.post(lambda state: with_allocated(state, asked, found))

        self._done = 0.0
        if not self._job.start(NAME, work, USUAL_S):
            self._context.notify("Busy", "Tolerances are being allocated already.", "gray")


# --- Limit, probability and histogram of the tolerances, and what is done with all of them --------

OVER_NAMES = {MAX: "everywhere", SAMPLED: "a random point"}
SPREAD_NAMES = {UNIFORM: "uniform", NORMAL: "normal, 3σ at the limits"}
KEPT_BYTES = 100_000_000
WITHIN, OUTSIDE, LIMIT = "#4a7ab5", "#c9863a", "#d6336c"
"""Colours of the histogram; its key in the style sheet has the same."""
CHART_HEIGHT = 150
SCALES = {"÷ 1.5": 1.0 / 1.5, "− 5 %": 0.95, "+ 5 %": 1.05, "× 1.5": 1.5}
"""What the buttons for all tolerances multiply them by."""
ENSEMBLES: "Cache[Ensemble]" = Cache(KEPT_BYTES)
"""Sampled machines before their tolerances are known, for all sessions together."""


class TolerancesPanel:
    """Specification, histogram and tolerance sliders; all of it follows when changes pause."""

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, gui = context, context.gui
        wanted = state.specification
        # the style sheet keeps these two at the top
        self._limit: Input[float] = Input(
            gui.add_slider(
                "|E| allowed [µm]",
                min=LIMIT_UM.low,
                max=LIMIT_UM.high,
                step=LIMIT_UM.step,
                initial_value=wanted.limit_um,
                hint="The limit: the largest volumetric error that is accepted.",
            ),
            context.changed,
        )
        self._words = gui.add_html("")
        self._allocation = AllocationPart(context, state)
        self._alternative = gui.add_html("")
        self._histogram = add_chart(
            gui,
            (np.array([0.0, 1.0]),) + (np.zeros(2),) * 3,
            (
                uplot.Series(label="within", fill=WITHIN, width=0),
                uplot.Series(label="outside", fill=OUTSIDE, width=0),
                uplot.Series(label="limit", scale=WHOLE, stroke=LIMIT, width=2, dash=(5.0, 3.0)),
            ),
            CHART_HEIGHT,
            axes=(chart_axis("|E| [µm]", 34), chart_axis("machines", 50)),
            visible=False,
        )
        self._numbers = gui.add_html("")
        self._over: Input[str] = Input(
            gui.add_dropdown(
                "Evaluated at",
                tuple(OVER_NAMES.values()),
                initial_value=OVER_NAMES[wanted.over],
                hint="Where each sampled machine has to stay within the limit: everywhere in the"
                " volume, or at one random point (as in the thesis).",
            ),
            context.changed,
        )
        self._spread: Input[str] = Input(
            gui.add_dropdown(
                "Errors in their tolerance",
                tuple(SPREAD_NAMES.values()),
                initial_value=SPREAD_NAMES[wanted.distribution],
                hint="How the errors of the machines are spread over their tolerances.",
            ),
            context.changed,
        )
        self._allocation.add_costs(state)
        scale = gui.add_button_group(
            "Scale all",
            tuple(SCALES),
            hint="Narrows or widens all tolerances in the same ratio; fixed ones stay.",
        )
        scale.on_click(lambda event: self._scale(str(event.target.value)))
        reset = gui.add_button(
            "Tolerances of the scene", color="gray", hint="Give all tolerances the scene's values."
        )
        reset.on_click(lambda _: context.post(edits.with_scene_tolerances))
        self._rows = ToleranceRows(context)
        self._built_for: tuple[object, ...] = ()
        self._shown: tuple[object, ...] = ()

    def _scale(self, name: str) -> None:
        """Scale all tolerances that are not fixed."""
        factor = SCALES.get(name)
        if factor is not None:
            keys = self._rows.keys
            self._context.post(partial(edits.with_scaled_tolerances, keys=keys, factor=factor))

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has set."""
        limit, over, spread = self._limit.poll(), self._over.poll(), self._spread.poll()
        wanted = state.specification
        if limit is not None:
            wanted = wanted.with_limit(limit)
        if over is not None:
            wanted = wanted.with_over(_value(OVER_NAMES, over))
        if spread is not None:
            wanted = wanted.with_distribution(_value(SPREAD_NAMES, spread))
        if wanted != state.specification:
            state = edits.with_specification(state, wanted)
        return self._rows.read(self._allocation.read(state))

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what the widgets show."""
        state = picture.state
        return Identity(state.specification), Identity(state.tolerances), Identity(state.origin)

    def show(self, picture: LivePicture) -> None:
        """Put the widgets where the state has them."""
        state = picture.state
        self._limit.show(state.specification.limit_um)
        self._over.show(OVER_NAMES[state.specification.over])
        self._spread.show(SPREAD_NAMES[state.specification.distribution])
        self._allocation.show(state)
        if self._built_for[:1] == (Identity(state.origin),):
            self._rows.show(state)  # others are about to be replaced: nothing is sent to them

    def settle(self, picture: LivePicture) -> None:
        """Sample again, which takes some milliseconds, and draw."""
        state = picture.state
        moving = tuple(state.positions.items()) if state.loop is Loop.RELATIVE else ()
        sampled = (
            Identity(state.scene.model),
            Identity(state.scene.workspace),
            str(state.scene.reference),
            state.scene.parameter_keys,
            state.seen,
            state.specification.over,
            state.specification.distribution,
            moving,
        )
        wanted = state.specification
        shown = (sampled, state.tolerances, wanted.limit_um, wanted.fixed)
        if shown == self._shown:
            return
        self._shown = shown
        try:
            ensemble = ENSEMBLES.get(sampled, lambda: _sample(state), lambda found: found.size)
        except WarpspaceError as error:
            self._words.content = message(str(error), "refusal", small=True)
            self._numbers.content = self._alternative.content = ""
            self._histogram.visible = False
            self._allocation.use(())
            return
        self._allocation.use(ensemble.keys)
        self._draw(ensemble, state)

    def _draw(self, ensemble: "Ensemble", state: AppState) -> None:
        from warpspace.app.evaluation.probability import estimate, tolerance_shares

        estimated = estimate(ensemble, state.tolerances, state.specification.limit_um)
        shares = tolerance_shares(ensemble, state.tolerances, ensemble.keys)
        self._words.content = spell_probability(estimated)
        self._histogram.data = histogram_lines(estimated)
        bars = estimated.histogram
        self._alternative.content = chart_text(
            describe_histogram(
                bars.edges_um, bars.counts, estimated.probability.spec_um, "machines"
            )
        )
        self._histogram.visible = True
        self._numbers.content = spell_scatter(estimated)
        built_for = (Identity(state.origin), ensemble.keys)
        if built_for != self._built_for:
            self._built_for = built_for
            self._rows.build(state, shares)
        else:
            self._rows.show_shares(state, shares)


def _value(names: dict[str, str], text: str) -> str:
    """Give the value that is shown as a text; empty for a text there is not."""
    return next((value for value, name in names.items() if name == text), "")


def _sample(state: AppState) -> "Ensemble":
    # scipy's distributions take half a second to import: not before the first picture
    from warpspace.analysis.cases import Over
    from warpspace.analysis.distribution import Distribution
    from warpspace.app.evaluation.probability import build_ensemble

    return build_ensemble(
        replace(state.scene, placed=state.placed),
        state.loop,
        over=Over(state.specification.over),
        distribution=Distribution(state.specification.distribution),
        positions=state.positions,
    )
