"""A handle of viser that is only told what has changed.

Every assignment to a handle costs type checks and comparisons even where nothing is sent; a picture
consists of some sixty values of which a slider move changes ten.
"""

from typing import Any

import numpy as np

_UNSET = object()


class Drawn:
    """A scene handle with the values it was told last.

    Arrays count as the same only where they are the same object, so an array that was handed over
    must not be changed afterwards.

    Parameters
    ----------
    handle : viser.SceneNodeHandle
    """

    __slots__ = ("_told", "handle")

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self._told: dict[str, object] = {}

    def put(self, **values: Any) -> None:
        """Assign what differs from what was assigned last."""
        for name, value in values.items():
            told = self._told.get(name, _UNSET)
            if value is told:
                continue
            if not isinstance(value, np.ndarray) and told is not _UNSET and value == told:
                continue
            setattr(self.handle, name, value)
            self._told[name] = value

    @property
    def visible(self) -> bool:
        """Whether it is drawn."""
        return bool(self._told.get("visible", True))
