"""What is always in view: heading with the exaggeration, colour bar, statistics, scale bars."""

from collections.abc import Callable

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.panels.budget import add_worst_button
from warpspace.app.readouts.summary import heading, summary
from warpspace.app.state.app_state import AppState


class HtmlPanel:
    """A block of HTML that follows the picture.

    Parameters
    ----------
    context : PanelContext
    spell : callable
        Writes the HTML of a picture.
    """

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
    """Colour bar, numbers and scale bars, and the way to the worst point."""
    panel = HtmlPanel(context, summary)
    add_worst_button(context, "Worst point: error budget")
    return panel


def heading_panel(context: PanelContext) -> HtmlPanel:
    """Machine, error set and exaggeration."""
    return HtmlPanel(context, heading)
