"""How the page of a tab comes to be: what matters most first, all else while it is in use.

A page draws what it gets in one go before it answers anybody, and two hundred widgets take it
nearly a second. The map and the first sliders are sent first; every further step when the page has
drawn the one before, so that a hand at a slider is not kept waiting for long.
"""

import time
from collections import deque
from typing import Any

from warpspace.app.browser.opening import drawn_script, stage_script
from warpspace.app.browser.viser_private import dom_id
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.server.contents import Build, PageContents
from warpspace.app.server.display import Display
from warpspace.app.server.layout import Places

ANSWER_S = 1.0
"""How long a page may take for one step; one that does not answer gets the rest at once."""


class PageSteps:
    """Builds the page of one tab; every step is one atomic change.

    Parameters
    ----------
    context : PanelContext
    places : Places
    display : Display
        Gets what is built.
    """

    def __init__(self, context: PanelContext, places: Places, display: Display) -> None:
        self._context, self._display = context, display
        self.contents = PageContents(context, places)
        self._steps: deque[Build] = deque()
        self._answer: Any = None
        self._asked, self._patient, self._asked_at = 0, True, 0.0

    def begin(self, picture: LivePicture) -> None:
        """Draw the map, its sliders and numbers; the session has begun an atomic change."""
        self._answer = self._context.gui.add_text("", "", visible=False)

        @self._answer.on_update
        async def _(_: object) -> None:  # a plain function would take a thread of a pool
            self._context.wake()

        self._steps.extend(self.contents.steps)
        self._context.page.run_script(stage_script("opening"))
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
        """Take the next step.

        Parameters
        ----------
        picture : LivePicture
            What is shown.
        """
        self._patient = self._patient and self.remaining_s() != 0.0
        with self._context.client.atomic():
            self._build(picture)
        self._context.client.flush()

    def _build(self, picture: LivePicture) -> None:
        """Build what is next, and have the page say when it has drawn that."""
        layers, panels = self._steps.popleft()(picture)
        self._display.add(picture, layers, panels)
        page = self._context.page
        if self._steps:
            self._asked += 1
            self._asked_at = time.monotonic()
            page.run_script(drawn_script(dom_id(self._answer), self._asked))
        else:
            self._answer.remove()
            page.run_script(stage_script("open"))
            self.contents.show_tour(asked=False)
