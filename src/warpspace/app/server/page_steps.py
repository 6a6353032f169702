"""How the page of a tab comes to be: what matters most first, all else while it is in use.

A page draws what it gets in one go before it answers anybody. The map and all that is written are
sent first, what stands around the map when the page has drawn that.
"""

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from warpspace.app.browser.viser_private import dom_id
from warpspace.app.evaluation.budget import pick, with_picked
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.server.display import Display
from warpspace.app.tasks.catalogue import build_parts
from warpspace.app.tasks.context import Context
from warpspace.app.viewport.box import BoxLayer
from warpspace.app.viewport.moving import MovingLayer
from warpspace.app.viewport.shapes import SCENE_PER_MM, Layer

# --- What a click in the drawing means ------------------------------------------------------------
# A question why, or the choice of a reference point.


class Pointing:
    """Listens to clicks in the drawing of one tab."""

    def __init__(self, context: Context) -> None:
        self._context = context

        @context.client.scene.on_click()
        def _(event: Any) -> None:
            origin, direction = event.ray_origin, event.ray_direction
            context.act(lambda: self._clicked(origin, direction))

    def _clicked(self, origin: Any, direction: Any) -> None:
        picture = self._context.shown
        if picture is None:
            return
        try:
            ray = np.array([origin, direction], dtype=float)
        except (TypeError, ValueError):
            return
        if ray.shape != (2, 3):
            return
        picked = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if picked is None:
            return
        if self._context.next_click is not None and picked.point_mm is None:
            self._context.next_click(picked)
            return
        self._context.post(lambda state: with_picked(state, picked))


Build: TypeAlias = Callable[[LivePicture], Sequence[Layer]]
ANSWER_S = 1.0
"""How long a page may take for one step; one that does not answer gets the rest at once."""


class PageSteps:
    """Builds the page of one tab; every step is one atomic change."""

    def __init__(self, context: Context, display: Display) -> None:
        self._context, self._display = context, display
        self._steps: deque[Build] = deque()
        self._answer: Any = None
        self._asked, self._patient, self._asked_at = 0, True, 0.0

    def begin(self, picture: LivePicture) -> None:
        """Draw the map, its sliders and numbers; the session has begun an atomic change."""
        self._answer = self._context.gui.add_text("", "", visible=False)

        @self._answer.on_update
        async def _(_: object) -> None:  # a plain function would take a thread of a pool
            self._context.wake()

        self._steps.extend((self._draw_box, self._draw_around))
        self._context.page.call("stage", "opening")
        self._build(picture)

    def stop(self) -> None:
        """Take no further step, and let nothing move by itself."""
        self._steps.clear()
        if self._context.stage is not None:
            self._context.stage.stop()

    def remaining_s(self) -> float | None:
        """Give how long to wait for the page at most; None where nothing is left to be done."""
        if not self._steps:
            return None
        if not self._patient:
            return 0.0
        return max(0.0, self._asked_at + ANSWER_S - time.monotonic())

    @property
    def is_due(self) -> bool:
        """Whether the page has drawn the last step, or does not say."""
        left = self.remaining_s()
        return left == 0.0 or (left is not None and self._answer.value == str(self._asked))

    def advance(self, picture: LivePicture) -> None:
        """Take the next step."""
        self._patient = self._patient and self.remaining_s() != 0.0
        with self._context.client.atomic():
            self._build(picture)
        self._context.client.flush()

    def _build(self, picture: LivePicture) -> None:
        layers = self._steps.popleft()(picture)
        parts = [] if self._display.parts else build_parts(self._context)
        self._display.add(picture, layers, parts)
        page = self._context.page
        if self._steps:
            self._asked += 1
            self._asked_at = time.monotonic()
            page.call("drawn", dom_id(self._answer), self._asked)
        else:
            self._answer.remove()
            page.call("stage", "open")

    def _draw_box(self, picture: LivePicture) -> Sequence[Layer]:
        return [BoxLayer(self._context.client.scene, self._context.page, picture)]

    def _draw_around(self, picture: LivePicture) -> Sequence[Layer]:
        context = self._context
        context.stage = MovingLayer(context.client, picture, context.act)
        Pointing(context)
        return [context.stage]
