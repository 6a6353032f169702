"""Handles of viser: inputs bound to a value of the state, and outputs that are only assigned to."""

from typing import Any

import numpy as np

_UNSET = object()


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
