"""The panels of the page, one module each.

A panel binds widgets to the state: `read` takes what a browser has set and returns the new state,
`show` makes the widgets show a picture. Neither knows of other panels or of threads.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from viser import GuiApi

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import StateStore, Update

__all__ = ["Deferred", "Panel", "PanelContext", "Selective", "Update"]


@dataclass(frozen=True, slots=True)
class PanelContext:
    """What a panel gets from its session.

    Attributes
    ----------
    gui : viser.GuiApi
        Private to one browser tab.
    changed : callable
        To be called from widget callbacks: something is to be read.
    post : callable
        To be called from button callbacks with a pure update of the state.
    act : callable
        To be called from callbacks with something to be done beside the state (undo, a modal):
        it is done by the session's worker, and what it raises is shown and logged.
    store : callable
        Gives the board with state and history.
    notify : callable
        Shows a message in this tab: title, text, colour. For the worker.
    """

    gui: GuiApi
    changed: Callable[[], None]
    post: Callable[[Update], None]
    act: Callable[[Callable[[], None]], None]
    store: Callable[[], StateStore]
    notify: Callable[[str, str, str], None]


class Panel(Protocol):
    """Widgets bound to a part of the state."""

    def read(self, state: AppState) -> AppState:
        """Take over what a browser has set since the last call."""
        ...

    def show(self, picture: LivePicture) -> None:
        """Make the widgets show a picture."""
        ...


@runtime_checkable
class Selective(Protocol):
    """A part of the page that need not follow every picture."""

    def concerns(self, picture: LivePicture) -> tuple[object, ...]:
        """Give what it shows of a picture; as long as that is equal it is not asked to show it."""
        ...


@runtime_checkable
class Deferred(Protocol):
    """A panel with something slow that follows when changes pause."""

    def settle(self, picture: LivePicture) -> None:
        """Bring charts up to date; some tens of milliseconds at most."""
        ...
