"""A widget bound to a value of the state, without feedback and without stale values."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")
Changed = Callable[[], None]


class Bound(Generic[T]):
    """A viser input and the value of it that the program has dealt with.

    What the browser sets meanwhile is never overwritten: `show` writes only where the wanted value
    differs from the one read last.

    Parameters
    ----------
    handle : viser.GuiInputHandle
    changed : callable
        Called when a browser has changed it; it must only take note.
    """

    def __init__(self, handle: Any, changed: Changed) -> None:
        self.handle = handle
        self._seen: T = handle.value
        handle.on_update(lambda event: changed() if event.client is not None else None)

    def poll(self) -> T | None:
        """Give the value a browser has set since the last poll, else None."""
        value: T = self.handle.value
        if value == self._seen:
            return None
        self._seen = value
        return value

    def show(self, value: T) -> None:
        """Make the widget show a value; what shows it already is left alone."""
        if value != self._seen:
            self._seen = value
            self.handle.value = value


def dom_id(handle: Any) -> str:
    """Give the id of a widget in the page, for style sheets."""
    return str(handle._impl.uuid)  # noqa: SLF001 - viser has no public name for it
