"""Everything of a tab that shows the picture: the layers of its drawing and its panels."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels import Deferred, Panel, Resting, Selective
from warpspace.app.state.app_state import AppState
from warpspace.app.viewport.layers import Layer

SETTLE_S = 0.1
"""Pause in the changes after which charts follow: longer than between two moves of a drag."""
LONGEST_SETTLE_S = 0.4  # charts lag no longer than this behind while a slider is being dragged
REST_S = 0.5  # pause after which the slowest panels follow; a drag does not pay for them


class Display:
    """Layers and panels of one tab; none at first."""

    def __init__(self) -> None:
        self.layers: tuple[Layer, ...] = ()
        self.panels: tuple[Panel, ...] = ()
        self._state: AppState | None = None
        self._unsettled_since: float | None = None
        # isinstance of a protocol is slow: asked once, not on every slider move
        self._selective: dict[Layer | Panel, Selective] = {}
        self._deferred: list[Deferred] = []
        self._resting: list[Resting] = []
        self._restless_since: float | None = None
        self._waiting: deque[Callable[[LivePicture], None]] = deque()
        self._concerned: dict[Layer | Panel, tuple[object, ...]] = {}

    @property
    def state(self) -> AppState | None:
        """The state whose picture is shown; None before the first."""
        return self._state

    def add(
        self, picture: LivePicture, layers: Sequence[Layer] = (), panels: Sequence[Panel] = ()
    ) -> None:
        """Add parts that have just been built."""
        for panel in panels:
            panel.show(picture)
        self.layers, self.panels = (*self.layers, *layers), (*self.panels, *panels)
        for part in (*layers, *panels):
            if isinstance(part, Selective):
                self._selective[part] = part
                self._concerned[part] = part.concerns(picture)
        self._deferred += [panel for panel in panels if isinstance(panel, Deferred)]
        self._resting += [panel for panel in panels if isinstance(panel, Resting)]
        self._state = picture.state
        self._unsettle()

    def show(self, picture: LivePicture, *, anew: bool = False) -> None:
        """Show a picture; charts follow when changes pause."""
        self._state = picture.state
        for part in (*self.layers, *self.panels):
            selective = self._selective.get(part)
            if selective is None:
                part.show(picture)
                continue
            concerned = selective.concerns(picture)
            if anew or self._concerned.get(part) != concerned:
                self._concerned.pop(part, None)
                part.show(picture)
                self._concerned[part] = concerned
        self._unsettle()

    def _unsettle(self) -> None:
        now = time.monotonic()
        if self._unsettled_since is None:
            self._unsettled_since = now
        if self._resting:
            self._restless_since = now

    @property
    def pause_s(self) -> float | None:
        """How long to wait for further changes before charts follow; None where none has to."""
        if self._waiting:
            return 0.0
        if self._unsettled_since is not None:
            return SETTLE_S
        since = self._restless_since
        return None if since is None else max(0.0, since + REST_S - time.monotonic())

    def is_due(self, *, paused: bool) -> bool:
        """Tell whether a chart is to follow now."""
        if self._waiting:
            return True
        since, now = self._unsettled_since, time.monotonic()
        if since is not None:
            return paused or now - since > LONGEST_SETTLE_S
        return self._restless_since is not None and now - self._restless_since >= REST_S

    def settle(self, picture: LivePicture, guarded: Callable[[Callable[[], object]], None]) -> None:
        """Bring the next chart up to date; one at a time, so that a slider never waits for all."""
        if not self._waiting and self._unsettled_since is not None:
            self._unsettled_since = None
            self._waiting.extend(panel.settle for panel in self._deferred)
        elif not self._waiting:
            self._restless_since = None
            self._waiting.extend(panel.rest for panel in self._resting)
        if self._waiting:
            guarded(partial(self._waiting.popleft(), picture))
