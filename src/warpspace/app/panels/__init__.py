"""The panels of the page, one module each.

A panel binds widgets to the state: `read` takes what a browser has set and returns the new state,
`show` makes the widgets show a frame. Neither knows of other panels or of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from viser import GuiApi

from warpspace.app.live import Frame
from warpspace.app.state import AppState

Update = Callable[[AppState], AppState]


@dataclass(frozen=True, slots=True)
class Desk:
    """What a panel gets from its session.

    Attributes
    ----------
    gui : viser.GuiApi
        Private to one browser tab.
    changed : callable
        To be called from widget callbacks: something is to be read.
    post : callable
        To be called from button callbacks with a pure update of the state.
    """

    gui: GuiApi
    changed: Callable[[], None]
    post: Callable[[Update], None]


class Panel(Protocol):
    """Widgets bound to a part of the state."""

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has set since the last call."""
        ...

    def show(self, frame: Frame) -> None:
        """Make the widgets show a frame."""
        ...
