"""The panels of the page, one module each.

A panel binds widgets to the state: `read` takes what a browser has set and returns the new state,
`show` makes the widgets show a picture. Neither knows of other panels or of threads.
"""

from typing import Protocol, runtime_checkable

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.context import PanelContext
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import Update

__all__ = ["Deferred", "Panel", "PanelContext", "Resting", "Selective", "Update"]


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


@runtime_checkable
class Resting(Protocol):
    """A panel with something so slow that it waits until nothing has changed for a while."""

    def rest(self, picture: LivePicture) -> None:
        """Have what is slow worked out; it is not asked to while a slider is dragged."""
        ...
