"""A line at the head of tabs whose numbers are worked out from the errors, not from the box."""

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.context import PanelContext
from warpspace.app.readouts.html import message
from warpspace.app.state.app_state import AppState
from warpspace.app.state.table import without_words


class TableNote:
    """Says that what stands below is of the machine without a table, where the box has one.

    Parameters
    ----------
    context : PanelContext
    """

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
