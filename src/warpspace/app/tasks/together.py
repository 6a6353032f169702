"""A shared review: each tab sees where the others point."""

import time
from collections.abc import Callable, Iterable

import numpy as np

from warpspace.app.browser.viser_private import queued
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.budget import pick
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.parts import Part

OFTEN_S = 0.08  # between two places of one pointer; a page sends one each tenth of a second
LONGEST_NAME, LONGEST_RAY = 24, 200  # characters
MOST_QUEUED = 8  # messages that wait for a page; one that takes none is sent no pointers
Tabs = Callable[[], Iterable[Context]]


class PointerPart(Part):
    """Takes where the mouse is over the map: ``pointer:at``, a name, then a ray of six numbers."""

    name = "pointer"

    def __init__(self, context: Context, tabs: Tabs) -> None:
        super().__init__(context)
        self._tabs, self._last = tabs, 0.0
        context.page.call("together")

    def take(self, state: AppState, word: str, value: str) -> AppState:
        now, picture, at = time.monotonic(), self.context.shown, None
        spelt, _, name = value.partition("\n")
        if word == "at":
            if len(spelt) > LONGEST_RAY or now - self._last < OFTEN_S or self.context.telling:
                return state
            try:
                ray = np.array([float(one) for one in spelt.split(",")]).reshape(2, 3)
            except ValueError:  # not six numbers; what is not finite or too far meets nothing
                return state
            self._last = now
            found = picture and pick(picture, ray[0] / SCENE_PER_MM, ray[1])
            at = found and (found[1] * SCENE_PER_MM).round(4).tolist()
        for one in self._tabs():
            if one is not self.context and not one.telling and queued(one.client) <= MOST_QUEUED:
                said = " ".join(name[:LONGEST_NAME].split())
                one.page.call("pointer", self.context.client.client_id, said, at)
        return state
