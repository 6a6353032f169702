"""A shared review: each tab sees where the others point."""

import threading
import time
from collections.abc import Sequence

import numpy as np

from warpspace.app.browser.viser_private import queued
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.budget import pick_drawn
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part

OFTEN_S = 0.08  # between two places of one pointer; a page sends one each tenth of a second
LONGEST_NAME, LONGEST_RAY = 24, 200  # characters
MOST_QUEUED = 8  # messages that wait for a page; one that takes none is sent no pointers


class Together:
    """The tabs of a shared review; usable from any thread."""

    def __init__(self) -> None:
        self._contexts: set[Context] = set()
        self._lock = threading.Lock()

    def join(self, context: Context) -> None:
        with self._lock:
            self._contexts.add(context)

    def leave(self, context: Context) -> None:
        with self._lock:
            self._contexts.discard(context)
        self.tell(context, "", None)

    def tell(self, own: Context, name: str, at: Sequence[float] | None) -> None:
        """Tell all others where somebody points, in the drawing's units; None for nowhere."""
        with self._lock:
            others = [one for one in self._contexts if one is not own]
        for one in others:
            if one.telling is None and queued(one.client) <= MOST_QUEUED:
                one.page.call("pointer", own.client.client_id, name, at)


class PointerPart(Part):
    """Takes where the mouse is over the map: ``pointer:at``, a name, then a ray of six numbers."""

    name = "pointer"

    def __init__(self, context: Context, together: Together) -> None:
        super().__init__(context)
        self._together, self._last = together, 0.0
        together.join(context)
        context.page.call("together")

    def take(self, state: AppState, word: str, value: str) -> AppState:
        now, picture = time.monotonic(), self.context.shown
        spelt, _, name = value.partition("\n")
        if word == "gone":
            self._together.tell(self.context, "", None)
        if word != "at" or len(spelt) > LONGEST_RAY or now - self._last < OFTEN_S:
            return state
        try:
            ray = np.array([float(one) for one in spelt.split(",")]).reshape(2, 3)
        except ValueError:  # not six numbers; what is not finite or too far meets nothing
            return state
        if picture is not None and self.context.telling is None:
            self._last = now
            found = pick_drawn(picture, ray[0] / SCENE_PER_MM, ray[1])
            at = None if found is None else (found[1] * SCENE_PER_MM).round(4).tolist()
            self._together.tell(self.context, " ".join(name[:LONGEST_NAME].split()), at)
        return state
