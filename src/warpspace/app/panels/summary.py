"""What is always in view: heading with the display factor, colour bar, statistics, scale bars."""

from typing import Any

from warpspace.app import legend
from warpspace.app.live import Frame
from warpspace.app.panels import Desk
from warpspace.app.state import AppState
from warpspace.app.widgets import Told


class HtmlPanel:
    """A block of HTML that follows the frame.

    Parameters
    ----------
    desk : Desk
    render : callable
        Turns a frame into HTML.
    """

    def __init__(self, desk: Desk, render: Any) -> None:
        self._render = render
        self._handle = Told(desk.gui.add_html(""))

    def read(self, state: AppState) -> AppState:
        """Nothing to take over."""
        return state

    def show(self, frame: Frame) -> None:
        """Write the frame's text."""
        self._handle.put(content=self._render(frame))


def summary_panel(desk: Desk) -> HtmlPanel:
    """Colour bar, numbers and scale bars."""
    return HtmlPanel(desk, legend.summary)


def heading_panel(desk: Desk) -> HtmlPanel:
    """Machine, error set and display factor."""
    return HtmlPanel(desk, legend.heading)
