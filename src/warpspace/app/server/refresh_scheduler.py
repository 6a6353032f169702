"""Times at which the panels of one tab are rendered again, by their `Refresh` classes."""

import time
from collections import deque
from collections.abc import Callable, Iterable

from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.panels.panel import PAUSE_S, Panel, Refresh

THROTTLE_S = 0.4  # between two refreshes of a throttled panel
MAX_DELAY_S = 3.0  # of debounced panels, while a slider is dragged
IDLE_S = 0.5  # without changes, before idle panels follow


class RefreshScheduler:
    """Waiting times of the panels of one tab, and the queue of those that are due.

    A picture starts a debounced pass after a pause in the changes, and an idle pass after that.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.queue: deque[Panel] = deque()  # of the present pass
        self._clock = clock
        self._changed_at = 0.0  # latest change
        self._waiting_since: float | None = None  # first change since the latest debounced pass
        self._awaits_idle = False
        self._forced: set[Panel] = set()
        self._throttled: dict[Panel, tuple[float, object]] = {}

    def is_due(self, panel: Panel, picture: LivePicture) -> bool:
        """Return whether a visible panel is rendered together with the picture."""
        if panel.refresh is not Refresh.THROTTLED:
            return panel.refresh is Refresh.IMMEDIATE
        now, urgent = self._clock(), panel.dependencies(picture)[0]
        rendered_at, before = self._throttled.get(panel, (float("-inf"), None))
        if now - rendered_at < THROTTLE_S and urgent == before:
            return False
        self._throttled[panel] = now, urgent
        return True

    def record_picture(self) -> None:
        self.restart_idle()
        if self._waiting_since is None:
            self._waiting_since = self._changed_at

    def restart_idle(self, *panels: Panel) -> None:
        """Restart the idle time; render these panels after it, whatever they depend on."""
        self._changed_at, self._awaits_idle = self._clock(), True
        self._forced.update(panels)

    @property
    def due_in_s(self) -> float | None:
        """Time until `start_pass` or a queued panel is due; None where nothing is."""
        if self.queue:
            return 0.0
        if self._waiting_since is not None:
            due_at = min(self._changed_at + PAUSE_S, self._waiting_since + MAX_DELAY_S)
        elif self._awaits_idle:
            due_at = self._changed_at + IDLE_S
        else:
            return None
        return max(0.0, due_at - self._clock())

    def start_pass(self, panels: Iterable[Panel]) -> frozenset[Panel] | None:
        """Queue the panels that are due; return those to render in any case, None before idle."""
        if self._waiting_since is not None:
            self._waiting_since = None
            classes = (Refresh.THROTTLED, Refresh.DEBOUNCED)
            self.queue.extend(panel for panel in panels if panel.refresh in classes)
            return None
        self._awaits_idle = False
        forced, self._forced = frozenset(self._forced), set()
        self.queue.extend(panel for panel in panels if panel.refresh is Refresh.IDLE)
        self.queue.extend(forced)
        return forced
