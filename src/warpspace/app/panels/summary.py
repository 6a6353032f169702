"""What is always in view: heading with the display factor, colour bar, statistics, scale bars."""

from warpspace.app.browser.handles import Handle
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.drafts import TEXTS


class HtmlPanel:
    """A block of HTML that follows the picture.

    Parameters
    ----------
    context : PanelContext
    name : str
        A key of `TEXTS`.
    """

    def __init__(self, context: PanelContext, name: str) -> None:
        self.name = name
        self._handle = Handle(context.gui.add_html(""))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, picture: LivePicture) -> None:
        """Write the picture's text."""
        self.write(TEXTS[self.name](picture))

    def write(self, text: str) -> None:
        """Write HTML."""
        self._handle.put(content=text)


def summary_panel(context: PanelContext) -> HtmlPanel:
    """Colour bar, numbers and scale bars."""
    return HtmlPanel(context, "summary")


def heading_panel(context: PanelContext) -> HtmlPanel:
    """Machine, error set and display factor."""
    return HtmlPanel(context, "heading")
