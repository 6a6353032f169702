"""Limit, probability and histogram of the tolerances, and what is done with all of them."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from viser import uplot

from warpspace.app.browser.handles import Input
from warpspace.app.evaluation.cache import Cache, Identity
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.panels.tolerances.allocation import AllocationPart
from warpspace.app.panels.tolerances.rows import ToleranceRows
from warpspace.app.readouts.chart_text import chart_text, describe_histogram
from warpspace.app.readouts.charts import WHOLE, add_chart, chart_axis
from warpspace.app.readouts.html import message
from warpspace.app.readouts.probability import histogram_lines, spell_probability, spell_scatter
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.specification import LIMIT_UM, MAX, NORMAL, SAMPLED, UNIFORM
from warpspace.exceptions import WarpspaceError
from warpspace.kinematics.model import Loop

if TYPE_CHECKING:
    from warpspace.analysis.allocation import Ensemble

OVER_NAMES = {SAMPLED: "a random point", MAX: "everywhere"}
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
    """Specification, histogram and tolerance sliders; all of it follows when changes pause.

    Parameters
    ----------
    context : PanelContext
    state : AppState
    """

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
                hint="Where each sampled machine has to stay within the limit: at one random point"
                " (as in the thesis), or everywhere in the volume.",
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
            state.loop,
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
            self._allocation.use(None)
            return
        self._allocation.use(ensemble)
        self._draw(ensemble, state)

    def _draw(self, ensemble: "Ensemble", state: AppState) -> None:
        """Work out and draw what the tolerances of a state give."""
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
    """Sample machines for a state."""
    # scipy's distributions take half a second to import: not before the first picture
    from warpspace.analysis.draws import Distribution
    from warpspace.analysis.nodes import Over
    from warpspace.app.evaluation.probability import build_ensemble

    return build_ensemble(
        state.scene,
        state.loop,
        over=Over(state.specification.over),
        distribution=Distribution(state.specification.distribution),
        positions=state.positions,
    )
