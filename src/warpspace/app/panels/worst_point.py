"""The way to the worst point: one button, key or command, and its error budget is in front."""

from warpspace.app.browser.arrangement import front_script
from warpspace.app.evaluation.budget import pick_worst, with_picked
from warpspace.app.panels import PanelContext

BUDGET_TAB = "Error budget"
WORST = "Worst point"
HINT = "Ask what the largest error of the volume is made of (W does the same)."


def add_worst_button(context: PanelContext, label: str = WORST) -> None:
    """Add the button that asks about the worst point."""
    button = context.gui.add_button(label, color="gray", hint=HINT)
    button.on_click(lambda _: context.act(lambda: ask_worst(context)))


def ask_worst(context: PanelContext) -> None:
    """Ask about the worst point of what is drawn, and bring its budget to the front."""
    if context.shown is None:
        return
    picked = pick_worst(context.shown)
    context.page.run_script(front_script(BUDGET_TAB))
    context.post(lambda state: with_picked(state, picked))
