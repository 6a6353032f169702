"""What is always in view: heading with the display factor, colour bar, statistics, scale bars."""

from warpspace.app.browser.handles import Told
from warpspace.app.evaluation.evaluate import Frame
from warpspace.app.panels import Desk
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.drafts import TEXTS


class HtmlPanel:
    """A block of HTML that follows the frame.

    Parameters
    ----------
    desk : Desk
    name : str
        A key of `TEXTS`.
    """

    def __init__(self, desk: Desk, name: str) -> None:
        self.name = name
        self._handle = Told(desk.gui.add_html(""))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, frame: Frame) -> None:
        """Write the frame's text."""
        self.write(TEXTS[self.name](frame))

    def write(self, text: str) -> None:
        """Write HTML."""
        self._handle.put(content=text)


def summary_panel(desk: Desk) -> HtmlPanel:
    """Colour bar, numbers and scale bars."""
    return HtmlPanel(desk, "summary")


def heading_panel(desk: Desk) -> HtmlPanel:
    """Machine, error set and display factor."""
    return HtmlPanel(desk, "heading")
