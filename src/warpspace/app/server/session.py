"""One browser tab: the one thread that joins its page, its state and its drawing.

The way of a slider move:

1. `browser/page.js` sends an event, the tab's connection (`server/guard.py`) queues it;
2. here, `_follow`: the event's part (`tasks/parts.py`) says what it does to the state,
3. which is applied (`state/store.py`) and
4. evaluated (`evaluation/evaluate.py`);
5. all that shows the picture follows (`server/display.py`): layers (`drawing/`) change viser's
   nodes in place, parts write pieces of HTML; what has not changed is not sent.

The session reads the last position of a slider when it gets there, so that is always what is shown,
however fast the slider was moved.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from warpspace.app.browser.incoming import Event
from warpspace.app.browser.viser_private import queued
from warpspace.app.drawing.box import BoxLayer
from warpspace.app.drawing.camera import focus
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.budget import pick
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.server.display import Display
from warpspace.app.server.tab_keeper import TabKeeper, TabRecord, new_token
from warpspace.app.state.app_state import AppState
from warpspace.app.state.store import StateStore
from warpspace.app.tasks.catalogue import build_parts
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.together import PointerPart, Together
from warpspace.exceptions import WarpspaceError

logger = logging.getLogger(__name__)
TAB = "tab"  # events of the page itself begin with it
TOKEN_WAIT_S = 0.25  # how long the first picture waits for a tab that may have been here before
MOST_QUEUED, BEHIND_S = 4, 0.02  # messages that wait to be sent, and how long to wait for them
ANSWER_S = 1.0  # how long a page may take to draw the map; one that does not say gets the rest


_TURNS: deque[object] = deque()  # of tabs whose picture is made or waits to be made
_CHANGED = threading.Condition()


@contextmanager
def turn() -> Generator[None]:
    """Make pictures of all tabs one after the other: made at once, all of them would be late."""
    own = object()
    with _CHANGED:
        _TURNS.append(own)
        _CHANGED.wait_for(lambda: _TURNS[0] is own)
    try:
        yield
    finally:
        with _CHANGED:
            _TURNS.popleft()
            _CHANGED.notify_all()


class Session:
    """The app of one browser tab."""

    def __init__(
        self,
        context: Context,
        live: LiveModel,
        claim: "Callable[[Session, str], TabRecord | None]",
        *,
        together: Together | None = None,
    ) -> None:
        self.context, self._live, self._claim = context, live, claim
        self._client = context.client
        self.token = new_token()
        self._together = together
        self._keeper = TabKeeper(context, shared=together is not None)
        self.display = Display(context)
        self._is_known = False  # whether the page has said which tab it is
        self._around_at: float | None = None  # when what lies around the map is drawn at the latest
        self._stopped = threading.Event()
        self._worker = threading.Thread(
            target=self._run, name=f"warpspace-session-{self._client.client_id}", daemon=True
        )

    @property
    def state(self) -> AppState:
        return self.context.state

    def start(self) -> None:
        self._worker.start()

    def stop(self) -> None:
        self._stopped.set()
        for job in tuple(self.context.jobs):
            job.set()
        self.context.wake()
        self.context.store.unsubscribe(self.context.changed)

    def rename(self, token: str) -> None:
        self.token = token
        self.context.page.call("rename", token)

    def record(self) -> TabRecord:
        return TabRecord(self.context.store, self.context.camera.remember())

    def use(self, store: StateStore) -> None:
        self.context.store.unsubscribe(self.context.changed)
        self.context.store, self.context.unfolded = store, store.state.page
        store.subscribe(self.context.changed)

    def _run(self) -> None:
        self.use(self.context.store)
        try:
            self._guarded(self._build)
            while not self._stopped.is_set():
                self._turn()
        finally:
            self.context.store.unsubscribe(self.context.changed)
            if self._together:
                self._together.leave(self.context)

    def _turn(self) -> None:
        left = None if self._around_at is None else max(0.0, self._around_at - time.monotonic())
        stage = self.context.stage
        turns = None if stage is None else stage.wait_s
        waits = [wait for wait in (self.display.due_in_s, left, turns) if wait is not None]
        changed = self.context.wait(min(waits, default=None))
        while queued(self._client) > MOST_QUEUED and not self._stopped.wait(BEHIND_S):
            pass  # pictures that a page does not take would fill the memory
        if changed and not self._stopped.is_set():
            self._guarded(self._follow)
        picture = self.context.shown
        if picture is None:
            return
        if self._around_at is not None and time.monotonic() >= self._around_at:
            self._guarded(partial(self._draw_around, picture))
        if stage is not None and stage.wait_s == 0.0:
            self._guarded(stage.turn)
        if self.display.due_in_s == 0.0:
            self._guarded(partial(self._settle, picture))

    def _guarded(self, step: Callable[[], object]) -> None:
        try:
            step()
        except Exception as error:
            if self._stopped.is_set() or not self.context.page.is_open:
                return  # nobody is there to be told, and its widgets are gone
            if not isinstance(error, WarpspaceError):
                logger.exception("session %d", self._client.client_id)
            self.context.page.report(error)

    def _build(self) -> None:
        """Show map and all that is written; the rest follows when the page has drawn that.

        A page draws what it gets in one go before it answers anybody.
        """
        context = self.context
        if not context.events:
            context.wait(TOKEN_WAIT_S)
        if context.events and context.events[0].part == TAB:
            self._hear(context.events.popleft())
        context.wake()  # what else has come
        picture = self._live.evaluate(self.state)
        with context.page.as_one():
            self._darken(picture)
            context.page.call("title", picture.state.scene.title)
            context.camera.place(picture)
            context.page.call("stage", "opening")
            layers = [BoxLayer(self._client.scene, context.page, picture)]
            pointer = [PointerPart(context, self._together)] if self._together else []
            self.display.add(picture, layers, [*build_parts(context), self._keeper, *pointer])
            context.page.call("drawn")
        self._around_at = time.monotonic() + ANSWER_S

    def _draw_around(self, picture: LivePicture) -> None:
        self._around_at = None
        context = self.context
        with context.page.as_one():
            context.stage = MovingLayer(self._client, context.page, picture)
            self.display.add(picture, [context.stage])
            context.page.call("stage", "open")

        @self._client.scene.on_click()
        def _(event: Any) -> None:
            context.act(partial(self._clicked, event.ray_origin, event.ray_direction))

    def _clicked(self, origin: object, direction: object) -> None:
        """Ask why a point is off, or what else a section has points picked for."""
        context, picture = self.context, self.context.shown
        if picture is None or context.telling is not None:
            return
        ray = np.array([origin, direction], dtype=float)
        picked = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if picked is None:
            return
        context.post(lambda state: context.take_picked(state, picked))

    def _hear(self, event: Event) -> None:
        """Take note of what a page says of itself."""
        if event.word == "drawn" and self._around_at is not None:
            self._around_at = 0.0
        if event.word != "here" or self._is_known:
            return
        self._is_known = True
        record = self._claim(self, event.value[:100])
        if record is not None:
            self.use(record.store)
            self.context.camera.wanted = record.camera
        self._keeper.begin(known=record is not None)

    def _follow(self) -> None:
        context = self.context
        for event in [context.events.popleft() for _ in range(len(context.events))]:
            if event.part == TAB:
                self._hear(event)
            elif (part := self.display.parts.get(event.part)) is not None:
                take = partial(part.take, word=event.word, value=event.value)
                self._guarded(partial(context.apply, take))
        while context.actions:
            self._guarded(context.actions.popleft())
        notes, context.notes = context.notes, []
        state, shown = self.state, context.shown
        if shown is None:  # it could not be built
            return
        if context.camera.wanted and focus(shown.state) == focus(state):
            context.camera.place(shown)
        if notes or state is not shown.state:
            with turn():
                self._show(self._live.evaluate(state), shown, anew=bool(notes))
        if notes:
            context.notify("Please note", "\n".join(notes), "warning")

    def _show(self, picture: LivePicture, before: LivePicture, *, anew: bool) -> None:
        context = self.context
        with context.page.as_one():
            self.display.show(picture, anew=anew)
            if focus(before.state) != focus(picture.state):
                context.page.call("title", picture.state.scene.title)
                context.camera.place(picture)
            if before.state.shown.dark != picture.state.shown.dark:
                self._darken(picture)

    def _darken(self, picture: LivePicture) -> None:
        dark = picture.state.shown.dark
        self._client.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
        self.context.page.call("dark", dark)

    def _settle(self, picture: LivePicture) -> None:
        with turn(), self.context.page.as_one():
            self.display.settle(picture, self._guarded)
