"""The panel "Why": the error of the point that was clicked, taken apart."""

from typing import Any

from warpspace.app.live import Frame
from warpspace.app.panels import Desk
from warpspace.app.panels.clicks import Clicks
from warpspace.app.state import AppState
from warpspace.app.why import answer, with_lever, with_picked
from warpspace.app.why_text import ASK, REFUSED, answer_html


class WhyPanel:
    """Numbers of the picked point, one row per contribution, and a button that ends it.

    Parameters
    ----------
    desk : Desk
    """

    def __init__(self, desk: Desk) -> None:
        gui = desk.gui
        self._clicks = Clicks(gui, lambda key: desk.post(lambda s: with_lever(s, key)))
        self._text: Any = gui.add_html(ASK)
        self._clear: Any = gui.add_button(
            "Clear",
            color="gray",
            visible=False,
            hint="Forget the point (N does the same).",
        )
        self._clear.on_click(lambda _: desk.post(forget))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over: clicks post what they change."""
        return state

    def show(self, frame: Frame) -> None:
        """Explain the point in the state that is drawn."""
        state = frame.subject or frame.state
        picked = frame.state.picked
        self._clear.visible = picked is not None
        if picked is None:
            self._text.content = ASK
        elif is_difference(frame):
            self._text.content = REFUSED
        else:
            found = answer(state, picked, frame.exaggeration)
            self._text.content = answer_html(found, frame.state.lever, self._clicks.attributes)


def forget(state: AppState) -> AppState:
    """Ask about no point any more."""
    return with_picked(state, None)


def is_difference(frame: Frame) -> bool:
    """Tell whether a difference of two states is drawn."""
    return frame.compared is not None and frame.compared.shown == "difference"
