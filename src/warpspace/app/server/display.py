"""Everything of a tab that shows the picture: layers of its drawing and parts of its page."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from warpspace.app.drawing.shapes import Layer
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.tasks.context import PAUSE_S, Context
from warpspace.app.tasks.parts import Part, Window

OFTEN_S = 0.4  # between two writings of what follows often
LONGEST_PAUSE_S = 3.0  # what follows in a pause lags no longer than this while a slider is dragged
REST_S = 0.5  # pause after which the slowest parts follow; a drag does not pay for them


class Display:
    """Layers and parts of one tab; none at first."""

    def __init__(self, context: Context) -> None:
        self._context = context
        context.renew, context.closed = self._renew, self._closed
        context.rest_again = self._rest_again
        self.layers: tuple[Layer, ...] = ()
        self.parts: dict[str, Part] = {}
        self._shown: dict[Part, object] = {}
        self._following: list[Part] = []
        self._often: dict[Part, tuple[float, object]] = {}
        self._waiting: deque[Part] = deque()
        self._noted_at = 0.0
        self._changed_at: float | None = None  # since when parts wait for a pause
        self._is_to_rest = False
        self._late: set[Part] = set()  # that wait for a rest, whatever they usually wait for

    def add(
        self, picture: LivePicture, layers: Sequence[Layer] = (), parts: Sequence[Part] = ()
    ) -> None:
        """Add what has just been built, and write its pieces."""
        self.layers = (*self.layers, *layers)
        self.parts |= {part.name: part for part in parts}
        self._following = [p for p in self.parts.values() if p.follows in ("at once", "often")]
        self._write(parts, picture)
        self._note(picture)

    def show(self, picture: LivePicture, *, anew: bool = False) -> None:
        """Show a picture; what is slow follows when changes pause."""
        for layer in self.layers:
            layer.show(picture)
        if anew:
            self._shown.clear()
        # what is in sight changes with what is open on the page
        known = self._context.shown
        same = known is not None and known.state.page is picture.state.page and not anew
        parts = self._following if same else self.parts.values()
        self._write([one for one in parts if self._is_due(one, picture)], picture)
        self._note(picture)

    def _is_due(self, part: Part, picture: LivePicture) -> bool:
        # a part that has just come into sight is not kept waiting, nor is one that has left it
        if part.is_seen(picture.state) != (self._shown.get(part) is not None):
            return True
        if part.follows != "often":
            return part.follows == "at once"
        now, urgent = time.monotonic(), part.depends(picture)[0]
        at, before = self._often.get(part, (0.0, None))
        is_due = now - at >= OFTEN_S or urgent != before
        self._often[part] = (now, urgent) if is_due else (at, before)
        return is_due

    def _note(self, picture: LivePicture) -> None:
        self._context.shown = picture
        self._rest_again()
        self._changed_at = self._changed_at or self._noted_at

    def _rest_again(self, *parts: Part) -> None:
        self._noted_at, self._is_to_rest = time.monotonic(), True
        self._late.update(parts)

    def _renew(self, part: Part) -> None:
        if self._context.shown is not None:
            self._write([part], self._context.shown)

    def _closed(self) -> None:
        self._context.page.forget("window")
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
        self._context.page.put(pieces)

    @property
    def due_in_s(self) -> float | None:
        """How long until something is to follow; None where nothing has to."""
        if self._waiting:
            return 0.0
        if self._changed_at is not None:
            at = min(self._noted_at + PAUSE_S, self._changed_at + LONGEST_PAUSE_S)
        elif self._is_to_rest:
            at = self._noted_at + REST_S
        else:
            return None
        return max(0.0, at - time.monotonic())

    def settle(self, picture: LivePicture, guarded: Callable[[Callable[[], object]], None]) -> None:
        """Bring the next part up to date; one at a time, so that a slider never waits for all."""
        if not self._waiting:
            follows = ("at rest",) if self._changed_at is None else ("often", "in a pause")
            self._waiting.extend(p for p in self.parts.values() if p.follows in follows)
            if self._changed_at is None:
                self._is_to_rest = False
                self._waiting.extend(self._late)
                self._shown |= dict.fromkeys(self._late)
                self._late.clear()
                for layer in self.layers:
                    if rest := getattr(layer, "rest", None):
                        guarded(partial(rest, picture))
            self._changed_at = None
        while self._waiting:
            part = self._waiting.popleft()
            if _key(part, picture) != self._shown.get(part):  # else it takes no turn
                guarded(partial(self._write, [part], picture))
                break


def _key(part: Part, picture: LivePicture) -> object:
    return part.depends(picture) if part.is_seen(picture.state) else None
