"""Everything of a tab that follows the picture: layers and panels, on a busy server by drafts."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import Deferred, Panel, Selective
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.summary import HtmlPanel
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.drafts import Draft, build_draft, only_moved
from warpspace.app.viewport.layers import Layer
from warpspace.app.viewport.layers.box import BoxLayer
from warpspace.app.viewport.painter import PAINTER
from warpspace.app.viewport.turns import Turns

SETTLE_S = 0.1
"""Pause in the changes after which charts follow: longer than between two moves of a drag."""
LONGEST_SETTLE_S = 0.25
"""Charts lag no longer than this behind while a slider is being dragged."""
BUSY_PAUSE_S = 0.2
"""The pause on a busy server. Its charts wait for one however long a drag takes, and drafts are
shown meanwhile."""
BUSY_S = 0.01
"""Wait for other tabs' pictures beyond which the server counts as busy."""
BUSY_MEMORY_S = 2.0
"""How long a server that was busy counts as such without another wait."""
BUSY_PACE = 60.0
"""Pictures a second, of all tabs, with which a busy server stays busy."""
TURN = Turns()
"""Pictures are made one after the other: twenty at once would all be late, and fight for caches."""
_LATEST: deque[float] = deque(maxlen=32)
"""When the latest pictures of all tabs were asked for, s."""


def pace() -> float:
    """Give how many pictures a second all tabs together have asked for lately."""
    now = time.monotonic()
    _LATEST.append(now)
    return len(_LATEST) / max(now - _LATEST[0], 1e-3) if len(_LATEST) == _LATEST.maxlen else 0.0


def make_draft(live: LiveModel, state: AppState) -> Draft:
    """Work out the draft of a state, in the other process if that can be had."""
    draft = PAINTER.paint(state)
    if draft is None:
        with TURN:
            draft = build_draft(live.evaluate(state))
    return draft


class Followers:
    """Layers and panels of one tab.

    Parameters
    ----------
    layers : sequence of Layer
    panels : sequence of Panel
    """

    def __init__(
        self,
        layers: Sequence[Layer] = (),
        panels: Sequence[Panel] = (),
        picture: LivePicture | None = None,
    ) -> None:
        self.layers, self.panels = tuple(layers), tuple(panels)
        self._picture, self._state = picture, None if picture is None else picture.state
        self._late: tuple[Layer | Panel, ...] = ()
        self._busy = False
        self._busy_until = 0.0
        self._since: float | None = None
        self._concerns: dict[object, Callable[[LivePicture], tuple[object, ...]]] = {
            part: part.concerns for part in (*layers, *panels) if isinstance(part, Selective)
        }
        self._concerned: dict[object, tuple[object, ...]] = {}

    def add(
        self, picture: LivePicture, layers: Sequence[Layer] = (), panels: Sequence[Panel] = ()
    ) -> None:
        """Have further parts follow, which show a picture that may be behind by now."""
        self.layers, self.panels = (*self.layers, *layers), (*self.panels, *panels)
        added = (*layers, *panels)
        self._concerns |= {part: part.concerns for part in added if isinstance(part, Selective)}
        if picture.state is not self._state:
            self._late = (*self._late, *added)
        self.unsettle()

    @property
    def pause_s(self) -> float | None:
        """How long to wait for further changes before charts follow; None where none has to."""
        if self._since is None:
            return None
        return BUSY_PAUSE_S if self._busy else SETTLE_S

    def is_due(self, *, paused: bool) -> bool:
        """Tell whether charts are to follow now."""
        if self._since is None:
            return False
        lagging = time.monotonic() - self._since > LONGEST_SETTLE_S
        return paused or (lagging and not self._busy)

    @property
    def state(self) -> AppState | None:
        """What is shown, be it as a draft."""
        return self._state

    def waited(self, seconds: float) -> None:
        """Take note of how long the tab has waited for its turn."""
        if seconds > BUSY_S:
            self._busy_until = time.monotonic() + BUSY_MEMORY_S

    def takes_draft(self, state: AppState) -> bool:
        """Tell whether a draft of a state will do for now."""
        if pace() > BUSY_PACE and self._busy:
            self._busy_until = time.monotonic() + BUSY_MEMORY_S
        self._busy = time.monotonic() < self._busy_until
        return self._busy and self._state is not None and only_moved(self._state, state)

    def show_draft(self, state: AppState, draft: Draft) -> None:
        """Show a draft; all else follows when it settles."""
        for part in self.layers:
            if isinstance(part, BoxLayer):
                part.move(draft.box)
        for part in self.panels:
            if isinstance(part, HtmlPanel):
                part.write(draft.texts[part.name])
            elif isinstance(part, ErrorsPanel) and self._picture is not None:
                part.show(replace(self._picture, state=state))
        self._state = state
        self._late = (*self.layers, *self.panels)
        self.unsettle()

    def show(self, picture: LivePicture, *, anew: bool = False) -> None:
        """Follow a picture.

        Parameters
        ----------
        picture : LivePicture
        anew : bool, optional
            Also what shows the same as before: a widget may show what was refused.
        """
        self._picture, self._state, self._late = picture, picture.state, ()
        for part in (*self.layers, *self.panels):
            self._show(part, picture, anew=anew)
        self.unsettle()

    def _show(self, part: Layer | Panel, picture: LivePicture, *, anew: bool = False) -> None:
        """Have one part follow, unless it shows all that already."""
        concerns = self._concerns.get(part)
        if concerns is not None:
            concerned = concerns(picture)
            if not anew and self._concerned.get(part) == concerned:
                return
            self._concerned.pop(part, None)
            part.show(picture)
            self._concerned[part] = concerned
            return
        part.show(picture)

    def unsettle(self) -> None:
        """Have charts follow soon."""
        if self._since is None:
            self._since = time.monotonic()

    def settle(self, picture: LivePicture, guarded: Callable[[Callable[[], object]], None]) -> None:
        """Bring everything up to date that has been put off.

        Parameters
        ----------
        picture : LivePicture
        guarded : callable
            Runs a step and reports what it raises.
        """
        self._since, self._picture = None, picture
        late, self._late = self._late, ()
        for part in late:
            guarded(partial(self._show, part, picture))
        for panel in self.panels:
            if isinstance(panel, Deferred):
                guarded(partial(panel.settle, picture))
