"""The button "Allocate" with what belongs to it: wanted share, costs, progress, outcome."""

import threading
from typing import TYPE_CHECKING, Any

from warpspace.app.browser.handles import Input
from warpspace.app.panels import PanelContext
from warpspace.app.panels.job_part import JobPart
from warpspace.app.readouts.probability import spell_allocation
from warpspace.app.state import edits
from warpspace.app.state.app_state import AppState
from warpspace.app.state.specification import PERCENT
from warpspace.machine.tolerances import ToleranceSet

if TYPE_CHECKING:
    from warpspace.analysis.allocation import Ensemble

NAME = "Allocating tolerances"
USUAL_S = 3.0


class AllocationPart:
    """Allocates tolerances beside the session and applies them as one change.

    Parameters
    ----------
    context : PanelContext
    state : AppState
    """

    def __init__(self, context: PanelContext, state: AppState) -> None:
        self._context, gui = context, context.gui
        self._done = 0.0
        self._ensemble: Ensemble | None = None
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

    def use(self, ensemble: "Ensemble | None") -> None:
        """Take the machines that the probability on the page is estimated from."""
        self._ensemble = ensemble

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
        """Show what was reached while those tolerances are the ones shown."""
        text = ""
        if self._found is not None and state.tolerances == self._found[0]:
            text = self._found[1]
        if self._outcome.content != text:
            self._outcome.content = text
            self._outcome.visible = bool(text)

    def _allocate(self) -> None:
        """Start the work."""
        from warpspace.app.evaluation.allocation import allocate_tolerances, with_allocated

        asked, ensemble = self._context.store.state, self._ensemble
        if ensemble is None:
            self._context.notify("Not allocated", "No machines can be sampled here.", "yellow")
            return

        def progress(share: float) -> None:
            self._done += share

        def work(cancelled: threading.Event) -> None:
            found = allocate_tolerances(asked, ensemble, cancelled, progress)
            if found is None or cancelled.is_set():
                return
            after = with_allocated(asked, asked, found)
            self._found = after.tolerances, spell_allocation(found)
            self._context.post(lambda state: with_allocated(state, asked, found))

        self._done = 0.0
        if not self._job.start(NAME, work, USUAL_S):
            self._context.notify("Busy", "Tolerances are being allocated already.", "gray")
