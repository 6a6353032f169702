"""Everything of a tab that shows the picture: layers of its drawing and parts of its page."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from warpspace.app.browser.incoming import Event
from warpspace.app.browser.page import Page
from warpspace.app.drawing.shapes import Layer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import Update
from warpspace.app.tasks.parts import Part, Window

PAUSE_S = 0.1
"""Pause in the changes after which parts follow: longer than between two moves of a drag."""
LONGEST_PAUSE_S = 0.4  # what follows in a pause lags no longer than this while a slider is dragged
REST_S = 0.5  # pause after which the slowest parts follow; a drag does not pay for them


class Display:
    """Layers and parts of one tab; none at first."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self.layers: tuple[Layer, ...] = ()
        self.parts: dict[str, Part] = {}
        self._shown: dict[Part, object] = {}
        self._state: AppState | None = None
        self._changed_at: float | None = None
        self._rest_from: float | None = None
        self._waiting: deque[Part] = deque()
        self._picture: LivePicture | None = None

    @property
    def state(self) -> AppState | None:
        """The state whose picture is shown; None before the first."""
        return self._state

    def add(
        self, picture: LivePicture, layers: Sequence[Layer] = (), parts: Sequence[Part] = ()
    ) -> None:
        """Add what has just been built, and write its pieces."""
        self.layers = (*self.layers, *layers)
        self.parts |= {part.name: part for part in parts}
        self._write(parts, picture)
        self._note(picture)

    def show(self, picture: LivePicture, *, anew: bool = False) -> None:
        """Show a picture; what is slow follows when changes pause."""
        for layer in self.layers:
            layer.show(picture)
        # a part that has just come into sight is not kept waiting, nor is one that has left it
        due = [
            part for part in self.parts.values()
            if part.follows == "at once" or self._shown.get(part) is None
            or not part.is_seen(picture.state)
        ]  # fmt: skip
        if anew:
            due = [*self.parts.values()]
            self._shown |= dict.fromkeys(due)
        self._write(due, picture)
        self._note(picture)

    def _note(self, picture: LivePicture) -> None:
        self._state, self._picture = picture.state, picture
        self._rest_from = now = time.monotonic()
        self._changed_at = self._changed_at or now

    def renew(self, part: Part) -> None:
        """Write a part anew, since something beside the state has changed; from the session."""
        if self._picture is not None:
            self._write([part], self._picture)

    def closed(self) -> None:
        """Take note that the page has closed its window by itself; the same may be opened again."""
        self._page.forget("window")
        windows = [part for part in self.parts.values() if isinstance(part, Window)]
        self._shown |= dict.fromkeys(windows)

    def _write(self, parts: Iterable[Part], picture: LivePicture) -> None:
        pieces: dict[str, str] = {}
        for part in parts:
            key = _key(part, picture)
            if key != self._shown.get(part):
                self._shown[part] = key
                if key is not None:
                    pieces |= part.pieces(picture)
        self._page.put(pieces)

    @property
    def pause_s(self) -> float | None:
        """How long to wait for further changes before parts follow; None where none has to."""
        if self._waiting:
            return 0.0
        if self._changed_at is not None:
            return PAUSE_S
        since = self._rest_from
        return None if since is None else max(0.0, since + REST_S - time.monotonic())

    def is_due(self, *, paused: bool) -> bool:
        """Tell whether a part is to follow now."""
        if self._waiting:
            return True
        since, now = self._changed_at, time.monotonic()
        if since is not None:
            return paused or now - since > LONGEST_PAUSE_S
        return self._rest_from is not None and now - self._rest_from >= REST_S

    def settle(self, picture: LivePicture, guarded: Callable[[Callable[[], object]], None]) -> None:
        """Bring the next part up to date; one at a time, so that a slider never waits for all."""
        if not self._waiting:
            follows = "in a pause" if self._changed_at is not None else "at rest"
            self._rest_from = None if self._changed_at is None else self._rest_from
            self._changed_at = None
            self._waiting.extend(p for p in self.parts.values() if p.follows == follows)
            if follows == "at rest":
                for layer in self.layers:
                    guarded(partial(getattr(layer, "rest", _nothing), picture))
        while self._waiting:
            part = self._waiting.popleft()
            if _key(part, picture) != self._shown.get(
                part
            ):  # what has nothing to write takes no turn
                guarded(partial(self._write, [part], picture))
                break

    def update(self, event: Event) -> Update | None:
        """Give what an event does to the state; None where it is for nobody."""
        part = self.parts.get(event.part)
        return None if part is None else lambda state: part.take(state, event.word, event.value)


def _key(part: Part, picture: LivePicture) -> object:
    return part.depends(picture) if part.is_seen(picture.state) else None


def _nothing(_picture: LivePicture) -> None:
    """Most layers have nothing to do at rest."""
