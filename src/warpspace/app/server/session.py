"""One browser tab: the one thread that joins its page, its state and its drawing.

The way of a slider move:

1. `browser/page.js` sends an event, the tab's connection (`server/guard.py`) queues it;
2. here, `_follow`: the event's part (`tasks/parts.py`) says what it does to the state,
3. which is applied (`state/store.py`) and
4. evaluated (`evaluation/evaluate.py`);
5. all that shows the picture follows (`Display`): layers (`drawing/`) change viser's
   nodes in place, parts write pieces of HTML; what has not changed is not sent.

The session reads the last position of a slider when it gets there, so that is always what is shown,
however fast the slider was moved.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from warpspace.app.browser.incoming import Event
from warpspace.app.browser.viser_private import queued
from warpspace.app.drawing.box import BoxLayer
from warpspace.app.drawing.camera import focus
from warpspace.app.drawing.moving import MovingLayer
from warpspace.app.drawing.shapes import SCENE_PER_MM
from warpspace.app.evaluation.live_model import LiveModel
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.evaluation.point_explanation import pick, pick_line, with_clicked
from warpspace.app.panels.note_panels import StoryPanel
from warpspace.app.panels.overlay import PointerPanel, Tabs
from warpspace.app.panels.page_panels import build_parts
from warpspace.app.panels.panel import PAUSE_S, Context, Panel, Window
from warpspace.app.server.tab_keeper import TabKeeper, TabRecord, new_token
from warpspace.app.state.app_state import AppState, Comparison, PageLook, PartLook
from warpspace.app.state.look import Look
from warpspace.app.state.store import Mark, StateStore
from warpspace.exceptions import WarpspaceError

OFTEN_S = 0.4  # between two writings of what follows often
LONGEST_PAUSE_S = 3.0  # what follows in a pause lags no longer than this while a slider is dragged
REST_S = 0.5  # pause after which the slowest parts follow; a drag does not pay for them
Guarded = Callable[[object, Callable[[], object]], None]
"""Does something of a part or a layer, and takes in what that raises."""


class Display:
    """Layers and parts of one tab; none at first."""

    def __init__(self, context: Context) -> None:
        self._context = context
        context.renew, context.closed = self._renew, self._closed
        context.rest_again = self._rest_again
        self.layers: tuple[BoxLayer | MovingLayer, ...] = ()
        self.parts: dict[str, Panel] = {}
        self._shown: dict[Panel, object] = {}
        self._following: list[Panel] = []
        self._often: dict[Panel, tuple[float, object]] = {}
        self._waiting: deque[Panel] = deque()
        self._noted_at = 0.0
        self._changed_at: float | None = None  # since when parts wait for a pause
        self._is_to_rest = False
        self._late: set[Panel] = set()  # that wait for a rest, whatever they usually wait for

    def add(
        self,
        picture: LivePicture,
        layers: Sequence[BoxLayer | MovingLayer] = (),
        parts: Sequence[Panel] = (),
    ) -> None:
        """Add what has just been built, and write its pieces."""
        self.layers = (*self.layers, *layers)
        self.parts |= {part.name: part for part in parts}
        self._following = [p for p in self.parts.values() if p.follows in ("at once", "often")]
        self._write(parts, picture)
        self._note(picture)

    def show(self, picture: LivePicture, *, force: bool = False) -> None:
        """Show a picture; what is slow follows when changes pause."""
        for layer in self.layers:
            layer.show(picture)
        if force:
            self._shown.clear()
        # what is in sight changes with what is open on the page
        known = self._context.shown
        same = known is not None and known.state.page is picture.state.page and not force
        parts = self._following if same else self.parts.values()
        self._write([one for one in parts if self._is_due(one, picture)], picture)
        self._note(picture)

    def _is_due(self, part: Panel, picture: LivePicture) -> bool:
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

    def _rest_again(self, *parts: Panel) -> None:
        self._noted_at, self._is_to_rest = time.monotonic(), True
        self._late.update(parts)

    def _renew(self, part: Panel) -> None:
        if self._context.shown is not None:
            self._shown[part] = None  # whatever it depends on
            self._write([part], self._context.shown)

    def _closed(self) -> None:
        self._context.page.forget("window")
        windows = [part for part in self.parts.values() if isinstance(part, Window)]
        self._shown |= dict.fromkeys(windows)

    def _write(self, parts: Iterable[Panel], picture: LivePicture) -> None:
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

    def settle(self, picture: LivePicture, guarded: Guarded) -> None:
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
                    if isinstance(layer, BoxLayer):
                        guarded(layer, partial(layer.synchronise, picture))
            self._changed_at = None
        while self._waiting:
            part = self._waiting.popleft()
            if _key(part, picture) != self._shown.get(part):  # else it takes no turn
                guarded(part, partial(self._write, [part], picture))
                break


def _key(part: Panel, picture: LivePicture) -> object:
    return part.depends(picture) if part.is_seen(picture.state) else None


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


class Good(NamedTuple):
    mark: Mark
    page: PageLook  # of this tab


def _bare(state: AppState) -> AppState:
    """Return a state without what stands in the box and what it is compared with."""
    return replace(state, part=PartLook(), look=Look(), comparison=Comparison(), controller=None,
                   picked=None, lever="", forms={})  # fmt: skip


class Session:
    def __init__(
        self,
        context: Context,
        live: LiveModel,
        claim: "Callable[[Session, str], TabRecord | None]",
        *,
        review_tabs: Tabs | None = None,  # the tabs of a shared review
    ) -> None:
        self.context, self._live, self._claim = context, live, claim
        self._client = context.client
        self.token = new_token()
        self._others = review_tabs
        self._keeper = TabKeeper(context, shared=review_tabs is not None)
        self.display = Display(context)
        # what was evaluated last without an exception: of the map, and of all that follows it
        self._shown = self._settled = self._good()
        self._failing = set[object]()  # parts that fail whatever is shown
        self._is_known = False  # whether the page has said which tab it is
        self._around_at: float | None = None  # when what lies around the map is drawn at the latest
        self._stopped = threading.Event()
        self._worker = threading.Thread(
            target=self._run, name=f"warpspace-session-{self._client.client_id}", daemon=True
        )

    @property
    def state(self) -> AppState:
        return self.context.state

    @property
    def _tabs(self) -> Iterable[Context]:
        """All that look at the state."""
        return [self.context] if self._others is None else self._others()

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
            if pointer := self.display.parts.get(PointerPanel.name):
                pointer.take(self.state, "gone", "")

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
        except Exception as error:  # noqa: BLE001 - logged and shown
            self._report(error, [self.context])

    def _report(self, error: Exception, tabs: Iterable[Context], **title: str) -> None:
        if self._stopped.is_set() or not self.context.page.is_open:
            return  # nobody is there to be told, and its widgets are gone
        if not isinstance(error, WarpspaceError):
            logger.error("session %d", self._client.client_id, exc_info=error)
        for tab in tabs:
            tab.page.report(error, **title)

    def _good(self) -> Good:
        return Good(self.context.store.mark(), self.context.unfolded)

    def _go_back(self, error: Exception, failed: Good, good: Good) -> bool:
        """Replace a state that cannot be evaluated, with a message; tell whether that helps."""
        context, tabs = self.context, self._tabs
        if context.telling is not None:
            tabs = [context]
            self._guarded(partial(self.display.parts[StoryPanel.name].take, self.state, "end", ""))
        elif failed.mark.state is good.mark.state and failed.page is good.page:
            return False
        elif failed.mark.state is not context.store.state:
            return True  # another tab has replaced it
        else:
            context.unfolded = good.page
            if not context.store.back_to(good.mark, failed.mark.state):
                return True
        self._report(error, tabs, title="The change was reverted")
        context.wake()
        return True

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
        try:
            self._open(self._live.evaluate(self.state))
        except Exception as error:
            if not self._strip(error):
                raise
            self.display = Display(context)
            self._open(self._live.evaluate(self.state))

    def _strip(self, error: Exception) -> bool:
        """Leave out what may fail of a state that cannot be opened; tell whether it had any."""
        now, bare = self.context.store.state, _bare(self.context.store.state)
        if bare == now:
            return False
        self.context.store.back_to(Mark(bare, (), ()), now)
        self._report(error, self._tabs, title="Not all of the scene can be shown")
        return True

    def _open(self, picture: LivePicture) -> None:
        context = self.context
        self._shown = self._settled = self._good()
        with context.page.batch():
            self._darken(picture)
            context.page.call("title", picture.state.scene.title)
            context.camera.place(picture)
            context.page.call("stage", "opening")
            layers = [BoxLayer(self._client.scene, context.page, picture)]
            pointer = [PointerPanel(context, self._others)] if self._others else []
            self.display.add(picture, layers, [*build_parts(context), self._keeper, *pointer])
            context.page.call("drawn")
        self._around_at = time.monotonic() + ANSWER_S

    def _draw_around(self, picture: LivePicture) -> None:
        self._around_at = None
        context = self.context
        try:
            with context.page.batch():
                context.stage = MovingLayer(self._client, context.page, picture)
                context.stage.clamp = partial(context.send, "state:set.part.place")
                self.display.add(picture, [context.stage])
                context.page.call("stage", "open")
        except Exception as error:
            if not self._strip(error):
                raise
            self._around_at = time.monotonic()
            return

        @self._client.scene.on_click()
        def _(event: Any) -> None:
            context.act(partial(self._clicked, event.ray_origin, event.ray_direction))

    def _clicked(self, origin: object, direction: object) -> None:
        context, picture = self.context, self.context.shown
        if picture is None or context.telling is not None:
            return
        ray = np.array([origin, direction], dtype=float)
        if line := pick_line(picture, ray[0] / SCENE_PER_MM, ray[1]):
            context.send("program:set.at_line", str(line))
            return
        found = pick(picture, ray[0] / SCENE_PER_MM, ray[1])
        if found is not None:
            context.post(lambda state: with_clicked(state, found[0]))

    def _hear(self, event: Event) -> None:
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
        now, state, shown = self._good(), self.state, context.shown
        if shown is None:  # it could not be built
            return
        if context.camera.wanted and focus(shown.state) == focus(state):
            context.camera.place(shown)
        if notes or state is not shown.state:
            try:
                with turn():
                    self._show(self._live.evaluate(state), shown, force=bool(notes))
            except Exception as error:
                if not self._go_back(error, now, self._shown):
                    raise
                self._guarded(partial(self._show, shown, shown, force=True))
                return
            self._shown = now
        if notes:
            context.notify("Please note", "\n".join(notes), "warning")

    def _show(self, picture: LivePicture, before: LivePicture, *, force: bool) -> None:
        context = self.context
        with context.page.batch():
            self.display.show(picture, force=force)
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
        with turn(), self.context.page.batch():
            self.display.settle(picture, self._follow_picture)
        if self.display.due_in_s is None:
            self._settled = self._shown

    def _follow_picture(self, part: object, step: Callable[[], object]) -> None:
        try:
            step()
            self._failing.discard(part)
        except Exception as error:  # noqa: BLE001 - logged and shown
            if part in self._failing or not self._go_back(error, self._shown, self._settled):
                self._failing.add(part)
                self._report(error, [self.context])
