"""How the page of a tab comes to be: what matters most first, all else while it is in use.

A page draws what it gets in one go before it answers anybody, and two hundred widgets take it
nearly a second. The map and the first sliders are sent first; every further step when the page has
drawn the one before, so that a hand at a slider is not kept waiting for long.
"""

import json
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from warpspace.app.browser.handles import dom_id
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import PanelContext
from warpspace.app.panels.appearance import Choose
from warpspace.app.panels.commands import hint_script
from warpspace.app.panels.contents import Build, PanelBuilder
from warpspace.app.panels.layout import Places
from warpspace.app.server.followers import Followers
from warpspace.app.server.tab_context import TabContext
from warpspace.app.viewport.layers.box import BoxLayer
from warpspace.app.viewport.layers.stage import StageLayer, draw_around

ANSWER_S = 1.0
"""How long a page may take for one step; one that does not answer gets the rest at once."""
Step = Callable[[LivePicture], None]


class PageSteps:
    """Builds the page of one tab; every step is one atomic change.

    Parameters
    ----------
    context : PanelContext
    tab : TabContext
    places : Places
    fit_view : callable
        Puts the camera to a named view, or changes its lens.
    told : callable
        Called when a step may be due; it must only take note.
    """

    def __init__(
        self,
        context: PanelContext,
        tab: TabContext,
        places: Places,
        fit_view: Choose,
        told: Callable[[], None],
    ) -> None:
        self._context, self._tab = context, tab
        self._contents = PanelBuilder(context, tab, places, fit_view, self._play)
        self._answer = context.gui.add_text("", "", visible=False)

        @self._answer.on_update
        async def _(_: object) -> None:  # a plain function would take a thread of a pool
            told()

        self._steps: deque[Step] = deque()
        self._asked, self._patient, self._asked_at = 0, True, 0.0
        self._parts = Followers()
        self._stage: StageLayer | None = None

    def begin(self, picture: LivePicture) -> Followers:
        """Draw the map, its sliders and numbers.

        Parameters
        ----------
        picture : LivePicture

        Returns
        -------
        Parts
            To which the further steps add.
        """
        box = BoxLayer(self._tab.client.scene, picture)
        panels = self._contents.build_first(picture.state)
        for panel in panels:
            panel.show(picture)
        self._parts = Followers([box], panels, picture)
        self._steps.append(self._draw_around)
        self._steps.extend(partial(self._add_panels, build) for build in self._contents.others())
        self._tab.run_script(stage_script("opening"))
        self._ask()
        return self._parts

    def stop(self) -> None:
        """Take no further step, and let nothing move by itself."""
        self._steps.clear()
        if self._stage is not None:
            self._stage.stop()

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
        step = self._steps.popleft()
        with self._tab.client.atomic():
            step(picture)
            if self._steps:
                self._ask()
            else:
                self._end()
        self._tab.client.flush()

    def _ask(self) -> None:
        """Have the page say when it has drawn what it gets now."""
        self._asked += 1
        self._asked_at = time.monotonic()
        self._tab.run_script(drawn_script(dom_id(self._answer), self._asked))

    def _draw_around(self, picture: LivePicture) -> None:
        """Draw what lies on and around the map."""
        client = self._tab.client
        self._stage = StageLayer(client, picture, self._context.act)
        self._parts.add(picture, layers=[*draw_around(client.scene, picture), self._stage])

    def _add_panels(self, build: Build, picture: LivePicture) -> None:
        """Build some panels."""
        panels = build(picture.state)
        for panel in panels:
            panel.show(picture)
        self._parts.add(picture, panels=panels)

    def _end(self) -> None:
        """Say how to begin."""
        self._answer.remove()
        self._tab.run_script(hint_script())
        self._tab.run_script(stage_script("open"))

    def _play(self, on: bool | None, tell: Callable[[str], None]) -> None:
        """Play, pause or take back the rotation."""
        if self._stage is not None:
            self._stage.play(on, tell)


def stage_script(word: str) -> str:
    """Write the script that marks how far a page is, for whoever drives it from outside.

    Parameters
    ----------
    word : str
        "opening", or "open" once everything is there: what `data-warpspace` of the page's root is.
    """
    return f"document.documentElement.dataset.warpspace = {json.dumps(word)};"


def drawn_script(widget: str, number: int) -> str:
    """Write the script that makes a page say when it has drawn all before it.

    Parameters
    ----------
    widget : str
        Identifier of the widget that takes the number.
    number : int

    Returns
    -------
    str
        JavaScript. A page that is not in view draws nothing, and answers at once.
    """
    return f"""(() => {{
  const tell = () => window.__viserMutable?.sendMessage({{
    type: "GuiUpdateMessage", uuid: {json.dumps(widget)}, updates: {{ value: "{number:d}" }}
  }});
  if (document.hidden) setTimeout(tell, 0);
  else requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(tell, 0)));
}})();"""
