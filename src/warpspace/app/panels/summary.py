"""What is always in view beside the drawing: colour bar, statistics, key to the lines."""

from collections.abc import Callable
from functools import partial

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.budget import add_worst_button
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.html import message
from warpspace.app.readouts.summary import summary
from warpspace.app.state.app_state import AppState
from warpspace.app.state.table import without_words


class HtmlPanel:
    """A block of HTML that follows the picture."""

    def __init__(self, context: PanelContext, spell: Callable[[LivePicture], str]) -> None:
        self._spell = spell
        self._handle = Handle(context.gui.add_html(""))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Write the picture's text."""
        self._handle.put(content=self._spell(picture))


def summary_panel(context: PanelContext, _state: AppState) -> HtmlPanel:
    """Colour bar, numbers and key, and the way to the worst point; scale bars are drawn apart."""
    panel = HtmlPanel(context, partial(summary, bars=False))
    add_worst_button(context, "Worst point: error budget")
    return panel


# --------------------------------------------------------------------------------------------------
# A line at the head of tabs whose numbers are worked out from the errors, not from the box.


class TableNote:
    """Says that what stands below is of the machine without a table, where the box has one."""

    def __init__(self, context: PanelContext, _state: AppState) -> None:
        self._text = Handle(context.gui.add_html("", visible=False))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Follow the table, that of what is compared too."""
        words = without_words(picture.state)
        content = message(words, "without the table", small=True) if words else ""
        self._text.put(content=content, visible=bool(words))
