"""Everything of a tab that follows the frame: layers and panels, on a busy server in two goes."""

import time
from collections.abc import Callable, Sequence
from functools import partial

from warpspace.app.layers import Layer
from warpspace.app.layers.box import BoxLayer
from warpspace.app.layers.traces import TracesLayer
from warpspace.app.live import Frame
from warpspace.app.mapmesh import drafted
from warpspace.app.panels import Choosy, Panel, Settling
from warpspace.app.panels.errors import ErrorsPanel
from warpspace.app.panels.summary import HtmlPanel
from warpspace.app.turns import Turns

SETTLE_S = 0.1
"""Pause in the changes after which charts follow: longer than between two moves of a drag."""
LONGEST_SETTLE_S = 0.25
"""Charts lag no longer than this behind while a slider is being dragged."""
BUSY_PAUSE_S = 0.2
"""The pause on a busy server. Its charts wait for one however long a drag takes, and the map is
drawn of every second node meanwhile."""
BUSY_S = 0.01
"""Wait for other tabs' pictures beyond which the server counts as busy."""
BUSY_MEMORY_S = 5.0
"""How long a server that was busy counts as such."""
TURN = Turns()
"""Pictures are made one after the other: twenty at once would all be late, and fight for caches."""
AT_ONCE = (BoxLayer, TracesLayer, HtmlPanel, ErrorsPanel)
"""What is never put off: map, traces, numbers and the sliders themselves."""


class Parts:
    """Layers and panels of one tab.

    Parameters
    ----------
    layers : sequence of Layer
    panels : sequence of Panel
    """

    def __init__(self, layers: Sequence[Layer] = (), panels: Sequence[Panel] = ()) -> None:
        self.layers, self.panels = tuple(layers), tuple(panels)
        every = (*self.layers, *self.panels)
        self._at_once = tuple(part for part in every if isinstance(part, AT_ONCE))
        self._thinned = tuple(part for part in every if isinstance(part, BoxLayer))
        self._put_off = tuple(p for p in every if p not in self._at_once or p in self._thinned)
        self._late: tuple[Layer | Panel, ...] = ()
        self._busy = False
        self._busy_until = 0.0
        self._since: float | None = None
        self._concerns: dict[object, Callable[[Frame], tuple[object, ...]]] = {
            part: part.concerns for part in every if isinstance(part, Choosy)
        }
        self._concerned: dict[object, tuple[object, ...]] = {}

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

    def waited(self, seconds: float) -> None:
        """Take note of how long the tab has waited for its turn."""
        now = time.monotonic()
        if seconds > BUSY_S:
            self._busy_until = now + BUSY_MEMORY_S
        self._busy = now < self._busy_until

    def show(self, frame: Frame, *, anew: bool = False) -> None:
        """Follow a frame; on a busy server map and numbers first, the others when it settles.

        Parameters
        ----------
        frame : Frame
        anew : bool, optional
            Also what shows the same as before: a widget may show what was refused.
        """
        self._late = ()
        if self._busy and not anew:
            draft = drafted(frame)
            for part in self._at_once:
                self._show(part, draft if part in self._thinned else frame)
            self._late = self._put_off
        else:
            for part in (*self.layers, *self.panels):
                self._show(part, frame, anew=anew)
        self.unsettle()

    def _show(self, part: Layer | Panel, frame: Frame, *, anew: bool = False) -> None:
        """Have one part follow, unless it shows all that already."""
        concerns = self._concerns.get(part)
        if concerns is not None:
            concerned = concerns(frame)
            if not anew and self._concerned.get(part) == concerned:
                return
            self._concerned.pop(part, None)
            part.show(frame)
            self._concerned[part] = concerned
            return
        part.show(frame)

    def unsettle(self) -> None:
        """Have charts follow soon."""
        if self._since is None:
            self._since = time.monotonic()

    def settle(self, frame: Frame, guarded: Callable[[Callable[[], object]], None]) -> None:
        """Bring everything up to date that has been put off.

        Parameters
        ----------
        frame : Frame
        guarded : callable
            Runs a step and reports what it raises.
        """
        self._since = None
        late, self._late = self._late, ()
        for part in late:
            guarded(partial(self._show, part, frame))
        for panel in self.panels:
            if isinstance(panel, Settling):
                guarded(partial(panel.settle, frame))
