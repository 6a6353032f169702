"""Handles of viser: inputs bound to a value of the state, and outputs that are only assigned to."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np

T = TypeVar("T")
Changed = Callable[[], None]
_UNSET = object()


class Input(Generic[T]):
    """A viser input and the value of it that the program has dealt with.

    What the browser sets meanwhile is never overwritten: `show` writes only where the wanted value
    differs from the one read last.
    """

    def __init__(self, handle: Any, changed: Changed) -> None:
        self.handle = handle
        self._seen: T = handle.value
        self._touched = False

        async def note(event: Any) -> None:  # a plain function would take a thread of a pool
            if event.client is not None:
                self._touched = True
                changed()

        handle.on_update(note)

    def poll(self) -> T | None:
        """Give the value a browser has set since the last poll, else None."""
        if not self._touched:
            return None
        self._touched = False
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


class Handle:
    """A handle that is assigned only what has changed.

    Every assignment to a handle costs viser's checks even where nothing is sent; a picture consists
    of some sixty values of which a slider move changes ten. Arrays count as the same only where
    they are the same object, so one that was handed over must not be changed afterwards.
    """

    __slots__ = ("_assigned", "handle")

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self._assigned: dict[str, object] = {}

    def put(self, **values: Any) -> None:
        """Assign what differs from what was assigned last."""
        for name, value in values.items():
            known = self._assigned.get(name, _UNSET)
            if value is known:
                continue
            if not isinstance(value, np.ndarray) and known is not _UNSET and value == known:
                continue
            setattr(self.handle, name, value)
            self._assigned[name] = value
